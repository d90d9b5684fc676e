// Occlusion queries of (tile, node) pairs of any size: how many rays of the tile enter the node's children at or before their
// present hit (the tighter bounds of CHC++: two child boxes in place of the node's own; of a leaf, its brick's root's).
#include "shared/types.wgsl"
#include "shared/bindings.wgsl"
#include "shared/tiles.wgsl"
#include "shared/exact.wgsl"
#include "shared/node.wgsl"
#include "shared/leaf.wgsl"

// Whether the ray enters a box of the top level in its range, padded as in node_hits.
fn enters(ray: FramedRay, node: u32, t_max: f32) -> bool {
    let lo = top2[node].min;
    let hi = top2[node].max;
    let reach = max(abs(lo - ray.origin), abs(hi - ray.origin));
    let m = max(reach.x, max(reach.y, reach.z));
    let o = abs(ray.origin);
    let delta = vec3<f32>(64.0 * UNIT * m + params.instance_pad * (m + max(o.x, max(o.y, o.z)))) + 8.0 * UNIT * max(abs(lo), abs(hi));
    let a = (lo - delta - ray.origin) * ray.frame.inv;
    let b = (hi + delta - ray.origin) * ray.frame.inv;
    let near = min(a, b);
    let far = max(a, b);
    return max(max(near.x, near.y), max(near.z, ray.t_min)) <= min(min(far.x, far.y), min(far.z, t_max));
}

var<workgroup> visible: atomic<u32>;

// One workgroup a pair; each thread tests every 64th ray of its tile.
@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = group.x + group.y * groups.x;
    var seen = 0u;
    if index < params.pair_count {
        let pair = pairs[index];
        let node = top2[pair.node];
        let w = pair.x1 - pair.x0;
        let count = w * (pair.y1 - pair.y0);
        for (var i = lane; i < count; i += 64u) {
            let at = (pair.y0 + i / w) * params.width + pair.x0 + i % w;
            let ray = rays[at];
            let hit = hits[at];
            let occluded = (params.flags & PARAM_ANY_HIT) != 0u && hit.id != NONE;
            if ray.t_min > ray.t_max || occluded {
                continue;
            }
            let world = framed_ray(ray.origin, ray.direction, ray.t_min);
            if node.right != NONE {
                seen += u32(enters(world, node.left, hit.t) || enters(world, node.right, hit.t));
            } else if enters(world, pair.node, hit.t) {
                var r: BrickRay;
                enter_leaf(&r, world, node.left);
                let brick = 5u * leaves[node.left].brick;
                let entered = node_hits(r.ray, roots[brick], roots[brick + 2u], roots[brick + 3u], roots[brick + 4u], r.offset_high, r.offset_low, 0.0, hit.t).mask;
                seen += u32(traversal_mask(entered, roots[brick + 1u], 0u) != 0u);
            }
        }
    }
    if seen > 0u {
        atomicAdd(&visible, seen);
    }
    workgroupBarrier();
    if lane == 0u && index < params.pair_count {
        pair_rays[index] = atomicLoad(&visible);
    }
}
