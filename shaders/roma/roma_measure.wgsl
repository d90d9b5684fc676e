// Counts, of the pilots, which were traced to their ends, how many maps would have answered wrongly: those that meet
// something though they were found free, and for each of several distances up to which rays in doubt may be traced,
// those that are free and meet something in the maps from there on. (That such a ray meets something beyond and the
// maps have nothing there is no likelier than for the whole ray.)
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "shade/shading.wgsl"
#include "common/exact.wgsl"
#include "common/random.wgsl"
#include "roma/roma.wgsl"
#include "occupancy/levels.wgsl"
#include "roma/roma_start.wgsl"
#include "roma/roma_walk.wgsl"
#include "roma/roma_pilot.wgsl"

var<workgroup> counted: array<atomic<u32>, 8>; // as the counters from COUNTER_PILOTS on

// Cells of a map of distance `i`: 0, 2, 4, 8...
fn handover_cells(i: u32) -> u32 {
    return select(1u << i, 0u, i == 0u);
}

// One thread a ray.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    if global.x < params.width && global.y < params.height {
        let index = global.y * params.width + global.x;
        let ray = rays[index];
        if ray.t_min <= ray.t_max && is_pilot(index) {
            atomicAdd(&counted[0], 1u);
            let is_free = hits[index].id == NONE;
            let taken = nearest(index, ray);
            let found = answer(index, ray, taken, ray.t_min, true);
            if !is_free && found.t < 0.0 && found.is_known {
                atomicAdd(&counted[1], 1u);
            }
            for (var i = 0u; i < HANDOVERS && is_free && found.t >= 0.0; i++) {
                let begin = near_end(index, ray, handover_cells(i) * own.near);
                if begin < ray.t_max && answer(index, ray, taken, begin, false).t >= 0.0 {
                    atomicAdd(&counted[2u + i], 1u);
                }
            }
        }
    }
    workgroupBarrier();
    if lane < 2u + HANDOVERS {
        atomicAdd(&counters[COUNTER_PILOTS + lane], atomicLoad(&counted[lane]));
    }
}
