// Leaves out the rays of three pixels in four: of all whose column or row in the picture is odd.
#include "common/types.wgsl"
#include "common/bindings.wgsl"

// One thread a ray.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    if global.x >= params.width || global.y >= params.height {
        return;
    }
    if ((global.x | (params.first_row + global.y)) & 1u) != 0u {
        let index = global.y * params.width + global.x;
        rays[index].t_min = 1.0;
        rays[index].t_max = 0.0;
        hits[index].t = 0.0;
    }
}
