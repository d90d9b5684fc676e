// One ray from every primary hit to a point of the sun's disc; from surfaces that face away, none.
#include "shared/types.wgsl"
#include "shared/bindings.wgsl"
#include "shared/shading.wgsl"
#include "shared/exact.wgsl"
#include "shared/random.wgsl"

// One thread a pixel.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    if global.x >= params.width || global.y >= params.height {
        return;
    }
    let index = global.y * params.width + global.x;
    let surface = primary_surfaces[index];
    var ray = Ray(surface.point, 1.0, params.sun.xyz, 0.0);
    if surface.leaf != NONE {
        var d = params.sun.xyz;
        if params.sun_radius > 0.0 {
            let r = random2(index, params.sample, params.seed);
            let disc = disc_point(r) * params.sun_radius;
            let x = tangent(d);
            let y = cross(d, x);
            d = barrier3(d + barrier3(barrier3(x * disc.x) + barrier3(y * disc.y)));
        }
        ray.direction = d;
        if dot(surface.normal, d) > 0.0 {
            ray.t_min = 0.0;
            ray.t_max = T_INFINITE;
        }
    }
    rays[index] = ray;
    start_hit(index, ray.t_max, primary_hits[index].id);
}
