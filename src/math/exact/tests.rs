//! Arithmetic against oracles, the triangle test against exact edge functions, and planted defects that must show.

use crate::math::exact::*;
use crate::math::random::Rng;

impl Rng {
    /// An integer in `-n..=n`.
    fn about(&mut self, n: i64) -> i64 {
        self.below(2 * n as u64 + 1) as i64 - n
    }

    /// A number in [0, 1) with 24 bits.
    fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / 16_777_216.0
    }
}

/// Compares two results, counting any difference of bits.
fn differ(a: f32, b: f32) -> bool {
    a.to_bits() != b.to_bits()
}

#[test]
fn divide_is_correctly_rounded() {
    let mut rng = Rng(1);
    let edge = [0x80_0000u32, 0x80_0001, 0xff_ffff, 0xff_fffe, 0xc0_0000, 0xaa_aaaa, 0xaa_aaab, 0xd5_5555];
    let mut wrong = 0;
    let mut approximation_wrong = 0;
    let mut check = |a: f32, b: f32| {
        wrong += u32::from(differ(divide(a, b), a / b));
        wrong += u32::from(differ(divide_by_integers(a, b), a / b));
        // Negative control: what a kernel gets from a reciprocal.
        approximation_wrong += u32::from(differ(a * (1.0 / b), a / b));
    };
    for m in edge {
        for n in edge {
            check(m as f32, n as f32);
            check(m as f32, -(n as f32) * 2.0);
        }
    }
    for _ in 0..3_000_000 {
        let (a, b) = (rng.float(-60, 60), rng.float(-60, 60));
        check(a, b);
    }
    // Hardest to round: quotients near the middle of two floats, from the convergents of (2q + 1) / 2^25.
    for _ in 0..300_000 {
        let n = 0x80_0000 + rng.below(0x80_0000);
        let q = 0x80_0000 + rng.below(0x80_0000);
        let m = ((2 * q + 1) * n) >> 24;
        for m in m.saturating_sub(1)..=m + 1 {
            if m < 1 << 24 {
                check(m as f32, n as f32);
            }
        }
    }
    assert_eq!(wrong, 0);
    assert!(approximation_wrong > 100_000, "the control must show: {approximation_wrong}");
}

/// The processor's own operations give what the kernel's do, also where results leave the normal range.
#[test]
fn shortcuts_give_what_the_kernel_gives() {
    let mut rng = Rng(9);
    let (mut beyond, mut ordinary_differs, mut fused_differs) = (0, 0, 0);
    for _ in 0..2_000_000 {
        let (a, b) = (rng.float(-127, 127), rng.float(-127, 127));
        if b != 0.0 {
            assert_eq!(divide(a, b).to_bits(), divide_by_integers(a, b).to_bits(), "{a:e} {b:e}");
            beyond += u32::from(!(a / b).is_normal());
            ordinary_differs += u32::from(differ(a / b, divide_by_integers(a, b)));
        }
        assert_eq!(square_root(a.abs()).to_bits(), square_root_by_integers(a.abs()).to_bits(), "{a:e}");
        // Products that are near each other, too.
        let (c, d) = if a.to_bits() & 1 == 0 { (rng.float(-90, 90), rng.float(-90, 90)) } else { (a.next_up(), b) };
        let exact = diffprod_by_integers(a, b, c, d);
        assert_eq!(diffprod(a, b, c, d).to_bits(), exact.to_bits(), "{a:e} {b:e} {c:e} {d:e}");
        // Zeros of either sign among the factors, as axis-aligned edges have them.
        let zero = |x: f32, bit: u32| if d.to_bits() >> bit & 1 == 0 { x } else { 0.0f32.copysign(x) };
        let (x, y, z, w) = (zero(a, 1), zero(b, 2), zero(c, 3), zero(d, 4));
        let exactly = diffprod_by_integers(x, y, z, w);
        assert_eq!(diffprod(x, y, z, w).to_bits(), exactly.to_bits(), "{x:e} {y:e} {z:e} {w:e}");
        if b != 0.0 {
            assert_eq!(divide(x, b).to_bits(), divide_by_integers(x, b).to_bits(), "{x:e} {b:e}");
        }
        fused_differs += u32::from(differ(a.mul_add(b, -(c * d)), exact));
    }
    assert!(beyond > 100_000, "{beyond}");
    // Control: division alone would not do, nor one fused product.
    assert!(ordinary_differs > 10_000 && fused_differs > 10_000, "{ordinary_differs} {fused_differs}");
}

