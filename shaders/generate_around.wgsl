// One ray from every primary hit in the pass's direction around the interpolated normal, turned about it at random within limits
// (CHC+RT §5.3); where that leads below the surface, none. Limited rays ask for occlusion; for the others the throughput
// is noted: what the surface reflects, by the share of the direction; in w the direction's number.
#include "shared/types.wgsl"
#include "shared/bindings.wgsl"
#include "shared/shading.wgsl"
#include "shared/exact.wgsl"
#include "shared/random.wgsl"

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
        let angle = params.around.w * random2(index, params.stream, params.seed).x;
        let c = cos(angle);
        let s = sin(angle);
        let x = tangent(g.normal);
        let y = cross(g.normal, x);
        let a = params.around;
        let turned = vec3<f32>(c * a.x - s * a.y, s * a.x + c * a.y, a.z);
        ray.direction = normalize(turned.x * x + turned.y * y + turned.z * g.normal);
        if dot(surface.normal, ray.direction) > 0.0 {
            ray.t_min = 0.0;
            ray.t_max = select(T_INFINITE, params.length, LIMITED);
            carried = surface_share() * params.share * g.albedo;
        }
    }
    rays[index] = ray;
    if !LIMITED {
        throughput[index] = vec4<f32>(carried, f32(params.direction));
    }
    start_hit(index, ray.t_max, seen_hits[index].id);
}
