//! Twin of `shaders/common/exact.wgsl`, `triangle.wgsl` and `surface.wgsl`: watertight, deterministic f32 ray-triangle
//! arithmetic.
//!
//! Woop, Benthin, Wald 2013 ("Watertight Ray/Triangle Intersection", JCGT 2). Their f64 fallback is replaced by
//! [`diffprod`] in integers, because WGSL has no f64, and the kernel rounds every product before it is added
//! ([`barrier`]), because WGSL allows contraction. Edge values then have their exact signs, so that of two triangles
//! that share an edge at least one is hit by a ray through it.
//!
//! Names and the order of operations are those of the kernel; the results are equal bit for bit while the dominant
//! component of a direction lies in 2^-40..2^40 and coordinates are 0 or 2^-60..2^31 in magnitude. Vectors are `[x, y,
//! z]`.

const SIGN: u32 = 0x8000_0000;
const LEAST_NORMAL: u32 = 0x0080_0000;
const GREATEST_FINITE: u32 = 0x7f7f_ffff;
/// 2^-100: below it a flushed product might show.
const TINY_EDGE: u32 = 0x0d80_0000;
/// The same as a number.
pub const TINY: f32 = f32::from_bits(TINY_EDGE);
/// 2^-60.
pub const LEAST_SHEAR: f32 = f32::from_bits((127 - 60) << 23);
/// 2^96.
pub const GREATEST_INVERSE: f32 = f32::from_bits((127 + 96) << 23);
/// 2^-60.
pub const LEAST_COORDINATE: f32 = LEAST_SHEAR;
/// 32 u with u = 2^-24.
pub const CLAMP_ULPS: f32 = 1.0 / 524_288.0;
/// The greatest number below 1 / 3.
pub const THIRD: f32 = f32::from_bits(0x3eaa_aaaa);
/// K u with K = 32.
pub const OFFSET_ULPS: f32 = 1.0 / 524_288.0;

/// The same value. On the device it hides a rounded value from the compiler; Rust never contracts or reassociates.
#[inline(always)]
pub fn barrier(x: f32) -> f32 {
    x
}

