// Lambertian shading of the primary hits by the sun, where its shadow ray went free, and by a sky of two colours.
#include "shared/types.wgsl"
#include "shared/bindings.wgsl"
#include "shared/shading.wgsl"

const SHADE_SHADOWS: u32 = 4u;  // bit of params.flags: the pass's hits are shadow rays

fn sky(d: vec3<f32>) -> vec3<f32> {
    let up = normalize(d).y;
    let horizon = mix(params.sky_color.rgb, vec3<f32>(dot(params.sky_color.rgb, vec3<f32>(0.2126, 0.7152, 0.0722))), 0.65) * 1.3;
    if up < 0.0 {
        return mix(horizon, params.ground_color.rgb, clamp(-up * 8.0, 0.0, 1.0));
    }
    return mix(horizon, params.sky_color.rgb, sqrt(up));
}

// One thread a pixel.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    if global.x >= params.width || global.y >= params.height {
        return;
    }
    let index = global.y * params.width + global.x;
    let surface = primary_surfaces[index];
    var color: vec3<f32>;
    if surface.leaf == NONE {
        color = sky(primary_rays[index].direction);
    } else {
        let g = gbuffer[index];
        let lit = !((params.flags & SHADE_SHADOWS) != 0u && (hits[index].id != NONE || rays[index].t_max < rays[index].t_min));
        let cosine = max(dot(g.normal, params.sun.xyz), 0.0);
        let sun = select(vec3<f32>(0.0), params.sun_color.rgb * cosine, lit);
        // Irradiance of a sky over a ground, each of one radiance: a cosine-weighted hemisphere sees the share of both.
        let ambient = mix(params.ground_color.rgb, params.sky_color.rgb, 0.5 + 0.5 * g.normal.y);
        color = g.albedo * (sun + ambient) + g.emission;
    }
    let bits = bitcast<vec3<u32>>(color) & vec3<u32>(0x7f800000u);
    if any(bits == vec3<u32>(0x7f800000u)) {
        atomicAdd(&counters[COUNTER_NON_FINITE], 1u);
        color = vec3<f32>(0.0);
    }
    radiance[index] += vec4<f32>(color, 1.0);
}