#[test]
fn divide_at_the_ends_of_the_range() {
    assert_eq!(divide(0.0, -3.0).to_bits(), SIGN);
    assert_eq!(divide(1e-40, 1.0).to_bits(), 0);
    assert_eq!(divide(1e38, 1e-30), f32::MAX);
    assert_eq!(divide(-1.0, 0.0), -f32::MAX);
    assert_eq!(divide(1e-30, 1e30), 0.0);
    assert_eq!(divide(f32::MIN_POSITIVE, 1.0), f32::MIN_POSITIVE);
    // In the denormal range, though it would round to the least normal number.
    assert_eq!(divide(f32::from_bits(0x00ff_ffff), 2.0), 0.0);
}

#[test]
fn square_root_is_correctly_rounded() {
    let mut rng = Rng(2);
    for exponent in -126..=127 {
        for _ in 0..4_000 {
            let x = rng.float(exponent, exponent).abs();
            assert_eq!(square_root(x).to_bits(), x.sqrt().to_bits(), "{x:e}");
            assert_eq!(square_root_by_integers(x).to_bits(), x.sqrt().to_bits(), "{x:e}");
        }
    }
    for i in 0..=4096u32 {
        assert_eq!(square_root((i * i) as f32), i as f32);
        assert_eq!(square_root_by_integers((i * i) as f32), i as f32);
    }
    assert_eq!(square_root(1e-40), 0.0);
}

/// a*b - c*d from i128, where the exponents are close enough for it, rounded to nearest even.
fn diffprod_oracle(a: f32, b: f32, c: f32, d: f32) -> f32 {
    let parts = |x: f32, y: f32| {
        let m = |x: f32| i128::from((x.to_bits() & 0x7f_ffff) | 0x80_0000) * if x < 0.0 { -1 } else { 1 };
        let e = |x: f32| ((x.to_bits() >> 23) & 255) as i32;
        if x == 0.0 || y == 0.0 { (0, 0) } else { (m(x) * m(y), e(x) + e(y) - 300) }
    };
    let ((mut p, mut ep), (q, eq)) = (parts(a, b), parts(c, d));
    let mut q = -q;
    let mut eq = eq;
    if p == 0 || (q != 0 && ep < eq) {
        (p, q, ep, eq) = (q, p, eq, ep);
    }
    // Beyond 76 bits apart the lesser product is far below half an ulp and only its sign counts.
    let shift = if q == 0 { 0 } else { (ep - eq).min(76) };
    let q = if q != 0 && ep - eq > 76 { q.signum() } else { q };
    let mut sum = (p << shift) + q;
    if sum == 0 {
        return 0.0;
    }
    let sign = if sum < 0 { SIGN } else { 0 };
    sum = sum.abs();
    let bits = 128 - sum.leading_zeros() as i32;
    let drop = bits - 24;
    let mut m = if drop > 0 { sum >> drop } else { sum << -drop };
    if drop > 0 {
        let (rest, half) = (sum & ((1 << drop) - 1), 1i128 << (drop - 1));
        if rest > half || (rest == half && m & 1 == 1) {
            m += 1;
        }
    }
    let mut e = ep - shift + drop;
    if m == 1 << 24 {
        (m, e) = (1 << 23, e + 1);
    }
    let biased = e + 150;
    if biased < 1 {
        return f32::from_bits(sign | LEAST_NORMAL);
    }
    if biased > 254 {
        return f32::from_bits(sign | GREATEST_FINITE);
    }
    f32::from_bits(sign | (biased as u32) << 23 | (m as u32 & 0x7f_ffff))
}

