// Watertight, deterministic f32 ray-triangle arithmetic, equal bit for bit in every pipeline and to its twin src/math/exact.rs.
//
// Woop, Benthin, Wald 2013 ("Watertight Ray/Triangle Intersection"), without its f64 fallback: edge values that vanish are
// recomputed in integers, and every product that feeds a sum passes `barrier`, so that no compiler fuses it.
// Division and square root are exact integer corrections of the built-in ones, because WGSL lets those be off by some ulps.
//
// Pure functions, no bindings. The including kernel defines `fn zero_bits() -> u32`, which returns a uniform that holds 0.
// Ranges: the dominant component of a direction lies in 2^-40..2^40; coordinates are 0 or 2^-60..2^31 in magnitude. Within
// them no result depends on whether the device flushes denormals.

const SIGN: u32 = 0x80000000u;
const LEAST_NORMAL: u32 = 0x00800000u;      // 2^-126
const GREATEST_FINITE: u32 = 0x7f7fffffu;
const TINY_EDGE: u32 = 0x0d800000u;         // 2^-100: below it a flushed product might show
const LEAST_SHEAR: f32 = 0x1p-60;
const GREATEST_INVERSE: f32 = 0x1p96;
const LEAST_COORDINATE: f32 = 0x1p-60;
const CLAMP_ULPS: f32 = 0x1p-19;            // 32 u, u = 2^-24
const OFFSET_ULPS: f32 = 0x1p-19;           // K u, K = 32

// The same value, hidden from the compiler: what is inside is rounded to f32 before it is used.
fn barrier(x: f32) -> f32 {
    return bitcast<f32>(bitcast<u32>(x) | zero_bits());
}

fn barrier3(x: vec3<f32>) -> vec3<f32> {
    return bitcast<vec3<f32>>(bitcast<vec3<u32>>(x) | vec3<u32>(zero_bits()));
}

// f32 of sign, significand in 2^23..=2^24 and biased exponent; outside the normal range `under` or the greatest finite value.
fn compose(sign: u32, significand: u32, exponent: i32, under: u32) -> f32 {
    let e = exponent + i32(significand >> 24u);
    let normal = (u32(exponent - 1) << 23u) + significand;
    let magnitude = select(select(normal, GREATEST_FINITE, e > 254), under, e < 1);
    return bitcast<f32>(sign | magnitude);
}

// (quotient, remainder) by n, with `step` moved to the quotient if the remainder allows it.
fn quotient_step(qr: vec2<u32>, n: u32, step: u32) -> vec2<u32> {
    return select(qr, vec2<u32>(qr.x + step, qr.y - n * step), qr.y >= n * step);
}

// (root, remainder), with `step` added to the root if the remainder allows it.
fn root_step(qr: vec2<u32>, step: u32) -> vec2<u32> {
    let square = (2u * qr.x + step) * step;
    return select(qr, vec2<u32>(qr.x + step, qr.y - square), qr.y >= square);
}

// a / b, correctly rounded (ties cannot occur). b != 0; denormals count as 0; too small: 0, too large: greatest finite.
fn divide(a: f32, b: f32) -> f32 {
    let x = bitcast<u32>(a);
    let y = bitcast<u32>(b);
    let sign = (x ^ y) & SIGN;
    let ex = (x >> 23u) & 255u;
    let ey = (y >> 23u) & 255u;
    if ex == 0u {
        return bitcast<f32>(sign);
    }
    if ey == 0u {
        return bitcast<f32>(sign | GREATEST_FINITE);
    }
    var m = (x & 0x7fffffu) | 0x800000u;
    let n = (y & 0x7fffffu) | 0x800000u;
    let low = u32(m < n);
    m = m << low;
    // 25 bits of quotient, 8 below the estimate, which is off by at most 4 ulps: the true remainder is in 0..16 n < 2^28, so
    // its low 32 bits are all of it.
    let estimate = u32(f32(m) / f32(n) * 16777216.0) - 8u;
    var qr = vec2<u32>(estimate, (m << 24u) - estimate * n);
    qr = quotient_step(quotient_step(quotient_step(quotient_step(qr, n, 8u), n, 4u), n, 2u), n, 1u);
    // An odd q is never exact: n would divide m 2^24 with an odd quotient, but m 2^24 / n has at least one factor 2.
    return compose(sign, (qr.x >> 1u) + (qr.x & 1u), i32(ex) - i32(ey) + 127 - i32(low), 0u);
}

