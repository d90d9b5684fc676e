// Ray-by-ray queries of the selected (tile, leaf) pairs: how many rays of the tile enter a child box of the brick's
// root at or before their present hit, and where the nearest does. With PARAM_NEEDED the hits are final and the rays of
// an any-hit pass that ended occluded ask only for the brick that holds their hit.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "query/tiles.wgsl"
#include "trace/triangle.wgsl"
#include "trace/node.wgsl"
#include "trace/levels.wgsl"
#include "trace/leaf.wgsl"

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
    let ray = rays[index];
    if !is_traced(index, ray) {
        return;
    }
    let hit = hits[index];
    let occluded = (params.flags & PARAM_ANY_HIT) != 0u && hit.id != NONE;
    let needed = (params.flags & PARAM_NEEDED) != 0u;
    if occluded && !needed {
        return;
    }
    let world = framed_ray(ray.origin, ray.direction, ray.t_min);
    let cone = cone_of(index, ray);
    var r: BrickRay;
    var first = NONE;
    var first_near = T_INFINITE;
    let up_to_next = (params.flags & PARAM_NEXT) != 0u;
    var limit = hit.t;
    for (var next = entry.first; next < entry.first + entry.selected; next++) {
        let position = selection[next];
        let listed = list[position];
        let leaf = top2[listed.node].left;
        if occluded {
            if surfaces[index].leaf == leaf {
                atomicAdd(&pair_demand[position].rays, 1u);
                atomicMin(&pair_demand[position].nearest, 0u);
            }
            continue;
        }
        if listed.near > limit || !takes(cone, leaf) || !may_meet(world, listed.node, limit) {
            continue;
        }
        enter_leaf(&r, world, leaf);
        let brick = leaves[leaf].brick;
        let at = 5u * brick;
        let n1 = roots[at + 1u];
        let entered = node_hits(r.ray, roots[at], roots[at + 2u], roots[at + 3u], roots[at + 4u],
                                r.offset_high, r.offset_low, 0.0, limit);
        var near = T_INFINITE;
        var any = false;
        for (var i = 0u; i < 8u; i++) {
            let what = (select(n1.z, n1.w, i >= 4u) >> (8u * (i & 3u))) & 255u;
            if (entered.mask & (1u << i)) != 0u && what != 0u {
                near = min(near, entered.near[i >> 2u][i & 3u]);
                any = true;
            }
        }
        if any {
            atomicAdd(&pair_demand[position].rays, 1u);
            atomicMin(&pair_demand[position].nearest, bitcast<u32>(max(near, 0.0)));
            if first == NONE || near < first_near {
                first = brick;
                first_near = near;
                if up_to_next {
                    limit = min(limit, near);
                }
            }
        }
    }
    if first != NONE {
        atomicAdd(&demand[first].next, 1u);
    }
}