#[test]
fn diffprod_matches_wide_integers() {
    let mut rng = Rng(3);
    let (mut wrong, mut rounded_wrong) = (0, 0);
    let mut check = |a: f32, b: f32, c: f32, d: f32| {
        let truth = diffprod_oracle(a, b, c, d);
        wrong += u32::from(differ(diffprod(a, b, c, d), truth));
        // Negative control: the products rounded apart, as without the exact path.
        rounded_wrong += u32::from(differ(a * b - c * d, truth));
    };
    for _ in 0..1_000_000 {
        check(rng.float(-120, 120), rng.float(-120, 120), rng.float(-120, 120), rng.float(-120, 120));
    }
    for _ in 0..2_000_000 {
        // Products close to each other: exponents that add up alike, significands that nearly do.
        let (a, b) = (rng.float(-50, 50), rng.float(-50, 50));
        let c = f32::from_bits((a.to_bits() as i64 + rng.about(3)) as u32);
        let d = f32::from_bits((b.to_bits() as i64 + rng.about(3)) as u32);
        let scale = f32::from_bits(((127 + rng.about(60)) as u32) << 23);
        check(a, b, c * scale, d / scale);
    }
    for apart in 0..80 {
        for _ in 0..2_000 {
            let (a, b) = (rng.float(0, 1), rng.float(0, 1));
            let (c, d) = (rng.float(-apart, -apart), rng.float(0, 1));
            check(a, b, c, d);
            check(c, d, a, b);
        }
    }
    for _ in 0..100_000 {
        let (a, b) = (rng.float(-120, 120), rng.float(-120, 120));
        check(a, b, b, a);
        check(0.0, a, b, a);
        check(a, b, -0.0, b);
        check(0.0, a, b, 0.0);
    }
    assert_eq!(wrong, 0);
    assert!(rounded_wrong > 100_000, "the control must show: {rounded_wrong}");
}

#[test]
fn diffprod_takes_denormals_as_zero() {
    assert_eq!(diffprod(1e-40, 1e30, 0.0, 1.0).to_bits(), 0);
    assert_eq!(diffprod(1e-40, 1e30, 1.0, 1.0), -1.0);
    assert_eq!(diffprod(1e-30, 1e-30, 0.0, 0.0), f32::MIN_POSITIVE);
    assert_eq!(diffprod(0.0, 0.0, 1e-30, 1e-30), -f32::MIN_POSITIVE);
}

/// Which part of the triangle test is broken on purpose.
#[derive(Clone, Copy, Debug)]
enum Defect {
    /// Nothing: must agree with [`intersect_triangle`].
    None,
    /// A vanished edge value stays 0 where the exact one is not, and what is next to it decides.
    NoExactPath,
    /// The compiler fused one product of each edge function, and the shear.
    Fused,
    /// Möller and Trumbore 1997.
    MoellerTrumbore,
}

/// Whether a triangle relative to the origin is met by the line along `d`, with a planted defect.
fn meets(defect: Defect, d: [f32; 3], a: [f32; 3], b: [f32; 3], c: [f32; 3]) -> bool {
    let f = ray_frame(d);
    let fused_shear = |v: [f32; 3]| {
        let p = [v[f.kx as usize], v[f.ky as usize], v[f.kz as usize]];
        [(-f.sx).mul_add(p[2], p[0]), p[1] - f.sy * p[2]]
    };
    let same_sign = |u: f32, v: f32, w: f32| !(u.min(v.min(w)) < 0.0 && u.max(v.max(w)) > 0.0) && (u + v) + w != 0.0;
    match defect {
        Defect::None => intersect_triangle(&f, a, b, c, 0.0).hit,
        Defect::NoExactPath => {
            // Strict about zeros, because a zero says nothing about the side.
            let (a, b, c) = (shear(&f, a), shear(&f, b), shear(&f, c));
            let edge = |p: [f32; 3], q: [f32; 3]| p[0] * q[1] - p[1] * q[0];
            let (u, v, w) = (edge(c, b), edge(a, c), edge(b, a));
            (u > 0.0 && v > 0.0 && w > 0.0) || (u < 0.0 && v < 0.0 && w < 0.0)
        }
        Defect::Fused => {
            let (a, b, c) = (fused_shear(a), fused_shear(b), fused_shear(c));
            let edge = |p: [f32; 2], q: [f32; 2]| p[0].mul_add(q[1], -(p[1] * q[0]));
            same_sign(edge(c, b), edge(a, c), edge(b, a))
        }
        Defect::MoellerTrumbore => {
            let sub = |x: [f32; 3], y: [f32; 3]| zip(x, y, |x, y| x - y);
            let cross = |x: [f32; 3], y: [f32; 3]| {
                [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]]
            };
            let (e1, e2) = (sub(b, a), sub(c, a));
            let p = cross(d, e2);
            let det = dot(e1, p);
            let s = a.map(|x| -x);
            let u = dot(s, p) / det;
            let v = dot(d, cross(s, e1)) / det;
            det != 0.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0
        }
    }
}

