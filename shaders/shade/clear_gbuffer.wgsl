// Empties the G-buffer of the shaded set, and before the first sample of a batch the radiance.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "shade/shading.wgsl"

// One thread a pixel.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    if global.x >= params.width || global.y >= params.height {
        return;
    }
    let index = global.y * params.width + global.x;
    gbuffer[index] = GBuffer();
    if params.sample % BATCH_SAMPLES == 0u && (params.flags & PARAM_BOUNCE) == 0u {
        radiance[index] = vec4<f32>(0.0);
    }
}