/// The greater one, as one machine instruction; of numbers, never of NaN.
#[inline(always)]
pub fn most(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The lesser one, as one machine instruction; of numbers, never of NaN.
#[inline(always)]
pub fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// f32 of sign, significand in 2^23..=2^24 and biased exponent; beyond the normal range `under` or the greatest finite
/// value.
fn compose(sign: u32, significand: u32, exponent: i32, under: u32) -> f32 {
    let e = exponent + (significand >> 24) as i32;
    let magnitude = if e < 1 {
        under
    } else if e > 254 {
        GREATEST_FINITE
    } else {
        ((exponent - 1) as u32).wrapping_shl(23).wrapping_add(significand)
    };
    f32::from_bits(sign | magnitude)
}

/// (quotient, remainder) by n, with `step` moved to the quotient if the remainder allows it.
fn quotient_step((q, r): (u32, u32), n: u32, step: u32) -> (u32, u32) {
    if r >= n * step { (q + step, r - n * step) } else { (q, r) }
}

/// (root, remainder), with `step` added to the root if the remainder allows it.
fn root_step((q, r): (u32, u32), step: u32) -> (u32, u32) {
    let square = (2 * q + step) * step;
    if r >= square { (q + step, r - square) } else { (q, r) }
}

/// a / b, correctly rounded. b must not be 0; denormals count as 0; a quotient too small becomes 0, one too large the
/// greatest finite value.
#[inline]
pub fn divide(a: f32, b: f32) -> f32 {
    // Inside the range of normal numbers Rust's division is correctly rounded, too.
    let quotient = a / b;
    let is_plain = is_inside(b) && (a == 0.0 || (is_inside(a) && is_inside(quotient)));
    if is_plain { quotient } else { divide_by_integers(a, b) }
}

/// Whether x is far enough from the ends of the normal range that rounding beyond them has no part in it.
#[inline(always)]
pub fn is_inside(x: f32) -> bool {
    (2..=253).contains(&((x.to_bits() >> 23) & 255))
}

/// [`divide`] as the kernel carries it out.
fn divide_by_integers(a: f32, b: f32) -> f32 {
    let (x, y) = (a.to_bits(), b.to_bits());
    let sign = (x ^ y) & SIGN;
    let (ex, ey) = ((x >> 23) & 255, (y >> 23) & 255);
    if ex == 0 {
        return f32::from_bits(sign);
    }
    if ey == 0 {
        return f32::from_bits(sign | GREATEST_FINITE);
    }
    let m = (x & 0x007f_ffff) | 0x0080_0000;
    let n = (y & 0x007f_ffff) | 0x0080_0000;
    let low = u32::from(m < n);
    let m = m << low;
    // 25 bits of quotient, 8 below the estimate: the true remainder is in 0..16 n < 2^28, so its low 32 bits are all of
    // it.
    let estimate = (m as f32 / n as f32 * 16_777_216.0) as u32 - 8;
    let qr = (estimate, (m << 24).wrapping_sub(estimate.wrapping_mul(n)));
    let (q, _) = quotient_step(quotient_step(quotient_step(quotient_step(qr, n, 8), n, 4), n, 2), n, 1);
    // An odd q is never exact: n would divide m 2^24 with an odd quotient, but m 2^24 / n has at least one factor 2.
    compose(sign, (q >> 1) + (q & 1), ex as i32 - ey as i32 + 127 - low as i32, 0)
}

/// Square root of x >= 0, correctly rounded; denormals count as 0.
#[inline]
pub fn square_root(x: f32) -> f32 {
    // Rust's root is correctly rounded, too.
    if is_inside(x) { x.sqrt() } else { square_root_by_integers(x) }
}

/// [`square_root`] as the kernel carries it out.
fn square_root_by_integers(x: f32) -> f32 {
    let bits = x.to_bits();
    let e = (bits >> 23) as i32 - 127;
    if e <= -127 {
        return 0.0;
    }
    let odd = e as u32 & 1;
    let m = (bits & 0x007f_ffff) | 0x0080_0000;
    // root = sqrt(m 2^(25 + odd)), 25 bits; estimated on 1 <= y < 4 and corrected as in `divide`.
    let y = f32::from_bits((127 + odd) << 23 | (bits & 0x007f_ffff));
    let estimate = (y.sqrt() * 16_777_216.0) as u32 - 8;
    let qr = (estimate, (m << (25 + odd)).wrapping_sub(estimate.wrapping_mul(estimate)));
    let (q, _) = root_step(root_step(root_step(root_step(qr, 8), 4), 2), 1);
    compose(0, (q >> 1) + (q & 1), (e - odd as i32) / 2 + 127, 0)
}

/// The 48-bit significand of a*b, 0 when a factor is zero or denormal.
fn significand_product(a: u32, b: u32) -> u64 {
    if a & 0x7f80_0000 == 0 || b & 0x7f80_0000 == 0 {
        return 0;
    }
    u64::from((a & 0x007f_ffff) | 0x0080_0000) * u64::from((b & 0x007f_ffff) | 0x0080_0000)
}

/// x >> n for n < 64; the lowest bit is set when a bit fell out.
fn shift_down_sticky(x: u64, n: u32) -> u64 {
    (x >> n) | u64::from(x & ((1 << n) - 1) != 0)
}

/// a*b - c*d, correctly rounded, in integers. Zero only when the products are equal; a difference too small for f32
/// becomes the least normal number of its sign, so that the sign is always right; one too large the greatest finite
/// value. A denormal factor counts as 0.
#[inline]
pub fn diffprod(a: f32, b: f32, c: f32, d: f32) -> f32 {
    // In f64 the products are exact. Their difference is rounded to odd (Boldo, Melquiond 2008), so that rounding it
    // once more gives what rounding it once would.
    let (p, q) = (f64::from(a) * f64::from(b), f64::from(c) * f64::from(d));
    let sum = p - q;
    let back = sum - p;
    let error = (p - (sum - back)) - (q + back);
    let odd = if error == 0.0 || sum.to_bits() & 1 == 1 {
        sum
    } else if error > 0.0 {
        sum.next_up()
    } else {
        sum.next_down()
    };
    let difference = odd as f32;
    let is_plain = |x: f32| x == 0.0 || is_inside(x);
    if is_plain(a) && is_plain(b) && is_plain(c) && is_plain(d) {
        if is_inside(difference) {
            return difference;
        } else if sum == 0.0 {
            return 0.0;
        }
    }
    diffprod_by_integers(a, b, c, d)
}

/// [`diffprod`] as the kernel carries it out.
fn diffprod_by_integers(a: f32, b: f32, c: f32, d: f32) -> f32 {
    let (ua, ub, uc, ud) = (a.to_bits(), b.to_bits(), c.to_bits(), d.to_bits());
    let mut p = significand_product(ua, ub);
    let mut q = significand_product(uc, ud);
    let mut sign = (ua ^ ub) & SIGN;
    let mut other = !(uc ^ ud) & SIGN;
    // The products are p 2^(ep-300) and q 2^(eq-300); a zero product must not decide the scale.
    let exponents = |m: u64, x: u32, y: u32| {
        if m == 0 { -1000 } else { ((x >> 23) & 255) as i32 + ((y >> 23) & 255) as i32 }
    };
    let mut ep = exponents(p, ua, ub);
    let mut eq = exponents(q, uc, ud);
    if ep < eq {
        std::mem::swap(&mut p, &mut q);
        std::mem::swap(&mut sign, &mut other);
        std::mem::swap(&mut ep, &mut eq);
    }
    // p moves up by at most 15 bits (below 2^63); what q still lacks moves it down, and bits that fall out leave a
    // sticky one: the difference is then above 2^60, so that they only matter for rounding.
    let apart = ep - eq;
    let up = apart.min(15) as u32;
    p <<= up;
    q = shift_down_sticky(q, (apart - 15).clamp(0, 63) as u32);
    if sign == other {
        p += q;
    } else {
        if p < q {
            std::mem::swap(&mut p, &mut q);
            sign = other;
        }
        p -= q;
    }
    if p == 0 {
        return 0.0;
    }
    // Leading one to bit 63, round the upper 24 bits to nearest even.
    let zeros = p.leading_zeros();
    let p = p << zeros;
    let significand = (p >> 40) as u32;
    let rest = ((p >> 31) as u32 & 0x1fe) | u32::from(p as u32 != 0);
    let round = u32::from(rest + (significand & 1) > 256);
    compose(sign, significand + round, ep - 300 - up as i32 + 63 - zeros as i32 + 127, LEAST_NORMAL)
}

/// What a ray's direction d contributes to the triangle test; the same for every triangle, from [`ray_frame`] alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayFrame {
    /// (kz + 1) % 3.
    pub kx: u32,
    /// (kz + 2) % 3.
    pub ky: u32,
    /// Axis of the largest component of d, the lowest on ties.
    pub kz: u32,
    /// `d[kx] / d[kz]`.
    pub sx: f32,
    /// `d[ky] / d[kz]`.
    pub sy: f32,
    /// `1 / d[kz]`, correctly rounded.
    pub iz: f32,
    /// 1 / d, correctly rounded; magnitude at most 2^96 (also for 0, of either sign) but on axis kz.
    pub inv: [f32; 3],
}

