// Intersects each ray with the whole scene, all of it resident: the baseline. One flat loop over the wide top-level tree
// and, through copies of the bricks' roots in its leaves, the bricks.
#include "shared/types.wgsl"
#include "shared/bindings.wgsl"
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
    let index = global.y * params.width + global.x;
    let ray = rays[index];
    if !(ray.t_min <= ray.t_max) {
        return;
    }
    atomicAdd(&counters[COUNTER_RAYS], 1u);
    if params.top_count == 0u {
        return;
    }
    let any_hit = (params.flags & PARAM_ANY_HIT) != 0u;
    let before = hits[index];
    var best = Best(before.t, before.id, NONE, 0u, 0.0, 0.0, 0.0, 0.0);
    let world = box_ray(ray.origin, ray.direction, ray.t_min);
    let world_frame = ray_frame(ray.direction);
    var r: BrickRay;
    r.box = world;
    var stack: array<vec2<u32>, STACK_SIZE>;
    var depth = 0u;
    var floor = 0u;                         // stack depth at which the brick ends; 0: in the top level
    var in_brick = false;
    var group = root_group(world.flip);
    var leaf_bits = 0u;                     // leaves of the last top-level node still to enter
    var leaf_base = 0u;
    var nodes = 0u;
    var triangles = 0u;
    loop {
        if in_brick && group.y <= 0x00ffffffu && depth == floor {
            in_brick = false;
            r.box.flip = world.flip;
            depth -= 1u;
            group = stack[depth];
        }
        if !in_brick && leaf_bits != 0u {
            let bit = firstTrailingBit(leaf_bits);
            leaf_bits &= leaf_bits - 1u;
            let leaf = leaf_base + bit;
            if depth + 1u >= STACK_SIZE {
                atomicAdd(&counters[COUNTER_STACK_OVERFLOW], 1u);
                break;
            }
            stack[depth] = group;
            depth += 1u;
            floor = depth;
            in_brick = true;
            enter_leaf(&r, world, ray.direction, world_frame, leaf);
            enter_brick(&r, leaves[leaf].brick);
            group = root_group(r.box.flip);
        }
        if group.y <= 0x00ffffffu {
            if depth == 0u {
                break;
            }
            depth -= 1u;
            group = stack[depth];
            continue;
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
        nodes += 1u;
        if in_brick {
            let visited = visit_node(&r, child.x, best.t);
            group = visited.xy;
            var bits = visited.z;
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
        } else {
            let at = 5u * child.x;
            let n0 = top8[at];
            let n1 = top8[at + 1u];
            let entered = node_hits(world, n0, top8[at + 2u], top8[at + 3u], top8[at + 4u], vec3<f32>(0.0), vec3<f32>(0.0), params.instance_pad, best.t).mask;
            let bits = traversal_mask(entered, n1, world.flip);
            group = vec2<u32>(n1.x, (bits & 0xff000000u) | (n0.w >> 24u));
            leaf_bits = bits & 0x00ffffffu;
            leaf_base = n1.y;
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
