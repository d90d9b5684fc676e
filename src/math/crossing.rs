//! Does a ray meet a triangle, and where: f64 with error bounds, exact arithmetic where they do not decide.
//!
//! With the vertices a, b, c relative to the ray's origin and d its direction, the edge values U = d·(b×c),
//! V = d·(c×a), W = d·(a×b) weight a, b and c. The ray's line meets the closed triangle where no two of them have
//! opposite signs and not all are zero; then D = U + V + W is not zero either, and t = N / D with N = a·(b×c).

use glam::DVec3;
use num_bigint::BigInt;
use num_traits::ToPrimitive;
use std::cmp::Ordering;

/// 2^-53.
const ROUNDING: f64 = f64::EPSILON / 2.0;
/// Bounds the error of a sum of six products of three factors, two of them with relative errors of 2 roundings each: 4
/// from the factors, 4 from products and sums within a 2x2 minor and its product with the third factor, 2 from adding
/// up; doubled against terms of higher order.
const TRIPLE_ERROR: f64 = 24.0 * ROUNDING;
/// More than what sums of small numbers are off by, which f64 rounds to multiples of 2^-1074.
const UNDERFLOW: f64 = f64::MIN_POSITIVE;

/// A ray's line, whose origin is given relative to a reference point, so that nothing is rounded. All are finite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// The point that `origin` is relative to.
    pub reference: [f64; 3],
    /// Origin.
    pub origin: [f64; 3],
    /// Direction, of any length but zero.
    pub direction: [f64; 3],
}

/// A point of the ray's line on a triangle.
#[derive(Clone, Copy, Debug)]
pub struct Crossing {
    /// Parameter.
    pub t: f64,
    /// Bound of the error of `t`.
    t_error: f64,
    /// Weights of the vertices; they sum to 1.
    pub weights: [f64; 3],
}

/// A vertex relative to the ray's origin, and a bound of the magnitudes that went into it.
fn relative(line: &Line, vertex: [f64; 3]) -> (DVec3, DVec3) {
    let (from_reference, origin) = (DVec3::from(vertex) - DVec3::from(line.reference), DVec3::from(line.origin));
    (from_reference - origin, from_reference.abs() + origin.abs())
}

/// a × b with every subtraction an addition.
fn permanent(a: DVec3, b: DVec3) -> DVec3 {
    DVec3::new(a.y * b.z + a.z * b.y, a.z * b.x + a.x * b.z, a.x * b.y + a.y * b.x)
}

/// A vector of whole numbers.
type Whole3 = [BigInt; 3];

/// The exact quantities of a ray and a triangle, in multiples of one power of two.
struct Exact {
    vertices: [Whole3; 3],
    d: Whole3,
}

/// Whole m and e with x = m 2^e, m odd or 0.
fn parts(x: f64) -> (i64, i32) {
    let exponent = (x.to_bits() >> 52 & 0x7ff) as i32;
    let fraction = (x.to_bits() << 12 >> 12) as i64 | i64::from(exponent > 0) << 52;
    let zeros = if fraction == 0 { 0 } else { fraction.trailing_zeros() };
    ((fraction >> zeros) * x.signum() as i64, exponent.max(1) - 1075 + zeros as i32)
}

fn cross(a: &Whole3, b: &Whole3) -> Whole3 {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| &a[i] * &b[j] - &a[j] * &b[i])
}

fn dot(a: &Whole3, b: &Whole3) -> BigInt {
    &a[0] * &b[0] + &a[1] * &b[1] + &a[2] * &b[2]
}

/// The quotient, to some roundings.
fn quotient(a: &BigInt, b: &BigInt) -> f64 {
    // Within the range of f64, and with more bits than one has.
    let beyond = a.bits().max(b.bits()).saturating_sub(1000);
    let [a, b] = [a, b].map(|x| (x >> beyond).to_f64().unwrap_or(f64::NAN));
    a / b
}

