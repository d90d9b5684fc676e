// Adds the light of the pass's lamp to the hits of the shaded set whose shadow ray went free: Lambertian surfaces.
#include "shared/types.wgsl"
#include "shared/bindings.wgsl"
#include "shared/shading.wgsl"
#include "shared/light.wgsl"

// One thread a pixel.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    if global.x >= params.width || global.y >= params.height {
        return;
    }
    let index = global.y * params.width + global.x;
    let ray = rays[index];
    if !(ray.t_min <= ray.t_max) || hits[index].id != NONE {
        return;
    }
    let g = gbuffer[index];
    var light: vec3<f32>;
    if (params.flags & PARAM_RECTANGLE) == 0u {
        light = sunlight(g.normal);
    } else {
        // One point of the light, drawn evenly over its area: radiance * cos * cos' * area / distance^2 / pi. The direction leads
        // from the surface to the point, and the length of the cross product is the area.
        let d = ray.direction;
        let squared = dot(d, d);
        let from_light = max(dot(-d, cross(params.lamp_u.xyz, params.lamp_v.xyz)), 0.0);
        light = params.lamp_color.rgb * max(dot(g.normal, d), 0.0) * from_light / (PI * squared * squared);
    }
    add_light(index, surface_share() * g.albedo * light);
}
