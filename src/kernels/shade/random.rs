//! Points and directions from random numbers: twin of `shaders/common/random.wgsl`, whose hashes are those of
//! [`crate::math::sampling`].

use crate::kernels::vector::{Vec3, cross, normalize};
use crate::math::sines::sin_cos;
use std::f32::consts::FRAC_PI_4;

/// The kernel's literal, the f32 below the nearest to pi / 2.
#[expect(clippy::approx_constant, reason = "the next f32 is nearer, and it is not the kernel's")]
const HALF_PI: f32 = 1.570_796_3;

/// Shirley and Chiu's concentric map of the unit square to the unit disc, of several points, number by number.
#[inline(always)]
pub fn disc_points<const N: usize>(r: [[f32; N]; 2]) -> [[f32; N]; 2] {
    let p = r.map(|r| r.map(|x| 2.0 * x - 1.0));
    let (mut radius, mut angle) = ([0.0; N], [0.0; N]);
    for k in 0..N {
        let (x, y) = (p[0][k], p[1][k]);
        let is_along_x = x.abs() > y.abs();
        let (along, across) = if is_along_x { (x, y) } else { (y, x) };
        let turn = FRAC_PI_4 * across / along;
        radius[k] = along;
        angle[k] = if is_along_x { turn } else { HALF_PI - turn };
    }
    let [sines, cosines] = sin_cos(angle);
    let scaled = |by: [f32; N]| std::array::from_fn(|k| if radius[k] == 0.0 { 0.0 } else { radius[k] * by[k] });
    [scaled(cosines), scaled(sines)]
}

/// A unit vector orthogonal to the unit vector n.
#[inline(always)]
pub fn tangent(n: Vec3) -> Vec3 {
    let axis = if n[0].abs() > 0.7 { [0.0, 1.0, 0.0] } else { [1.0, 0.0, 0.0] };
    normalize(cross(n, axis))
}
