// One ray from every hit of the shaded set, which a path goes on by, in a direction drawn by what the surface reflects:
// around the normal by its diffuse part, else by its gloss, which may lead through it. The throughput is what was
// carried so far times what is reflected. From the third ray on, paths that lose light end by chance, and what goes on
// makes up for them (Russian roulette: Arvo, Kirk 1990). Where paths end at these hits, those alone go on that lead
// through them. Until the rays are moved to the set before (move_paths.wgsl), what is known of the path lies in the
// surface of its ray: the throughput in `point`, the density in `area`, the origin in `emitter` and `triangle`, the
// curvature in `normal`.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "shade/shading.wgsl"
#include "common/random.wgsl"
#include "shade/lamps.wgsl"
#include "shade/light.wgsl"
#include "shade/gloss.wgsl"
#include "shade/paths.wgsl"
#include "shade/cones.wgsl"

// The first ray of a path that may end by chance: that of the third hit.
const FIRST_CHANCE: u32 = 3u;
// No path goes on for certain from there, so that all end.
const MOST_LIKELY: f32 = 0.95;

// One thread a pixel.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    if global.x >= params.width || global.y >= params.height {
        return;
    }
    let index = global.y * params.width + global.x;
    let surface = seen_surfaces[index];
    let before = throughput[index].rgb;
    let origin = origins[index];
    var ray = Ray(surface.point, 1.0, vec3<f32>(0.0, 1.0, 0.0), 0.0);
    var carried = vec3<f32>(0.0);
    var density = 0.0;
    var alpha = 0.0;
    var curvature = 0.0;
    if surface.leaf != NONE && max(before.x, max(before.y, before.z)) > 0.0 {
        let g = gbuffer[index];
        let s = gloss_of(g, index, -seen_rays[index].direction);
        let words = points4(pixel_of(index) ^ pcg(origin.direction + 1u), params.stream, params.seed);
        let drawn = path_direction(s, g.normal, words);
        let is_through = drawn.w > 0.0;
        ray.direction = drawn.xyz;
        density = UNSHARED;
        if !is_through {
            density = path_density(s, g.normal, ray.direction);
        }
        let goes_on = is_through || (params.flags & PARAM_PATH) != 0u;
        if goes_on && density > 0.0 && (dot(surface.normal, ray.direction) > 0.0) != is_through {
            var weight: vec3<f32>;
            var scale = 1.0;
            if is_through {
                weight = passed(s, ray.direction) / path_choice(s);
                scale = radiance_scale(s);
            } else {
                let reflects = s.diffuse + reflected(s, ray.direction);
                weight = reflects * (dot(g.normal, ray.direction) / (PI * density));
            }
            weight *= left_within(g, seen_hits[index].t * length(seen_rays[index].direction));
            var chance = 1.0;
            if params.direction >= FIRST_CHANCE {
                chance = min(max(weight.x, max(weight.y, weight.z)), MOST_LIKELY);
            }
            if unit(pcg(words.w)) < chance {
                ray.t_min = 0.0;
                ray.t_max = T_INFINITE;
                alpha = select(1.0, greatest_alpha(s), is_glossy(s));
                curvature = select(g.curvature, 0.0, is_through);
                carried = before * (weight * (scale / chance));
            }
        }
    }
    rays[index] = ray;
    start_hit(index, ray.t_max, seen_hits[index].id);
    surfaces[index].point = carried;
    surfaces[index].area = density;
    surfaces[index].emitter = origin.pixel;
    surfaces[index].triangle = origin.direction;
    surfaces[index].normal.x = curvature;
    if ray.t_max > 0.0 {
        widen_reflected(index, density, alpha, curvature);
    }
}
