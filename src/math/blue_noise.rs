//! A tile of blue noise: numbers that differ most between neighbours, so that what is drawn by them errs at high
//! frequencies only.
//!
//! Void and cluster (Ulichney, "The void-and-cluster method for dither array generation", SPIE 1993): pixels are ranked
//! so that the first n of them are spread evenly over the tile, whatever n is; the tile repeats without a seam.
//! Energies are whole numbers, so that ranks do not depend on the machine.

use std::sync::OnceLock;

/// Pixels of the tile on both axes.
pub const SIDE: usize = 64;

/// Pixels of the tile.
const PIXELS: usize = SIDE * SIDE;

/// Standard deviation of the Gaussian by which pixels keep others away (Ulichney: 1.5 pixels).
const SIGMA: f64 = 1.5;

/// The energies of the pixels of a pattern: a sum over its pixels, by distance on the tile.
struct Energy {
    /// Of a pixel at a distance.
    of: Vec<u64>,
    sums: Vec<u64>,
    pattern: Vec<bool>,
}

impl Energy {
    fn new() -> Self {
        let along = |x: usize| x.min(SIDE - x) as f64;
        let of = |i: usize| {
            let squared = along(i % SIDE).powi(2) + along(i / SIDE).powi(2);
            ((-squared / (2.0 * SIGMA * SIGMA)).exp() * f64::from(1u32 << 24)).round() as u64
        };
        Self { of: (0..PIXELS).map(of).collect(), sums: vec![0; PIXELS], pattern: vec![false; PIXELS] }
    }

    /// Adds a pixel, or takes it away.
    fn flip(&mut self, pixel: usize) {
        let is_there = self.pattern[pixel];
        self.pattern[pixel] = !is_there;
        for (i, sum) in self.sums.iter_mut().enumerate() {
            let apart = |a: usize, b: usize| (a + SIDE - b) % SIDE;
            let of = self.of[apart(i / SIDE, pixel / SIDE) * SIDE + apart(i % SIDE, pixel % SIDE)];
            *sum = if is_there { *sum - of } else { *sum + of };
        }
    }

    /// The pixel of the pattern that lies closest to others; the first of several.
    fn cluster(&self) -> usize {
        let there = (0..PIXELS).filter(|&i| self.pattern[i]);
        there.max_by_key(|&i| (self.sums[i], PIXELS - i)).unwrap_or(0)
    }

    /// The pixel beside the pattern that lies farthest from it; the first of several.
    fn void(&self) -> usize {
        let free = (0..PIXELS).filter(|&i| !self.pattern[i]);
        free.min_by_key(|&i| (self.sums[i], i)).unwrap_or(0)
    }
}

/// The ranks of the tile's pixels, row by row: each number below SIDE² once.
pub fn ranks() -> &'static [u16] {
    static RANKS: OnceLock<Vec<u16>> = OnceLock::new();
    RANKS.get_or_init(|| {
        // A tenth of the pixels, at random, then spread.
        let mut start = Energy::new();
        let mut word = 1;
        while start.pattern.iter().filter(|&&is| is).count() < PIXELS / 10 {
            word = super::sampling::pcg(word);
            if !start.pattern[word as usize % PIXELS] {
                start.flip(word as usize % PIXELS);
            }
        }
        loop {
            let from = start.cluster();
            start.flip(from);
            let to = start.void();
            start.flip(to);
            if from == to {
                break;
            }
        }
        let mut ranks = vec![0; PIXELS];
        let first = start.pattern.iter().filter(|&&is| is).count();
        let spread = start.pattern.clone();
        for rank in (0..first).rev() {
            let pixel = start.cluster();
            start.flip(pixel);
            ranks[pixel] = rank as u16;
        }
        (0..PIXELS).filter(|&i| spread[i]).for_each(|i| start.flip(i));
        // The largest void of the pattern is the tightest cluster of what is free, too: both have all energy together.
        for rank in first..PIXELS {
            let pixel = start.void();
            start.flip(pixel);
            ranks[pixel] = rank as u16;
        }
        ranks
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The share of a tile's power below an eighth of the sampling rate, which white noise has evenly.
    fn low(tile: &[f64]) -> f64 {
        let mean = tile.iter().sum::<f64>() / PIXELS as f64;
        let power = |kx: i32, ky: i32| {
            let (mut re, mut im) = (0.0, 0.0);
            for (i, value) in tile.iter().enumerate() {
                let turns = f64::from(kx) * (i % SIDE) as f64 + f64::from(ky) * (i / SIDE) as f64;
                let (sin, cos) = (std::f64::consts::TAU * turns / SIDE as f64).sin_cos();
                (re, im) = (re + (value - mean) * cos, im + (value - mean) * sin);
            }
            (re * re + im * im) / PIXELS as f64
        };
        let all: f64 = tile.iter().map(|value| (value - mean).powi(2)).sum();
        let near = (-8..=8).flat_map(|x| (-8..=8).map(move |y| (x, y))).filter(|(x, y)| x * x + y * y <= 64);
        near.map(|(x, y)| power(x, y)).sum::<f64>() / all
    }

    #[test]
    fn ranks_differ_and_have_no_low_frequencies() {
        let ranks = ranks();
        let mut sorted = ranks.to_vec();
        sorted.sort_unstable();
        assert!(sorted.iter().enumerate().all(|(i, rank)| i == usize::from(*rank)), "each rank once");
        let tile: Vec<f64> = ranks.iter().map(|&rank| f64::from(rank)).collect();
        let white: Vec<f64> = (0..PIXELS as u32).map(|i| f64::from(crate::math::sampling::pcg(i) >> 8)).collect();
        let (blue, control) = (low(&tile), low(&white));
        // 197 of 4096 frequencies.
        assert!((0.035..0.065).contains(&control), "{control} of white noise");
        assert!(blue < 0.1 * control, "{blue} of blue noise, {control} of white noise");
        // So have the first of them, however many: those below a rank are spread.
        for share in [0.1, 0.25, 0.5] {
            let first: Vec<f64> = tile.iter().map(|&rank| f64::from(rank < share * PIXELS as f64)).collect();
            assert!(low(&first) < 0.15 * control, "{} of the first {share}", low(&first));
        }
    }
}
