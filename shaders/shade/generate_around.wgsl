// One ray from every hit of the shaded set in the pass's direction around the interpolated normal, turned about it at
// random within limits (CHC+RT §5.3), or, scattered, moved over the whole hemisphere by a random step in the two
// numbers that it comes from (Cranley and Patterson 1976: the turn, and the square of the sine); where that leads below
// the surface, none. Limited rays ask for occlusion, or for an even environment. For the others the throughput is
// noted: what of light from around the surface reflects, by the share of the direction; in w the density of the
// direction.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "shade/shading.wgsl"
#include "common/exact.wgsl"
#include "common/random.wgsl"
#include "shade/lamps.wgsl"
#include "shade/light.wgsl"
#include "shade/gloss.wgsl"

// By which the direction is moved; rays from hits of bounces have some of their own in every direction that their paths
// begin with.
fn moved_by(index: u32) -> vec2<f32> {
    var pixel = pixel_of(index);
    if (params.flags & PARAM_BOUNCE) != 0u {
        pixel ^= pcg(origins[index].direction + 1u);
    }
    return points2(pixel, params.stream, params.seed);
}

override LIMITED: bool = false;

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
    if surface.leaf != NONE {
        let g = gbuffer[index];
        let r = moved_by(index);
        let angle = params.around.w * r.x;
        let c = cos(angle);
        let s = sin(angle);
        let x = tangent(g.normal);
        let y = cross(g.normal, x);
        var a = params.around.xyz;
        if (params.flags & PARAM_SCATTER) != 0u {
            // The same bits everywhere: near 1 the height of the direction is sensitive to them.
            let squared = barrier(barrier(a.x * a.x) + barrier(a.y * a.y));
            let moved = fract(barrier(squared + r.y));
            let scale = sqrt(moved / max(squared, 1e-6));
            a = vec3<f32>(scale * a.x, scale * a.y, sqrt(1.0 - moved));
        }
        let turned = vec3<f32>(c * a.x - s * a.y, s * a.x + c * a.y, a.z);
        ray.direction = normalize(turned.x * x + turned.y * y + turned.z * g.normal);
        if dot(surface.normal, ray.direction) > 0.0 {
            ray.t_min = 0.0;
            ray.t_max = select(T_INFINITE, params.length, LIMITED);
            if !LIMITED {
                carried = params.share * reflected_by_diffuse_rays(gloss_of(g, index, -seen_rays[index].direction));
            }
        }
    }
    rays[index] = ray;
    if !LIMITED {
        let density = params.diffuse_count * max(dot(gbuffer[index].normal, ray.direction), 0.0) / PI;
        throughput[index] = vec4<f32>(carried, density);
        origins[index] = Origin(index, params.direction);
    }
    start_hit(index, ray.t_max, seen_hits[index].id);
}
