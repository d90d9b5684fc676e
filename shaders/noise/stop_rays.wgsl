// Leaves out the rays of pixels that take no more samples, block by block.
#include "common/types.wgsl"
#include "common/bindings.wgsl"

@group(2) @binding(0) var<storage, read> stopped: array<u32>; // of blocks of 8x8 rays, row by row: 0, they are traced

// One thread a ray.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    if global.x >= params.width || global.y >= params.height {
        return;
    }
    if stopped[global.y / 8u * ((params.width + 7u) / 8u) + global.x / 8u] != 0u {
        let index = global.y * params.width + global.x;
        rays[index].t_min = 1.0;
        rays[index].t_max = 0.0;
        hits[index].t = 0.0;
    }
}
