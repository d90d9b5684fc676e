// One ray from every hit of the shaded set to a point of the pass's lamp; from surfaces that face away, none.
#include "shared/types.wgsl"
#include "shared/bindings.wgsl"
#include "shared/shading.wgsl"
#include "shared/exact.wgsl"
#include "shared/random.wgsl"

// Rays to the rectangular light end short of it by this share of the distance, so that what lies in its plane casts no shadow.
const SHORT_OF_LIGHT: f32 = 1.0 / 65536.0;

// One thread a pixel.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    if global.x >= params.width || global.y >= params.height {
        return;
    }
    let index = global.y * params.width + global.x;
    let surface = seen_surfaces[index];
    var ray = Ray(surface.point, 1.0, params.sun.xyz, 0.0);
    if surface.leaf != NONE {
        let r = random2(index, params.stream, params.seed);
        var faces = true;
        var t_max = T_INFINITE;
        if (params.flags & PARAM_RECTANGLE) != 0u {
            let p = barrier3(params.lamp_corner.xyz + barrier3(barrier3(r.x * params.lamp_u.xyz) + barrier3(r.y * params.lamp_v.xyz)));
            ray.direction = barrier3(p - surface.point);
            faces = dot(ray.direction, cross(params.lamp_u.xyz, params.lamp_v.xyz)) < 0.0;
            t_max = 1.0 - SHORT_OF_LIGHT;
        } else if params.sun_radius > 0.0 {
            let d = params.sun.xyz;
            let disc = disc_point(r) * params.sun_radius;
            let x = tangent(d);
            let y = cross(d, x);
            ray.direction = barrier3(d + barrier3(barrier3(x * disc.x) + barrier3(y * disc.y)));
        }
        if faces && dot(surface.normal, ray.direction) > 0.0 {
            ray.t_min = 0.0;
            ray.t_max = t_max;
        }
    }
    rays[index] = ray;
    start_hit(index, ray.t_max, seen_hits[index].id);
}