/// A fan of triangles around a centre before the origin; coordinates are multiples of `2^-14`.
struct Fan {
    centre: [f32; 3],
    ring: Vec<[f32; 3]>,
}

impl Fan {
    fn new(rng: &mut Rng) -> Self {
        let lattice = |x: f32| (x * 16_384.0).round() / 16_384.0;
        let n = 3 + rng.below(6) as usize;
        // Distance from 1/4 to 64 radii, along any axis and either way.
        let distance = f32::powi(2.0, rng.below(9) as i32 - 2) * (1.0 + rng.unit());
        let (axis, side) = (rng.below(3) as usize, if rng.below(2) == 0 { 1.0 } else { -1.0 });
        let place = |x: f32, y: f32, z: f32| {
            let mut p = [0.0; 3];
            p[axis] = lattice(z * side);
            p[(axis + 1) % 3] = lattice(x);
            p[(axis + 2) % 3] = lattice(y);
            p
        };
        let (x, y) = (rng.signed() * distance * 0.6, rng.signed() * distance * 0.6);
        let ring = (0..n)
            .map(|i| {
                let angle = (i as f32 + 0.4 * rng.unit()) / n as f32 * std::f32::consts::TAU;
                place(x + angle.cos(), y + angle.sin(), distance + 0.2 * rng.signed())
            })
            .collect();
        Self { centre: place(x, y, distance), ring }
    }

    fn hits(&self, defect: Defect, d: [f32; 3], origin: [f32; 3]) -> usize {
        let n = self.ring.len();
        let relative = |v: [f32; 3]| zip(v, origin, |v, o| v - o);
        (0..n)
            .filter(|&i| {
                let (a, b, c) = (self.centre, self.ring[i], self.ring[(i + 1) % n]);
                // The rotation must not matter.
                let (a, b, c) = if i % 2 == 0 { (a, b, c) } else { (c, a, b) };
                meets(defect, d, relative(a), relative(b), relative(c))
            })
            .count()
    }
}

/// Misses among rays aimed at the centre of a fan and at its inner edges.
fn fan_misses(defect: Defect, fans: usize) -> usize {
    let mut rng = Rng(4);
    let mut missed = 0;
    for _ in 0..fans {
        let fan = Fan::new(&mut rng);
        for ray in 0..8 {
            let s = if ray == 0 { 0.0 } else { 0.4 * rng.unit() };
            let i = rng.below(fan.ring.len() as u64) as usize;
            let aim = zip(fan.centre, fan.ring[i], |c, r| c + s * (r - c));
            let origin = [rng.signed() * 0.05, rng.signed() * 0.05, rng.signed() * 0.05];
            let scale = if rng.below(2) == 0 { 1.0 } else { 0.3 + rng.unit() };
            let d = zip(aim, origin, |p, o| (p - o) * scale);
            missed += usize::from(fan.hits(defect, d, origin) == 0);
        }
    }
    missed
}

#[test]
fn rays_at_vertices_and_edges_of_fans_hit() {
    let fans = 60_000;
    assert_eq!(fan_misses(Defect::None, fans), 0);
    for defect in [Defect::NoExactPath, Defect::Fused, Defect::MoellerTrumbore] {
        let missed = fan_misses(defect, fans);
        println!("{defect:?}: {missed} of {} rays missed", 8 * fans);
        assert!(missed > 50, "{defect:?} must show: {missed}");
    }
}

