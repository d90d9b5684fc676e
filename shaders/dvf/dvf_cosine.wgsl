// A ray from every primary hit in the pass's direction about the interpolated normal, turned about it by blue noise
// over the pixels (Günay, Akyüz, section 2.1.2): all directions of a pixel by the same angle, so that they stay as
// evenly spread as they are made, and neighbours by the most different ones. The tile lies elsewhere for every seed.
// Where that leads below the surface, none. Every operation but the last is rounded by itself.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "shade/shading.wgsl"
#include "common/exact.wgsl"
#include "common/random.wgsl"
#include "dvf/dvf.wgsl"

// By which the rays of a pixel are turned: a point of the unit circle.
fn turn_of(pixel: vec2<u32>) -> vec2<f32> {
    let moved = pcg(params.seed);
    let at = (pixel + vec2<u32>(moved, moved >> 8u)) % DVF_TILE_SIDE;
    let place = at.y * DVF_TILE_SIDE + at.x;
    let number = u32(dvf_directions[dvf.rays + DVF_CIRCLE_POINTS + place / 4u][place % 4u]);
    return dvf_directions[dvf.rays + number].xy;
}

// One thread a pixel.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    if global.x >= params.width || global.y >= params.height {
        return;
    }
    let index = global.y * params.width + global.x;
    let surface = seen_surfaces[index];
    var ray = Ray(surface.point, 1.0, vec3<f32>(0.0, 1.0, 0.0), 0.0);
    if surface.leaf != NONE {
        ray.direction = dvf_around(turn_of(global.xy), own.around.xyz, gbuffer[index].normal);
        if dot(surface.normal, ray.direction) > 0.0 {
            ray.t_min = 0.0;
            ray.t_max = T_INFINITE;
        }
    }
    rays[index] = ray;
    start_hit(index, ray.t_max, seen_hits[index].id);
}
