// Intersects each ray with the selected leaves of its tile, near leaf first, in one flat loop.
#include "shared/types.wgsl"
#include "shared/bindings.wgsl"
#include "shared/tiles.wgsl"
#include "shared/cache.wgsl"
#include "shared/exact.wgsl"
#include "shared/node.wgsl"
#include "shared/leaf.wgsl"
#include "shared/brick.wgsl"
#include "shared/walk_brick.wgsl"

override COUNT: bool = false; // count nodes and triangles visited

// One thread a ray; workgroups are squares of 8 x 8 rays.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    if global.x >= params.width || global.y >= params.height {
        return;
    }
    let tile = (global.y / params.tile) * params.tiles_x + global.x / params.tile;
    let entry = tile_lists[tile];
    if entry.selected == 0u {
        return;
    }
    let index = global.y * params.width + global.x;
    let ray = rays[index];
    if !(ray.t_min <= ray.t_max) {
        return;
    }
    let any_hit = (params.flags & PARAM_ANY_HIT) != 0u;
    let before = hits[index];
    if any_hit && before.id != NONE {
        return;
    }
    var best = Best(before.t, before.id, NONE, 0u, 0.0, 0.0, 0.0, 0.0);
    let world = box_ray(ray.origin, ray.direction, ray.t_min);
    let world_frame = ray_frame(ray.direction);
    var r: BrickRay;
    var stack: array<vec2<u32>, STACK_SIZE>;
    var depth = 0u;
    var group = vec2<u32>(0u);
    var next = entry.first;
    let end = entry.first + entry.selected;
    var nodes = 0u;
    var triangles = 0u;
    loop {
        var node = 0u;
        if group.y <= 0x00ffffffu {
            if depth > 0u {
                depth -= 1u;
                group = stack[depth];
            } else {
                if next == end {
                    break;
                }
                let leaf = list[selection[next]];
                next += 1u;
                enter_leaf(&r, world, ray.direction, world_frame, leaf);
                enter_brick(&r, leaves[leaf].brick);
                group = root_group(r.box.flip);
            }
        }
        let child = nearest_child(group, r.box.flip);
        group.y = child.y;
        if group.y > 0x00ffffffu {
            if depth == STACK_SIZE {
                atomicAdd(&counters[COUNTER_STACK_OVERFLOW], 1u);
                break;
            }
            stack[depth] = group;
            depth += 1u;
        }
        let visited = visit_node(&r, child.x, best.t);
        group = visited.xy;
        var bits = visited.z;
        nodes += 1u;
        if bits != 0u {
            let first = cache_vec4(r.page, r.nodes + 5u * child.x + 1u).y;
            triangles += countOneBits(bits);
            while bits != 0u {
                let bit = firstTrailingBit(bits);
                bits &= bits - 1u;
                if test_triangle(&r, &best, first + bit) && any_hit {
                    break;
                }
            }
            if any_hit && best.leaf != NONE {
                break;
            }
        }
    }
    if best.leaf != NONE {
        let leaf = best.leaf;
        enter_leaf(&r, world, ray.direction, world_frame, leaf);
        enter_brick(&r, leaves[leaf].brick);
        write_hit(&r, best, ray.direction, index);
    }
    if COUNT {
        atomicAdd(&counters[COUNTER_NODES], nodes);
        atomicAdd(&counters[COUNTER_TRIANGLES], triangles);
    }
}
