//! Running mean and variance of colours, with weights.

use crate::picture::color::squared;

/// Mean and variance of a stream of colours in which a new value weighs α: Welford's recurrence as West has it for
/// weights ("Updating Mean and Variance Estimates", CACM 1979). No difference of large numbers is taken, so that a
/// spread far below the mean stays right.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moments {
    /// Weighted mean.
    pub mean: [f64; 3],
    /// Weighted mean of squared distances from it (`squared`).
    pub spread: f64,
    /// Sum of the squares of the weights, which sum to 1: 1/n of n equal ones; 0 before the first value.
    pub squares: f64,
}

impl Moments {
    /// Takes a value in with weight `alpha`, over 0 and at most 1; what was before keeps the rest. With 1, 1/2, 1/3...
    /// all weigh alike.
    pub fn push(&mut self, value: [f64; 3], alpha: f64) {
        let rest = 1.0 - alpha;
        let delta = [0, 1, 2].map(|k| value[k] - self.mean[k]);
        self.mean = [0, 1, 2].map(|k| self.mean[k] + alpha * delta[k]);
        self.spread = rest * (self.spread + alpha * squared(delta));
        self.squares = rest * rest * self.squares + alpha * alpha;
    }

    /// Unbiased variance of the values: with equal weights the sum of squares over n - 1. `None` of fewer than two
    /// values.
    pub fn variance(&self) -> Option<f64> {
        (self.squares > 0.0 && self.squares < 1.0).then(|| self.spread / (1.0 - self.squares))
    }

    /// Variance of the mean of independent values.
    pub fn variance_of_mean(&self) -> Option<f64> {
        self.variance().map(|variance| variance * self.squares)
    }

    /// Adds `weight` times another.
    pub fn add(&mut self, other: &Self, weight: f64) {
        self.mean = [0, 1, 2].map(|k| self.mean[k] + weight * other.mean[k]);
        self.spread += weight * other.spread;
        self.squares += weight * other.squares;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_weights_give_the_textbook() {
        let values = [3.0, -1.0, 4.0, 1.5, 9.0];
        let mut moments = Moments::default();
        assert_eq!(moments.variance(), None);
        for (k, value) in values.into_iter().enumerate() {
            moments.push([value; 3], 1.0 / (k + 1) as f64);
        }
        let mean = values.iter().sum::<f64>() / 5.0;
        let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 4.0;
        assert!((moments.mean[1] - mean).abs() < 1e-12 && (moments.squares - 0.2).abs() < 1e-12);
        assert!((moments.variance().unwrap() / variance - 1.0).abs() < 1e-12);
        assert!((moments.variance_of_mean().unwrap() / (variance / 5.0) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn one_value_has_no_variance() {
        let mut moments = Moments::default();
        moments.push([7.0; 3], 1.0);
        assert_eq!((moments.mean, moments.variance()), ([7.0; 3], None));
    }

    /// Directions to an environment are drawn by luminance, so that samples may differ in colour alone.
    #[test]
    fn colours_of_one_luminance_vary() {
        let mut moments = Moments::default();
        for k in 0..10 {
            let color = if k % 2 == 0 { [1.0 / 0.2126, 0.0, 0.0] } else { [0.0, 0.0, 1.0 / 0.0722] };
            moments.push(color, 1.0 / f64::from(k + 1));
        }
        assert!(moments.variance().is_some_and(|variance| variance > 1.0), "{moments:?}");
    }
}
