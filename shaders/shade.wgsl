// What the hits of the shaded set show by themselves, unless passes of their own bring it: the background on a miss, else their emission
// and the light of the sun and of the background on a Lambertian surface. The first shading of a sample counts it.
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
    if (params.flags & PARAM_BOUNCE) == 0u {
        radiance[index].w += 1.0;
    }
    let ray = seen_rays[index];
    if !(ray.t_min <= ray.t_max) {
        return;
    }
    if seen_surfaces[index].leaf == NONE {
        if (params.flags & PARAM_MISS) != 0u {
            add_light(index, background(ray.direction));
        }
        return;
    }
    let g = gbuffer[index];
    var light = vec3<f32>(0.0);
    if (params.flags & PARAM_SUN) != 0u {
        light += sunlight(g.normal);
    }
    if (params.flags & PARAM_SKY) != 0u {
        light += ambient(g.normal);
    }
    var shown = g.albedo * light;
    if (params.flags & PARAM_EMISSION) != 0u {
        shown += g.emission;
    }
    add_light(index, surface_share() * shown);
}
