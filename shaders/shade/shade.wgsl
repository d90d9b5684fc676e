// What the hits of the shaded set show by themselves, unless passes of their own bring it: the background on a miss,
// else their emission and the light of the sun and of the background, unshadowed. Where rays were drawn by the gloss of
// surfaces, what rays to lamps bring as well is weighted; so is the environment where diffuse rays meet it. The first
// shading of a sample counts it.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "shade/shading.wgsl"
#include "common/random.wgsl"
#include "shade/lamps.wgsl"
#include "shade/light.wgsl"
#include "shade/gloss.wgsl"

// Of the background in direction d, which was drawn by `density`; 0: where no lamp draws it as well.
fn seen_background(d: vec3<f32>, density: f32) -> vec3<f32> {
    var light = background(d);
    if density > 0.0 {
        let n = normalize(d);
        if (params.flags & PARAM_ENVIRONMENT) != 0u && params.environment_width != 0u {
            light *= outweighs(density, environment_density(n));
        }
        // The sun's disc is met by rays of gloss alone, unless its light is without shadows.
        let along = dot(n, params.sun.xyz);
        if (params.flags & (PARAM_SUN | PARAM_EMITTER)) == PARAM_EMITTER && params.sun_radius > 0.0 && along > 0.0 {
            let across = cross(n, params.sun.xyz);
            if dot(across, across) <= params.sun_radius * params.sun_radius * along * along {
                let of_sun = sun_density(n / along);
                light += params.sun_color.rgb * (PI * of_sun * outweighs(density, of_sun));
            }
        }
    }
    return light;
}

// The emission of a hit by a ray that was drawn by `density`, as above.
fn seen_emission(g: GBuffer, ray: Ray, index: u32, density: f32) -> vec3<f32> {
    let m = materials[g.material];
    // Only these are lamps.
    let is_lamp = m.emissive_texture == NONE && (m.flags & MATERIAL_UNLIT) == 0u;
    if !is_lamp {
        return g.emission;
    }
    let is_behind = (m.flags & MATERIAL_DOUBLE_SIDED) == 0u && (g.state & GBUFFER_BACK) != 0u;
    if (params.flags & PARAM_EMISSION) == 0u || is_behind {
        return vec3<f32>(0.0);
    }
    if density > 0.0 && params.emitter_density > 0.0 {
        let d = ray.direction;
        let length = seen_hits[index].t * sqrt(dot(d, d));
        let cosine = max(abs(dot(normalize(d), seen_surfaces[index].normal)), 1.0e-6);
        let sides = select(1.0, 2.0, (m.flags & MATERIAL_DOUBLE_SIDED) != 0u);
        let luminance = dot(m.emission, vec3<f32>(0.2126, 0.7152, 0.0722));
        let of_lamp = luminance * sides * params.emitter_density * (length * length / cosine);
        return g.emission * outweighs(density, of_lamp);
    }
    return g.emission;
}

// One thread a pixel.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    if global.x >= params.width || global.y >= params.height {
        return;
    }
    let index = global.y * params.width + global.x;
    let ray = seen_rays[index];
    if !(ray.t_min <= ray.t_max) {
        return;
    }
    var density = 0.0;
    if (params.flags & PARAM_BOUNCE) != 0u {
        density = throughput[index].w;
    } else {
        radiance[index].w += 1.0;
    }
    if seen_surfaces[index].leaf == NONE {
        // What occupancy maps met is lit otherwise.
        if (params.flags & PARAM_MISS) != 0u && seen_hits[index].id != MET {
            add_light(index, seen_background(ray.direction, density));
        }
        return;
    }
    let g = gbuffer[index];
    let s = gloss_of(g, index, -ray.direction);
    var light = vec3<f32>(0.0);
    var mirrored = vec3<f32>(0.0);
    if (params.flags & PARAM_SUN) != 0u {
        light += sunlight(g.normal);
        mirrored += reflected(s, params.sun.xyz) * sunlight(g.normal);
    }
    if (params.flags & PARAM_SKY) != 0u {
        light += ambient(g.normal) * g.occlusion;
        mirrored += reflected_ambient(s) * g.occlusion;
    }
    add_light(index, s.diffuse * light + mirrored + seen_emission(g, ray, index, density));
}
