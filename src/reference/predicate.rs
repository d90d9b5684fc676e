//! Does a ray meet a triangle, and where: f64 with error bounds, exact arithmetic where they do not decide.
//!
//! With the vertices a, b, c relative to the ray's origin and d its direction, the edge values U = d·(b×c),
//! V = d·(c×a), W = d·(a×b) weight a, b and c. The ray's line meets the closed triangle where no two of them have
//! opposite signs and not all are zero; then D = U + V + W is not zero either, and t = N / D with N = a·(b×c).

use super::ray::TruthRay;
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

/// A point of the ray's line on a triangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Crossing {
    /// Parameter.
    pub(super) t: f64,
    /// Bound of the error of `t`.
    t_error: f64,
    /// Weights of the vertices; they sum to 1.
    pub(super) weights: [f64; 3],
}

/// A vertex relative to the ray's origin, and a bound of the magnitudes that went into it.
fn relative(ray: &TruthRay, vertex: [f64; 3]) -> (DVec3, DVec3) {
    let (from_reference, origin) = (DVec3::from(vertex) - DVec3::from(ray.reference), DVec3::from(ray.origin));
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
    fn new(ray: &TruthRay, triangle: [[f64; 3]; 3]) -> Self {
        let given = [ray.reference, ray.origin, ray.direction].into_iter().chain(triangle);
        let exponents = given.flatten().map(parts).filter(|part| part.0 != 0).map(|part| part.1);
        let unit = exponents.min().unwrap_or(0);
        let whole = |x: f64| match parts(x) {
            (0, _) => BigInt::ZERO,
            (mantissa, exponent) => BigInt::from(mantissa) << (exponent - unit),
        };
        let relative = |vertex: [f64; 3]| {
            std::array::from_fn(|k| whole(vertex[k]) - whole(ray.reference[k]) - whole(ray.origin[k]))
        };
        Self { vertices: triangle.map(relative), d: ray.direction.map(whole) }
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
}

/// Where the line of `ray` meets the closed triangle, whatever t; `None` if it does not, or lies in its plane.
pub(super) fn crossing(ray: &TruthRay, triangle: [[f64; 3]; 3]) -> Option<Crossing> {
    let [(a, ma), (b, mb), (c, mc)] = triangle.map(|vertex| relative(ray, vertex));
    let d = DVec3::from(ray.direction);
    let normals = [b.cross(c), c.cross(a), a.cross(b)];
    let edges = normals.map(|n| d.dot(n));
    let errors = [(mb, mc), (mc, ma), (ma, mb)].map(|(p, q)| TRIPLE_ERROR * d.abs().dot(permanent(p, q)));

    // Two edges certain to have opposite signs: a miss, by far the most frequent case.
    let certain = |k: usize, sign: f64| edges[k] * sign > errors[k];
    if (0..3).any(|k| certain(k, 1.0)) && (0..3).any(|k| certain(k, -1.0)) {
        return None;
    }
    let all_certain = (0..3).all(|k| edges[k].abs() > errors[k]);
    let determinant = edges[0] + edges[1] + edges[2];
    let numerator = a.dot(normals[0]);
    let numerator_error = TRIPLE_ERROR * ma.dot(permanent(mb, mc));
    let determinant_error = errors[0] + errors[1] + errors[2] + 2.0 * ROUNDING * determinant.abs();
    let relative_error = numerator_error / numerator.abs() + determinant_error / determinant.abs() + 2.0 * ROUNDING;
    if all_certain && relative_error < 1e-12 {
        let t = numerator / determinant;
        return Some(Crossing { t, t_error: 2.0 * relative_error * t.abs(), weights: edges.map(|e| e / determinant) });
    }

    let exact = Exact::new(ray, triangle);
    let exact_edges = exact.edges();
    let signs = exact_edges.each_ref().map(sign);
    if (signs.contains(&1) && signs.contains(&-1)) || signs == [0; 3] {
        return None;
    }
    let (numerator, determinant) = exact.fraction();
    let t = quotient(&numerator, &determinant);
    let weights = exact_edges.each_ref().map(|edge| quotient(edge, &determinant));
    Some(Crossing { t, t_error: 8.0 * ROUNDING * t.abs(), weights })
}

/// The order of two crossings of one ray along it, exactly.
pub(super) fn order(ray: &TruthRay, p: (&Crossing, [[f64; 3]; 3]), q: (&Crossing, [[f64; 3]; 3])) -> Ordering {
    let apart = p.0.t - q.0.t;
    if apart.abs() > p.0.t_error + q.0.t_error + ROUNDING * apart.abs() {
        return apart.total_cmp(&0.0);
    }
    let ((n0, d0), (n1, d1)) = (Exact::new(ray, p.1).fraction(), Exact::new(ray, q.1).fraction());
    let difference = sign(&(n0 * &d1 - n1 * &d0)) * sign(&d0) * sign(&d1);
    difference.cmp(&0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ray(origin: [f64; 3], direction: [f64; 3]) -> TruthRay {
        TruthRay::new(origin, direction, 0.0, f64::INFINITY)
    }

    const TRIANGLE: [[f64; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

    #[test]
    fn inside_on_edges_and_outside() {
        let hit = crossing(&ray([0.25, 0.5, 3.0], [0.0, 0.0, -2.0]), TRIANGLE).unwrap();
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
            assert_eq!(crossing(&ray([x, y, 1.0], [0.0, 0.0, -1.0]), TRIANGLE).is_some(), met, "{x} {y}");
            let [a, b, c] = TRIANGLE;
            assert_eq!(crossing(&ray([x, y, 1.0], [0.0, 0.0, -1.0]), [c, b, a]).is_some(), met, "{x} {y}");
        }
        assert!(crossing(&ray([-1.0, 0.25, 0.0], [1.0, 0.0, 0.0]), TRIANGLE).is_none(), "in the plane");
    }

    #[test]
    fn signs_hold_far_from_the_origin() {
        // The edge x = y from 2^30 on, a point 2^-20 beside it, seen from a reference point far away.
        let far = 2.0f64.powi(30);
        let triangle = [[far, far, 0.0], [far + 1.0, far + 1.0, 0.0], [far, far + 1.0, 0.0]];
        let beside = 2.0f64.powi(-20);
        for (shift, met) in [(0.0, true), (beside, true), (-beside, false)] {
            let ray = TruthRay {
                reference: [-3.0 * far, 5.0 * far, 0.0],
                origin: [4.0 * far + 0.5, 0.5 - 4.0 * far + shift, 1.0],
                ..ray([0.0; 3], [0.0, 0.0, -1.0])
            };
            assert_eq!(crossing(&ray, triangle).is_some(), met, "{shift}");
        }
    }

    #[test]
    fn order_is_exact() {
        // Two triangles of the plane z = x / 3 meet the ray at one point, a third lies 2^-50 below.
        let plane = |x: f64, y: f64| [3.0 * x, y, x];
        let p = [plane(-5.0, -7.0), plane(11.0, 0.0), plane(-1.0, 13.0)];
        let q = [plane(-6.0, -2.0), plane(7.0, -3.0), plane(1.0, 17.0)];
        let lower = q.map(|[x, y, z]| [x, y, z - 2.0f64.powi(-48)]);
        let ray = ray([0.7, 0.1, 9.3], [0.01, 0.02, -0.7]);
        let at = |t| crossing(&ray, t).unwrap();
        assert_eq!(order(&ray, (&at(p), p), (&at(q), q)), Ordering::Equal);
        assert_eq!(order(&ray, (&at(p), p), (&at(lower), lower)), Ordering::Less);
        assert_eq!(order(&ray, (&at(lower), lower), (&at(p), p)), Ordering::Greater);
    }
}
