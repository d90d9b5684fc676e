// Intersects each ray with a run of the selected leaves of its tile, in their order. Nodes are visited until one has
// triangles, so that the rays of a subgroup test theirs together.
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

// One thread a ray; workgroups are squares of 8 x 8 rays.
@compute @workgroup_size(8, 8)
fn main(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    let work = work_of(WORK_CHOSEN, workgroup.x + workgroup.y * workgroups.x);
    let index = ray_of(work, local);
    if index == NONE {
        return;
    }
    let entry = tile_lists[work.tile];
    var next = entry.first + min(params.run_first, entry.selected);
    let end = min(entry.first + entry.selected, next + params.run_count);
    if next == end {
        return;
    }
    let ray = rays[index];
    if !is_traced(index, ray) {
        return;
    }
    let any_hit = (params.flags & PARAM_ANY_HIT) != 0u;
    let before = hits[index];
    if any_hit && before.id != NONE {
        return;
    }
    let world = framed_ray(ray.origin, ray.direction, ray.t_min);
    var best = Best(before.t, before.id, NONE, 0u, 0.0, 0.0, 0.0, 0.0, surfaces[index].source);
    let cone = cone_of(index, ray);
    var r: BrickRay;
    var stack: array<vec2<u32>, STACK_SIZE>;
    var depth = 0u;
    var group = vec2<u32>(0u);
    loop {
        var triangles = vec2<u32>(0u);
        loop {
            if !has_children(group) {
                if depth > 0u {
                    depth -= 1u;
                    group = stack[depth];
                } else {
                    if next == end {
                        break;
                    }
                    let listed = list[selection[next]];
                    next += 1u;
                    let leaf = top2[listed.node].left;
                    if listed.near > best.t || !takes(cone, leaf) || !may_meet(world, listed.node, best.t) {
                        continue;
                    }
                    enter_leaf(&r, world, leaf);
                    enter_brick(&r, leaves[leaf].brick);
                    group = root_group(r.ray.flip);
                }
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
            let opened = open_node(&r, best.t, child_index(group, nearest.slot));
            group = opened.children;
            triangles = opened.triangles;
            if triangles.y != 0u {
                break;
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
