//! Adaptive sampling: pixels take samples until their noise is below a part of their value.
//!
//! The noise of a pixel is the standard error of its mean luminance, by the variance of the means of rounds of
//! [`ROUND`] samples ([`Welford`]).
//! Samples of a round are spread evenly, so rounds vary less than as many samples that are not, and the mean of rounds
//! less still than independent ones: the error comes out at about half of what is found.
//!
//! To stop where few samples look alike shows too little of what is rarely met: of a pixel that has missed it so far,
//! no sample comes any more. So pixels are judged together, in blocks of 8x8: the root mean square of their noise
//! against that of their values, no sooner than after [`LEAST`] samples and after whole rounds alone.

use crate::frame::luminance;
use crate::kernels::FrameExecutor;
use crate::kernels::noise::{BLOCK, FAMILY, STOPPED, stop};
use crate::math::welford::Welford;
use crate::schedule::{ExecutorError, Step};
use rayon::prelude::*;

use crate::kernels::layout::BATCH_SAMPLES;

/// Samples of a round; a divisor of [`BATCH_SAMPLES`].
pub const ROUND: u32 = 8;
/// Samples that every pixel takes.
pub const LEAST: u32 = 2 * ROUND;

/// Means of a pixel's rounds.
#[derive(Clone, Copy, Debug, Default)]
struct Rounds {
    means: Welford,
    /// Luminance summed over the batch before the round at hand.
    before: f64,
}

impl Rounds {
    /// Takes the sum of luminance over the batch after a round.
    fn take(&mut self, sum: f64) {
        self.means.push((sum - self.before) / f64::from(ROUND));
        self.before = sum;
    }
}

/// Which pixels of a band take more samples.
#[derive(Clone, Debug)]
pub struct Noise {
    /// Greatest noise of a pixel, as a part of its value.
    target: f64,
    /// Pixels of a row.
    width: usize,
    pixels: Vec<Rounds>,
    /// By block, row by row: 0, its pixels take more.
    stopped: Vec<u32>,
}

impl Noise {
    /// Of a band of `width` x `rows` pixels.
    pub fn new(target: f64, [width, rows]: [usize; 2]) -> Self {
        let blocks = width.div_ceil(BLOCK) * rows.div_ceil(BLOCK);
        Self { target, width, pixels: vec![Rounds::default(); width * rows], stopped: vec![0; blocks] }
    }

    /// Whether all pixels have stopped.
    pub fn is_done(&self) -> bool {
        self.stopped.iter().all(|&stopped| stopped != 0)
    }

    /// The step that leaves out the rays of pixels that have stopped, if some have.
    pub fn step(&self) -> Option<Step> {
        self.stopped.iter().any(|&stopped| stopped != 0).then(stop)
    }

    /// Notes the samples so far of `finished`, at the end of a round, and tells the executor which pixels stop.
    ///
    /// # Errors
    /// The device's.
    pub fn note(&mut self, executor: &mut dyn FrameExecutor, finished: u32) -> Result<(), ExecutorError> {
        if finished.is_multiple_of(ROUND) {
            self.take(&executor.read_radiance()?, finished);
            executor.reserve(&FAMILY, &[self.stopped.len()])?;
            executor.write(&FAMILY, STOPPED, 0, bytemuck::cast_slice(&self.stopped));
        }
        Ok(())
    }

    /// Takes the radiance summed over the batch, `finished` samples of the frame.
    fn take(&mut self, radiance: &[[f32; 4]], finished: u32) {
        let Self { target, width, ref mut pixels, ref mut stopped } = *self;
        let number = finished / ROUND;
        let ends_batch = finished.is_multiple_of(BATCH_SAMPLES);
        // Squares of noise over those of values: the error of the mean of n rounds has 1 / (n (n - 1)) of the squares.
        let most = target * target * f64::from(number) * f64::from(number.saturating_sub(1));
        let blocks = stopped.par_chunks_mut(width.div_ceil(BLOCK)).zip(pixels.par_chunks_mut(BLOCK * width));
        blocks.zip(radiance.par_chunks(BLOCK * width)).for_each(|((stopped, pixels), radiance)| {
            let mut sums = vec![[0.0; 2]; stopped.len()];
            for (index, (pixel, radiance)) in pixels.iter_mut().zip(radiance).enumerate() {
                let block = index % width / BLOCK;
                if stopped[block] == 0 {
                    pixel.take(luminance([0, 1, 2].map(|k| f64::from(radiance[k]))));
                    let [squares, values] = &mut sums[block];
                    *squares += pixel.means.squares;
                    *values += pixel.means.mean * pixel.means.mean;
                }
                if ends_batch {
                    pixel.before = 0.0;
                }
            }
            for (stopped, [squares, values]) in stopped.iter_mut().zip(sums) {
                if finished >= LEAST && squares <= most * values {
                    *stopped = 1;
                }
            }
        });
    }
}
