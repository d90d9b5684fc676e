//! How far f32 arithmetic, as the kernels carry it out, can be from truth.
//!
//! Everything is in units of the triangle's object, relative to the ray's origin; u = 2⁻²⁴. The device's units differ
//! from these by powers of two, which round nothing. Bounds are to first order in u, times 1 + 2⁻¹⁶, which holds what
//! is left: each term of higher order is below 8 u times one that is counted.
//!
//! # What the kernel computes
//!
//! 1. *Vertices.* v = fl(p − R), whatever the form of the brick, then a = fl(v − o). Per component the error is
//!    at most u·abs(v) + u·abs(a). The ray of an instance is transformed first, o′ = fl(M o + c′) and d′ = fl(M d),
//!    with M = A⁻¹ and c′ = M (R − T) − R′ in f64, rounded to f32. M and three products and two sums of which take
//!    part: d′ is off by at most δd = 4u·abs(M)·abs(d) per component; o′, with one more sum and the rounding of c′, by
//!    δo = 5u·abs(M)·abs(o) + 2u·abs(c′), which adds to a. (These are worst cases of what was measured as
//!    3.5 u κ and 3.7 u κ (abs(o) + abs(c)) in world space.) What f64 itself rounds for the instance is added too.
//! 2. *Shear.* x = fl(a_x − fl(S·a_z)), S = fl(d_x · iz), iz = fl(1 / d_z), along the axis z of the largest component
//!    of d. S is off by δS = (δd_x + abs(S)·δd_z) / (abs(d_z) − δd_z) + 2u·abs(S), and x by
//!
//!    e_x = δa_x + abs(S)·δa_z + δS·abs(a_z) + u·abs(S·a_z) + u·abs(x) + 2⁻⁶⁰·abs(a_z)
//!
//!    (the last because shears below 2⁻⁶⁰ are taken as 0). If another component of d is within δd of the largest, the
//!    kernel may shear along that axis; distances across both planes differ by at most the norm of the map between
//!    them, (1 + √5) / 2.
//! 3. *Edge values* have exact signs for the sheared coordinates that the kernel has. So it decides exactly whether the
//!    origin of the sheared plane, which is the ray, lies in the closed triangle of *perturbed* vertices.
//! 4. *Distance.* t = fl(fl(Σ U z / Σ U) iz), clamped to the slab of the perturbed triangle grown by 32 u times its
//!    largest coordinate.
//!
//! # ε_edge
//!
//! Let E = max over the vertices of √(e_x² + e_y²). If the vertices move along straight lines from truth to what the
//! kernel has, every point of the boundary moves by at most E. The answer "inside" changes only when the boundary
//! passes over the origin. So kernel and truth agree unless the true triangle's boundary comes within ε_edge = E of the
//! ray, measured across axis z, along the ray. This holds for any shape of triangle.
//!
//! # The interval of t
//!
//! An accepted perturbed triangle has weights w ≥ 0 with Σ w (x + δx) = 0. The exact plane has at q = Σ w x the height
//! Σ w z, and abs(q) ≤ E; so the perturbed height differs from the true one at the origin by at most
//! abs(g)·E + E_z with g the gradient of z over the sheared plane and E_z = max δa_z. Rounding the edge values moves it
//! further: each U is off by η ≤ u (abs(c_x b_y) + abs(c_y b_x) + abs(U)), which moves Σ U z / Σ U by at most Σ η times
//! the extent of z over Σ U, a Σ U that is no less than abs(det) − E·perimeter − 3E² − Σ η. Rounding products, sums,
//! quotient and the product with iz adds 3 + 2 + 1 + 2 units of u, taken as 9 u·max abs(z); an instance's direction
//! abs(t)·δd_z / abs(d_z).
//!
//! Whatever the plane's slope, the clamp keeps z within the extent of the perturbed triangle, 32 u of padding and 4 u
//! of rounding. It never moves t away from the perturbed triangle's own distance, which lies within. The two intervals
//! are intersected; if Σ U may vanish only the second one stands.
//!
//! # Boxes
//!
//! Of a triangle only its world box is known. Let V and A be the greatest distances of a point of the box from the
//! reference point R and from the ray's origin (Euclidean, world units), so that abs(v) ≤ V and abs(a) ≤ A for its
//! vertices. Every term of ε_edge grows with these. With abs(S) ≤ 1, e = (e_x, e_y) has at most the length
//! (1 + √2) abs(δa) + √2 (δS + u) abs(a_z) + u (1 + √2) abs(a).
//!
//! *Identity.* abs(δa) ≤ u (V + A) and δS ≤ 2u, so that 4 ε_edge ≤ 4 · 1.6181 · u (2.42 V + 9.1 A) < 16u V + 64u A.
//!
//! *Instances.* In object units, with the Frobenius norms s of A and m of M and κ = s m ≥ 3: abs(a) ≤ m A. The
//! reference point R′ of the instance is the lattice point nearest to M (R − T), held per component to an interval
//! around the object, which p is in; so abs(v) and abs(c′) are at most m V + √3/2 cell. With abs(o) ≤ V + A, abs(δa) ≤
//! u (m (8 V + 6 A) + 2.6 cell). The dominant component of d in the object is at least abs(d) / (√3 s) of the world's,
//! so that δd / d_z ≤ 4√3 u κ plus √3 `NOISE` κ²; be this at most φ; then δS ≤ 2 φ / (1 − φ) + 2u. Times s gives world
//! units, and 4 ε_edge is below u κ (128 V + 144 A) + 20 κ φ / (1 − φ) A + 48 u s cell, plus what f64 rounds: 4 ·
//! 1.6181 · (1 + √2) · √3 `NOISE` (κ² (abs(R) + abs(T) + abs(o) + s abs(p)) + s abs(R′)).
//!
//! A point of the boundary within 4 ε_edge across an axis has a point of the ray at the same height, so no farther than
//! that; this point of the ray is in the box grown by as much. And a kernel's hit, clamped, is within the perturbed
//! triangle's slabs grown by 36 u abs(a), and so in the grown box as well (φ abs(a) more for instances).

