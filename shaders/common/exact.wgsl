// Deterministic f32 arithmetic, equal bit for bit in every pipeline and to its twin src/math/exact.rs.
//
// Every product that feeds a sum passes `barrier`, so that no compiler fuses it. Division and square root are exact
// integer corrections of the built-in ones, because WGSL lets those be off by some ulps; a difference of products is
// rounded once.
//
// Pure functions, no bindings. The including kernel defines `fn zero_bits() -> u32`, which returns a uniform that holds
// 0. Ranges: the dominant component of a direction lies in 2^-40..2^40; coordinates are 0 or 2^-60..2^31 in magnitude.
// Within them no result depends on whether the device flushes denormals.

const SIGN: u32 = 0x80000000u;
const LEAST_NORMAL: u32 = 0x00800000u;      // 2^-126
const GREATEST_FINITE: u32 = 0x7f7fffffu;

// The same value, hidden from the compiler: what is inside is rounded to f32 before it is used.
fn barrier(x: f32) -> f32 {
    return bitcast<f32>(bitcast<u32>(x) | zero_bits());
}

fn barrier3(x: vec3<f32>) -> vec3<f32> {
    return bitcast<vec3<f32>>(bitcast<vec3<u32>>(x) | vec3<u32>(zero_bits()));
}

// f32 of sign, significand in 2^23..=2^24 and biased exponent; outside the normal range `under` or the greatest finite
// value.
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
    // 25 bits of quotient, 8 below the estimate, which is off by at most 4 ulps: the true remainder is in 0..16 n <
    // 2^28, so its low 32 bits are all of it.
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
    // p moves up by at most 15 bits (below 2^63); what q still lacks moves it down, and bits that fall out leave a
    // sticky one: the difference is then above 2^60, so that they only matter for rounding.
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
