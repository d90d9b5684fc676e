//! Twin of `shaders/denoise/denoise_filter.wgsl`: one level of the edge-avoiding à-trous wavelet, a 5x5 B-spline with
//! holes.

use super::buffers::{Buffers, LAYERS};
use super::grid::{Grid, difference, divided, dot, is_same, off_plane, size};
use crate::kernels::layout::{DenoiseGiven, DenoiseLit, DenoiseOwn, DenoisePast, DenoiseSeen};
use crate::math::exact::{divide, square_root};
use rayon::prelude::*;

/// The cubic B-spline's weights by distance.
const SPLINE: [f32; 3] = [3.0 / 8.0, 1.0 / 4.0, 1.0 / 16.0];
/// The Gaussian of 3 x 3 pixels that smooths variances, by distance.
const GAUSS: [f32; 2] = [0.5, 0.25];
/// Widths of a pixel that a point may be off a plane, for each pixel between them, and count as on it: of the first
/// frame...
const PLANE_FIRST: f32 = 0.25;
/// ... and the least. The more frames an average has, the less it needs of what lies around, and edges stay sharp.
const PLANE_LEAST: f32 = 0.06;
/// 2^-40: less counts as nothing.
const LEAST_WEIGHT: f32 = 1.0 / (1u64 << 40) as f32;

/// exp(-x) of x >= 0 within 2^-20 of it, relative; 0 from 28 on and of what is no number.
fn exp_of_minus(x: f32) -> f32 {
    if x.is_nan() || x >= 28.0 {
        return 0.0;
    }
    let y = x * std::f32::consts::LOG2_E;
    let whole = (y + 0.5).floor();
    let g = whole - y;
    // 2^g of -0.5..0.5 by its series: ln(2)^k / k!.
    let series = [0.0013333558, 0.009618129, 0.05550411, 0.2402265, std::f32::consts::LN_2, 1.0];
    let p: f32 = series.into_iter().fold(0.0001540353, |p, coefficient| p * g + coefficient);
    f32::from_bits(p.to_bits() - ((whole as u32) << 23))
}

/// The 32nd power of the cosine between normals.
fn of_normals(a: [f32; 3], b: [f32; 3]) -> f32 {
    let mut cosine = dot(a, b).max(0.0);
    for _ in 0..5 {
        cosine *= cosine;
    }
    cosine
}

/// The unit vector along which a surface mirrors the view.
fn mirrored(s: &DenoiseSeen) -> [f32; 3] {
    let view = divided(s.point, square_root(dot(s.point, s.point)).max(f32::MIN_POSITIVE));
    let along = 2.0 * dot(view, s.normal);
    [0, 1, 2].map(|k| view[k] - along * s.normal[k])
}

fn smooth_variance(grid: Grid, seen: &[DenoiseSeen], lit: &[DenoiseLit], pixel: usize) -> f32 {
    let (x, y) = grid.position(pixel);
    let (mut sum, mut weights) = (0.0, 0.0);
    for other in grid.around(pixel, 1).filter(|&other| other == pixel || is_same(&seen[pixel], &seen[other])) {
        let (ox, oy) = grid.position(other);
        let weight = GAUSS[(ox - x).unsigned_abs() as usize] * GAUSS[(oy - y).unsigned_abs() as usize];
        sum += weight * lit[other].variance;
        weights += weight;
    }
    divide(sum, weights)
}

