//! The sum of a pixel's samples.
//!
//! A device adds samples in f32. A sum of n numbers has a relative error of up to γₙ₋₁ = (n − 1) u / (1 − (n − 1) u) of
//! the sum of their magnitudes, u = 2⁻²⁴ (Higham, Accuracy and Stability of Numerical Algorithms, §4.2), and of many
//! equal ones it stops growing altogether. So the device sums [`BATCH_SAMPLES`] samples at most, and the host adds
//! these sums in f64: the error is that of one batch, γ₆₃ < 4 · 10⁻⁶, however many there are.

pub use crate::kernels::layout::BATCH_SAMPLES;
use crate::kernels::vector::each;
use rayon::prelude::*;

/// The samples of a frame so far.
#[derive(Clone, Debug, Default)]
pub struct Accumulation {
    /// The first batch: radiance per pixel, w the number of samples.
    first: Vec<[f32; 4]>,
    /// The sums of all batches, where there are more.
    sums: Vec<[f64; 4]>,
}

impl Accumulation {
    /// Adds a batch that a device has summed: radiance per pixel, w the number of samples.
    pub fn add(&mut self, batch: Vec<[f32; 4]>) {
        if self.first.is_empty() {
            self.first = batch;
            return;
        }
        if self.sums.is_empty() {
            self.sums = self.first.par_iter().map(|first| first.map(f64::from)).collect();
        }
        self.sums.par_iter_mut().zip(&batch).for_each(|(sum, batch)| {
            for (sum, x) in sum.iter_mut().zip(batch) {
                *sum += f64::from(*x);
            }
        });
    }

    /// The mean of the samples, 0 of a pixel without any. Of one batch it is the quotient in f32, which is what that in
    /// f64 would be rounded to, as 53 ≥ 2 · 24 + 2 (Figueroa, "When is Double Rounding Innocuous?", 1995).
    pub fn mean(&self) -> Vec<[f32; 3]> {
        if self.sums.is_empty() {
            return self.first.par_iter().map(|sum| each(|k| sum[k] / sum[3].max(1.0))).collect();
        }
        self.sums.par_iter().map(|sum| each(|k| (sum[k] / sum[3].max(1.0)) as f32)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_batch_is_divided_in_f32_as_in_f64() {
        let mut state = 1u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state
        };
        for _ in 0..200_000 {
            let count = (1 + next() % BATCH_SAMPLES) as f32;
            // Any finite float that is not negative, denormals among them.
            let sum = [next() % 0x7f80_0000, next() % 0x0100_0000, next() % 0x4000_0000].map(f32::from_bits);
            let mut all = Accumulation::default();
            all.add(vec![[sum[0], sum[1], sum[2], count]]);
            let in_f64 = sum.map(|x| ((f64::from(x) / f64::from(count)) as f32).to_bits());
            assert_eq!(all.mean()[0].map(f32::to_bits), in_f64, "{sum:?} / {count}");
            // A second batch of nothing brings the sums in f64 into use.
            all.add(vec![[0.0; 4]]);
            assert_eq!(all.mean()[0].map(f32::to_bits), in_f64, "{sum:?} / {count}");
        }
    }

    #[test]
    fn batches_do_not_drift() {
        let value = 0.1f32;
        let mut all = Accumulation::default();
        let mut one_after_the_other = 0.0f32;
        for _ in 0..1_000_000 / BATCH_SAMPLES {
            let sum = (0..BATCH_SAMPLES).fold(0.0, |sum, _| sum + value);
            all.add(vec![[sum, sum, sum, BATCH_SAMPLES as f32]]);
            one_after_the_other = (0..BATCH_SAMPLES).fold(one_after_the_other, |sum, _| sum + value);
        }
        assert!((all.mean()[0][0] / value - 1.0).abs() <= 63.0 * 0.5 * f32::EPSILON);
        // The control: one sum in f32.
        assert!((one_after_the_other / 1e6 / value - 1.0).abs() > 1e-3);
    }
}