/// Acceptance of the closed triangle from exact signs of the edge functions of its sheared vertices.
fn sheared_truth(f: &RayFrame, a: [f32; 3], b: [f32; 3], c: [f32; 3]) -> bool {
    // Products of two f32 are exact in f64.
    let edge = |p: [f32; 3], q: [f32; 3]| {
        let (x, y) = (f64::from(p[0]) * f64::from(q[1]), f64::from(p[1]) * f64::from(q[0]));
        i32::from(x > y) - i32::from(x < y)
    };
    let (a, b, c) = (shear(f, a), shear(f, b), shear(f, c));
    let signs = [edge(c, b), edge(a, c), edge(b, a)];
    signs != [0; 3] && (signs.iter().all(|&s| s >= 0) || signs.iter().all(|&s| s <= 0))
}

#[test]
fn needles_are_accepted_exactly() {
    let mut rng = Rng(5);
    let (mut hits, mut wrong) = (0, 0);
    for _ in 0..500_000 {
        // Aspects up to 10^8: a long edge, a third vertex next to it, a ray through or close to the long edge.
        let long = 2.0f32.powi(rng.below(10) as i32);
        let a = [rng.signed() * long, rng.signed() * long, 4.0 + rng.unit()];
        let b = [rng.signed() - a[0], rng.signed() - a[1], 4.0 + rng.unit()];
        let (s, width) = (rng.unit(), 2.0f32.powi(-(rng.below(18) as i32)));
        let c = [0, 1, 2].map(|k| a[k] + s * (b[k] - a[k]) + width * rng.signed());
        let w = rng.unit();
        let mut d = [0, 1, 2].map(|k| a[k] * w + b[k] * (1.0 - w));
        d[0] += rng.signed() * width;
        let f = ray_frame(d);
        if [a, b, c].iter().any(|v| v[f.kz as usize] * d[f.kz as usize] <= 0.0) {
            // Partly behind the origin: a hit may be.
            continue;
        }
        let truth = sheared_truth(&f, a, b, c);
        hits += u32::from(truth);
        wrong += u32::from(intersect_triangle(&f, a, b, c, 0.0).hit != truth);
    }
    assert_eq!(wrong, 0);
    assert!(hits > 20_000, "the rays must hit often enough to test anything: {hits}");
}

/// A ray whose shear is exact, on integer coordinates: the slopes are `d[k] / 16`, and `d[axis]` is +-16.
struct IntegerCase {
    d: [i64; 3],
    triangle: [[i64; 3]; 3],
}

impl IntegerCase {
    fn new(rng: &mut Rng) -> Self {
        let mut d = [rng.about(16), rng.about(16), rng.about(16)];
        d[rng.below(3) as usize] = if rng.below(2) == 0 { 16 } else { -16 };
        let mut vertex = |range: i64| [rng.about(range), rng.about(range), rng.about(range)];
        let mut triangle = [vertex(1 << 12), vertex(1 << 12), vertex(1 << 12)];
        // Half of the rays pass through a vertex or a point of an edge.
        match rng.below(4) {
            0 => triangle[0] = d.map(|x| x * 64),
            1 => {
                let step = [rng.about(300), rng.about(300), rng.about(300)];
                let (before, after) = (1 + rng.about(2).abs(), 1 + rng.about(2).abs());
                triangle[0] = [0, 1, 2].map(|k| d[k] * 64 - before * step[k]);
                triangle[1] = [0, 1, 2].map(|k| d[k] * 64 + after * step[k]);
            }
            _ => {}
        }
        Self { d, triangle }
    }

