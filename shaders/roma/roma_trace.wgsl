// Answers the pass's rays by ray-aligned occupancy maps, each by that of its stratum. What is met is written as a hit
// of no triangle, but where rays are sifted: there, those that meet nothing are ended, and others are traced up to
// own.near cells from their start. Where pilots have been traced, these count for what maps get wrong.
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
#include "roma/roma_write.wgsl"

// Ends a ray that maps find free, and says whether they do; what they do not is traced.
fn sift(index: u32, ray: Ray, found: Answer) -> bool {
    if found.t < 0.0 {
        if found.is_known {
            hits[index].t = ANSWERED;
        }
        return found.is_known;
    }
    if own.near == 0u {
        hits[index].t = WAITING;
    } else if own.near != NONE {
        hits[index].t = min(ray.t_max, near_end(index, ray, own.near));
    }
    return false;
}

// Counts a pilot, of n rays one, by m + n (e - m), where m is what maps say and e what tracing says: 1, it is free, or
// 0. So the mean is that of traced rays, and its noise that of what maps get wrong (a control variate).
fn correct(index: u32, found: Answer) {
    if own.levels == 0u {
        return;
    }
    let n = f32(own.pilots);
    let is_free = hits[index].id == NONE;
    if is_free && found.t >= 0.0 {
        hits[index].u = n - 1.0;
    } else if !is_free && found.t < 0.0 {
        hits[index] = Hit(hits[index].t, NONE, -n, 0.0);
    }
}

// One thread a ray.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    if global.x < params.width && global.y < params.height {
        let index = global.y * params.width + global.x;
        let ray = rays[index];
        let is_far = own.part == ROMA_FAR;
        let is_sifted = own.part == ROMA_SIFT;
        // What has met something is not asked again, nor what was traced to its end or answered; pilots are traced.
        let is_done = hits[index].id != NONE || hits[index].t == ANSWERED || hits[index].t >= ray.t_max;
        if ray.t_min <= ray.t_max && !(is_far && is_done) && !(is_sifted && is_pilot(index)) {
            let found = answer(index, ray, nearest(index, ray), select(ray.t_min, hits[index].t, is_far), is_sifted);
            // What has been traced is not answered, though maps go on with it or correct it.
            var is_answered = own.part == ROMA_WHOLE || !is_traced(index, ray);
            if is_sifted {
                is_answered = sift(index, ray, found);
            } else if own.part == ROMA_CORRECT && is_pilot(index) {
                correct(index, found);
            } else {
                write(index, found);
            }
            count(is_answered, found.is_capped);
        }
    }
    sum_up(lane);
}
