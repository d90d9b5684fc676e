//! The samples of a field in memory, of any number of bits.

use crate::kernels::layout::DisplacementPosition;
use crate::secondary::displacement::{FieldView, Shape, code_of};

/// Samples.
pub struct Samples {
    shape: Shape,
    bits: u32,
    table: Vec<DisplacementPosition>,
    codes: Vec<u32>,
    met: u64,
    shares: f64,
}

impl Samples {
    /// None yet, of 1, 8 or 32 bits each.
    pub fn new(shape: Shape, bits: u32) -> Self {
        let words = (shape.samples() * u64::from(bits)).div_ceil(32) as usize;
        Self { shape, bits, table: shape.table(), codes: vec![0; words], met: 0, shares: 0.0 }
    }

    /// Takes shares of chords from number `first` on, below 0 where nothing is met.
    pub fn take(&mut self, first: u64, shares: &[f32]) {
        for (at, &share) in (first as usize..).zip(shares) {
            let met = (share >= 0.0).then_some(share);
            match self.bits {
                1 => self.codes[at / 32] |= u32::from(met.is_some()) << (at % 32),
                8 => self.codes[at / 4] |= u32::from(code_of(met)) << (8 * (at % 4)),
                _ => self.codes[at] = share.to_bits(),
            }
            self.met += u64::from(met.is_some());
            self.shares += met.map_or(0.0, f64::from);
        }
    }

    /// To be asked. Of 1 bit what is met lies at the mean share of all chords that meet something.
    pub fn view(&self) -> FieldView<'_> {
        let mean = (self.shares / self.met.max(1) as f64) as f32;
        FieldView { shape: self.shape, table: &self.table, codes: &self.codes, bits: self.bits, mean }
    }

    /// A sample: the share of its chord.
    pub fn of(&self, position: u32, number: u32) -> f32 {
        self.view().stored(position, number)
    }

    /// Bytes of the samples.
    pub fn bytes(&self) -> u64 {
        4 * self.codes.len() as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_kept_as_their_bits_allow() {
        let shape = Shape { rings: 1, directions: 2 };
        // Of 10 positions 4 each: none, 0, 1/3 and 1.
        let of = |at: usize| [-1.0, 0.0, 1.0 / 3.0, 1.0][(at + at / 4) % 4];
        let shares: Vec<f32> = (0..40).map(of).collect();
        for (bits, bytes, most) in [(32, 160, 0.0), (8, 40, 0.5 / 254.0 + 1e-6), (1, 8, 0.6)] {
            let mut samples = Samples::new(shape, bits);
            samples.take(0, &shares[..7]);
            samples.take(7, &shares[7..]);
            assert_eq!(samples.bytes(), bytes);
            for (at, &share) in (0u32..).zip(&shares) {
                let found = samples.of(at / 4, at % 4);
                assert!((found < 0.0) == (share < 0.0) && (found - share).abs() <= most, "{bits} {at} {found} {share}");
            }
        }
        // Of one bit every hit is at the mean.
        let mut one = Samples::new(shape, 1);
        one.take(0, &shares);
        assert!((one.of(0, 3) - 4.0 / 9.0).abs() < 1e-6);
    }
}
