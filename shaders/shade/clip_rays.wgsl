// Ends or starts rays at the plane that a scene is cut at. What its normal points to is not there.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "common/exact.wgsl"

// The distance of `p` from the plane times the normal's length, but for `off`.
fn along_normal(p: vec3<f32>) -> f32 {
    let n = params.clip.xyz;
    return barrier(barrier(barrier(n.x * p.x) + barrier(n.y * p.y)) + barrier(n.z * p.z));
}

// One thread a ray.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    if global.x >= params.width || global.y >= params.height {
        return;
    }
    let index = global.y * params.width + global.x;
    let ray = rays[index];
    if ray.t_min > ray.t_max {
        return;
    }
    let height = along_normal(ray.origin) - params.clip.w;
    let rise = along_normal(ray.direction);
    var t_min = ray.t_min;
    var t_max = ray.t_max;
    if rise == 0.0 {
        t_max = select(t_max, t_min, height > 0.0);
    } else {
        let crossing = divide(-height, rise);
        if rise > 0.0 {
            t_max = min(t_max, crossing);
        } else {
            t_min = max(t_min, crossing);
        }
    }
    // A ray that lies beyond the plane is traced over a range of a point: it goes free.
    t_min = min(t_min, ray.t_max);
    t_max = max(t_max, t_min);
    rays[index].t_min = t_min;
    rays[index].t_max = t_max;
    hits[index].t = t_max;
}
