// The mirrored ray of every primary hit, about the interpolated normal; where that leads below the surface, none.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "shade/shading.wgsl"
#include "common/exact.wgsl"

// One thread a pixel.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    if global.x >= params.width || global.y >= params.height {
        return;
    }
    let index = global.y * params.width + global.x;
    let surface = seen_surfaces[index];
    var ray = Ray(surface.point, 1.0, vec3<f32>(0.0, 1.0, 0.0), 0.0);
    var carried = 0.0;
    if surface.leaf != NONE {
        ray.direction = normalize(reflect(normalize(seen_rays[index].direction), gbuffer[index].normal));
        if dot(surface.normal, ray.direction) > 0.0 {
            ray.t_min = 0.0;
            ray.t_max = T_INFINITE;
            carried = 1.0 - params.surface_share;
        }
    }
    rays[index] = ray;
    throughput[index] = vec4<f32>(vec3<f32>(carried), 0.0);
    densities[index] = 0.0;
    start_hit(index, ray.t_max, seen_hits[index].id);
}
