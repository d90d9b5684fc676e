//! Drawing one of many by weight with two random numbers: alias tables (Walker 1977), built as by Vose 1991.

/// A table over n weights: an index drawn evenly is kept by its share, else it gives way to another.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AliasTable {
    /// Of an index that was drawn evenly: its share of staying, 0 to 1. 0 exactly for weights of zero.
    pub stays: Vec<f64>,
    /// What it gives way to otherwise.
    pub others: Vec<u32>,
}

impl AliasTable {
    /// Over `weights`, finite, none negative and at most 2^32 in number. `None` where none is positive.
    pub fn new(weights: &[f64]) -> Option<Self> {
        let sum: f64 = weights.iter().sum();
        // A number that is none fails, too.
        if !(sum > 0.0 && sum.is_finite()) {
            return None;
        }
        let scale = weights.len() as f64 / sum;
        let mut left: Vec<f64> = weights.iter().map(|w| w * scale).collect();
        let (mut small, mut large): (Vec<u32>, Vec<u32>) =
            (0..weights.len() as u32).partition(|&i| left[i as usize] < 1.0);
        let mut table = Self { stays: vec![1.0; weights.len()], others: (0..weights.len() as u32).collect() };
        while let (Some(&s), Some(&l)) = (small.last(), large.last()) {
            small.pop();
            table.stays[s as usize] = left[s as usize];
            table.others[s as usize] = l;
            let rest = (left[l as usize] + left[s as usize]) - 1.0;
            left[l as usize] = rest;
            if rest < 1.0 {
                large.pop();
                small.push(l);
            }
        }
        // What is left is 1 but for rounding; weights of zero are never drawn all the same.
        let heaviest = (0..weights.len()).max_by(|&a, &b| weights[a].total_cmp(&weights[b])).unwrap_or(0);
        for s in small.into_iter().filter(|&s| weights[s as usize] == 0.0) {
            table.stays[s as usize] = 0.0;
            table.others[s as usize] = heaviest as u32;
        }
        Some(table)
    }

    /// As kernels read it: an index stays where a random number of 32 bits is below the first word, else goes to the
    /// second.
    pub fn words(&self) -> Vec<[u32; 2]> {
        // A float-to-integer cast saturates; what stays with 2^32 - 1 of 2^32 and gives way to itself stays.
        let threshold = |stays: &f64| (stays * 4_294_967_296.0).round() as u32;
        self.stays.iter().zip(&self.others).map(|(stays, &other)| [threshold(stays), other]).collect()
    }

    /// The probability by which each index is drawn.
    #[cfg(test)]
    pub fn probabilities(&self) -> Vec<f64> {
        let each = 1.0 / self.stays.len() as f64;
        let mut sums: Vec<f64> = self.stays.iter().map(|stays| stays * each).collect();
        for (stays, &other) in self.stays.iter().zip(&self.others) {
            sums[other as usize] += (1.0 - stays) * each;
        }
        sums
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampling::pcg;

    fn check(weights: &[f64]) -> f64 {
        let table = AliasTable::new(weights).unwrap();
        let sum: f64 = weights.iter().sum();
        let apart = |(p, w): (&f64, &f64)| (p - w / sum).abs();
        assert!(table.stays.iter().all(|s| (0.0..=1.0).contains(s)), "{table:?}");
        for (i, weight) in weights.iter().enumerate() {
            let is_drawn =
                table.stays[i] > 0.0 || (0..weights.len()).any(|j| table.others[j] == i as u32 && table.stays[j] < 1.0);
            assert_eq!(is_drawn, *weight > 0.0, "{i} of {weight}");
        }
        table.probabilities().iter().zip(weights).map(apart).fold(0.0, f64::max)
    }

    #[test]
    fn probabilities_are_the_weights() {
        let random =
            |n: u32, spread: f64| -> Vec<f64> { (0..n).map(|i| (f64::from(pcg(i)) / 4.3e9 * spread).exp()).collect() };
        let mut spiked = random(2000, 1.0);
        spiked[700] = 1e9;
        let mut holes = random(1000, 12.0);
        holes.iter_mut().step_by(3).for_each(|w| *w = 0.0);
        for weights in [vec![3.0], vec![1.0; 7], vec![0.0, 0.0, 5.0, 0.0], random(1000, 30.0), spiked, holes] {
            let apart = check(&weights);
            assert!(apart < 1e-12, "{apart:e} over {} weights", weights.len());
        }
        // Control: of other weights it is another table.
        let table = AliasTable::new(&[1.0, 2.0, 3.0]).unwrap();
        assert!((table.probabilities()[0] - 1.0 / 3.0).abs() > 0.1);
    }

    #[test]
    fn nothing_is_drawn_of_nothing() {
        for weights in [&[][..], &[0.0, 0.0], &[f64::NAN, 1.0], &[f64::INFINITY]] {
            assert_eq!(AliasTable::new(weights), None);
        }
        let words = AliasTable::new(&[0.0, 1.0, 1.0, 2.0]).unwrap().words();
        assert_eq!(words[0][0], 0);
        assert_eq!(AliasTable::new(&[2.0]).unwrap().words(), [[u32::MAX, 0]]);
    }
}
