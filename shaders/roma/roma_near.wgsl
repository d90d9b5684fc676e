// Ends the pass's rays, before they are traced, so many cells of the base map that holds their start from it; those
// that no base map holds are traced whole. Where there are pilots only these are traced.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "shade/shading.wgsl"
#include "common/exact.wgsl"
#include "common/random.wgsl"
#include "roma/roma.wgsl"
#include "occupancy/levels.wgsl"
#include "roma/roma_start.wgsl"
#include "roma/roma_pilot.wgsl"

// One thread a ray.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    if global.x >= params.width || global.y >= params.height || own.levels == 0u {
        return;
    }
    let index = global.y * params.width + global.x;
    let ray = rays[index];
    if !(ray.t_min <= ray.t_max) {
        return;
    }
    if own.near != NONE {
        hits[index].t = min(ray.t_max, near_end(index, ray, own.near));
    }
    if own.pilots != 0u && !is_pilot(index) {
        hits[index].t = ANSWERED;
    }
}
