// One ray from every primary hit that reflects otherwise than diffusely, in a direction drawn by its gloss, which may
// lead through it; where what is reflected leads below the surface, none. The throughput and by which density the
// direction was drawn are noted.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "shade/shading.wgsl"
#include "common/random.wgsl"
#include "shade/lamps.wgsl"
#include "shade/light.wgsl"
#include "shade/gloss.wgsl"
#include "shade/cones.wgsl"

// One thread a pixel.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    if global.x >= params.width || global.y >= params.height {
        return;
    }
    let index = global.y * params.width + global.x;
    let surface = seen_surfaces[index];
    var ray = Ray(surface.point, 1.0, vec3<f32>(0.0, 1.0, 0.0), 0.0);
    var carried = vec3<f32>(0.0);
    var density = 0.0;
    var alpha = 0.0;
    var curvature = 0.0;
    if surface.leaf != NONE {
        let g = gbuffer[index];
        let s = gloss_of(g, index, -seen_rays[index].direction);
        if is_glossy(s) {
            let drawn = gloss_direction(s, points4(pixel_of(index), params.stream, params.seed));
            let is_through = drawn.w > 0.0;
            ray.direction = drawn.xyz;
            density = UNSHARED;
            if !is_through {
                density = density_of(s, ray.direction);
            }
            if density > 0.0 && (dot(surface.normal, ray.direction) > 0.0) != is_through {
                ray.t_min = 0.0;
                ray.t_max = T_INFINITE;
                alpha = greatest_alpha(s);
                if is_through {
                    carried = passed(s, ray.direction) * radiance_scale(s);
                } else {
                    curvature = g.curvature;
                    carried = reflected(s, ray.direction) * (dot(g.normal, ray.direction) / (PI * density));
                }
                carried *= left_within(g, seen_hits[index].t * length(seen_rays[index].direction));
            }
        }
    }
    rays[index] = ray;
    throughput[index] = vec4<f32>(carried, density);
    origins[index] = Origin(index, 0u);
    start_hit(index, ray.t_max, seen_hits[index].id);
    surfaces[index].emitter = bitcast<u32>(curvature);
    if alpha > 0.0 {
        widen_reflected(index, density, alpha, curvature);
    }
}