use super::assessment::{Assessment, SLACK, distance_to_segment, orientation, perimeter};
use super::bvh::Padding;
use super::instance::{Extremes, frobenius, linear, translation};
use super::ray::TruthRay;
use super::truth::Truth;
use crate::math::crossing::crossing;
use bricks::ORIGIN_STEPS;
use glam::{DMat3, DVec3};

/// u = 2⁻²⁴.
const U: f64 = 1.0 / 16_777_216.0;
/// f64's own rounding in transforming by an instance, relative to the sizes that take part: 2⁻⁴⁸ per unit of the ratio
/// of scales.
const NOISE: f64 = f64::EPSILON * 16.0;
/// Norm of the map between the sheared planes of two axes along which the direction is equally long.
const OTHER_AXIS: f64 = 1.618_033_988_749_895;

/// A ray and a triangle in the triangle's object, with the bounds of step 1.
struct Local {
    /// Vertices relative to the ray's origin.
    a: [[f64; 3]; 3],
    /// Bound of their error.
    a_error: [[f64; 3]; 3],
    d: [f64; 3],
    /// Bound of its error.
    d_error: [f64; 3],
}

impl Local {
    fn new(truth: &Truth, ray: &TruthRay, index: usize) -> Self {
        let (instance, object, triangle) = truth.stored(index);
        let step = f64::from(object.step_log2).exp2();
        let vertices = triangle.vertices.map(|v| v.map(|x| x as f64 * step));
        let Some(m) = &instance.world_from_object else {
            let frame = Frame { reference: ray.reference, origin: ray.origin, origin_error: [0.0; 3] };
            let [first, second, third] = vertices.map(|p| frame.vertex(p));
            return Self {
                a: [first.0, second.0, third.0],
                a_error: [first.1, second.1, third.1],
                d: ray.direction,
                d_error: [0.0; 3],
            };
        };
        let (linear, translation) = (linear(m), translation(m));
        let inverse = linear.inverse();
        let magnitude = DMat3::from_cols(inverse.x_axis.abs(), inverse.y_axis.abs(), inverse.z_axis.abs());
        let (reference, o, d) = (DVec3::from(ray.reference), DVec3::from(ray.origin), DVec3::from(ray.direction));
        let cell = step * ORIGIN_STEPS as f64;
        let offset = inverse * (reference - translation);
        let object_reference = DVec3::from(std::array::from_fn(|k| {
            let [low, high] = object.bounds.map(|bound| bound[k].div_euclid(ORIGIN_STEPS) as f64);
            (offset[k] / cell).round().clamp(low - 1.0, high + 1.0) * cell
        }));
        let c = offset - object_reference;

        let (size, inverse_size) = (frobenius(&linear), frobenius(&inverse));
        let far = vertices.iter().map(|&p| DVec3::from(p).length()).fold(0.0, f64::max);
        let reach = reference.length() + translation.length() + o.length() + size * far;
        let noise = NOISE * size * inverse_size * inverse_size * reach + NOISE * object_reference.length();
        let origin_error = 5.0 * U * (magnitude * o.abs()) + 2.0 * U * c.abs() + DVec3::splat(noise);
        let d_noise = NOISE * size * inverse_size * inverse_size * d.length();
        let d_error = 4.0 * U * (magnitude * d.abs()) + DVec3::splat(d_noise);

        let frame = Frame {
            reference: object_reference.to_array(),
            origin: (inverse * o + c).to_array(),
            origin_error: origin_error.to_array(),
        };
        let [first, second, third] = vertices.map(|p| frame.vertex(p));
        Self {
            a: [first.0, second.0, third.0],
            a_error: [first.1, second.1, third.1],
            d: (inverse * d).to_array(),
            d_error: d_error.to_array(),
        }
    }
}

