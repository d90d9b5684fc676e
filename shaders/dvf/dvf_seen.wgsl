// Counts the primary hits that lie in each cell.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "shade/shading.wgsl"
#include "common/exact.wgsl"
#include "dvf/dvf.wgsl"

// One thread a pixel.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    if global.x >= params.width || global.y >= params.height {
        return;
    }
    let surface = seen_surfaces[global.y * params.width + global.x];
    if surface.leaf == NONE {
        return;
    }
    let cell = dvf_cell(surface.point);
    if cell < dvf.listed {
        atomicAdd(&dvf_tally[cell], 1u);
    }
}