// Square root of x >= 0, correctly rounded; denormals count as 0.
fn square_root(x: f32) -> f32 {
    let bits = bitcast<u32>(x);
    let e = i32(bits >> 23u) - 127;
    if e <= -127 {
        return 0.0;
    }
    let odd = u32(e) & 1u;
    let m = (bits & 0x7fffffu) | 0x800000u;
    // root = sqrt(m 2^(25 + odd)), 25 bits; estimated on 1 <= y < 4 and corrected as in `divide`.
    let y = bitcast<f32>((127u + odd) << 23u | (bits & 0x7fffffu));
    let estimate = u32(sqrt(y) * 16777216.0) - 8u;
    var qr = vec2<u32>(estimate, (m << (25u + odd)) - estimate * estimate);
    qr = root_step(root_step(root_step(root_step(qr, 8u), 4u), 2u), 1u);
    return compose(0u, (qr.x >> 1u) + (qr.x & 1u), (e - i32(odd)) / 2 + 127, 0u);
}

// The 48-bit product of two 24-bit integers as (low, high).
fn wide_product(a: u32, b: u32) -> vec2<u32> {
    let a0 = a & 4095u;
    let a1 = a >> 12u;
    let b0 = b & 4095u;
    let b1 = b >> 12u;
    let middle = a1 * b0 + a0 * b1;
    let high = a1 * b1;
    let low = a0 * b0 + (middle << 12u);
    let sum = low + (high << 24u);
    let carry = u32(low < (middle << 12u)) + u32(sum < low);
    return vec2<u32>(sum, (high >> 8u) + (middle >> 20u) + carry);
}

// Significand of a*b as (low, high), zero when a factor is zero or denormal.
fn significand_product(a: u32, b: u32) -> vec2<u32> {
    let zero = (a & 0x7f800000u) == 0u || (b & 0x7f800000u) == 0u;
    let product = wide_product((a & 0x7fffffu) | 0x800000u, (b & 0x7fffffu) | 0x800000u);
    return select(product, vec2<u32>(0u), zero);
}

