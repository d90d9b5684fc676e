//! A running mean and variance.

/// The mean of values, and the sum of their squared differences from it (Welford, "Note on a Method for Calculating
/// Corrected Sums of Squares and Products", 1962).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Welford {
    /// Values so far.
    pub count: u32,
    /// Their mean.
    pub mean: f64,
    /// The sum of their squared differences from it.
    pub squares: f64,
}

impl Welford {
    /// Takes one more value.
    pub fn push(&mut self, value: f64) {
        self.count += 1;
        let off = value - self.mean;
        self.mean += off / f64::from(self.count);
        self.squares += off * (value - self.mean);
    }

    /// The variance of what the values were drawn from; `None` of fewer than two.
    pub fn variance(&self) -> Option<f64> {
        (self.count > 1).then(|| self.squares / f64::from(self.count - 1))
    }
}
