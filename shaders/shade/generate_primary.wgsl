// Camera rays: direction(x, y) = base + x * step_x + y * step_y through the jittered pixel position, not normalised.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "common/exact.wgsl"
#include "common/random.wgsl"

fn along(base: f32, x: f32, step_x: f32, y: f32, step_y: f32) -> f32 {
    return barrier(barrier(base + barrier(x * step_x)) + barrier(y * step_y));
}

// Whether the ray's block is traced: all are, or the one of its group that is chosen.
fn is_chosen(column: u32, row: u32) -> bool {
    let one_in = params.traced_one_in;
    if one_in == 0u {
        return true;
    }
    let block = row / 8u * ((params.width + 7u) / 8u) + column / 8u;
    return block % one_in == pcg(block / one_in ^ pcg(params.seed)) % one_in;
}

// One thread a ray.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    if global.x >= params.width || global.y >= params.height {
        return;
    }
    let index = global.y * params.width + global.x;
    let x = barrier(f32(global.x) + params.jitter.x);
    let row = params.first_row + global.y;
    let y = barrier(f32(row) + params.jitter.y);
    let d = vec3<f32>(along(params.base.x, x, params.step_x.x, y, params.step_y.x),
                      along(params.base.y, x, params.step_x.y, y, params.step_y.y),
                      along(params.base.z, x, params.step_x.z, y, params.step_y.z));
    // The last band of a picture may reach beyond it.
    let is_inside = row < params.picture_rows && is_chosen(global.x, row);
    let t_max = select(0.0, T_INFINITE, is_inside);
    rays[index] = Ray(params.origin.xyz, select(1.0, 0.0, is_inside), d, t_max);
    start_hit(index, t_max, NONE);
}