fn sign(x: &BigInt) -> i32 {
    x.cmp(&BigInt::ZERO) as i32
}

impl Exact {
    fn new(line: &Line, triangle: [[f64; 3]; 3]) -> Self {
        let given = [line.reference, line.origin, line.direction].into_iter().chain(triangle);
        let exponents = given.flatten().map(parts).filter(|part| part.0 != 0).map(|part| part.1);
        let unit = exponents.min().unwrap_or(0);
        let whole = |x: f64| match parts(x) {
            (0, _) => BigInt::ZERO,
            (mantissa, exponent) => BigInt::from(mantissa) << (exponent - unit),
        };
        let relative = |vertex: [f64; 3]| {
            std::array::from_fn(|k| whole(vertex[k]) - whole(line.reference[k]) - whole(line.origin[k]))
        };
        Self { vertices: triangle.map(relative), d: line.direction.map(whole) }
    }

    /// U, V, W.
    fn edges(&self) -> Whole3 {
        let [a, b, c] = &self.vertices;
        [(b, c), (c, a), (a, b)].map(|(p, q)| dot(&self.d, &cross(p, q)))
    }

    /// N and D.
    fn fraction(&self) -> (BigInt, BigInt) {
        let [a, b, c] = &self.vertices;
        (dot(a, &cross(b, c)), self.edges().into_iter().sum())
    }

    /// Where the line meets the triangle, which it does.
    fn met(&self) -> Crossing {
        let (numerator, determinant) = self.fraction();
        let t = quotient(&numerator, &determinant);
        let weights = self.edges().each_ref().map(|edge| quotient(edge, &determinant));
        Crossing { t, t_error: 8.0 * ROUNDING * t.abs(), weights }
    }
}

/// Where `line`, which meets a triangle, does so: by its plane, from edges that are rounded once and not from vertices
/// far from each other. `None` where the triangle is seen so much from its side, or is so small or narrow, that f64 has
/// less than 40 bits of t or 30 of the weights.
#[inline(always)]
fn by_plane(line: &Line, triangle: [[f64; 3]; 3]) -> Option<Crossing> {
    let [a, b, c] = triangle.map(DVec3::from);
    let d = DVec3::from(line.direction);
    let (u, v) = (b - a, c - a);
    let normal = u.cross(v);
    let (from, reach) = relative(line, triangle[0]);
    let (numerator, determinant) = (normal.dot(from), normal.dot(d));
    // Each component of the normal is wrong by four roundings of its permanent, each sum by three more.
    let spread = permanent(u.abs(), v.abs());
    let determinant_error = 8.0 * ROUNDING * spread.dot(d.abs()) + UNDERFLOW;
    let numerator_error =
        8.0 * ROUNDING * spread.dot(from.abs()) + 2.0 * ROUNDING * normal.abs().dot(reach) + UNDERFLOW;
    let relative_error = numerator_error / numerator.abs() + determinant_error / determinant.abs() + 2.0 * ROUNDING;
    let t = numerator / determinant;
    let t_error = 2.0 * relative_error * t.abs();
    // The point relative to the first vertex, and how far it may be off.
    let (way, area) = (d * t, normal.length_squared());
    let point = way - from;
    let off = (d.abs() * t_error).element_sum() + 4.0 * ROUNDING * (reach + way.abs()).element_sum();
    let per_area = 1.0 / area;
    let weights = [point.cross(v).dot(normal) * per_area, u.cross(point).dot(normal) * per_area];
    // The error of the weights, squared, over the area.
    let weight_error = 4.0 * off * off * u.length_squared().max(v.length_squared());
    let is_good = relative_error < 1e-12 && weight_error < 1e-18 * area && area.is_normal();
    is_good.then(|| Crossing { t, t_error, weights: [1.0 - weights[0] - weights[1], weights[0], weights[1]] })
}

