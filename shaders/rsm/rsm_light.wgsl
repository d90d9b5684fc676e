// Adds what the hits of the shaded set that occupancy maps gave reflect of the lamps, by their reflective shadow maps.
// Such a hit is known to a cell: it is moved within one at random (Zeng et al., §6, move the points that they look up),
// and what a lamp sees there counts where it lies no farther away than the surface in that cell may, and turns to the
// ray. All else is in shadow.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "shade/shading.wgsl"
#include "common/exact.wgsl"
#include "common/random.wgsl"
#include "shade/lamps.wgsl"
#include "shade/light.wgsl"
#include "rsm/rsm.wgsl"

// All by the lift of the level that was met, 1.25 cells: how wide points are moved,
const MOVED: f32 = 0.8;
// how far what is seen may be from the point, across its surface,
const ACROSS: f32 = 1.2;
// and in depth, which is more where the light grazes it.
const IN_DEPTH: f32 = 3.6;

fn row_at(row: vec4<f32>, p: vec3<f32>) -> f32 {
    return barrier(barrier(barrier(barrier(row.x * p.x) + barrier(row.y * p.y)) + barrier(row.z * p.z)) + row.w);
}

// One thread a pixel.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    if global.x >= params.width || global.y >= params.height {
        return;
    }
    let index = global.y * params.width + global.x;
    let ray = seen_rays[index];
    if !(ray.t_min <= ray.t_max) || seen_hits[index].id != MET {
        return;
    }
    let met = seen_surfaces[index];
    let words = lamp_words(index, 0u);
    let moved = vec3<f32>(unit(words.x), unit(words.y), unit(words.z)) - vec3<f32>(0.5);
    let p = barrier3(met.point + barrier3(barrier(MOVED * met.area) * moved));
    var light = vec3<f32>(0.0);
    var done = params.emitter_count; // the lamp that was looked up last; none has this number
    for (var i = 0u; i < own.maps; i++) {
        let map = rsm_maps[i];
        if map.lamp == done {
            continue;
        }
        var u = row_at(map.texel_from_point[0], p);
        var v = row_at(map.texel_from_point[1], p);
        let depth = row_at(map.texel_from_point[2], p);
        if (map.flags & RSM_PERSPECTIVE) != 0u {
            if !(depth > 0.0) {
                continue;
            }
            u = divide(u, depth);
            v = divide(v, depth);
        }
        if !(u >= 0.0 && v >= 0.0 && u < f32(map.width) && v < f32(map.height)) {
            continue;
        }
        done = map.lamp;
        let texel = rsm_texels[map.first + u32(v) * map.width + u32(u)];
        let n = texel.normal;
        let turned = barrier(barrier(n.x * met.normal.x) + barrier(n.y * met.normal.y)) + barrier(n.z * met.normal.z);
        let apart = abs(depth - texel.depth);
        if texel.depth >= 0.0 && turned > 0.0 && apart <= IN_DEPTH * met.area
            && barrier(apart * texel.facing) <= ACROSS * met.area {
            light += texel.flux;
        }
    }
    if any(light != vec3<f32>(0.0)) {
        add_light(index, light);
    }
}
