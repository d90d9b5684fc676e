//! Light that changes: the long average gives way to the short one. The test radius, the chance and the
//! length of the long average are those of thirteen settings that leave the least error ten frames after the sun of
//! `tests/it/shading/post.rs` jumps, among those with which its still view is no worse. They were chosen on that scene,
//! so it does not confirm them.

use super::grid::Grid;
use crate::frame::Seen;
use crate::picture::color::{lerp, luminance};

/// Neighbourhood of the test for change, pixels to each side.
const TEST_RADIUS: i32 = 5;
/// Neighbourhood that bounds the long average, pixels to each side.
const BOUND_RADIUS: i32 = 2;
/// Standard errors that a difference may have by chance.
const CHANCE: f32 = 1.5;
/// Standard deviations about the mean of the short average within which the long one is held.
const DEVIATIONS: f32 = 2.0;
/// Fewer pixels tell nothing.
const LEAST_PIXELS: u32 = 5;

/// The averages of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Averages {
    /// Over many frames.
    pub long: [f32; 3],
    /// Over the last few.
    pub short: [f32; 3],
}

/// How much of the difference of the averages around `pixel` is more than chance, 0 to 1. Differences are taken pixel
/// by pixel: what both averages show there falls out.
pub fn change(grid: &Grid, seen: &[Seen], averages: &[Averages], pixel: usize) -> f32 {
    let (mut count, mut mean, mut squares) = (0u32, 0.0f32, 0.0f32);
    for other in grid.around(pixel, TEST_RADIUS).filter(|&other| seen[pixel].is_same_surface(&seen[other])) {
        let d = luminance(averages[other].short) - luminance(averages[other].long);
        count += 1;
        let delta = d - mean;
        mean += delta / count as f32;
        squares += delta * (d - mean);
    }
    if count < LEAST_PIXELS || mean == 0.0 {
        return 0.0;
    }
    let variance = squares.max(0.0) / (count - 1) as f32;
    (1.0 - CHANCE * (variance / count as f32).sqrt() / mean.abs()).clamp(0.0, 1.0)
}

/// The long average of `pixel`, moved to the short one by the share `change` and held near the short ones around it.
pub fn held(grid: &Grid, seen: &[Seen], averages: &[Averages], pixel: usize, change: f32) -> [f32; 3] {
    let (mut count, mut mean, mut squares) = (0u32, [0.0f32; 3], [0.0f32; 3]);
    for other in grid.around(pixel, BOUND_RADIUS).filter(|&other| seen[pixel].is_same_surface(&seen[other])) {
        count += 1;
        for k in 0..3 {
            let x = averages[other].short[k];
            let delta = x - mean[k];
            mean[k] += delta / count as f32;
            squares[k] += delta * (x - mean[k]);
        }
    }
    let moved = lerp(averages[pixel].long, averages[pixel].short, change);
    if count < LEAST_PIXELS {
        return moved;
    }
    [0, 1, 2].map(|k| {
        let reach = DEVIATIONS * (squares[k].max(0.0) / (count - 1) as f32).sqrt();
        moved[k].clamp(mean[k] - reach, mean[k] + reach)
    })
}
