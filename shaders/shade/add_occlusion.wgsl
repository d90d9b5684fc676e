// Adds the share of the sky's light that the pass's direction stands for, where its ray went free.
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
    let ray = rays[index];
    if !(ray.t_min <= ray.t_max) || hits[index].id != NONE {
        return;
    }
    let g = gbuffer[index];
    let s = gloss_of(g, index, -seen_rays[index].direction);
    add_light(index, weight_of(index) * params.share * (s.diffuse * ambient(g.normal) + reflected_ambient(s)));
}
