// Light: the sky, and what is added to pixels.

const PI: f32 = 3.14159265;

fn sky(d: vec3<f32>) -> vec3<f32> {
    let up = normalize(d).y;
    let horizon = mix(params.sky_color.rgb, vec3<f32>(dot(params.sky_color.rgb, vec3<f32>(0.2126, 0.7152, 0.0722))), 0.65) * 1.3;
    if up < 0.0 {
        return mix(horizon, params.ground_color.rgb, clamp(-up * 8.0, 0.0, 1.0));
    }
    return mix(horizon, params.sky_color.rgb, sqrt(up));
}

// What a white surface reflects of a sky over a ground, each of one radiance: a cosine-weighted hemisphere sees the share of both.
fn ambient(normal: vec3<f32>) -> vec3<f32> {
    return mix(params.ground_color.rgb, params.sky_color.rgb, 0.5 + 0.5 * normal.y);
}

// What a white surface with this normal reflects of the sun.
fn sunlight(normal: vec3<f32>) -> vec3<f32> {
    return params.sun_color.rgb * max(dot(normal, params.sun.xyz), 0.0);
}

// Adds what the hits of the shaded set show to their pixel; light that is not finite is counted and left out.
fn add_light(index: u32, light: vec3<f32>) {
    var color = light;
    if (params.flags & PARAM_BOUNCE) != 0u {
        color *= throughput[index].rgb;
    }
    let bits = bitcast<vec3<u32>>(color) & vec3<u32>(0x7f800000u);
    if any(bits == vec3<u32>(0x7f800000u)) {
        atomicAdd(&counters[COUNTER_NON_FINITE], 1u);
        return;
    }
    radiance[index] += vec4<f32>(color, 0.0);
}
