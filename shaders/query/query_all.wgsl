// Ray-by-ray queries of the whole top level, near children first: each ray asks for the bricks in the wanted state of
// whose root it enters a child box at or before its present hit, and notes whether it asked for any. With OF_TILES only
// the rays of the tiles that have no list ask. With PAIRS they ask for nothing: counted is how many rays of a tile see
// each leaf. With STAND_INS they ask, for the bricks that they would enter if nothing were missing, those that stand in
// for them; a ray that asks for none, and has not hit such a one, has the hit that it would have. What each ray is left
// with is then in pair_rays: 0 that hit, else 1, and 3 where nothing stands in for something.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "query/tiles.wgsl"
#include "trace/triangle.wgsl"
#include "trace/node.wgsl"
#include "trace/levels.wgsl"
#include "trace/leaf.wgsl"

override OF_TILES: bool = false;
override PAIRS: bool = false;
override STAND_INS: bool = false;

const TOP_STACK_SIZE: u32 = 192u;  // MAX_TOP_HEIGHT levels of which each leaves at most 7 siblings, and the root

// Children of a node that a ray enters, by priority in the high byte as in traversal, and where it enters each.
struct Entered {
    bits: u32,
    hits: NodeHits,
}

fn entered(
    ray: FramedRay,
    n0: vec4<u32>,
    n1: vec4<u32>,
    n2: vec4<u32>,
    n3: vec4<u32>,
    n4: vec4<u32>,
    high: vec3<f32>,
    low: vec3<f32>,
    pad: f32,
    t_max: f32,
) -> Entered {
    var e = Entered(0u, node_hits(ray, n0, n2, n3, n4, high, low, pad, t_max));
    for (var i = 0u; i < 8u; i++) {
        let what = (select(n1.z, n1.w, i >= 4u) >> (8u * (i & 3u))) & 255u;
        if (e.hits.mask & (1u << i)) != 0u && what != 0u {
            e.bits |= 0x80000000u >> (i ^ ray.flip);
        }
    }
    return e;
}

fn is_selected(brick: u32) -> bool {
    return (slots[brick].state & params.select_mask) == params.select_want;
}

// Whether what a ray has hit stands in for something else.
fn is_stand_in(cone: Cone, leaf: u32) -> bool {
    return leaf != NONE && is_marked(leaf) && !would_suffice(cone, leaf);
}

// Whether rays with such a cone leave out what is below a node.
fn is_left(cone: Cone, node: u32) -> bool {
    if STAND_INS {
        return would_be_stood_for_wide(cone, node);
    }
    return is_stood_for_wide(cone, node);
}

// Whether they ask for a leaf that they enter.
fn is_asked_for(cone: Cone, leaf: u32) -> bool {
    let selected = is_selected(leaves[leaf].brick);
    if STAND_INS {
        return (!selected || stand_in_of(leaf) != leaf) && would_take(cone, leaf);
    }
    return selected && takes(cone, leaf);
}

// Asks for a brick that is entered at a distance.
fn ask(brick: u32, nearest: f32) {
    atomicAdd(&demand[brick].rays, 1u);
    atomicMin(&demand[brick].nearest, bitcast<u32>(max(nearest, 0.0)));
}

