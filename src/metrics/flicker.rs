//! Flicker: what a sequence of pictures changes from frame to frame that its truth does not.

use super::image::{Image, ImageError, check_same_size};

/// How much pixels change, linear radiance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Change {
    /// Pixels that were looked at.
    pub pixels: usize,
    /// The mean.
    pub mean: f64,
    /// What 99 of 100 pixels do not exceed.
    pub p99: f64,
    /// The greatest.
    pub greatest: f64,
    /// The share of pixels that change by more than was asked about.
    pub above: f64,
}

/// Of the pixels that `of` has: |(a_t − b_t) − (a_{t−1} − b_{t−1})|, the greatest over the channels, for pictures
/// `before` and `now` of a sequence a, of which b is the truth: how much its error changes. A picture that has the same
/// error in every frame does not flicker, however wrong it is. `above` counts those that change by more than `limit`.
/// Pixels that are not finite somewhere are left out.
///
/// # Errors
/// Pictures of different sizes.
pub fn flicker(before: [&Image; 2], now: [&Image; 2], of: &[bool], limit: f64) -> Result<Change, ImageError> {
    for other in [before[0], before[1], now[1]] {
        check_same_size(now[0], other)?;
    }
    let error = |[a, b]: [&Image; 2], i: usize, c: usize| f64::from(a.rgb[i][c]) - f64::from(b.rgb[i][c]);
    let change = |i: usize| [0, 1, 2].map(|c| (error(now, i, c) - error(before, i, c)).abs());
    let of = (0..now[0].rgb.len()).filter(|&i| of.get(i).is_some_and(|&is_of| is_of));
    let mut changes: Vec<f64> =
        of.map(change).filter(|c| c.iter().all(|c| c.is_finite())).map(|[r, g, b]| r.max(g).max(b)).collect();
    changes.sort_by(f64::total_cmp);
    let Some(&greatest) = changes.last() else { return Ok(Change::default()) };
    let pixels = changes.len();
    Ok(Change {
        pixels,
        mean: changes.iter().sum::<f64>() / pixels as f64,
        p99: changes[(99 * pixels).div_ceil(100) - 1],
        greatest,
        above: (pixels - changes.partition_point(|change| *change <= limit)) as f64 / pixels as f64,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_of_the_error_alone_count() {
        let picture = |of: &dyn Fn(usize) -> f32| Image::from_fn(100, 1, |x, _| [0.5, of(x), 1.0]);
        // The truth moves, and a picture that is wrong by the same follows.
        let [truth, moved] = [picture(&|x| x as f32), picture(&|x| x as f32 + 3.0)];
        let [wrong, followed] = [picture(&|x| x as f32 + 0.25), picture(&|x| x as f32 + 3.25)];
        let all = [true; 100];
        let still = flicker([&wrong, &truth], [&followed, &moved], &all, 0.0).unwrap();
        assert_eq!(still, Change { pixels: 100, ..Change::default() });
        // Controls: one pixel jumps; all do not follow.
        let jumps = picture(&|x| x as f32 + if x == 7 { 4.25 } else { 3.25 });
        let seen = flicker([&wrong, &truth], [&jumps, &moved], &all, 0.5).unwrap();
        assert_eq!(seen, Change { pixels: 100, mean: 0.01, p99: 0.0, greatest: 1.0, above: 0.01 });
        let rests = flicker([&wrong, &truth], [&wrong, &moved], &all, 0.5).unwrap();
        assert_eq!(rests, Change { pixels: 100, mean: 3.0, p99: 3.0, greatest: 3.0, above: 1.0 });
        // What is not asked about, and what is not finite, does not count.
        let mut without = all;
        without[7] = false;
        let seen = flicker([&wrong, &truth], [&jumps, &moved], &without, 0.5).unwrap();
        assert_eq!(seen, Change { pixels: 99, ..Change::default() });
        let broken = picture(&|x| if x == 7 { f32::NAN } else { x as f32 + 3.25 });
        assert_eq!(flicker([&wrong, &truth], [&broken, &moved], &all, 0.5).unwrap(), seen);
        assert_eq!(flicker([&wrong, &truth], [&jumps, &moved], &[], 0.5).unwrap(), Change::default());
        assert!(flicker([&wrong, &truth], [&Image::from_fn(1, 1, |_, _| [0.0; 3]), &moved], &all, 0.5).is_err());
    }
}