/// One pixel. Pixels without variance around them stay as they are, but for young ones.
fn filtered(
    own: &DenoiseOwn,
    (seen, given): (&[DenoiseSeen], &[DenoiseGiven]),
    lit: &[DenoiseLit],
    known: &DenoisePast,
    pixel: usize,
) -> Option<DenoiseLit> {
    let grid = Grid::new(own);
    let (mine, surface, is_young) = (&lit[pixel], &seen[pixel], known.young != 0);
    if !surface.is_hit() {
        return None;
    }
    let variance = smooth_variance(grid, seen, lit, pixel);
    if variance <= 0.0 && !is_young {
        return None;
    }
    let per_size = if is_young { 0.0 } else { divide(1.0, own.tolerance * square_root(variance) + 1e-12) };
    let plane = divide(PLANE_FIRST, known.length.max(1.0)).max(PLANE_LEAST);
    let per_length = divide(1.0, (plane * surface.footprint).max(f32::MIN_POSITIVE));
    let polish = given[pixel].polish;
    let way = if polish > 0.0 { mirrored(surface) } else { [0.0; 3] };
    let step = 1i32 << own.level;
    let (x, y) = grid.position(pixel);
    let mut sum = [0.0f32; 3];
    let (mut variances, mut weights) = (0.0f32, 0.0f32);
    for (dx, dy) in (-2i32..=2).flat_map(|dy| (-2i32..=2).map(move |dx| (dx, dy))) {
        let Some(other) = grid.at(x + dx * step, y + dy * step).filter(|&other| seen[other].is_hit()) else {
            continue;
        };
        let theirs = &lit[other];
        let mut weight = SPLINE[dx.unsigned_abs() as usize] * SPLINE[dy.unsigned_abs() as usize];
        if other != pixel {
            // Distances are powers of two.
            let per_distance = 1.0 / (dx.abs().max(dy.abs()) * step) as f32;
            let off = off_plane(surface, seen[other].point) * per_length * per_distance;
            let apart = size(difference(theirs.color, mine.color)) * per_size;
            let mut turned = 0.0;
            if polish > 0.0 {
                let by = difference(mirrored(&seen[other]), way);
                turned = square_root(dot(by, by)) * polish;
            }
            let unlike = off + apart + turned;
            weight = weight * of_normals(surface.normal, seen[other].normal) * exp_of_minus(unlike);
        }
        if weight.is_nan() || weight < LEAST_WEIGHT {
            continue;
        }
        sum = [0, 1, 2].map(|k| sum[k] + weight * theirs.color[k]);
        variances += weight * weight * theirs.variance;
        weights += weight;
    }
    // The pixel itself has a weight of 9/64.
    Some(DenoiseLit { color: divided(sum, weights), variance: divide(variances, weights * weights) })
}

/// One level over a layer. Levels read one half of the light and write the other; after the first, its colour is the
/// history's.
pub fn filter(own: &DenoiseOwn, buffers: &mut Buffers) {
    let (shown, pixels) = ((buffers.seen, buffers.given), Grid::new(own).pixels());
    let first = own.layer as usize * pixels;
    let (one, two) = buffers.lit.split_at_mut(LAYERS * pixels);
    let (lit, to) = if own.level.is_multiple_of(2) { (two, one) } else { (one, two) };
    let (lit, to, known) = (&lit[first..][..pixels], &mut to[first..][..pixels], &buffers.known[first..][..pixels]);
    let past = buffers.past[first..][..pixels].par_iter_mut();
    to.par_iter_mut().zip(past).enumerate().with_min_len(256).for_each(|(pixel, (to, past))| {
        let found = filtered(own, shown, lit, &known[pixel], pixel);
        *to = found.unwrap_or(lit[pixel]);
        if own.level == 0 {
            *past = known[pixel];
            past.long = found.map_or(past.long, |found| found.color);
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponentials_are_right() {
        for k in 0..28_000 {
            let x = k as f32 / 1000.0;
            let (found, truth) = (f64::from(exp_of_minus(x)), (-f64::from(x)).exp());
            assert!((found / truth - 1.0).abs() < 1.0 / f64::from(1 << 18), "exp(-{x}): {found} {truth}");
        }
        assert_eq!([28.0, f32::INFINITY, f32::NAN].map(exp_of_minus), [0.0; 3]);
        assert_eq!(exp_of_minus(0.0), 1.0);
    }
}
