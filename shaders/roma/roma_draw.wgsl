// Answers the pass's rays, which are snapped, by ray-aligned occupancy maps that are drawn by the cosine to their
// normals. A kernel of its own: drawing within roma_trace would cost every other ray time on devices that execute both
// ways of a branch.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "shade/shading.wgsl"
#include "common/exact.wgsl"
#include "common/random.wgsl"
#include "roma/roma.wgsl"
#include "occupancy/levels.wgsl"
#include "roma/roma_start.wgsl"
#include "roma/roma_walk.wgsl"
#include "roma/roma_cosine.wgsl"
#include "roma/roma_write.wgsl"

// Gives a ray the direction that it was answered in, unless nothing is asked of what is met there.
fn turn(index: u32, direction: vec3<f32>) {
    if (params.flags & PARAM_ANY_HIT) == 0u {
        rays[index].direction = direction;
        // 0.3183… is 1 / pi.
        throughput[index].w = params.diffuse_count * max(dot(gbuffer[index].normal, direction), 0.0) * 0.31830987;
    }
}

// One thread a ray.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    if global.x < params.width && global.y < params.height {
        let index = global.y * params.width + global.x;
        let ray = rays[index];
        if ray.t_min <= ray.t_max {
            var is_capped = false;
            if own.levels > 0u {
                let taken = drawn(index, ray);
                turn(index, taken.direction);
                let found = answer(index, ray, taken, ray.t_min, false);
                write(index, found);
                is_capped = found.is_capped;
            }
            count(true, is_capped);
        }
    }
    sum_up(lane);
}
