// Ends those of the pass's rays that are no pilots before they are traced: maps answer them.
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
    if own.pilots != 0u && !is_pilot(index) {
        hits[index].t = ANSWERED;
    }
}
