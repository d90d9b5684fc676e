// Bounds of the rays of each tile: origins, directions, and the range of distances in which they can still hit.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "query/tiles.wgsl"
#include "query/tile_spreads.wgsl"

var<workgroup> origin_min: array<vec3<f32>, 64>;
var<workgroup> origin_max: array<vec3<f32>, 64>;
var<workgroup> direction_min: array<vec3<f32>, 64>;
var<workgroup> direction_max: array<vec3<f32>, 64>;
var<workgroup> range: array<vec2<f32>, 64>;
var<workgroup> traced: array<u32, 64>;

// One workgroup a tile: each thread bounds every 64th ray, then the workgroup reduces.
@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let tile = group.x + group.y * groups.x;
    let x0 = (tile % params.tiles_x) * params.tile;
    let y0 = (tile / params.tiles_x) * params.tile;
    let w = min(params.tile, params.width - min(x0, params.width));
    let h = min(params.tile, params.height - min(y0, params.height));
    var o0 = vec3<f32>(T_INFINITE);
    var o1 = vec3<f32>(-T_INFINITE);
    var d0 = vec3<f32>(T_INFINITE);
    var d1 = vec3<f32>(-T_INFINITE);
    var t = vec2<f32>(T_INFINITE, 0.0);
    var n = 0u;
    start_spreads(lane);
    if tile < params.tiles {
        for (var i = lane; i < w * h; i += 64u) {
            let index = (y0 + i / w) * params.width + x0 + i % w;
            let ray = rays[index];
            if is_traced(index, ray) {
                o0 = min(o0, ray.origin);
                o1 = max(o1, ray.origin);
                d0 = min(d0, ray.direction);
                d1 = max(d1, ray.direction);
                t = vec2<f32>(min(t.x, ray.t_min), max(t.y, hits[index].t));
                n += 1u;
                bound_spread(lane, index);
            }
        }
    }
    origin_min[lane] = o0;
    origin_max[lane] = o1;
    direction_min[lane] = d0;
    direction_max[lane] = d1;
    range[lane] = t;
    traced[lane] = n;
    for (var step = 32u; step > 0u; step >>= 1u) {
        workgroupBarrier();
        if lane < step {
            origin_min[lane] = min(origin_min[lane], origin_min[lane + step]);
            origin_max[lane] = max(origin_max[lane], origin_max[lane + step]);
            direction_min[lane] = min(direction_min[lane], direction_min[lane + step]);
            direction_max[lane] = max(direction_max[lane], direction_max[lane + step]);
            range[lane] = vec2<f32>(min(range[lane].x, range[lane + step].x), max(range[lane].y, range[lane + step].y));
            traced[lane] += traced[lane + step];
            join_spreads(lane, lane + step);
        }
    }
    if lane == 0u && tile < params.tiles {
        tile_bounds[tile] = TileBounds(origin_min[0], range[0].x, origin_max[0], range[0].y,
                                       direction_min[0], traced[0], direction_max[0], tile_spreads());
        atomicAdd(&counters[COUNTER_RAYS_TRACED], traced[0]);
    }
}
