// Occlusion queries of (tile, node) pairs of any size: how many rays of the tile enter the node at or before their
// present hit. With PARAM_TIGHTER they must enter one of its children's boxes (of a leaf, of its brick's root's), which
// lie in its own. A query of several nodes asks first whether any ray enters any of them, and only then for each node
// alone. No more rays than the threshold are none.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "query/tiles.wgsl"
#include "trace/triangle.wgsl"
#include "trace/node.wgsl"
#include "trace/levels.wgsl"
#include "trace/leaf.wgsl"

const MOST_NODES: u32 = 16u;
const OWN: u32 = 1u;      // the ray enters the node's own box
const SEEN: u32 = 2u;     // and what the query asks for

fn look(world: FramedRay, cone: Cone, index: u32, t_max: f32) -> u32 {
    if !enters(world, index, t_max) || is_stood_for(cone, index) {
        return 0u;
    }
    let node = top2[index];
    if node.right == NONE && !takes(cone, node.left) {
        return 0u;
    }
    if (params.flags & PARAM_TIGHTER) == 0u {
        return OWN | SEEN;
    }
    if node.right != NONE {
        return OWN | select(0u, SEEN, enters(world, node.left, t_max) || enters(world, node.right, t_max));
    }
    var r: BrickRay;
    enter_leaf(&r, world, node.left);
    let at = 5u * leaves[node.left].brick;
    let entered = node_hits(r.ray, roots[at], roots[at + 2u], roots[at + 3u], roots[at + 4u],
                            r.offset_high, r.offset_low, 0.0, t_max).mask;
    return OWN | select(0u, SEEN, traversal_mask(entered, roots[at + 1u], 0u) != 0u);
}

var<workgroup> visible: atomic<u32>;                           // rays that see any node of the query
var<workgroup> own: atomic<u32>;                               // nodes whose own box a ray enters, a bit each
var<workgroup> visible_each: array<atomic<u32>, MOST_NODES>;   // rays that see each, asked for alone

// Asks the rays of a thread for the nodes of the query, until one is seen, or for each alone.
fn ask(pair: Pair, lane: u32, each: bool) {
    let w = pair.x1 - pair.x0;
    let rays_of_tile = w * (pair.y1 - pair.y0);
    var seen = 0u;
    var entered = 0u;
    for (var i = lane; i < rays_of_tile; i += 64u) {
        let at = (pair.y0 + i / w) * params.width + pair.x0 + i % w;
        let ray = rays[at];
        let hit = hits[at];
        let occluded = (params.flags & PARAM_ANY_HIT) != 0u && hit.id != NONE;
        if !is_traced(at, ray) || occluded {
            continue;
        }
        let world = framed_ray(ray.origin, ray.direction, ray.t_min);
        let cone = cone_of(at, ray);
        for (var k = 0u; k < pair.count; k++) {
            let what = look(world, cone, pair_nodes[pair.first + k], hit.t);
            entered |= (what & OWN) << k;
            if (what & SEEN) != 0u {
                if each {
                    atomicAdd(&visible_each[k], 1u);
                } else {
                    seen += 1u;
                    break;
                }
            }
        }
    }
    if seen > 0u {
        atomicAdd(&visible, seen);
    }
    if entered > 0u {
        atomicOr(&own, entered);
    }
}

// One workgroup a query; each thread tests every 64th ray of its tile.
@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let index = group.x + group.y * groups.x;
    var pair = Pair();
    if index < params.pair_count {
        pair = pairs[index];
        ask(pair, lane, false);
    }
    workgroupBarrier();
    let failed = pair.count > 1u && atomicLoad(&visible) > params.threshold;
    if failed {
        ask(pair, lane, true);
    }
    workgroupBarrier();
    if lane == 0u && pair.count > 0u {
        atomicAdd(&counters[COUNTER_PAIRS_TESTED], select(1u, 1u + pair.count, failed));
    }
    if lane < pair.count {
        var seen = atomicLoad(&visible);
        if failed {
            seen = atomicLoad(&visible_each[lane]);
        }
        atomicStore(&pair_rays[pair.first + lane], select(0u, seen, seen > params.threshold));
        if seen == 0u && (atomicLoad(&own) & (1u << lane)) != 0u {
            atomicAdd(&counters[COUNTER_TIGHTENED], 1u);
        }
    }
}
