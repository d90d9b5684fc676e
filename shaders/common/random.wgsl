// Random numbers by hashing (pixel, sample, seed), and points that the samples of a pixel spread evenly: the same on
// every device and in every run.

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

// Owen's scrambling of a word whose bits are reversed, by a hash (Laine, Karras 2011, with Vegdahl's constants).
fn scrambled(word: u32, hash: u32) -> u32 {
    var x = word;
    x ^= x * 0x3d20adeau;
    x += hash;
    x *= (hash >> 16u) | 1u;
    x ^= x * 0x05526c56u;
    x ^= x * 0x53a22864u;
    return x;
}

// Two words of a pixel's sample, of the first two dimensions of Sobol's sequence, each scrambled and both in an order
// of their own (Burley 2020, "Practical Hash-based Owen Scrambling"): of 2^n samples from a multiple of 2^n on each
// elementary interval of 2^-n has one. The bits of the second dimension are sums over supersets of those of the index.
fn spread2(index: u32, hash: u32) -> vec2<u32> {
    let own = reverseBits(scrambled(reverseBits(index), hash));
    var sums = own;
    sums ^= (sums >> 1u) & 0x55555555u;
    sums ^= (sums >> 2u) & 0x33333333u;
    sums ^= (sums >> 4u) & 0x0f0f0f0fu;
    sums ^= (sums >> 8u) & 0x00ff00ffu;
    sums ^= (sums >> 16u) & 0x0000ffffu;
    let by_first = pcg(hash);
    return vec2<u32>(reverseBits(scrambled(own, by_first)), reverseBits(scrambled(sums, pcg(by_first))));
}

// Four words for what a stream draws at a sample of a pixel: the low 24 bits of the stream are the sample, the others
// tell what is drawn. They are two points that are spread evenly by themselves.
fn points4(pixel: u32, stream: u32, seed: u32) -> vec4<u32> {
    let hash = pcg(pixel ^ pcg((stream >> 24u) ^ pcg(seed)));
    let sample = stream & 0xffffffu;
    return vec4<u32>(spread2(sample, hash), spread2(sample, pcg(hash ^ GOLDEN)));
}

// Two numbers in [0, 1): the first two words of points4.
fn points2(pixel: u32, stream: u32, seed: u32) -> vec2<f32> {
    let hash = pcg(pixel ^ pcg((stream >> 24u) ^ pcg(seed)));
    return vec2<f32>(spread2(stream & 0xffffffu, hash) >> vec2<u32>(8u)) * 5.9604645e-8;
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