/// 1 / x for slab tests: finite, of the sign of x (of the zero, too).
fn slab_inverse(x: f32) -> f32 {
    let bits = x.to_bits();
    let inverse = divide(1.0, f32::from_bits((bits & !SIGN).max(LEAST_NORMAL))).to_bits();
    f32::from_bits((bits & SIGN) | inverse.min(GREATEST_INVERSE.to_bits()))
}

/// The frame of a ray of direction `d`, which need not be normalised; its dominant component is in 2^-40..2^40.
pub fn ray_frame(d: [f32; 3]) -> RayFrame {
    let m = d.map(f32::abs);
    let mut kz = usize::from(m[1] > m[0]);
    if m[2] > m[0].max(m[1]) {
        kz = 2;
    }
    let (kx, ky) = ((kz + 1) % 3, (kz + 2) % 3);
    let iz = divide(1.0, d[kz]);
    // A shear below 2^-60 moves no point by a bit of f64; as 0 it keeps every sheared coordinate out of the denormals.
    let shear = |x: f32| {
        let s = barrier(x * iz);
        if s.abs() < LEAST_SHEAR { 0.0 } else { s }
    };
    let mut inv = d.map(slab_inverse);
    inv[kz] = iz;
    RayFrame { kx: kx as u32, ky: ky as u32, kz: kz as u32, sx: shear(d[kx]), sy: shear(d[ky]), iz, inv }
}

/// A candidate hit. u, v, w weight the vertices a, b, c and are not divided by det = u + v + w; all have the sign of
/// det or are 0. A triangle that is counter-clockwise seen from the ray's origin has `det * iz > 0`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TriangleHit {
    /// Whether the triangle is met; if not, all else is 0.
    pub hit: bool,
    /// Ray parameter in units of the direction's length.
    pub t: f32,
    /// Edge value of vertex a.
    pub u: f32,
    /// Edge value of vertex b.
    pub v: f32,
    /// Edge value of vertex c.
    pub w: f32,
    /// Sum of the edge values.
    pub det: f32,
}

