//! Points and directions from random numbers: twin of `shaders/common/random.wgsl`, whose hashes are those of
//! [`crate::math::sampling`].

use crate::kernels::vector::{Vec3, cross, normalize};
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
    if p[0].abs() > p[1].abs() {
        let a = FRAC_PI_4 * p[1] / p[0];
        return [p[0] * a.cos(), p[0] * a.sin()];
    }
    let a = HALF_PI - FRAC_PI_4 * p[0] / p[1];
    [p[1] * a.cos(), p[1] * a.sin()]
}

/// A unit vector orthogonal to the unit vector n.
pub fn tangent(n: Vec3) -> Vec3 {
    let axis = if n[0].abs() > 0.7 { [0.0, 1.0, 0.0] } else { [1.0, 0.0, 0.0] };
    normalize(cross(n, axis))
}