/// The frame in which the kernel subtracts.
struct Frame {
    reference: [f64; 3],
    origin: [f64; 3],
    origin_error: [f64; 3],
}

impl Frame {
    /// A vertex relative to the ray's origin, and the bound of its error.
    fn vertex(&self, p: [f64; 3]) -> ([f64; 3], [f64; 3]) {
        let v: [f64; 3] = std::array::from_fn(|k| p[k] - self.reference[k]);
        let a: [f64; 3] = std::array::from_fn(|k| v[k] - self.origin[k]);
        (a, std::array::from_fn(|k| U * v[k].abs() + U * a[k].abs() + self.origin_error[k]))
    }
}

/// What a kernel can make of `ray` and the triangle with this index.
pub(super) fn assess_index(truth: &Truth, ray: &TruthRay, index: usize) -> Assessment {
    let local = Local::new(truth, ray, index);
    let met = crossing(&ray.line(), truth.world_vertices(index));
    let size = local.d.map(f64::abs);
    let kz = (0..3).fold(0, |best, k| if size[k] > size[best] { k } else { best });
    let (kx, ky) = ((kz + 1) % 3, (kz + 2) % 3);
    // Less its error, so that dividing by it bounds; 0 only for matrices that leave no digit of the direction.
    let dz = (size[kz] - local.d_error[kz]).max(f64::MIN_POSITIVE);
    let tied = [kx, ky].iter().any(|&k| size[k] + local.d_error[k] >= dz);

    let shear = [kx, ky].map(|k| local.d[k] / local.d[kz]);
    let shear_error: [f64; 2] = std::array::from_fn(|i| {
        let k = [kx, ky][i];
        (local.d_error[k] + shear[i].abs() * local.d_error[kz]) / dz + 2.0 * U * shear[i].abs()
    });
    let z = local.a.map(|a| a[kz]);
    let z_error = local.a_error.iter().map(|e| e[kz]).fold(0.0, f64::max);
    let sheared = local.a.map(|a| [a[kx] - shear[0] * a[kz], a[ky] - shear[1] * a[kz]]);
    let error = |vertex: usize, i: usize| {
        let (a_error, az) = (local.a_error[vertex], z[vertex].abs());
        let s = shear[i].abs();
        let moved = a_error[[kx, ky][i]] + s * a_error[kz] + shear_error[i] * az;
        moved + U * s * az + U * sheared[vertex][i].abs() + az * 2.0f64.powi(-60)
    };
    let e = SLACK * (0..3).map(|vertex| error(vertex, 0).hypot(error(vertex, 1))).fold(0.0, f64::max);
    let edge_epsilon = if tied { OTHER_AXIS * e } else { e };
    let edge_distance =
        (0..3).map(|i| distance_to_segment(sheared[i], sheared[(i + 1) % 3])).fold(f64::INFINITY, f64::min);

    // The clamp: z within the triangle.
    let (z_low, z_high) = (z[0].min(z[1]).min(z[2]), z[0].max(z[1]).max(z[2]));
    let largest = local.a.iter().flatten().fold(0.0f64, |m, x| m.max(x.abs()));
    let z_pad = z_error + 36.0 * U * (largest + local.a_error.iter().flatten().fold(0.0, |m: f64, &x| m.max(x)));
    let direction_error = local.d_error[kz] / dz;
    let at = |z: f64, pad: f64| {
        let t = z / local.d[kz];
        let error = (pad / dz + t.abs() * (direction_error + 1e-12)) * SLACK;
        [t - error, t + error]
    };
    let ends = [at(z_low, z_pad), at(z_high, z_pad)];
    let clamped = [ends[0][0].min(ends[1][0]), ends[0][1].max(ends[1][1])];

    // The plane.
    let edge_value = |i: usize| {
        let (p, q) = (sheared[(i + 1) % 3], sheared[(i + 2) % 3]);
        let larger = |x: f64| x.abs() + e;
        let products = larger(p[0]) * larger(q[1]) + larger(p[1]) * larger(q[0]);
        (p[0] * q[1] - p[1] * q[0], U * SLACK * 2.0 * products)
    };
    let edges = [edge_value(0), edge_value(1), edge_value(2)];
    let rounding: f64 = edges.iter().map(|edge| edge.1).sum();
    let determinant = orientation(sheared[0], sheared[1], sheared[2]);
    let least = determinant.abs() - SLACK * (perimeter(&sheared) * e + 3.0 * e * e) - rounding;
    let mut interval = clamped;
    if least > 0.0 {
        let height = match &met {
            Some(crossing) => crossing.t * local.d[kz],
            None => (0..3).map(|i| edges[i].0 * z[i]).sum::<f64>() / determinant,
        };
        let [p, q] = [1, 2].map(|i| [sheared[i][0] - sheared[0][0], sheared[i][1] - sheared[0][1]]);
        let (zp, zq) = (z[1] - z[0], z[2] - z[0]);
        let slope = ((zp * q[1] - zq * p[1]) / determinant).hypot((zq * p[0] - zp * q[0]) / determinant);
        let extent = z_high - z_low + 2.0 * z_error;
        let greatest = z.iter().fold(z_error, |m: f64, z| m.max(z.abs() + z_error));
        let [low, high] = at(height, slope * e + z_error + rounding * extent / least + 9.0 * U * greatest);
        let both = [low.max(clamped[0]), high.min(clamped[1])];
        if both[0] <= both[1] {
            interval = both;
        }
    }
    let [t_low, t_high] = interval;
    Assessment { inside: met.is_some(), edge_distance, edge_epsilon, t_low, t_high, sheared }
}

/// What a kernel can make of `ray` and triangle `id`; `None` if there is no such triangle.
pub fn assess(truth: &Truth, ray: &TruthRay, id: u32) -> Option<Assessment> {
    truth.find(id).map(|index| assess_index(truth, ray, index))
}

/// By how much boxes must be grown so that the ray meets the box of every triangle that comes within four times its own
/// ε_edge of the ray, and of every triangle that a kernel may find (see "Boxes" above).
pub(super) fn padding(truth: &Truth, ray: &TruthRay) -> Padding {
    let Extremes { scale_ratio: k, cell, reach } = truth.extremes;
    if k == 0.0 {
        return Padding { per_reference: 16.0 * U, per_origin: 64.0 * U, constant: 0.0 };
    }
    let share = 7.0 * U * k + 2.0 * NOISE * k * k;
    let turned = if share < 1.0 { share / (1.0 - share) } else { f64::INFINITY };
    let length = |v: [f64; 3]| DVec3::from(v).length();
    Padding {
        per_reference: 128.0 * U * k,
        per_origin: k * (144.0 * U + 20.0 * turned),
        constant: 48.0 * U * cell + 32.0 * NOISE * k * k * (length(ray.reference) + length(ray.origin) + reach),
    }
}