// One thread a ray; workgroups are squares of 8 x 8 rays.
@compute @workgroup_size(8, 8)
fn main(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    let work = rooted_or_all(OF_TILES, workgroup.x + workgroup.y * workgroups.x);
    let index = ray_of(work, local);
    if index == NONE {
        return;
    }
    if !PAIRS && !STAND_INS && !is_pending(index) {
        return;
    }
    let ray = rays[index];
    let hit = hits[index];
    let occluded = (params.flags & PARAM_ANY_HIT) != 0u && hit.id != NONE;
    if !PAIRS {
        set_pending(index, false);
    }
    let cone = cone_of(index, ray);
    if STAND_INS {
        let leaf = surfaces[index].leaf;
        let stands_in = is_stand_in(cone, leaf);
        if stands_in {
            ask(leaves[leaf].brick, hit.t);
            set_pending(index, true);
        }
        atomicStore(&pair_rays[index], u32(stands_in));
    }
    if !is_traced(index, ray) || params.top_count == 0u || occluded {
        return;
    }
    let world = framed_ray(ray.origin, ray.direction, ray.t_min);
    let up_to_next = !PAIRS && (params.flags & PARAM_NEXT) != 0u;
    var r: BrickRay;
    var stack: array<Entry, TOP_STACK_SIZE>; // nodes, and where the ray enters them
    stack[0] = Entry(0u, 0.0);
    var depth = 1u;
    var asks = 0u;
    var is_missing = false;
    var first = NONE;
    var first_near = T_INFINITE;
    var limit = hit.t;
    while depth > 0u {
        depth -= 1u;
        if stack[depth].near > limit {
            continue;
        }
        let at = 5u * stack[depth].node;
        let n0 = top8[at];
        let n1 = top8[at + 1u];
        let e = entered(world, n0, n1, top8[at + 2u], top8[at + 3u], top8[at + 4u],
                        vec3<f32>(0.0), vec3<f32>(0.0), params.instance_pad, limit);
        var bits = e.bits;
        let inner = n0.w >> 24u;
        while bits != 0u {
            // The farthest: the nearest is to be on top of the stack.
            let lowest = firstTrailingBit(bits);
            bits &= bits - 1u;
            let slot = (31u - lowest) ^ world.flip;
            let near = e.hits.near[slot >> 2u][slot & 3u];
            if near > limit {
                continue;
            }
            if (inner & (1u << slot)) != 0u {
                let child = n1.x + countOneBits(inner & ((1u << slot) - 1u));
                if is_left(cone, child) {
                    continue;
                }
                if depth == TOP_STACK_SIZE {
                    atomicAdd(&counters[COUNTER_STACK_OVERFLOW], 1u);
                    return;
                }
                stack[depth] = Entry(child, near);
                depth += 1u;
                continue;
            }
            let leaf = n1.y + ((select(n1.z, n1.w, slot >= 4u) >> (8u * (slot & 3u))) & 31u);
            if !is_asked_for(cone, leaf) || (!PAIRS && is_culled(work.tile, leaf)) {
                continue;
            }
            enter_leaf(&r, world, leaf);
            let root = 5u * leaves[leaf].brick;
            let own = entered(r.ray, roots[root], roots[root + 1u], roots[root + 2u], roots[root + 3u],
                              roots[root + 4u], r.offset_high, r.offset_low, 0.0, limit);
            if own.bits == 0u {
                continue;
            }
            if PAIRS {
                count(work.tile, leaf);
                continue;
            }
            var brick = leaves[leaf].brick;
            if STAND_INS {
                brick = leaves[stand_in_of(leaf)].brick;
                is_missing = is_missing || !is_selected(brick);
            }
            var nearest = T_INFINITE;
            for (var i = 0u; i < 8u; i++) {
                if (own.bits & (0x80000000u >> (i ^ r.ray.flip))) != 0u {
                    nearest = min(nearest, own.hits.near[i >> 2u][i & 3u]);
                }
            }
            ask(brick, nearest);
            asks += 1u;
            if first == NONE || nearest < first_near {
                first = brick;
                first_near = nearest;
                if up_to_next {
                    limit = min(limit, nearest);
                }
            }
        }
    }
    if asks > 0u {
        set_pending(index, true);
        if is_missing {
            surfaces[index].pending |= PENDING_MISSING;
        }
        if STAND_INS {
            atomicStore(&pair_rays[index], select(1u, 3u, is_missing));
        }
        atomicAdd(&demand[first].next, 1u);
        atomicAdd(&counters[COUNTER_PAIRS_VISIBLE], asks);
    }
}

// Counts a ray of the tile that sees the leaf. A pair is visible from one ray above the threshold on.
fn count(tile: u32, leaf: u32) {
    let before = atomicAdd(&pair_rays[place_of_pair(tile, leaf)], 1u);
    if before == 0u {
        atomicAdd(&counters[COUNTER_PAIRS_INVISIBLE], 1u);
    }
    if before == params.threshold {
        atomicAdd(&counters[COUNTER_PAIRS_INVISIBLE], 0xffffffffu);
        atomicAdd(&counters[COUNTER_PAIRS_VISIBLE], 1u);
    }
}
