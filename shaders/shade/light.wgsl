// Light: the background, and what is added to pixels.

const PI: f32 = 3.14159265;

fn sky(d: vec3<f32>) -> vec3<f32> {
    let up = normalize(d).y;
    let grey = vec3<f32>(dot(params.sky_color.rgb, vec3<f32>(0.2126, 0.7152, 0.0722)));
    let horizon = mix(params.sky_color.rgb, grey, 0.65) * 1.3;
    if up < 0.0 {
        return mix(horizon, params.ground_color.rgb, clamp(-up * 8.0, 0.0, 1.0));
    }
    return mix(horizon, params.sky_color.rgb, sqrt(up));
}

// What rays see that meet nothing.
fn background(d: vec3<f32>) -> vec3<f32> {
    if params.environment_width != 0u {
        return environment_at(d);
    }
    return sky(d);
}

// What a white surface reflects of the background, by its normal: of an environment by its spherical harmonics up to
// order 2 (Ramamoorthi, Hanrahan 2001); else of a sky over a ground, each of one radiance: a cosine-weighted hemisphere
// sees the share of both.
fn ambient(normal: vec3<f32>) -> vec3<f32> {
    if params.environment_width != 0u {
        let n = normal;
        var sum = params.ambient[0].rgb;
        sum += params.ambient[1].rgb * n.y;
        sum += params.ambient[2].rgb * n.z;
        sum += params.ambient[3].rgb * n.x;
        sum += params.ambient[4].rgb * (n.x * n.y);
        sum += params.ambient[5].rgb * (n.y * n.z);
        sum += params.ambient[6].rgb * (3.0 * n.z * n.z - 1.0);
        sum += params.ambient[7].rgb * (n.x * n.z);
        sum += params.ambient[8].rgb * (n.x * n.x - n.y * n.y);
        return max(sum, vec3<f32>(0.0));
    }
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
    radiance[own_pixel(index)] += vec4<f32>(color, 0.0);
}
