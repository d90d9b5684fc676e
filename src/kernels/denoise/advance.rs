//! Twin of `shaders/denoise/denoise_advance.wgsl`: cuts fireflies, and takes light into the averages.

use super::buffers::Buffers;
use super::grid::{Grid, difference, is_same, luminance, mixed, size, squared};
use crate::kernels::layout::{DENOISE_FIREFLIES, DenoiseGiven, DenoiseLit, DenoiseOwn, DenoisePast, DenoiseSeen};
use crate::math::exact::{divide, square_root};
use rayon::prelude::*;

/// Frames that the long average weighs alike; after them a new one weighs 1/12.
const LONG: f32 = 12.0;
/// What a new frame weighs in the short average, at least.
const SHORT_SHARE: f32 = 0.25;
/// What a frame leaves of the size that counted as brightest before it.
const FADE: f32 = 0.8;
/// Neighbours are looked for so far away, pixels: where one ray in thirty finds light, nine of ten that do have another
/// among 80.
const RADIUS: i32 = 4;
/// Fewer neighbours on the same surface say nothing.
const LEAST_NEIGHBOURS: u32 = 4;
/// Standard deviations of the neighbours above their mean that a pixel may have.
const DEVIATIONS: f32 = 4.0;

/// The greatest size that the neighbours of `pixel` on the same surface allow it; `None` where they say nothing. It is
/// at least that of the brightest of them, and the brightest that each of them had in the frames before: what is rare
/// but comes again is light.
fn limit(grid: Grid, seen: &[DenoiseSeen], light: &[DenoiseLit], known: &[DenoisePast], pixel: usize) -> Option<f32> {
    let (mut count, mut mean, mut squares, mut most) = (0u32, 0.0f32, 0.0f32, 0.0f32);
    for other in grid.around(pixel, RADIUS) {
        if other == pixel || light[other].variance == 0.0 || !is_same(&seen[pixel], &seen[other]) {
            continue;
        }
        let l = size(light[other].color);
        count += 1;
        let delta = l - mean;
        mean += delta * divide(1.0, count as f32);
        squares += delta * (l - mean);
        most = most.max(l).max(known[other].brightest);
    }
    if count < LEAST_NEIGHBOURS {
        return None;
    }
    let deviation = square_root(divide(squares, (count - 1) as f32).max(0.0));
    Some((mean + DEVIATIONS * deviation).max(most))
}

/// Takes a frame's light into the averages of a pixel, and its samples, which are so many and have this spread about
/// their mean, into mean and spread by weights: Welford's recurrence as West has it ("Updating Mean and Variance
/// Estimates", CACM 1979). No difference of large numbers is taken, so that a spread far below the mean stays right.
pub fn push(p: &mut DenoisePast, light: [f32; 3], (samples, spread): (f32, f32)) {
    p.length = (p.length + 1.0).min(LONG);
    let alpha = divide(1.0, p.length);
    let rest = 1.0 - alpha;
    p.long = mixed(p.long, light, alpha);
    p.short = mixed(p.short, light, alpha.max(SHORT_SHARE));
    let delta = difference(light, p.mean);
    p.mean = mixed(p.mean, light, alpha);
    p.spread = rest * (p.spread + alpha * squared(delta)) + alpha * spread;
    p.squares = rest * rest * p.squares + divide(alpha * alpha, samples.max(1.0));
}

/// Cuts fireflies of a layer, and takes its light into the averages.
pub fn advance(own: &DenoiseOwn, buffers: &mut Buffers) {
    let Buffers { seen, given, past, known, lit, picture, tally, .. } = buffers;
    let (grid, layer) = (Grid::new(own), own.layer as usize);
    let (seen, given, pixels) = (*seen, *given, grid.pixels());
    let (known, light) = (&known[layer * pixels..][..pixels], &lit[layer * pixels..][..pixels]);
    let past = &mut past[layer * pixels..][..pixels];
    // What is left of a firefly, as a share.
    let kept = |pixel: usize| {
        let DenoiseLit { color, variance } = light[pixel];
        let l = size(color);
        let is_cut = own.sparse != 0 && variance != 0.0 && seen[pixel].is_hit();
        let most = if is_cut { limit(grid, seen, light, known, pixel) } else { None };
        most.filter(|&most| l > most).map(|most| divide(most, l))
    };
    let fireflies = past.par_iter_mut().zip(picture.par_iter_mut()).enumerate().with_min_len(256);
    let fireflies = fireflies.map(|(pixel, (past, picture))| {
        if !seen[pixel].is_hit() {
            *past = DenoisePast::default();
            return 0;
        }
        let mut p = known[pixel];
        let DenoiseLit { color, variance } = light[pixel];
        let is_sound = variance != 0.0;
        p.brightest = (FADE * p.brightest).max(if is_sound { size(color) } else { 0.0 });
        let DenoiseGiven { albedo, samples, spreads, .. } = given[pixel];
        let (kept, mut light, mut spread) = (kept(pixel), color, spreads[layer]);
        if let Some(share) = kept {
            light = color.map(|x| x * share);
            let lost = difference(color, light);
            picture[3] = luminance([0, 1, 2].map(|k| albedo[k] * lost[k]));
            spread *= share * share;
        }
        if is_sound {
            push(&mut p, light, (samples, spread));
        }
        p.count = if p.squares > 0.0 { divide(1.0, p.squares) } else { 0.0 };
        *past = p;
        u32::from(kept.is_some())
    });
    tally[DENOISE_FIREFLIES as usize] += fireflies.sum::<u32>();
}
