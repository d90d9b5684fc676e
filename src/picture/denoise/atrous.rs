//! The edge-avoiding à-trous wavelet: five levels of a 5x5 B-spline with holes, 1, 2, 4, 8 and 16 pixels apart.

use super::grid::Grid;
use crate::frame::Seen;
use crate::picture::color::{difference, size};

/// Levels; the pixels of level k are 2^k apart.
pub const LEVELS: u32 = 5;
/// The cubic B-spline's weights by distance.
const SPLINE: [f32; 3] = [3.0 / 8.0, 1.0 / 4.0, 1.0 / 16.0];
/// The Gaussian of 3 x 3 pixels that smooths variances, by distance.
const GAUSS: [f32; 2] = [0.5, 0.25];

/// Widths of a pixel that a point may be off a plane, for each pixel between them, and count as on it: of the first
/// frame...
const PLANE_FIRST: f32 = 0.25;
/// ... and the least. The more frames an average has, the less it needs of what lies around, and edges stay sharp.
const PLANE_LEAST: f32 = 0.06;

/// Light and its variance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lit {
    /// Light divided by the albedo.
    pub color: [f32; 3],
    /// Variance of the estimate as it stands, of all channels ([`size`]).
    pub variance: f32,
    /// Whether samples are too few to tell it: then colour tells nothing apart.
    pub is_young: bool,
    /// Frames in the average, at least 1.
    pub length: f32,
}

/// Weight of normals: cos^32 of the angle between them.
fn of_normals(a: &Seen, b: &Seen) -> f32 {
    let mut cosine = a.normal.dot(b.normal).max(0.0);
    for _ in 0..5 {
        cosine *= cosine;
    }
    cosine
}

fn smooth_variance(grid: &Grid, seen: &[Seen], lit: &[Lit], pixel: usize) -> f32 {
    let (x, y) = grid.position(pixel);
    let (mut sum, mut weights) = (0.0, 0.0);
    for other in grid.around(pixel, 1).filter(|&other| other == pixel || seen[pixel].is_same_surface(&seen[other])) {
        let (ox, oy) = grid.position(other);
        let weight = GAUSS[(ox - x).unsigned_abs() as usize] * GAUSS[(oy - y).unsigned_abs() as usize];
        sum += weight * lit[other].variance;
        weights += weight;
    }
    sum / weights
}

/// One level. Pixels without variance around them stay as they are, but for young ones. `tolerance`: standard
/// deviations of colour that count as alike.
pub fn level(grid: &Grid, seen: &[Seen], lit: &[Lit], level: u32, tolerance: f32) -> Vec<Lit> {
    let step = 1i32 << level;
    grid.map(|pixel| {
        let (own, surface) = (lit[pixel], &seen[pixel]);
        if !surface.is_hit() {
            return own;
        }
        let variance = smooth_variance(grid, seen, lit, pixel);
        if variance <= 0.0 && !own.is_young {
            return own;
        }
        let per_size = if own.is_young { 0.0 } else { 1.0 / (tolerance * variance.sqrt() + 1e-12) };
        let plane = (PLANE_FIRST / own.length).max(PLANE_LEAST);
        let (x, y) = grid.position(pixel);
        let mut sum = [0.0f32; 3];
        let (mut variances, mut weights) = (0.0f32, 0.0f32);
        for (dx, dy) in (-2i32..=2).flat_map(|dy| (-2i32..=2).map(move |dx| (dx, dy))) {
            let Some(other) = grid.at(x + dx * step, y + dy * step).filter(|&other| seen[other].is_hit()) else {
                continue;
            };
            let mut weight = SPLINE[dx.unsigned_abs() as usize] * SPLINE[dy.unsigned_abs() as usize];
            if other != pixel {
                let distance = dx.abs().max(dy.abs()) as f32 * step as f32;
                let off = surface.off_plane(&seen[other]) / (plane * distance);
                let apart = size(difference(lit[other].color, own.color)) * per_size;
                weight *= of_normals(surface, &seen[other]) * (-off - apart).exp();
            }
            for (sum, c) in sum.iter_mut().zip(lit[other].color) {
                *sum += weight * c;
            }
            variances += weight * weight * lit[other].variance;
            weights += weight;
        }
        // The pixel itself has a weight of 9/64.
        let (color, variance) = (sum.map(|x| x / weights), variances / (weights * weights));
        Lit { color, variance, ..own }
    })
}
