//! Fireflies: single pixels far brighter than their neighbours.

use super::grid::Grid;
use crate::frame::Seen;
use crate::picture::color::size;

/// Neighbours are looked for so far away, pixels: where one ray in thirty finds light, nine of ten that do have another
/// among 80.
const RADIUS: i32 = 4;
/// Fewer neighbours on the same surface say nothing.
const LEAST_NEIGHBOURS: u32 = 4;
/// Standard deviations of the neighbours above their mean that a pixel may have.
const DEVIATIONS: f32 = 4.0;

/// The greatest size that the neighbours of `pixel` on the same surface allow it; infinite where they say nothing.
/// It is at least that of the brightest of them, and the `brightest` that each of them had in the frames before: what
/// is rare but comes again is light.
pub fn limit(grid: &Grid, seen: &[Seen], light: &[Option<[f32; 3]>], brightest: &[f32], pixel: usize) -> f32 {
    let (mut count, mut mean, mut squares, mut most) = (0u32, 0.0f32, 0.0f32, 0.0f32);
    for other in grid.around(pixel, RADIUS).filter(|&other| other != pixel) {
        let Some(color) = light[other].filter(|_| seen[pixel].is_same_surface(&seen[other])) else { continue };
        let l = size(color);
        count += 1;
        let delta = l - mean;
        mean += delta / count as f32;
        squares += delta * (l - mean);
        most = most.max(l).max(brightest[other]);
    }
    if count < LEAST_NEIGHBOURS {
        return f32::INFINITY;
    }
    let deviation = (squares / (count - 1) as f32).max(0.0).sqrt();
    (mean + DEVIATIONS * deviation).max(most)
}