/// [`crossing`] of a line whose reference is 0, and whose origin's components are no greater than `reach`: most are
/// decided by one bound for all three edges.
#[inline(always)]
pub fn crossing_near(line: &Line, reach: f64, triangle: [DVec3; 3]) -> Option<Crossing> {
    match surely_meets(line, reach, triangle) {
        Some(false) => None,
        Some(true) => Some(met(line, triangle.map(|vertex| vertex.to_array()))),
        None => crossing(line, triangle.map(|vertex| vertex.to_array())),
    }
}

/// Whether such a line meets the triangle, if that is certain.
#[inline(always)]
fn surely_meets(line: &Line, reach: f64, [a, b, c]: [DVec3; 3]) -> Option<bool> {
    let (origin, d) = (DVec3::from_array(line.origin), DVec3::from_array(line.direction));
    let most = a.abs().max(b.abs()).max(c.abs()).max_element() + reach;
    let [a, b, c] = [a - origin, b - origin, c - origin];
    // A permanent has two products in each component, and none of their factors is above `most`.
    let error = TRIPLE_ERROR * 2.0 * most * most * (d.x.abs() + d.y.abs() + d.z.abs()) + UNDERFLOW;
    let edges = [d.dot(b.cross(c)), d.dot(c.cross(a)), d.dot(a.cross(b))];
    let least = edges[0].min(edges[1]).min(edges[2]);
    let greatest = edges[0].max(edges[1]).max(edges[2]);
    if greatest > error && least < -error {
        return Some(false);
    }
    // Of edges that overflow nothing is known.
    let is_known = (edges[0] + edges[1] + edges[2]).is_finite();
    (is_known && (least > error || greatest < -error)).then_some(true)
}

/// Lines whose references are 0, side by side.
pub struct Lines<const N: usize> {
    /// By axes.
    pub origin: [[f64; N]; 3],
    /// By axes.
    pub direction: [[f64; N]; 3],
    /// Greatest magnitudes of the origins' components.
    reach: [f64; N],
    /// Sums of the magnitudes of the directions' components.
    length: [f64; N],
}

impl<const N: usize> Lines<N> {
    /// Of origins and directions, by axes.
    #[inline(always)]
    pub fn new(origin: [[f64; N]; 3], direction: [[f64; N]; 3]) -> Self {
        let (mut reach, mut length) = ([0.0f64; N], [0.0; N]);
        for k in 0..3 {
            for i in 0..N {
                reach[i] = reach[i].max(origin[k][i].abs());
                length[i] += direction[k][i].abs();
            }
        }
        Self { origin, direction, reach, length }
    }

    /// One of them.
    #[inline(always)]
    pub fn get(&self, i: usize) -> Lines<1> {
        let axes = |of: &[[f64; N]; 3]| [[of[0][i]], [of[1][i]], [of[2][i]]];
        Lines {
            origin: axes(&self.origin),
            direction: axes(&self.direction),
            reach: [self.reach[i]],
            length: [self.length[i]],
        }
    }

    /// One of them.
    #[inline(always)]
    pub fn line(&self, i: usize) -> Line {
        let axes = |of: &[[f64; N]; 3]| [of[0][i], of[1][i], of[2][i]];
        Line { reference: [0.0; 3], origin: axes(&self.origin), direction: axes(&self.direction) }
    }

    /// The greatest magnitude of its origin's components.
    #[inline(always)]
    pub fn reach(&self, i: usize) -> f64 {
        self.reach[i]
    }

