// Random numbers by hashing (pixel, sample, seed): the same on every device and in every run.

const GOLDEN: u32 = 0x9e3779b9u; // the golden section of 2^32

fn pcg(x: u32) -> u32 {
    let state = x * 747796405u + 2891336453u;
    let word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

// Two numbers in [0, 1).
fn random2(pixel: u32, sample: u32, seed: u32) -> vec2<f32> {
    let a = pcg(pixel ^ pcg(sample ^ pcg(seed)));
    let b = pcg(a);
    return vec2<f32>(vec2<u32>(a >> 8u, b >> 8u)) * 5.9604645e-8;
}

// Shirley and Chiu's concentric map of the unit square to the unit disc.
fn disc_point(r: vec2<f32>) -> vec2<f32> {
    let p = 2.0 * r - vec2<f32>(1.0);
    if p.x == 0.0 && p.y == 0.0 {
        return vec2<f32>(0.0);
    }
    if abs(p.x) > abs(p.y) {
        let a = 0.78539816 * p.y / p.x;
        return p.x * vec2<f32>(cos(a), sin(a));
    }
    let a = 1.5707963 - 0.78539816 * p.x / p.y;
    return p.y * vec2<f32>(cos(a), sin(a));
}

// A unit vector orthogonal to the unit vector n.
fn tangent(n: vec3<f32>) -> vec3<f32> {
    let axis = select(vec3<f32>(1.0, 0.0, 0.0), vec3<f32>(0.0, 1.0, 0.0), abs(n.x) > 0.7);
    return normalize(cross(n, axis));
}

// Four words; the first two are those of `random2`.
fn random4(pixel: u32, sample: u32, seed: u32) -> vec4<u32> {
    let a = pcg(pixel ^ pcg(sample ^ pcg(seed)));
    let b = pcg(a);
    let c = pcg(b);
    return vec4<u32>(a, b, c, pcg(c));
}
