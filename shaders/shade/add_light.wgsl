// Adds the light of the pass's lamp to the hits of the shaded set whose shadow ray went free. The environment shares a
// direction with diffuse rays, what is not diffuse with the rays that surfaces draw by their gloss, and all light with
// rays by which paths go on. Of an even environment rays to it bring what none of these do.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "shade/shading.wgsl"
#include "common/random.wgsl"
#include "shade/lamps.wgsl"
#include "shade/light.wgsl"
#include "shade/gloss.wgsl"
#include "shade/paths.wgsl"

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
    var density = 0.0; // by which the lamp drew the direction, where the rays of the gloss may meet it
    let d = ray.direction;
    let is_around = (params.flags & (PARAM_ENVIRONMENT | PARAM_SCATTER)) == (PARAM_ENVIRONMENT | PARAM_SCATTER);
    if (params.flags & PARAM_EMITTER) != 0u {
        // Of areas one point, drawn evenly over them: radiance * cos * cos' * area / distance^2 / pi. The direction
        // leads from the surface to the point.
        let e = emitters[surfaces[index].emitter];
        let squared = dot(d, d);
        let shone = shines(e, d);
        light = e.radiance * max(dot(g.normal, d), 0.0) * shone / (PI * squared * squared) / surfaces[index].area;
        // By power, however it was drawn: what shares the light with it must know the same density of what it met.
        if (e.kind & EMITTER_KIND) == EMITTER_TRIANGLE {
            density = e.probability * squared * sqrt(squared) / shone;
        }
    } else if is_around {
        light = environment_at(d);
    } else if (params.flags & PARAM_ENVIRONMENT) != 0u {
        let drawn = environment_sample(lamp_words(index, surfaces[index].emitter));
        light = drawn_light(drawn) * max(dot(g.normal, d), 0.0) / (PI * surfaces[index].area);
        density = drawn_density(drawn);
    } else {
        light = sunlight(g.normal);
        if params.sun_radius > 0.0 {
            density = sun_density(d);
        }
    }
    let s = gloss_of(g, index, -seen_rays[index].direction);
    var reflects = s.diffuse;
    if (params.flags & (PARAM_ENVIRONMENT | PARAM_BOUNCE)) == PARAM_ENVIRONMENT && params.diffuse_count > 0.0 {
        let by_rays = params.diffuse_count * max(dot(g.normal, d), 0.0) / PI;
        reflects *= select(outweighs(density, by_rays), 0.0, is_around);
    }
    let by_gloss = (params.flags & (PARAM_GLOSSY | PARAM_BOUNCE)) == PARAM_GLOSSY;
    if is_glossy(s) && !(is_around && by_gloss) {
        let unit_d = normalize(d);
        var weight = 1.0;
        if by_gloss && density > 0.0 {
            weight = outweighs(density, density_of(s, unit_d));
        }
        reflects += weight * reflected(s, unit_d);
    }
    if (params.flags & PARAM_PATH) != 0u && density > 0.0 {
        reflects *= outweighs(density, path_density(s, g.normal, normalize(d)));
    }
    add_light(index, weight_of(index) * reflects * light);
}