#[inline(always)]
fn is_tiny(x: f32) -> bool {
    x.to_bits() & !SIGN < TINY_EDGE
}

/// A vertex relative to the ray's origin, sheared along the ray: (x, y) on the plane across axis kz, z along kz.
#[inline(always)]
pub fn shear(f: &RayFrame, v: [f32; 3]) -> [f32; 3] {
    let p = [v[f.kx as usize], v[f.ky as usize], v[f.kz as usize]];
    [barrier(p[0] - barrier(f.sx * p[2])), barrier(p[1] - barrier(f.sy * p[2])), p[2]]
}

/// Closest-hit candidate of the ray (0, d), f = ray_frame(d), with a triangle whose vertices are relative to the ray's
/// origin. Closed on its edges, two-sided, t >= t_min >= 0. Accept it when t < best.t, or t == best.t and its id is
/// lower.
#[inline(always)]
pub fn intersect_triangle(f: &RayFrame, a: [f32; 3], b: [f32; 3], c: [f32; 3], t_min: f32) -> TriangleHit {
    let miss = TriangleHit::default();
    let (sa, sb, sc) = (shear(f, a), shear(f, b), shear(f, c));
    let mut u = barrier(barrier(sc[0] * sb[1]) - barrier(sc[1] * sb[0]));
    let mut v = barrier(barrier(sa[0] * sc[1]) - barrier(sa[1] * sc[0]));
    let mut w = barrier(barrier(sb[0] * sa[1]) - barrier(sb[1] * sa[0]));
    // Rounded products are ordered like the products, so a non-zero difference has the right sign.
    if is_tiny(u) || is_tiny(v) || is_tiny(w) {
        u = diffprod(sc[0], sb[1], sc[1], sb[0]);
        v = diffprod(sa[0], sc[1], sa[1], sc[0]);
        w = diffprod(sb[0], sa[1], sb[1], sa[0]);
    }
    if least(u, least(v, w)) < 0.0 && most(u, most(v, w)) > 0.0 {
        return miss;
    }
    let det = barrier(barrier(u + v) + w);
    if det == 0.0 {
        return miss;
    }
    let sum = barrier(barrier(barrier(u * sa[2]) + barrier(v * sb[2])) + barrier(w * sc[2]));
    let t = barrier(divide(sum, det) * f.iz);
    if t.is_nan() || t < t_min {
        return miss;
    }
    // The slab of the padded triangle: with t inside it, no box that holds the triangle is pruned before t.
    let low = zip(a, zip(b, c, least), least);
    let high = zip(a, zip(b, c, most), most);
    let m = greatest(zip(low, high, |l, h| most(l.abs(), h.abs())));
    let e = barrier(CLAMP_ULPS * m);
    let t0 = zip(low, f.inv, |l, i| barrier(barrier(l - e) * i));
    let t1 = zip(high, f.inv, |h, i| barrier(barrier(h + e) * i));
    let n = greatest(zip(t0, t1, least));
    let far = zip(t0, t1, most);
    let x = least(far[0], least(far[1], far[2]));
    if x < t_min {
        return miss;
    }
    // Without the sign of a zero, which max leaves open.
    let clamped = most(least(t, x), most(n, t_min)).to_bits() & !SIGN;
    TriangleHit { hit: true, t: f32::from_bits(clamped), u, v, w, det }
}

#[inline(always)]
fn zip(a: [f32; 3], b: [f32; 3], f: impl Fn(f32, f32) -> f32) -> [f32; 3] {
    [f(a[0], b[0]), f(a[1], b[1]), f(a[2], b[2])]
}

#[inline(always)]
fn greatest(x: [f32; 3]) -> f32 {
    most(x[0], most(x[1], x[2]))
}

/// A point on a triangle from which rays can start, in the frame of the vertices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// On the triangle, inset from its edges by more than the offset's error.
    pub p: [f32; 3],
    /// Distance along n that clears the surface.
    pub delta: f32,
    /// Unit geometric normal on the side that the ray came from.
    pub n: [f32; 3],
    /// Bit k: component k of the origin moves down (`n[k] < 0`; if it is 0, away from where the ray points).
    pub down: u32,
    /// Twice the triangle's area.
    pub area: f32,
}

