// Adds the light of the pass's lamp to the hits of the shaded set whose shadow ray went free: Lambertian surfaces.
#include "shared/types.wgsl"
#include "shared/bindings.wgsl"
#include "shared/shading.wgsl"
#include "shared/random.wgsl"
#include "shared/lamps.wgsl"
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
    let d = ray.direction;
    if (params.flags & PARAM_EMITTER) != 0u {
        // Of areas one point, drawn evenly over them: radiance * cos * cos' * area / distance^2 / pi. The direction leads from the
        // surface to the point.
        let e = emitter_of(index);
        let squared = dot(d, d);
        light = e.radiance * max(dot(g.normal, d), 0.0) * shines(e, d) / (PI * squared * squared) / e.probability;
    } else if (params.flags & PARAM_ENVIRONMENT) != 0u {
        light = environment_sample(lamp_words(index)).light * max(dot(g.normal, d), 0.0) / PI;
    } else {
        light = sunlight(g.normal);
    }
    add_light(index, surface_share() * g.albedo * light);
}