// a*b - c*d, correctly rounded, in integers. Zero only when the products are equal; too small for f32: the least normal
// number of that sign, so that the sign is always right.
fn diffprod(a: f32, b: f32, c: f32, d: f32) -> f32 {
    let ua = bitcast<u32>(a);
    let ub = bitcast<u32>(b);
    let uc = bitcast<u32>(c);
    let ud = bitcast<u32>(d);
    var p = significand_product(ua, ub);
    var q = significand_product(uc, ud);
    var sign = (ua ^ ub) & SIGN;
    var other = ~(uc ^ ud) & SIGN;
    // The products are p 2^(ep-300) and q 2^(eq-300); a zero product must not decide the scale.
    var ep = select(-1000, i32((ua >> 23u) & 255u) + i32((ub >> 23u) & 255u), (p.x | p.y) != 0u);
    var eq = select(-1000, i32((uc >> 23u) & 255u) + i32((ud >> 23u) & 255u), (q.x | q.y) != 0u);
    if ep < eq {
        let t = p;
        p = q;
        q = t;
        let s = sign;
        sign = other;
        other = s;
        let e = ep;
        ep = eq;
        eq = e;
    }
    // p moves up by at most 15 bits (below 2^63); what q still lacks moves it down, and bits that fall out leave a sticky one:
    // the difference is then above 2^60, so that they only matter for rounding.
    let apart = ep - eq;
    let up = u32(min(apart, 15));
    p = vec2<u32>(p.x << up, (p.y << up) | ((p.x >> 1u) >> (31u - up)));
    q = shift_down_sticky(q, u32(clamp(apart - 15, 0, 63)));
    if sign == other {
        let low = p.x + q.x;
        p = vec2<u32>(low, p.y + q.y + u32(low < q.x));
    } else {
        if p.y < q.y || (p.y == q.y && p.x < q.x) {
            let t = p;
            p = q;
            q = t;
            sign = other;
        }
        p = vec2<u32>(p.x - q.x, p.y - q.y - u32(p.x < q.x));
    }
    if (p.x | p.y) == 0u {
        return 0.0;
    }
    // Leading one to bit 63, round the upper 24 bits to nearest even.
    let zeros = select(countLeadingZeros(p.y), 32u + countLeadingZeros(p.x), p.y == 0u);
    let shift = zeros & 31u;
    var high = select(p.y, p.x, zeros >= 32u);
    var low = select(p.x, 0u, zeros >= 32u);
    high = (high << shift) | ((low >> 1u) >> (31u - shift));
    low = low << shift;
    let significand = high >> 8u;
    let rest = ((high & 255u) << 1u) | u32(low != 0u);
    let round = u32(rest + (significand & 1u) > 256u);
    return compose(sign, significand + round, ep - 300 - i32(up) + 63 - i32(zeros) + 127, LEAST_NORMAL);
}

// x >> n for a (low, high) pair, n < 64; the lowest bit is set when a bit fell out.
fn shift_down_sticky(x: vec2<u32>, n: u32) -> vec2<u32> {
    let s = n & 31u;
    let mask = (1u << s) - 1u;
    if n >= 32u {
        return vec2<u32>((x.y >> s) | u32((x.x | (x.y & mask)) != 0u), 0u);
    }
    return vec2<u32>((x.x >> s) | ((x.y << 1u) << (31u - s)) | u32((x.x & mask) != 0u), x.y >> s);
}

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
    return RayFrame(kx, ky, kz, select(sx, 0.0, abs(sx) < LEAST_SHEAR), select(sy, 0.0, abs(sy) < LEAST_SHEAR), iz, inv);
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

// A point on a triangle from which rays can start, in the frame of the vertices.
struct SurfacePoint {
    p: vec3<f32>,       // on the triangle, inset from its edges by more than the offset's error
    delta: f32,         // distance along n that clears the surface
    n: vec3<f32>,       // unit geometric normal on the side that the ray came from
    down: u32,          // bit k: component k of the origin moves down (n[k] < 0; if n[k] is 0, away from where d points)
    area: f32,          // twice the triangle's area
}

// Length of x, whose squares stay within the normal range.
fn length_of(x: vec3<f32>) -> f32 {
    return square_root(barrier(barrier(barrier(x.x * x.x) + barrier(x.y * x.y)) + barrier(x.z * x.z)));
}

// x / 2^e with the largest component in 1..2, and 2^e; components too small to matter become 0. x != 0.
struct Scaled {
    x: vec3<f32>,
    scale: f32,
}

fn scaled(x: vec3<f32>) -> Scaled {
    let m = abs(x);
    let exponent = clamp(bitcast<u32>(max(m.x, max(m.y, m.z))) >> 23u, 1u, 253u);
    let y = barrier3(x * bitcast<f32>((254u - exponent) << 23u));
    return Scaled(select(y, vec3<f32>(0.0), abs(y) < vec3<f32>(LEAST_SHEAR)), bitcast<f32>(exponent << 23u));
}

