// Ray-by-ray queries of the whole top level: each ray asks for the bricks in the wanted state of whose root it enters a child box at
// or before its present hit, and notes whether it asked for any. With OF_TILES only the rays of the tiles that have no list ask; with
// a threshold they count in their tile's table, and query_reduce decides.
#include "shared/types.wgsl"
#include "shared/bindings.wgsl"
#include "shared/tiles.wgsl"
#include "shared/exact.wgsl"
#include "shared/node.wgsl"
#include "shared/leaf.wgsl"

override OF_TILES: bool = false;

const TOP_STACK_SIZE: u32 = 192u;  // MAX_TOP_HEIGHT levels of which each leaves at most 7 siblings, and the root

// Children of a node with 8 children that a ray enters, a bit each, and the nearest entry.
struct Entered {
    mask: u32,
    near: f32,
}

fn entered(ray: FramedRay, n0: vec4<u32>, n1: vec4<u32>, n2: vec4<u32>, n3: vec4<u32>, n4: vec4<u32>, high: vec3<f32>, low: vec3<f32>, pad: f32, t_max: f32) -> Entered {
    let boxes = node_hits(ray, n0, n2, n3, n4, high, low, pad, t_max);
    var e = Entered(0u, T_INFINITE);
    for (var i = 0u; i < 8u; i++) {
        let what = (select(n1.z, n1.w, i >= 4u) >> (8u * (i & 3u))) & 255u;
        if (boxes.mask & (1u << i)) != 0u && what != 0u {
            e.mask |= 1u << i;
            e.near = min(e.near, boxes.near[i >> 2u][i & 3u]);
        }
    }
    return e;
}

// One thread a ray; workgroups are squares of 8 x 8 rays.
@compute @workgroup_size(8, 8)
fn main(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let work = rooted_or_all(OF_TILES, workgroup.x + workgroup.y * workgroups.x);
    let index = ray_of(work, local);
    if index == NONE {
        return;
    }
    if surfaces[index].pending == 0u {
        return;
    }
    let ray = rays[index];
    let hit = hits[index];
    let occluded = (params.flags & PARAM_ANY_HIT) != 0u && hit.id != NONE;
    surfaces[index].pending = 0u;
    if !(ray.t_min <= ray.t_max) || params.top_count == 0u || occluded {
        return;
    }
    let world = framed_ray(ray.origin, ray.direction, ray.t_min);
    var r: BrickRay;
    var stack: array<u32, TOP_STACK_SIZE>;
    stack[0] = 0u;
    var depth = 1u;
    var asks = 0u;
    var first = NONE;
    var first_near = T_INFINITE;
    while depth > 0u {
        depth -= 1u;
        let at = 5u * stack[depth];
        let n0 = top8[at];
        let n1 = top8[at + 1u];
        var mask = entered(world, n0, n1, top8[at + 2u], top8[at + 3u], top8[at + 4u], vec3<f32>(0.0), vec3<f32>(0.0), params.instance_pad, hit.t).mask;
        let inner = n0.w >> 24u;
        while mask != 0u {
            let slot = firstTrailingBit(mask);
            mask &= mask - 1u;
            if (inner & (1u << slot)) != 0u {
                if depth == TOP_STACK_SIZE {
                    atomicAdd(&counters[COUNTER_STACK_OVERFLOW], 1u);
                    return;
                }
                stack[depth] = n1.x + countOneBits(inner & ((1u << slot) - 1u));
                depth += 1u;
                continue;
            }
            let leaf = n1.y + ((select(n1.z, n1.w, slot >= 4u) >> (8u * (slot & 3u))) & 31u);
            let brick = leaves[leaf].brick;
            if (slots[brick].state & params.select_mask) != params.select_want {
                continue;
            }
            enter_leaf(&r, world, leaf);
            let root = 5u * brick;
            let e = entered(r.ray, roots[root], roots[root + 1u], roots[root + 2u], roots[root + 3u], roots[root + 4u],
                            r.offset_high, r.offset_low, 0.0, hit.t);
            if e.mask != 0u {
                let nearest = bitcast<u32>(max(e.near, 0.0));
                var position = NONE;
                if OF_TILES && params.threshold > 0u {
                    position = position_of(work.tile, leaf);
                }
                if position != NONE {
                    if atomicLoad(&pair_demand[position].rays) == PAIR_CULLED {
                        continue;
                    }
                    atomicAdd(&pair_demand[position].rays, 1u);
                    atomicMin(&pair_demand[position].nearest, nearest);
                } else {
                    atomicAdd(&demand[brick].rays, 1u);
                    atomicMin(&demand[brick].nearest, nearest);
                }
                asks += 1u;
                if first == NONE || e.near < first_near {
                    first = brick;
                    first_near = e.near;
                }
            }
        }
    }
    if asks > 0u {
        surfaces[index].pending = 1u;
        atomicAdd(&demand[first].next, 1u);
        if !OF_TILES || params.threshold == 0u {
            atomicAdd(&counters[COUNTER_PAIRS_VISIBLE], asks);
        }
    }
}