    /// Which lines certainly do not meet the triangle, a bit each, as decided for a line alone.
    #[inline(always)]
    pub fn surely_miss(&self, [a, b, c]: [DVec3; 3]) -> u32 {
        let greatest = a.abs().max(b.abs()).max(c.abs()).max_element();
        let mut misses = [0; N];
        for (i, miss) in misses.iter_mut().enumerate() {
            let [ox, oy, oz] = [self.origin[0][i], self.origin[1][i], self.origin[2][i]];
            let [dx, dy, dz] = [self.direction[0][i], self.direction[1][i], self.direction[2][i]];
            let (ax, ay, az) = (a.x - ox, a.y - oy, a.z - oz);
            let (bx, by, bz) = (b.x - ox, b.y - oy, b.z - oz);
            let (cx, cy, cz) = (c.x - ox, c.y - oy, c.z - oz);
            let u = dx * (by * cz - bz * cy) + dy * (bz * cx - bx * cz) + dz * (bx * cy - by * cx);
            let v = dx * (cy * az - cz * ay) + dy * (cz * ax - cx * az) + dz * (cx * ay - cy * ax);
            let w = dx * (ay * bz - az * by) + dy * (az * bx - ax * bz) + dz * (ax * by - ay * bx);
            let most = greatest + self.reach[i];
            let error = TRIPLE_ERROR * 2.0 * most * most * self.length[i] + UNDERFLOW;
            let is_above = (u > error) | (v > error) | (w > error);
            let is_below = (u < -error) | (v < -error) | (w < -error);
            *miss = u64::from(is_above & is_below);
        }
        (0..N).fold(0, |mask, i| mask | (misses[i] as u32) << i)
    }
}

/// Where `line` meets the closed triangle, whatever t; `None` if it does not, or lies in its plane.
pub fn crossing(line: &Line, triangle: [[f64; 3]; 3]) -> Option<Crossing> {
    let [(a, ma), (b, mb), (c, mc)] = triangle.map(|vertex| relative(line, vertex));
    let d = DVec3::from(line.direction);
    let normals = [b.cross(c), c.cross(a), a.cross(b)];
    let edges = normals.map(|n| d.dot(n));
    let errors = [(mb, mc), (mc, ma), (ma, mb)].map(|(p, q)| TRIPLE_ERROR * d.abs().dot(permanent(p, q)) + UNDERFLOW);

    // Two edges certain to have opposite signs: a miss, by far the most frequent case.
    let certain = |k: usize, sign: f64| edges[k] * sign > errors[k];
    if (0..3).any(|k| certain(k, 1.0)) && (0..3).any(|k| certain(k, -1.0)) {
        return None;
    }
    if (0..3).all(|k| edges[k].abs() > errors[k]) {
        return Some(met(line, triangle));
    }
    let exact = Exact::new(line, triangle);
    let signs = exact.edges().each_ref().map(sign);
    if (signs.contains(&1) && signs.contains(&-1)) || signs == [0; 3] { None } else { Some(exact.met()) }
}

/// Where `line` meets a triangle that it is certain to meet, but not along an edge.
#[inline(always)]
fn met(line: &Line, triangle: [[f64; 3]; 3]) -> Crossing {
    by_plane(line, triangle).unwrap_or_else(
        #[cold]
        || Exact::new(line, triangle).met(),
    )
}

