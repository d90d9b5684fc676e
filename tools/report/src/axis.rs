//! The axes of plots: where their labels stand, and what these say.

use crate::format;
use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};

/// An axis with labels at chosen values: the library's own choice has fractions of frames.
#[derive(Clone, Debug)]
pub struct Axis {
    /// Where it begins.
    pub low: f64,
    /// Where it ends.
    pub high: f64,
    /// Labelled values.
    pub ticks: Vec<f64>,
    /// Equal lengths stand for equal ratios.
    pub is_log: bool,
}

impl Ranged for Axis {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let along = match self.is_log {
            true => (value / self.low).ln() / (self.high / self.low).ln(),
            false => (value - self.low) / (self.high - self.low),
        };
        limit.0 + (f64::from(limit.1 - limit.0) * along).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        if hint.weight().allow_light_points() { Vec::new() } else { self.ticks.clone() }
    }

    fn range(&self) -> std::ops::Range<f64> {
        self.low..self.high
    }
}

/// Round numbers from 0 to at least `max`, about `parts` steps.
pub fn ticks(max: f64, parts: u32) -> Vec<f64> {
    let max = if max > 0.0 && max.is_finite() { max } else { 1.0 };
    let rough = max / f64::from(parts);
    let power = 10f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 2.5, 5.0, 10.0].into_iter().map(|s| s * power).find(|s| *s >= rough * 0.999).unwrap_or(rough);
    let count = (max / step * 0.9999).ceil().max(1.0) as u32;
    (0..=count).map(|k| f64::from(k) * step).collect()
}

/// At most seven frames for the horizontal axis, at round numbers.
pub fn frame_ticks(from: f64, to: f64) -> Vec<f64> {
    let steps = (0..).flat_map(|power| [1.0, 2.0, 5.0].map(|s| s * 10f64.powi(power)));
    let step = steps.into_iter().find(|step| (to - from) / step <= 6.0).unwrap_or(1.0);
    let first = (from / step).ceil();
    let count = ((to / step).floor() - first).max(0.0) as u32;
    (0..=count).map(|k| (first + f64::from(k)) * step).collect()
}

/// Labels of a logarithmic axis that holds `from` to `to`, both above zero: powers of ten, with 2 and 5 between them
/// where these are few, and not more than seven.
pub fn log_ticks(from: f64, to: f64) -> Vec<f64> {
    let (first, last) = (from.log10().floor() as i32, to.log10().ceil() as i32);
    let decades = (last - first).max(1);
    let parts: &[f64] = if decades <= 2 { &[1.0, 2.0, 5.0] } else { &[1.0] };
    let step = (decades as usize).div_ceil(6);
    // Up to the first power that is no less than the last: steps may pass it.
    let top = first + ((decades as usize).div_ceil(step) * step) as i32;
    let powers = (first..=top).step_by(step);
    let all = powers.flat_map(|power| parts.iter().map(move |part| part * 10f64.powi(power)));
    // One label below and one above what is shown.
    let all: Vec<f64> = all.take_while(|tick| *tick <= 10f64.powi(top) * 1.001).collect();
    let start = all.iter().rposition(|tick| *tick <= from * 1.001).unwrap_or(0);
    let end = all.iter().position(|tick| *tick >= to * 0.999).unwrap_or(all.len() - 1);
    all[start..=end.max(start + 1).min(all.len() - 1)].to_vec()
}

/// A tick's value without digits that say nothing: `0`, `0.25`, `2.5`, `1,000`.
pub fn tick_label(value: f64) -> String {
    if value >= 1000.0 {
        return format::count(value);
    }
    if value != 0.0 && value < 0.001 {
        return format!("{value:.0e}");
    }
    let text = format!("{value:.4}");
    text.trim_end_matches('0').trim_end_matches('.').to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_cover_the_maximum() {
        assert_eq!(ticks(4.0, 4), [0.0, 1.0, 2.0, 3.0, 4.0]);
        assert_eq!(ticks(90.0, 4), [0.0, 25.0, 50.0, 75.0, 100.0]);
        for exponent in -12..12 {
            for mantissa in 1..100 {
                let max = f64::from(mantissa) * 10f64.powi(exponent);
                let ticks = ticks(max, 4);
                assert!(ticks[ticks.len() - 1] >= max * 0.999, "{max}: {ticks:?}");
                assert!((2..=6).contains(&ticks.len()), "{max}: {ticks:?}");
            }
        }
        assert_eq!(ticks(0.0, 4).first(), Some(&0.0));
    }

    #[test]
    fn frame_ticks_are_integers_within_the_range() {
        assert_eq!(frame_ticks(0.0, 0.0), [0.0]);
        assert_eq!(frame_ticks(7.0, 7.0), [7.0]);
        assert_eq!(frame_ticks(0.0, 29.0), [0.0, 5.0, 10.0, 15.0, 20.0, 25.0]);
        for to in 0..3000 {
            let ticks = frame_ticks(3.0, 3.0 + f64::from(to));
            assert!(ticks.len() <= 7, "{ticks:?}");
            assert!(ticks.iter().all(|t| t.fract() == 0.0 && (3.0..=3.0 + f64::from(to)).contains(t)), "{ticks:?}");
        }
    }

    #[test]
    fn logarithmic_ticks_hold_the_range() {
        assert_eq!(log_ticks(1.0, 1000.0), [1.0, 10.0, 100.0, 1000.0]);
        assert_eq!(log_ticks(0.03, 0.2), [0.02, 0.05, 0.1, 0.2]);
        for (from, to) in [(1.0, 1.0), (3e-7, 4e5), (0.9, 1.1), (64.0, 65.0), (1e-12, 1e12)] {
            let ticks = log_ticks(from, to);
            assert!((2..=8).contains(&ticks.len()) && ticks.is_sorted(), "{from} to {to}: {ticks:?}");
            assert!(ticks[0] <= from * 1.001 && ticks[ticks.len() - 1] >= to * 0.999, "{from} to {to}: {ticks:?}");
        }
    }

    #[test]
    fn tick_labels_keep_what_tells_them_apart() {
        assert_eq!(tick_label(0.0), "0");
        assert_eq!(tick_label(0.25), "0.25");
        assert_eq!(tick_label(10.0), "10");
        assert_eq!(tick_label(2500.0), "2,500");
        assert_eq!(tick_label(0.0001), "1e-4");
    }
}
