//! Directions of many rays at once: those of the sun's disc, and around normals. Twin of the same in
//! `shaders/shade/generate_shadow.wgsl` and `generate_around.wgsl`.

use super::random::{disc_points, tangent};
use crate::kernels::bound::Bound;
use crate::kernels::layout::{Origin, PARAM_BOUNCE, PARAM_SCATTER};
use crate::kernels::simd::isa::{Isa, Work};
use crate::kernels::vector::{Vec3, cross, most, normalize};
use crate::math::exact::barrier;
use crate::math::sampling::{pcg, points2_of};
use crate::math::sines::sin_cos;

/// Rays whose directions are made at once.
pub const RUN: usize = 16;

/// A number of each ray of a run.
pub type Column = [f32; RUN];

/// Points of the sun's disc of radius 1 for rays from number `first` on, x and y.
pub struct OfDisc<'a, 'b> {
    /// What is bound.
    pub bound: &'a Bound<'b>,
    /// Number of the first ray.
    pub first: usize,
    /// Where rays of bounces come from.
    pub origins: &'a [Origin],
}

impl Work for OfDisc<'_, '_> {
    type Out = [Column; 2];

    #[inline(always)]
    fn run<I: Isa>(self, _: I) -> [Column; 2] {
        let Self { bound, first, origins } = self;
        let p = bound.params;
        disc_points(points2_of(pixels(bound, first, origins), p.stream, p.seed))
    }
}

/// The pass's direction around normals, turned about them at random within limits, or scattered over the hemisphere,
/// for rays from number `first` on.
pub struct Around<'a, 'b> {
    /// What is bound.
    pub bound: &'a Bound<'b>,
    /// Number of the first ray.
    pub first: usize,
    /// Where rays of bounces come from.
    pub origins: &'a [Origin],
    /// Unit vectors, component by component.
    pub normals: [Column; 3],
}

impl Work for Around<'_, '_> {
    type Out = [Column; 3];

    #[inline(always)]
    fn run<I: Isa>(self, _: I) -> [Column; 3] {
        let Self { bound, first, origins, normals } = self;
        let (p, is_scattered) = (bound.params, bound.has(PARAM_SCATTER));
        let mut pixels = pixels(bound, first, origins);
        if bound.has(PARAM_BOUNCE) {
            // Of their own in every direction that their paths begin with.
            for (k, pixel) in pixels.iter_mut().enumerate() {
                *pixel ^= pcg(origins[(first + k).min(origins.len() - 1)].direction.wrapping_add(1));
            }
        }
        let [turns, heights] = points2_of(pixels, p.stream, p.seed);
        let a = p.around;
        let [sines, cosines] = sin_cos(turns.map(|turn| a[3] * turn));
        // The same bits everywhere: near 1 the height of the direction is sensitive to them.
        let squared = barrier(barrier(a[0] * a[0]) + barrier(a[1] * a[1]));
        let mut out = [[0.0; RUN]; 3];
        for k in 0..RUN {
            let moved = barrier(squared + heights[k]).fract();
            let scale = if is_scattered { (moved / most(squared, 1e-6)).sqrt() } else { 1.0 };
            let up = if is_scattered { (1.0 - moved).sqrt() } else { a[2] };
            let (a0, a1) = (scale * a[0], scale * a[1]);
            let (s, c) = (sines[k], cosines[k]);
            let turned = [c * a0 - s * a1, s * a0 + c * a1, up];
            let n = [normals[0][k], normals[1][k], normals[2][k]];
            let d = around(turned, n);
            (out[0][k], out[1][k], out[2][k]) = (d[0], d[1], d[2]);
        }
        out
    }
}

/// A direction about z as one about n.
#[inline(always)]
fn around(d: Vec3, n: Vec3) -> Vec3 {
    let x = tangent(n);
    let y = cross(n, x);
    normalize([0, 1, 2].map(|k| d[0] * x[k] + d[1] * y[k] + d[2] * n[k]))
}

/// Pixels of the rays of a run; beyond the last ray, anything.
#[inline(always)]
fn pixels(bound: &Bound, first: usize, origins: &[Origin]) -> [u32; RUN] {
    std::array::from_fn(|k| {
        let index = if bound.has(PARAM_BOUNCE) { (first + k).min(origins.len() - 1) } else { first + k };
        bound.pixel_of(index, origins)
    })
}
