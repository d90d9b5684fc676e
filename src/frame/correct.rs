//! Frames with levels of detail, corrected: of every so many blocks of 8 x 8 pixels one is traced exactly as well, with
//! the same random numbers, and its mean difference is added to all of them.
//!
//! Blocks are numbered row by row, and each run of `one_in` of them is a group. Which of a group is traced is drawn
//! anew for each frame, each with the same probability. So the mean of a group is that of exact pixels in expectation
//! (the levels are a control variate); a pixel by itself keeps the difference that it has from its group's.

use crate::math::sampling::pcg;

/// Edge of a block in pixels.
pub const BLOCK: usize = 8;

/// Which block of a group is traced exactly, for the seed of a frame.
pub fn chosen(group: u32, one_in: u32, seed: u32) -> u32 {
    pcg(group ^ pcg(seed)) % one_in
}

/// Adds to each pixel of `levels`, `width` pixels a row, the mean difference of the traced block of its group, which
/// `exact` has. A last group that has no traced block is left as it is.
pub fn correct(levels: &mut [[f32; 3]], exact: &[[f32; 3]], width: usize, one_in: u32, seed: u32) {
    let (across, rows) = (width.div_ceil(BLOCK), levels.len() / width.max(1));
    let down = rows.div_ceil(BLOCK);
    let count = across * down;
    for group in 0..count.div_ceil(one_in as usize) {
        let first = group * one_in as usize;
        let traced = first + chosen(group as u32, one_in, seed) as usize;
        if traced >= count {
            continue;
        }
        let (mut sum, mut number) = ([0.0f64; 3], 0.0);
        for_each_pixel(traced, across, width, rows, |at| {
            for k in 0..3 {
                sum[k] += f64::from(exact[at][k]) - f64::from(levels[at][k]);
            }
            number += 1.0;
        });
        for block in first..(first + one_in as usize).min(count) {
            for_each_pixel(block, across, width, rows, |at| {
                for k in 0..3 {
                    levels[at][k] = (f64::from(levels[at][k]) + sum[k] / number) as f32;
                }
            });
        }
    }
}

/// Calls `visit` for the pixels of a block.
fn for_each_pixel(block: usize, across: usize, width: usize, rows: usize, mut visit: impl FnMut(usize)) {
    let (x, y) = (block % across * BLOCK, block / across * BLOCK);
    for row in y..(y + BLOCK).min(rows) {
        for column in x..(x + BLOCK).min(width) {
            visit(row * width + column);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Over the choices of many frames the mean of the picture is that of the exact one; without correction it is not.
    #[test]
    fn means_are_unbiased() {
        let (width, rows, one_in) = (96usize, 64usize, 4u32);
        let exact: Vec<[f32; 3]> = (0..width * rows).map(|i| [(i % 17) as f32, (i / width) as f32, 1.0]).collect();
        let wrong = |i: usize| 0.5 + (i % width) as f32 / 50.0;
        let levels: Vec<[f32; 3]> = exact.iter().enumerate().map(|(i, x)| x.map(|x| x + wrong(i))).collect();
        let mean = |picture: &[[f32; 3]]| picture.iter().map(|x| f64::from(x[0])).sum::<f64>() / picture.len() as f64;
        let frames = 400;
        let corrected = (0..frames).map(|seed| {
            let mut picture = levels.clone();
            correct(&mut picture, &exact, width, one_in, seed);
            mean(&picture)
        });
        let found = corrected.sum::<f64>() / f64::from(frames);
        let (before, truth) = (mean(&levels) - mean(&exact), mean(&exact));
        assert!((found - truth).abs() < 0.02 * before, "{found} for {truth}, uncorrected {before} off");
    }

    #[test]
    fn every_block_of_a_group_is_traced_as_often() {
        let mut counts = [0u32; 5];
        (0..5000).for_each(|group| counts[chosen(group, 5, 77) as usize] += 1);
        assert!(counts.iter().all(|count| count.abs_diff(1000) < 120), "{counts:?}");
    }
}
