// Adds the light of the environment to the primary hits as the paper has it (Günay, Akyüz, Algorithm 3, corrected):
// where their cell is mostly visible all of it by spherical harmonics (Ramamoorthi, Hanrahan 2001), less what the
// pass's ray would bring if it met something; else what the ray brings that went free. Rays are drawn by the cosine,
// and which cell it is was noted (dvf_sift.wgsl).
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "shade/shading.wgsl"
#include "common/random.wgsl"
#include "shade/lamps.wgsl"
#include "shade/light.wgsl"
#include "shade/gloss.wgsl"

// One thread a pixel.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    if global.x >= params.width || global.y >= params.height {
        return;
    }
    let index = global.y * params.width + global.x;
    if seen_surfaces[index].leaf == NONE {
        return;
    }
    let ray = rays[index];
    let g = gbuffer[index];
    // What leads below the surface meets it.
    let is_met = !(ray.t_min <= ray.t_max) || hits[index].id != NONE;
    let is_occluded_cell = g.padding0 == 1u;
    var light = vec3<f32>(0.0);
    if is_met != is_occluded_cell {
        light = background(ray.direction);
    }
    if !is_occluded_cell {
        light = ambient(g.normal) - light;
    }
    add_light(index, gloss_of(g, index, -seen_rays[index].direction).diffuse * light);
}