    /// t of the line, from exact edge values, and a bound of the kernel's error; `None` if the line misses or all edge
    /// values vanish.
    fn truth(&self) -> Option<(f64, f64)> {
        let d = self.d.map(i128::from);
        let kz = (0..3).find(|&k| d[k].abs() == 16)?;
        let (kx, ky) = ((kz + 1) % 3, (kz + 2) % 3);
        let flat = self.triangle.map(|v| {
            let v = v.map(i128::from);
            [v[kx] * d[kz] - d[kx] * v[kz], v[ky] * d[kz] - d[ky] * v[kz], v[kz]]
        });
        let edge = |p: [i128; 3], q: [i128; 3]| p[0] * q[1] - p[1] * q[0];
        let [a, b, c] = flat;
        let (u, v, w) = (edge(c, b), edge(a, c), edge(b, a));
        let det = u + v + w;
        if u.min(v).min(w) < 0 && u.max(v).max(w) > 0 || det == 0 {
            return None;
        }
        let z = (u * a[2] + v * b[2] + w * c[2]) as f64 / det as f64;
        // A rounded edge value p - q is off by u (|p| + |q| + |p - q|), which moves z by its share of z_i - z; the sum
        // of three terms, the division and the scaling add 5 roundings of at most the largest |z_i|. The clamp only
        // helps.
        let term = |p: [i128; 3], q: [i128; 3]| {
            ((p[0] * q[1]).abs() + (p[1] * q[0]).abs() + edge(p, q).abs()) as f64 / (det as f64).abs()
        };
        let edges = [(term(c, b), a[2]), (term(a, c), b[2]), (term(b, a), c[2])];
        let moved: f64 = edges.iter().map(|&(e, zi)| e * (zi as f64 - z).abs()).sum();
        let largest = a[2].abs().max(b[2].abs()).max(c[2].abs()) as f64;
        // Second-order terms: a tenth more. The kernel's direction is d / 16.
        Some((z / (d[kz] as f64 / 16.0), 1.1 * (moved + 8.0 * largest) / f64::from(1 << 24)))
    }
}

#[test]
fn integer_triangles_are_hit_as_exact_arithmetic_says() {
    let mut rng = Rng(6);
    let (mut hits, mut strict) = (0, 0);
    for _ in 0..1_000_000 {
        let case = IntegerCase::new(&mut rng);
        let d = case.d.map(|x| x as f32 / 16.0);
        let [a, b, c] = case.triangle.map(|v| v.map(|x| x as f32));
        let found = intersect_triangle(&ray_frame(d), a, b, c, 0.0);
        let truth = case.truth();
        match truth {
            Some((t, tolerance)) if t > tolerance => {
                assert!(found.hit, "missed {:?} {d:?}", case.triangle);
                assert!((f64::from(found.t) - t).abs() <= tolerance, "{} {t}", found.t);
                hits += 1;
                strict += u32::from(!meets(Defect::NoExactPath, d, a, b, c));
            }
            Some((t, tolerance)) if t >= -tolerance => {}
            _ => assert!(!found.hit, "hit {:?} {d:?} {truth:?}", case.triangle),
        }
    }
    assert!(hits > 100_000, "the rays must hit often enough to test anything: {hits}");
    assert!(strict > 10_000, "the control must show: {strict}");
}

#[test]
fn results_scale_by_powers_of_two() {
    let mut rng = Rng(7);
    for _ in 0..20_000 {
        let mut vertex = || [rng.signed(), rng.signed(), rng.signed()];
        let [a, b, c, d] = [vertex(), vertex(), vertex(), vertex()];
        let f = ray_frame(d);
        let hit = intersect_triangle(&f, a, b, c, 0.0);
        for k in [-20, -3, 8, 20] {
            let s = 2.0f32.powi(k);
            let scale = |v: [f32; 3]| v.map(|x| x * s);
            let scaled = intersect_triangle(&f, scale(a), scale(b), scale(c), 0.0);
            assert_eq!((scaled.hit, scaled.t.to_bits()), (hit.hit, (hit.t * s).to_bits()));
        }
    }
}

#[test]
fn interval_and_sides() {
    let (a, b, c) = ([-1.0, -1.0, -4.0], [1.0, -1.0, -4.0], [0.0, 1.0, -4.0]);
    let f = ray_frame([0.0, 0.0, -1.0]);
    let front = intersect_triangle(&f, a, b, c, 0.0);
    assert_eq!((front.hit, front.t), (true, 4.0));
    assert!(front.det * f.iz > 0.0, "counter-clockwise seen from the origin");
    let back = intersect_triangle(&f, a, c, b, 0.0);
    assert!(back.hit && back.det * f.iz < 0.0);
    assert!(intersect_triangle(&f, a, b, c, 4.0).hit, "the interval is closed");
    assert!(!intersect_triangle(&f, a, b, c, 4.0000005).hit);
    let behind = ray_frame([0.0, 0.0, 1.0]);
    assert!(!intersect_triangle(&behind, a, b, c, 0.0).hit);
    // In the plane of the triangle: no area across the ray.
    assert!(
        !intersect_triangle(&ray_frame([1.0, 0.0, 0.0]), [1.0, -1.0, 0.0], [2.0, 1.0, 0.0], [3.0, 0.0, 0.0], 0.0).hit
    );
    // Zero components of a direction, of either sign, give finite reciprocals.
    let f = ray_frame([0.0, -0.0, 2.0]);
    assert_eq!(f.inv, [GREATEST_INVERSE, -GREATEST_INVERSE, 0.5]);
    assert_eq!((f.kx, f.ky, f.kz, f.sx, f.sy), (0, 1, 2, 0.0, 0.0));
    assert_eq!(ray_frame([-1.0, 1.0, 1.0]).kz, 0);
    assert_eq!(ray_frame([0.5, 1.0, -1.0]).kz, 1);
}

