//! How wide the cones of rays are that each have a width of their own: twin of `shaders/shade/cones.wgsl`.

use crate::kernels::bound::Bound;
use crate::kernels::layout::Surface;
use crate::kernels::vector::{Vec3, dot, each, least};
use std::f32::consts::PI;

/// One of so many rays stands for its share of what is around.
pub const RAYS_AROUND: f32 = 100.0;

/// Square of the angle of one of them that is cosine-weighted, along the normal. No cone is wider.
pub const WIDEST: f32 = PI / RAYS_AROUND;

/// What no square exceeds whatever the tolerance: [`Surface::pending`] has room for no more.
const MOST_SPREAD: f32 = 1.0;

/// Has the cone of a ray that was just started from a surface of such a curvature spread by an angle, given squared,
/// and by the curvature; see the kernel.
pub fn widen(bound: &Bound, surface: &mut Surface, origin: Vec3, square: f32, curvature: f32) {
    if bound.has_levels() {
        let [at_origin, _, tolerance, _] = bound.params.levels;
        let way = each(|k| origin[k] - bound.params.origin[k]);
        let of_curve = at_origin * dot(way, way) * curvature;
        let square = least(tolerance * square + of_curve, tolerance * WIDEST);
        surface.pending |= least(square, MOST_SPREAD).to_bits() << 1;
    }
}

/// The square of the angle of a ray drawn by a density over solid angles, from a lobe with the square `alpha` of a
/// roughness; see the kernel.
pub fn reflected(density: f32, alpha: f32) -> f32 {
    least(1.0 / (RAYS_AROUND * density), alpha * alpha)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lobes_widen_and_mirrors_do_not() {
        // A cosine-weighted ray along the normal has a density of 1 / pi.
        assert!((reflected(1.0 / PI, 1.0) / WIDEST - 1.0).abs() < 1e-6);
        // The middle of a lobe seen along the normal: 1 / (4 pi alpha^2).
        let middle = |alpha: f32| reflected(1.0 / (4.0 * PI * alpha * alpha), alpha).sqrt();
        for alpha in [0.01, 0.1, 0.4] {
            assert!((middle(alpha) / alpha - 0.354_5).abs() < 1e-3, "{alpha}: {}", middle(alpha));
        }
        // Far from the middle of a mirror's lobe, where nearly no ray is drawn.
        assert_eq!(reflected(1e-6, 0.001).sqrt(), 0.001);
    }
}