/// ((x0 y0 + x1 y1) + x2 y2).
fn dot(x: [f32; 3], y: [f32; 3]) -> f32 {
    barrier(barrier(barrier(x[0] * y[0]) + barrier(x[1] * y[1])) + barrier(x[2] * y[2]))
}

/// Length of x, whose squares stay within the normal range.
pub fn length_of(x: [f32; 3]) -> f32 {
    square_root(dot(x, x))
}

/// (x / 2^e with the largest component in 1..2, 2^e); components too small to matter become 0.
pub fn scaled(x: [f32; 3]) -> ([f32; 3], f32) {
    let exponent = (greatest(x.map(f32::abs)).to_bits() >> 23).clamp(1, 253);
    let scale = f32::from_bits((254 - exponent) << 23);
    let y = x.map(|v| {
        let y = barrier(v * scale);
        if y.abs() < LEAST_SHEAR { 0.0 } else { y }
    });
    (y, f32::from_bits(exponent << 23))
}

fn weighted(weights: [f32; 3], a: [f32; 3], b: [f32; 3], c: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|k| dot(weights, [a[k], b[k], c[k]]))
}

/// Where on the triangle a hit lies. `a`, `b`, `c` are relative to the frame's reference point (not to the ray), `hit`
/// is that of [`intersect_triangle`], `d` the ray's direction in the frame. The barycentrics are inset so that the
/// point stays inside by more than its error, and `delta` is 32 u times the terms of the plane equation at the point.
pub fn surface_point(a: [f32; 3], b: [f32; 3], c: [f32; 3], hit: &TriangleHit, d: [f32; 3]) -> SurfacePoint {
    let minus = |x: f32, y: f32| barrier(x - y);
    let (ab, bc, ca) = (zip(b, a, minus), zip(c, b, minus), zip(a, c, minus));
    let (s, scale) = scaled([
        diffprod(ab[2], ca[1], ab[1], ca[2]),
        diffprod(ab[0], ca[2], ab[2], ca[0]),
        diffprod(ab[1], ca[0], ab[0], ca[1]),
    ]);
    let size = length_of(s);
    let mut n = s.map(|x| divide(x, size));
    if size == 0.0 {
        // The vertices, rounded to this frame, lie on a line: any side toward the ray will do.
        n = [0.0; 3];
        n[ray_frame(d).kz as usize] = 1.0;
    }
    if dot(n, d) > 0.0 {
        n = n.map(|x| -x);
    }
    let down = (0..3).map(|k| u32::from(n[k] < 0.0 || (n[k] == 0.0 && d[k] > 0.0)) << k).sum();

    let mut weights = [hit.u, hit.v, hit.w].map(|x| divide(x, hit.det).abs());
    let magnitude = |x: [f32; 3]| x.map(f32::abs);
    let reach = weighted(weights, magnitude(a), magnitude(b), magnitude(c));
    let margin = barrier(4.0 * OFFSET_ULPS * barrier(barrier(reach[0] + reach[1]) + reach[2]));
    let area = barrier(size * scale);
    let least = [bc, ca, ab].map(|edge| divide(barrier(margin * length_of(edge)), area));
    weights = zip(weights, least, |x, l| x.max(l.min(THIRD)));
    let total = barrier(barrier(weights[0] + weights[1]) + weights[2]);
    weights = weights.map(|x| divide(x, total));

    let near = weighted(weights, magnitude(a), magnitude(b), magnitude(c));
    SurfacePoint { p: weighted(weights, a, b, c), delta: barrier(OFFSET_ULPS * dot(magnitude(n), near)), n, down, area }
}

/// p + step, at least one ulp from p toward the side of `down`.
fn offset_component(p: f32, step: f32, down: bool) -> f32 {
    let moved = barrier(p + step);
    let bits = p.to_bits();
    let least = if p.abs() < LEAST_COORDINATE {
        if down { -LEAST_COORDINATE } else { LEAST_COORDINATE }
    } else if (bits >= SIGN) == down {
        f32::from_bits(bits + 1)
    } else {
        f32::from_bits(bits - 1)
    };
    if down { moved.min(least) } else { moved.max(least) }
}

/// Where rays that leave s start: p + delta n, every component moved by at least one ulp to its side. An instance adds
/// the error of its transformation to `delta` first.
pub fn offset_origin(s: &SurfacePoint) -> [f32; 3] {
    [0, 1, 2].map(|k| offset_component(s.p[k], barrier(s.delta * s.n[k]), s.down >> k & 1 != 0))
}

#[cfg(test)]
mod tests;