fn weighted(weights: vec3<f32>, a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> vec3<f32> {
    return barrier3(barrier3(barrier3(weights.x * a) + barrier3(weights.y * b)) + barrier3(weights.z * c));
}

// a, b, c relative to the frame's reference point (not to the ray), u, v, w, det of the hit, d the ray's direction in that frame.
fn surface_point(a: vec3<f32>, b: vec3<f32>, c: vec3<f32>, u: f32, v: f32, w: f32, det: f32, d: vec3<f32>) -> SurfacePoint {
    let ab = barrier3(b - a);
    let bc = barrier3(c - b);
    let ca = barrier3(a - c);
    let s = scaled(vec3<f32>(
        diffprod(ab.z, ca.y, ab.y, ca.z),
        diffprod(ab.x, ca.z, ab.z, ca.x),
        diffprod(ab.y, ca.x, ab.x, ca.y),
    ));
    let size = length_of(s.x);
    var n = vec3<f32>(divide(s.x.x, size), divide(s.x.y, size), divide(s.x.z, size));
    if size == 0.0 {
        // The vertices, rounded to this frame, lie on a line: any side toward the ray will do.
        let kz = ray_frame(d).kz;
        n = select(vec3<f32>(0.0), vec3<f32>(1.0), vec3<u32>(0u, 1u, 2u) == vec3<u32>(kz));
    }
    let toward = barrier(barrier(barrier(n.x * d.x) + barrier(n.y * d.y)) + barrier(n.z * d.z));
    if toward > 0.0 {
        n = -n;
    }
    let against = select(vec3<u32>(0u), vec3<u32>(1u), d > vec3<f32>(0.0));
    let below = select(select(vec3<u32>(0u), vec3<u32>(1u), n < vec3<f32>(0.0)), against, n == vec3<f32>(0.0));

    var weights = abs(vec3<f32>(divide(u, det), divide(v, det), divide(w, det)));
    let reach = weighted(weights, abs(a), abs(b), abs(c));
    let margin = barrier(4.0 * OFFSET_ULPS * barrier(barrier(reach.x + reach.y) + reach.z));
    let area = barrier(size * s.scale);
    let least = vec3<f32>(
        divide(barrier(margin * length_of(bc)), area),
        divide(barrier(margin * length_of(ca)), area),
        divide(barrier(margin * length_of(ab)), area),
    );
    weights = max(weights, min(least, vec3<f32>(0x1.555554p-2)));
    let total = barrier(barrier(weights.x + weights.y) + weights.z);
    weights = vec3<f32>(divide(weights.x, total), divide(weights.y, total), divide(weights.z, total));

    let near = weighted(weights, abs(a), abs(b), abs(c));
    let m = abs(n);
    let across = barrier(barrier(barrier(m.x * near.x) + barrier(m.y * near.y)) + barrier(m.z * near.z));
    return SurfacePoint(weighted(weights, a, b, c), barrier(OFFSET_ULPS * across), n, below.x | below.y << 1u | below.z << 2u, area);
}

// p + step, at least one ulp from p toward the side of `down`.
fn offset_component(p: f32, step: f32, down: bool) -> f32 {
    let moved = barrier(p + step);
    let bits = bitcast<u32>(p);
    let away = (bits >= SIGN) == down;
    let neighbour = bitcast<f32>(select(bits - 1u, bits + 1u, away));
    let least = select(neighbour, select(LEAST_COORDINATE, -LEAST_COORDINATE, down), abs(p) < LEAST_COORDINATE);
    return select(max(moved, least), min(moved, least), down);
}

// Where rays that leave s start: p + delta n, every component moved by at least one ulp to its side.
fn offset_origin(s: SurfacePoint) -> vec3<f32> {
    let step = barrier3(s.delta * s.n);
    return vec3<f32>(
        offset_component(s.p.x, step.x, (s.down & 1u) != 0u),
        offset_component(s.p.y, step.y, (s.down & 2u) != 0u),
        offset_component(s.p.z, step.z, (s.down & 4u) != 0u),
    );
}