type Triangle = [[f32; 3]; 3];

/// What a ray keeps of a list of boxed triangles.
fn nearest(f: &RayFrame, triangles: &[Triangle], order: &[usize], clamp: bool) -> (f32, usize) {
    let u = 1.0 / 16_777_216.0;
    let mut best = (f32::MAX, usize::MAX);
    for &id in order {
        let [a, b, c] = triangles[id];
        let low = zip(a, zip(b, c, f32::min), f32::min);
        let high = zip(a, zip(b, c, f32::max), f32::max);
        let m = greatest(zip(low, high, |l, h| l.abs().max(h.abs())));
        let delta = 64.0 * u * m;
        let t0 = zip(low, f.inv, |l, i| (l - delta) * i);
        let t1 = zip(high, f.inv, |h, i| (h + delta) * i);
        let (near, far) = (zip(t0, t1, f32::min), zip(t0, t1, f32::max));
        if greatest(near).max(0.0) > far[0].min(far[1]).min(far[2]).min(best.0) {
            continue;
        }
        let hit = intersect_triangle(f, a, b, c, 0.0);
        let z = [a, b, c].map(|v| v[f.kz as usize]);
        let raw = divide((hit.u * z[0] + hit.v * z[1]) + hit.w * z[2], hit.det) * f.iz;
        let t = if clamp { hit.t } else { raw };
        if hit.hit && (t < best.0 || (t == best.0 && id < best.1)) {
            best = (t, id);
        }
    }
    best
}

/// Rays whose nearest hit of coplanar, overlapping triangles depends on the order of the triangles.
fn order_dependent(clamp: bool) -> usize {
    let mut rng = Rng(8);
    let mut changed = 0;
    for _ in 0..20_000 {
        // Needles of no extent in y but a thousandth, in planes that hold the ray: along a needle t is ill-conditioned,
        // while its y admits little; duplicates and rotations that differ among them.
        let d = [1.0, 0.3 + 0.6 * rng.unit(), 0.1 + 0.8 * rng.unit()];
        let mut triangles: Vec<Triangle> = (0..8)
            .map(|_| {
                let (x, long, thin, slope) =
                    (20.0 + 0.001 * rng.unit(), 1.0 + 4.0 * rng.unit(), 0.001 * rng.unit(), rng.signed());
                let mut point = |s: f32, t: f32| {
                    let noise = 1e-6 * rng.signed();
                    [d[0] * t + s, d[1] * t, d[2] * t + slope * s + noise]
                };
                [point(-long, x), point(long, x), point(0.7 * long, x + thin)]
            })
            .collect();
        for i in 0..4 {
            let [a, b, c] = triangles[i];
            triangles.push([a, b, c]);
            triangles.push([b, c, a]);
        }
        let f = ray_frame(d);
        let mut order: Vec<usize> = (0..triangles.len()).collect();
        let first = nearest(&f, &triangles, &order, clamp);
        for _ in 0..4 {
            for i in (1..order.len()).rev() {
                order.swap(i, rng.below(i as u64 + 1) as usize);
            }
            if nearest(&f, &triangles, &order, clamp) != first {
                changed += 1;
                break;
            }
        }
    }
    changed
}

#[test]
fn the_nearest_of_coplanar_triangles_does_not_depend_on_the_order() {
    assert_eq!(order_dependent(true), 0);
    let changed = order_dependent(false);
    assert!(changed > 20, "the control, t outside its slab, must show: {changed}");
}

mod surface;
