// Which rays pass through a triangle: what the alpha of its material decides (glTF 2.0, section 3.9.4). MASK lets pass
// where alpha is below the cutoff; BLEND where a number drawn for ray and triangle is not below alpha, so that the mean
// over draws is what blending shows, and through a body that bends light no ray passes straight. Alpha is a function of
// the point on the triangle alone, so hits depend on no order. Kernels of a scene without such triangles have a
// function in place of this file that says no.
#include "common/random.wgsl"

// Opacity of each material, then texels, 16 to a vector.
@group(0) @binding(7) var<storage, read> opacity: array<vec4<u32>>;

// Of alpha in units of 1 / 255^2: the least difference between two alphas as they are stored.
const ALPHA_ONE: f32 = 65025.0;

// A coordinate of a texel, from 0 to size - 1, in what is repeated.
fn wrapped(x: i32, size: i32, mode: u32) -> i32 {
    if mode == 1u {
        return clamp(x, 0, size - 1);
    }
    if mode == 2u {
        let m = ((x % (2 * size)) + 2 * size) % (2 * size);
        return select(m, 2 * size - 1 - m, m >= size);
    }
    return ((x % size) + size) % size;
}

// A texel, 0 to 255.
fn opacity_texel(m: Opacity, x: i32, y: i32) -> f32 {
    let at = u32(wrapped(y, i32(m.height), m.wrap >> 16u)) * m.width + u32(wrapped(x, i32(m.width), m.wrap & 0xffffu));
    let word = opacity[m.texels + (at >> 4u)][(at >> 2u) & 3u];
    return f32((word >> (8u * (at & 3u))) & 255u);
}

// Texel coordinates along an axis: whole turns are taken off first so that large coordinates keep their fraction; the
// bound keeps integers in range.
fn opacity_coordinate(x: f32, size: u32, mode: u32) -> f32 {
    let turned = select(barrier(x - barrier(2.0 * floor(barrier(0.5 * x)))), x, mode == 1u);
    return barrier(barrier(clamp(turned, -4.0, 4.0) * f32(size)) - 0.5);
}

fn opacity_mix(a: f32, b: f32, t: f32) -> f32 {
    return barrier(a + barrier(t * barrier(b - a)));
}

// Bilinear lookup, 0 to 255.
fn opacity_lookup(m: Opacity, u: f32, v: f32) -> f32 {
    let x = opacity_coordinate(u, m.width, m.wrap & 0xffffu);
    let y = opacity_coordinate(v, m.height, m.wrap >> 16u);
    let i = i32(floor(x));
    let j = i32(floor(y));
    let s = barrier(x - floor(x));
    let t = barrier(y - floor(y));
    let low = opacity_mix(opacity_texel(m, i, j), opacity_texel(m, i + 1, j), s);
    let high = opacity_mix(opacity_texel(m, i, j + 1), opacity_texel(m, i + 1, j + 1), s);
    return opacity_mix(low, high, t);
}

fn weighted_sum(weights: vec3<f32>, a: f32, b: f32, c: f32) -> f32 {
    return barrier(barrier(barrier(weights.x * a) + barrier(weights.y * b)) + barrier(weights.z * c));
}

// A number from 0 to 1, drawn for a ray and a triangle: the same in whatever order they meet.
fn drawn(ray: FramedRay, id: u32) -> f32 {
    var bits = pcg(id ^ pcg(params.stream ^ pcg(params.seed)));
    let o = bitcast<vec3<u32>>(ray.origin);
    let d = bitcast<vec3<u32>>(ray.direction);
    bits = pcg(pcg(pcg(bits ^ o.x) ^ o.y) ^ o.z);
    bits = pcg(pcg(pcg(bits ^ d.x) ^ d.y) ^ d.z);
    return f32(bits >> 8u) * 0x1p-24;
}

// Whether the ray passes through a triangle that it meets at `h`.
fn passes(r: ptr<function, BrickRay>, triangle: u32, id: u32, h: TriangleHit) -> bool {
    if ((*r).flags & BRICK_OPACITY) == 0u {
        return false;
    }
    let b = bricks[leaves[(*r).leaf].brick];
    let number = cache_word((*r).page, 4u * (*r).nodes + b.opacity_of + triangle);
    if number == NONE {
        return false;
    }
    let at = (*r).nodes + (b.opacities >> 2u) + 2u * number;
    let first = cache_vec4((*r).page, at);
    let second = cache_vec4((*r).page, at + 1u);
    let weights = vec3<f32>(divide(h.u, h.det), divide(h.v, h.det), divide(h.w, h.det));
    let p = opacity[2u * second.z];
    let q = opacity[2u * second.z + 1u];
    let m = Opacity(bitcast<f32>(p.x), bitcast<f32>(p.y), p.z, p.w, q.x, q.y, q.z, q.w);
    if (m.blends & 2u) != 0u && (params.flags & PARAM_REFRACT) != 0u {
        return false;
    }
    let alphas = vec3<f32>(vec3<u32>(second.w, second.w >> 8u, second.w >> 16u) & vec3<u32>(255u));
    var alpha = barrier(m.factor * weighted_sum(weights, alphas.x, alphas.y, alphas.z));
    if m.texels == NONE {
        alpha = barrier(255.0 * alpha);
    } else {
        let uv = bitcast<vec4<f32>>(first);
        let last = bitcast<vec2<f32>>(second.xy);
        let u = weighted_sum(weights, uv.x, uv.z, last.x);
        let v = weighted_sum(weights, uv.y, uv.w, last.y);
        alpha = barrier(alpha * opacity_lookup(m, u, v));
    }
    if (m.blends & 1u) != 0u {
        return alpha <= barrier(ALPHA_ONE * drawn((*r).ray, id));
    }
    // Half a unit, so that rounding takes nothing away from an alpha that equals the cutoff.
    return barrier(alpha + 0.5) < barrier(ALPHA_ONE * m.cutoff);
}
