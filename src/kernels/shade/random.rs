//! Points and directions from random numbers: twin of `shaders/common/random.wgsl`, whose hashes are those of
//! [`crate::math::sampling`].

use crate::kernels::vector::{Vec3, cross, normalize};
use crate::math::sines::sin_cos;
use std::f32::consts::FRAC_PI_4;

/// The kernel's literal, the f32 below the nearest to pi / 2.
#[expect(clippy::approx_constant, reason = "the next f32 is nearer, and it is not the kernel's")]
const HALF_PI: f32 = 1.570_796_3;

/// Shirley and Chiu's concentric map of the unit square to the unit disc.
pub fn disc_point(r: [f32; 2]) -> [f32; 2] {
    let p = r.map(|x| 2.0 * x - 1.0);
    if p[0] == 0.0 && p[1] == 0.0 {
        return [0.0; 2];
    }
    let is_along_x = p[0].abs() > p[1].abs();
    let (radius, angle) =
        if is_along_x { (p[0], FRAC_PI_4 * p[1] / p[0]) } else { (p[1], HALF_PI - FRAC_PI_4 * p[0] / p[1]) };
    let [[sine], [cosine]] = sin_cos([angle]);
    [radius * cosine, radius * sine]
}

/// A unit vector orthogonal to the unit vector n.
pub fn tangent(n: Vec3) -> Vec3 {
    let axis = if n[0].abs() > 0.7 { [0.0, 1.0, 0.0] } else { [1.0, 0.0, 0.0] };
    normalize(cross(n, axis))
}
