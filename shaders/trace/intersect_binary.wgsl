// Intersects each ray with the whole scene, all of it resident, over binary trees: the baseline of the kind that
// Mattausch et al. 2015 (section 7) compare with. A while-while traversal (Aila and Laine 2009), near child first: down
// to a leaf, then its triangles. One stack serves the binary top level and the trees of the bricks at its leaves.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "texture/blocks.wgsl"
#include "trace/cache.wgsl"
#include "trace/surface.wgsl"
#include "trace/node.wgsl"
#include "trace/levels.wgsl"
#include "trace/leaf.wgsl"
#include "trace/brick.wgsl"
#include "trace/walk_brick.wgsl"
#include "trace/binary.wgsl"

// What is left to be visited: BinaryNode.what in a brick; in the top level an inner node, or BINARY_LEAF and the leaf.
struct Walk {
    stack: array<u32, BINARY_STACK>,
    depth: u32,
    floor: u32,               // stack depth at which the brick ends
    in_brick: bool,
}

const DONE: u32 = 0xffffffffu;  // no leaf: bricks have fewer triangles

struct BoxHit {
    near: f32,
    entered: bool,
}

// The padded test of a ray against one box, both in one frame. The padding is node_hits' with the box in place of the
// node's grid; distances take fewer roundings here, and the corners' one to f32 is within twice the term for it.
fn enter_box(ray: FramedRay, low: vec3<f32>, high: vec3<f32>, offset_low: vec3<f32>, slack: f32, t_max: f32) -> BoxHit {
    let w0 = low - ray.origin;
    let w1 = high - ray.origin;
    let reach = max(abs(w0), abs(w1));
    let m = max(reach.x, max(reach.y, reach.z));
    let o = abs(ray.origin);
    let delta = vec3<f32>(64.0 * UNIT * m + slack * (m + max(o.x, max(o.y, o.z))))
        + 8.0 * UNIT * max(abs(low), abs(high)) + 2.0 * UNIT * abs(offset_low);
    let a = (w0 - delta) * ray.frame.inv;
    let b = (w1 + delta) * ray.frame.inv;
    let tn = min(a, b);
    let tf = max(a, b);
    let near = max(max(tn.x, tn.y), max(tn.z, ray.t_min));
    // Not pruned at equality: a hit at equal distance with a lower id must be found.
    return BoxHit(near, near <= min(min(tf.x, tf.y), min(tf.z, t_max)));
}

fn top_reference(node: u32) -> u32 {
    return select(node, BINARY_LEAF | top2[node].left, top2[node].right == NONE);
}

fn pop(walk: ptr<function, Walk>) -> u32 {
    if (*walk).depth == 0u {
        return DONE;
    }
    (*walk).depth -= 1u;
    (*walk).in_brick = (*walk).in_brick && (*walk).depth >= (*walk).floor;
    return (*walk).stack[(*walk).depth];
}

// One thread a ray; workgroups are squares of 8 x 8 rays.
@compute @workgroup_size(8, 8)
fn main(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    let work = work_of_all(workgroup.x + workgroup.y * workgroups.x);
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
    let world = framed_ray(ray.origin, ray.direction, ray.t_min);
    var best = Best(before.t, before.id, NONE, 0u, 0.0, 0.0, 0.0, 0.0, surfaces[index].source);
    let cone = cone_of(index, ray);
    var r: BrickRay;
    r.ray = world;
    var walk: Walk;
    var root = vec2<u32>(0u);               // page and first node of the brick's tree
    var at = top_reference(0u);
    loop {
        while (at & BINARY_LEAF) == 0u {
            var children: vec2<u32>;
            var left: BoxHit;
            var right: BoxHit;
            if walk.in_brick {
                let a = binary_node(root.x, root.y + at);
                let b = binary_node(root.x, root.y + at + 1u);
                children = vec2<u32>(a.what, b.what);
                left = enter_box(r.ray, (a.min + r.offset_high) + r.offset_low,
                                 (a.max + r.offset_high) + r.offset_low, r.offset_low, 0.0, best.t);
                right = enter_box(r.ray, (b.min + r.offset_high) + r.offset_low,
                                  (b.max + r.offset_high) + r.offset_low, r.offset_low, 0.0, best.t);
            } else {
                let node = top2[at];
                children = vec2<u32>(top_reference(node.left), top_reference(node.right));
                left = enter_box(world, top2[node.left].min, top2[node.left].max,
                                 vec3<f32>(0.0), params.instance_pad, best.t);
                right = enter_box(world, top2[node.right].min, top2[node.right].max,
                                  vec3<f32>(0.0), params.instance_pad, best.t);
            }
            nodes_visited += 1u;
            if left.entered && right.entered {
                if walk.depth == BINARY_STACK {
                    atomicAdd(&counters[COUNTER_STACK_OVERFLOW], 1u);
                    at = DONE;
                    break;
                }
                let swap = right.near < left.near;
                walk.stack[walk.depth] = select(children.y, children.x, swap);
                walk.depth += 1u;
                at = select(children.x, children.y, swap);
            } else if left.entered || right.entered {
                at = select(children.y, children.x, left.entered);
            } else {
                at = pop(&walk);
            }
        }
        if at == DONE {
            break;
        }
        if !walk.in_brick {
            let leaf = at & ~BINARY_LEAF;
            if !takes(cone, leaf) {
                at = pop(&walk);
                continue;
            }
            let brick = leaves[leaf].brick;
            note_use(leaf);
            enter_leaf(&r, world, leaf);
            enter_brick(&r, brick);
            root = binary_roots[brick];
            walk.floor = walk.depth;
            walk.in_brick = true;
            at = binary_node(root.x, root.y).what;
            continue;
        }
        let first = at & 0x1fffffffu;
        let count = (at >> 29u) & 3u;
        triangles_tested += count;
        for (var i = 0u; i < count; i++) {
            if test_triangle(&r, &best, first + i) && any_hit {
                break;
            }
        }
        if any_hit && best.leaf != NONE {
            break;
        }
        at = pop(&walk);
    }
    finish_walk(&r, world, best, index);
}
