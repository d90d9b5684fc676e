// Watertight ray-triangle intersection in f32: twin of src/math/exact.rs.
//
// Woop, Benthin, Wald 2013 ("Watertight Ray/Triangle Intersection"), without its f64 fallback: edge values that vanish
// are recomputed in integers.

#include "common/exact.wgsl"

const TINY_EDGE: u32 = 0x0d800000u;         // 2^-100: below it a flushed product might show
const LEAST_SHEAR: f32 = 0x1p-60;
const GREATEST_INVERSE: f32 = 0x1p96;
const CLAMP_ULPS: f32 = 0x1p-19;            // 32 u, u = 2^-24

// What a ray's direction d contributes to the triangle test; the same for every triangle, from this one function.
struct RayFrame {
    kx: u32,            // (kz + 1) % 3
    ky: u32,            // (kz + 2) % 3
    kz: u32,            // axis of the largest component of d, the lowest on ties
    sx: f32,            // d[kx] / d[kz]
    sy: f32,            // d[ky] / d[kz]
    iz: f32,            // 1 / d[kz], correctly rounded
    inv: vec3<f32>,     // 1 / d, correctly rounded; magnitude at most 2^96 (also for 0, of either sign) but on axis kz
}

// (v[kx], v[ky], v[kz]), without indexing by a variable.
fn permuted(v: vec3<f32>, kz: u32) -> vec3<f32> {
    return select(select(v, v.zxy, kz == 1u), v.yzx, kz == 0u);
}

// 1 / x for slab tests: finite, of the sign of x (of the zero, too).
fn slab_inverse(x: f32) -> f32 {
    let bits = bitcast<u32>(x);
    let inverse = bitcast<u32>(divide(1.0, bitcast<f32>(max(bits & ~SIGN, LEAST_NORMAL))));
    return bitcast<f32>((bits & SIGN) | min(inverse, bitcast<u32>(GREATEST_INVERSE)));
}

fn ray_frame(d: vec3<f32>) -> RayFrame {
    let m = abs(d);
    var kz = u32(m.y > m.x);
    kz = select(kz, 2u, m.z > max(m.x, m.y));
    let kx = select(kz + 1u, 0u, kz == 2u);
    let ky = select(kx + 1u, 0u, kx == 2u);
    let s = permuted(d, kz);
    let iz = divide(1.0, s.z);
    // A shear below 2^-60 moves no point by a bit of f64; as 0 it keeps every sheared coordinate out of the denormals.
    let sx = barrier(s.x * iz);
    let sy = barrier(s.y * iz);
    var inv = vec3<f32>(slab_inverse(d.x), slab_inverse(d.y), slab_inverse(d.z));
    inv = select(inv, vec3<f32>(iz), vec3<u32>(0u, 1u, 2u) == vec3<u32>(kz));
    return RayFrame(kx, ky, kz,
                    select(sx, 0.0, abs(sx) < LEAST_SHEAR), select(sy, 0.0, abs(sy) < LEAST_SHEAR), iz, inv);
}

// u, v, w weight a, b, c and are not divided by det = u + v + w; all have the sign of det or are 0. A triangle that is
// counter-clockwise seen from the ray's origin has det * iz > 0.
struct TriangleHit {
    hit: bool,
    t: f32,
    u: f32,
    v: f32,
    w: f32,
    det: f32,
}

fn is_tiny(x: f32) -> bool {
    return (bitcast<u32>(x) & ~SIGN) < TINY_EDGE;
}

// A vertex relative to the ray's origin, sheared along the ray: (x, y) on the plane across axis kz, z along kz.
fn shear(f: RayFrame, v: vec3<f32>) -> vec3<f32> {
    let p = permuted(v, f.kz);
    return vec3<f32>(barrier(p.x - barrier(f.sx * p.z)), barrier(p.y - barrier(f.sy * p.z)), p.z);
}

// Closest-hit candidate of the ray from 0 with frame f with a triangle whose vertices are relative to the ray's origin.
// Closed on its edges, two-sided, t >= t_min >= 0. Accept it when t < best.t, or t == best.t and its id is lower.
fn intersect_triangle(f: RayFrame, a: vec3<f32>, b: vec3<f32>, c: vec3<f32>, t_min: f32) -> TriangleHit {
    let miss = TriangleHit(false, 0.0, 0.0, 0.0, 0.0, 0.0);
    let sa = shear(f, a);
    let sb = shear(f, b);
    let sc = shear(f, c);
    var u = barrier(barrier(sc.x * sb.y) - barrier(sc.y * sb.x));
    var v = barrier(barrier(sa.x * sc.y) - barrier(sa.y * sc.x));
    var w = barrier(barrier(sb.x * sa.y) - barrier(sb.y * sa.x));
    // Rounded products are ordered like the products, so a non-zero difference has the right sign.
    if is_tiny(u) || is_tiny(v) || is_tiny(w) {
        u = diffprod(sc.x, sb.y, sc.y, sb.x);
        v = diffprod(sa.x, sc.y, sa.y, sc.x);
        w = diffprod(sb.x, sa.y, sb.y, sa.x);
    }
    if min(u, min(v, w)) < 0.0 && max(u, max(v, w)) > 0.0 {
        return miss;
    }
    let det = barrier(barrier(u + v) + w);
    if det == 0.0 {
        return miss;
    }
    let sum = barrier(barrier(barrier(u * sa.z) + barrier(v * sb.z)) + barrier(w * sc.z));
    let t = barrier(divide(sum, det) * f.iz);
    if !(t >= t_min) {
        return miss;
    }
    // The slab of the padded triangle: with t inside it, no box that holds the triangle is pruned before t.
    let low = min(a, min(b, c));
    let high = max(a, max(b, c));
    let m = max(abs(low), abs(high));
    let e = barrier(CLAMP_ULPS * max(m.x, max(m.y, m.z)));
    let t0 = barrier3(barrier3(low - e) * f.inv);
    let t1 = barrier3(barrier3(high + e) * f.inv);
    let near = min(t0, t1);
    let far = max(t0, t1);
    let n = max(near.x, max(near.y, near.z));
    let x = min(far.x, min(far.y, far.z));
    if x < t_min {
        return miss;
    }
    // Without the sign of a zero, which max leaves open.
    let clamped = bitcast<u32>(max(min(t, x), max(n, t_min))) & ~SIGN;
    return TriangleHit(true, bitcast<f32>(clamped), u, v, w, det);
}