/// The order of two crossings of one ray along it, exactly.
pub fn order(line: &Line, p: (&Crossing, [[f64; 3]; 3]), q: (&Crossing, [[f64; 3]; 3])) -> Ordering {
    let apart = p.0.t - q.0.t;
    if apart.abs() > p.0.t_error + q.0.t_error + ROUNDING * apart.abs() {
        return apart.total_cmp(&0.0);
    }
    let ((n0, d0), (n1, d1)) = (Exact::new(line, p.1).fraction(), Exact::new(line, q.1).fraction());
    let difference = sign(&(n0 * &d1 - n1 * &d0)) * sign(&d0) * sign(&d1);
    difference.cmp(&0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(origin: [f64; 3], direction: [f64; 3]) -> Line {
        Line { reference: [0.0; 3], origin, direction }
    }

    const TRIANGLE: [[f64; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

    /// Lines through points of a triangle's plane, from near and from far: in the middle, a hair from an edge, beside.
    #[test]
    fn what_one_bound_decides_is_so() {
        let mut rng = crate::math::random::Rng(5);
        let mut point = |scale: f64| DVec3::from_array([0; 3].map(|_| scale * f64::from(rng.signed())));
        let (mut decided, mut met, mut last, mut missed) = ([0; 2], 0, Vec::new(), 0);
        for i in 0..30_000u32 {
            let [a, b, c] = [0; 3].map(|_| point(1.0));
            let from = point([3.0, 1e6, 1e12][i as usize / 3 % 3]);
            let to = match i % 3 {
                0 => (a + b + c) / 3.0,
                1 => a + 0.5 * (b - a) + f64::from(i % 7) * 1e-16 * (c - a) - 2e-16 * (c - a),
                _ => a + 3.0 * (a - c),
            };
            let line = line(from.to_array(), (to - from).to_array());
            let reach = from.abs().max_element();
            let truth = crossing(&line, [a, b, c].map(|vertex| vertex.to_array()));
            if let Some(told) = surely_meets(&line, reach, [a, b, c]) {
                assert_eq!(told, truth.is_some(), "{line:?}");
                decided[usize::from(told)] += 1;
            }
            last.push(line);
            if let Ok(lines) = <[Line; 8]>::try_from(&*last) {
                let axes = |of: fn(&Line) -> [f64; 3]| [0, 1, 2].map(|k| lines.each_ref().map(|line| of(line)[k]));
                let misses = Lines::new(axes(|line| line.origin), axes(|line| line.direction)).surely_miss([a, b, c]);
                for (k, line) in lines.iter().enumerate() {
                    let reach = DVec3::from_array(line.origin).abs().max_element();
                    let is_missed = surely_meets(line, reach, [a, b, c]) == Some(false);
                    assert_eq!(misses >> k & 1 != 0, is_missed, "{line:?}");
                    missed += u32::from(is_missed);
                }
                last.clear();
            }
            let near = crossing_near(&line, reach, [a, b, c]);
            assert_eq!(near.map(|x| (x.t, x.weights)), truth.map(|x| (x.t, x.weights)));
            met += u32::from(truth.is_some());
        }
        assert!(met > 9000 && decided[0] > 5000 && decided[1] > 5000, "{met} {decided:?}");
        assert!((5000..25_000).contains(&missed), "{missed}");
    }

    /// A direction of 2^-1060 of the length meets what the direction meets, also where products are rounded to
    /// multiples of 2^-1074.
    #[test]
    fn signs_hold_where_numbers_are_least() {
        let mut rng = crate::math::random::Rng(7);
        let mut place = || [0; 3].map(|_| f64::from((512.0 * rng.signed()).round()) / 64.0);
        let least = 2.0f64.powi(-1060);
        let mut met = [0; 2];
        for i in 0..3000 {
            let (a, b, c, from, other) = (place(), place(), place(), place(), place());
            // To a corner, and to somewhere else.
            let to = if i % 2 == 0 { a } else { other };
            let direction = [0, 1, 2].map(|k| to[k] - from[k]);
            if direction == [0.0; 3] {
                continue;
            }
            let is_met = |scale: f64| {
                let line = line(from, direction.map(|d| d * scale));
                let near = crossing_near(&line, 8.0, [a, b, c].map(DVec3::from)).is_some();
                assert_eq!(near, crossing(&line, [a, b, c]).is_some());
                near
            };
            assert_eq!(is_met(least), is_met(1.0), "{from:?} {direction:?} {a:?} {b:?} {c:?}");
            met[i % 2] += usize::from(is_met(1.0));
        }
        assert!(met[0] > 1000 && (10..1000).contains(&met[1]), "{met:?}");
    }

    /// Where a line meets a plane is what whole numbers say, to its bound.
    #[test]
    fn crossings_by_the_plane_are_near_the_exact_ones() {
        let mut rng = crate::math::random::Rng(6);
        let mut point = |scale: f64| DVec3::from_array([0; 3].map(|_| scale * f64::from(rng.signed())));
        let mut found = 0;
        for i in 0..3000 {
            let (scale, thin) = ([1.0, 1e-40, 1e60][i % 3], [1.0, 0.1, 1e-6][i / 3 % 3]);
            let (a, b) = (point(scale), point(scale));
            let c = 0.5 * (a + b) + point(thin * scale);
            let from = point(10.0 * scale);
            let line = line(from.to_array(), ((a + b + c) / 3.0 - from).to_array());
            let triangle = [a, b, c].map(|vertex| vertex.to_array());
            if let Some(near) = by_plane(&line, triangle) {
                let exact = Exact::new(&line, triangle).met();
                assert!((near.t - exact.t).abs() <= near.t_error + exact.t_error, "{line:?}");
                assert!((0..3).all(|k| (near.weights[k] - exact.weights[k]).abs() < 1e-9), "{line:?}");
                found += 1;
            }
        }
        assert!((1500..2100).contains(&found), "{found}");
    }

    #[test]
    fn inside_on_edges_and_outside() {
        let hit = crossing(&line([0.25, 0.5, 3.0], [0.0, 0.0, -2.0]), TRIANGLE).unwrap();
        assert_eq!((hit.t, hit.weights), (1.5, [0.25, 0.25, 0.5]));
        for (x, y, met) in [
            (0.0, 0.0, true),
            (0.5, 0.5, true),
            (0.5, 0.5 + f64::EPSILON, false),
            (-f64::MIN_POSITIVE, 0.5, false),
            (0.0, 0.5, true),
            (1.0, 0.0, true),
            (1.0 + f64::EPSILON, 0.0, false),
        ] {
            assert_eq!(crossing(&line([x, y, 1.0], [0.0, 0.0, -1.0]), TRIANGLE).is_some(), met, "{x} {y}");
            let [a, b, c] = TRIANGLE;
            assert_eq!(crossing(&line([x, y, 1.0], [0.0, 0.0, -1.0]), [c, b, a]).is_some(), met, "{x} {y}");
        }
        assert!(crossing(&line([-1.0, 0.25, 0.0], [1.0, 0.0, 0.0]), TRIANGLE).is_none(), "in the plane");
    }

    #[test]
    fn signs_hold_far_from_the_origin() {
        // The edge x = y from 2^30 on, a point 2^-20 beside it, seen from a reference point far away.
        let far = 2.0f64.powi(30);
        let triangle = [[far, far, 0.0], [far + 1.0, far + 1.0, 0.0], [far, far + 1.0, 0.0]];
        let beside = 2.0f64.powi(-20);
        for (shift, met) in [(0.0, true), (beside, true), (-beside, false)] {
            let line = Line {
                reference: [-3.0 * far, 5.0 * far, 0.0],
                origin: [4.0 * far + 0.5, 0.5 - 4.0 * far + shift, 1.0],
                ..line([0.0; 3], [0.0, 0.0, -1.0])
            };
            assert_eq!(crossing(&line, triangle).is_some(), met, "{shift}");
        }
    }

    #[test]
    fn order_is_exact() {
        // Two triangles of the plane z = x / 3 meet the ray at one point, a third lies 2^-50 below.
        let plane = |x: f64, y: f64| [3.0 * x, y, x];
        let p = [plane(-5.0, -7.0), plane(11.0, 0.0), plane(-1.0, 13.0)];
        let q = [plane(-6.0, -2.0), plane(7.0, -3.0), plane(1.0, 17.0)];
        let lower = q.map(|[x, y, z]| [x, y, z - 2.0f64.powi(-48)]);
        let line = line([0.7, 0.1, 9.3], [0.01, 0.02, -0.7]);
        let at = |t| crossing(&line, t).unwrap();
        assert_eq!(order(&line, (&at(p), p), (&at(q), q)), Ordering::Equal);
        assert_eq!(order(&line, (&at(p), p), (&at(lower), lower)), Ordering::Less);
        assert_eq!(order(&line, (&at(lower), lower), (&at(p), p)), Ordering::Greater);
    }
}
