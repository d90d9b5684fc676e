// Intersects each ray with the whole scene, all of it resident: the baseline, or with OF_TILES the rays of the tiles
// that have no list. One loop over the wide top-level tree and, through copies of the bricks' roots in its leaves, the
// bricks; nodes are visited until one has triangles, so that the rays of a subgroup test theirs together. With SELECT
// it passes by what is not in the wanted state.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "query/tiles.wgsl"
#include "trace/cache.wgsl"
#include "trace/surface.wgsl"
#include "trace/node.wgsl"
#include "trace/levels.wgsl"
#include "trace/leaf.wgsl"
#include "trace/brick.wgsl"
#include "trace/walk_brick.wgsl"

override SELECT: bool = false;
override OF_TILES: bool = false;

// A group of the top level: the node, and its entered children, inner ones and leaves alike, by priority in the high
// byte, so that bricks are met near to far.
fn top_group(ray: FramedRay, node: u32, t_max: f32) -> vec2<u32> {
    let at = 5u * node;
    let n1 = top8[at + 1u];
    let entered = node_hits(ray, top8[at], top8[at + 2u], top8[at + 3u], top8[at + 4u],
                            vec3<f32>(0.0), vec3<f32>(0.0), params.instance_pad, t_max).mask;
    nodes_visited += 1u;
    var bits = 0u;
    for (var i = 0u; i < 8u; i++) {
        let what = (select(n1.z, n1.w, i >= 4u) >> (8u * (i & 3u))) & 255u;
        if (entered & (1u << i)) != 0u && what != 0u {
            bits |= 0x80000000u >> (i ^ ray.flip);
        }
    }
    return vec2<u32>(node, bits);
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
    let ray = rays[index];
    if !is_traced(index, ray) || params.top_count == 0u {
        return;
    }
    let any_hit = (params.flags & PARAM_ANY_HIT) != 0u;
    let before = hits[index];
    if SELECT && ((any_hit && before.id != NONE) || !is_pending(index)) {
        return;
    }
    let world = framed_ray(ray.origin, ray.direction, ray.t_min);
    var best = Best(before.t, before.id, NONE, 0u, 0.0, 0.0, 0.0, 0.0, surfaces[index].source);
    let cone = cone_of(index, ray);
    var r: BrickRay;
    r.ray = world;
    var stack: array<vec2<u32>, STACK_SIZE>;
    var depth = 0u;
    var floor = 0u;                         // stack depth at which the brick ends
    var in_brick = false;
    var group = top_group(world, 0u, best.t);
    loop {
        var triangles = vec2<u32>(0u);
        loop {
            if !has_children(group) {
                if in_brick && depth == floor {
                    in_brick = false;
                    r.ray.flip = world.flip;
                }
                if depth == 0u {
                    break;
                }
                depth -= 1u;
                group = stack[depth];
            }
            let nearest = nearest_child(group, r.ray.flip);
            if has_children(nearest.rest) {
                if depth == STACK_SIZE {
                    atomicAdd(&counters[COUNTER_STACK_OVERFLOW], 1u);
                    break;
                }
                stack[depth] = nearest.rest;
                depth += 1u;
            }
            let slot = nearest.slot;
            if in_brick {
                let opened = open_node(&r, best.t, child_index(group, slot));
                group = opened.children;
                triangles = opened.triangles;
                if triangles.y != 0u {
                    break;
                }
                continue;
            }
            let inner = top8[5u * group.x].w >> 24u;
            let n1 = top8[5u * group.x + 1u];
            if (inner & (1u << slot)) != 0u {
                let child = n1.x + countOneBits(inner & ((1u << slot) - 1u));
                if is_stood_for_wide(cone, child) {
                    group = vec2<u32>(0u);
                    continue;
                }
                group = top_group(world, child, best.t);
            } else {
                let leaf = n1.y + ((select(n1.z, n1.w, slot >= 4u) >> (8u * (slot & 3u))) & 31u);
                let is_selected =
                    !SELECT || (slots[leaves[leaf].brick].state & params.select_mask) == params.select_want;
                if !is_selected || (SELECT && OF_TILES && is_culled(work.tile, leaf)) || !takes(cone, leaf) {
                    group = vec2<u32>(0u);
                    continue;
                }
                floor = depth;
                in_brick = true;
                enter_leaf(&r, world, leaf);
                enter_brick(&r, leaves[leaf].brick);
                group = root_group(r.ray.flip);
            }
        }
        if triangles.y == 0u {
            break;
        }
        test_triangles(&r, &best, triangles, any_hit);
        if any_hit && best.leaf != NONE {
            break;
        }
    }
    finish_walk(&r, world, best, index);
}
