// Starts the hits of rays that came from outside: nothing found within their range.
#include "common/types.wgsl"
#include "common/bindings.wgsl"

// One thread a ray.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    if global.x >= params.width || global.y >= params.height {
        return;
    }
    let index = global.y * params.width + global.x;
    start_hit(index, rays[index].t_max, NONE);
}
