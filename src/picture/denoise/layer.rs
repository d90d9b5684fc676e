//! A kind of light with its history: averaged over frames, then filtered.

use super::antilag::{Averages, change, held};
use super::atrous::Lit;
use super::grid::Grid;
use super::reproject::Taps;
use super::{Moments, atrous, firefly};
use crate::frame::Seen;
use crate::picture::color::{difference, is_finite, lerp, luminance, size, squared};

/// Frames that the long average weighs alike; after them a new one weighs 1/12.
const LONG: f32 = 12.0;
/// Frames of the short average.
const SHORT: f32 = 4.0;
/// With fewer frames the variance of a lamp's light is that of the neighbourhood.
const FEW: f32 = 2.0;
/// The variance of sparse light is not told by a neighbourhood with fewer samples that found light.
const LEAST_FOUND: f64 = 10.0;
/// What a frame leaves of the size that counted as brightest before it.
const FADE: f32 = 0.8;

/// How a kind of light is filtered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kind {
    /// The neighbourhood from which variance is taken where it is not of the pixel alone, pixels to each side.
    variance_radius: i32,
    /// Standard deviations of colour that the filter takes as alike (σ_l of the paper).
    tolerance: f32,
    /// Whether most of a pixel's samples may find nothing and a few much: then single pixels may be far brighter than
    /// what they stand for, and those that are black are not for that certain to be. The neighbourhood's samples tell
    /// the variance of each.
    is_sparse: bool,
}

impl Kind {
    /// The light of lamps: most of its variance in a neighbourhood is that of the edges of shadows, which are to stay,
    /// so that the variance over frames is taken as soon as there is one. Its samples are bounded by what shines: there
    /// are no fireflies.
    pub const LAMPS: Self = Self { variance_radius: 1, tolerance: 1.0, is_sparse: false };
    /// All other light, the environment's among it.
    pub const OTHER: Self = Self { variance_radius: 3, tolerance: 4.0, is_sparse: true };
}

/// What is kept of a pixel from frame to frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Past {
    /// The averages; the long one after the first level of the filter.
    pub averages: Averages,
    /// Of single frames.
    pub moments: Moments,
    /// The greatest size of single frames, uncut; it fades.
    pub brightest: f32,
    /// Frames that the long average has, 0 where there is none.
    pub length: f32,
}

impl Past {
    fn is_finite(&self) -> bool {
        let Self { averages, moments, brightest, length } = self;
        let sum = moments.mean.iter().sum::<f64>() + moments.spread + moments.squares + f64::from(*brightest);
        is_finite(&averages.long) && is_finite(&averages.short) && sum.is_finite() && length.is_finite()
    }
}

/// What was done to a layer in a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LayerReport {
    /// Pixels cut.
    pub fireflies: u64,
    /// Luminance cut off them, times the albedo.
    pub energy_lost: f64,
    /// Pixels of the history with a value that was not finite.
    pub non_finite: u64,
}

impl LayerReport {
    /// Adds another.
    pub fn add(&mut self, other: &Self) {
        self.fireflies += other.fireflies;
        self.energy_lost += other.energy_lost;
        self.non_finite += other.non_finite;
    }
}

/// A kind of light.
#[derive(Clone, Debug, Default)]
pub struct Layer {
    /// The history, pixel by pixel; empty before the first frame.
    pub past: Vec<Past>,
}

/// The history of a surface, from where it was before. What is not finite there is left out.
fn recall(past: &[Past], taps: Option<&Taps>) -> Past {
    let mut sum = Past::default();
    let mut weights = 0.0;
    for &(pixel, weight) in taps.map_or(&[][..], |taps| &taps.0) {
        let Some(old) = past.get(pixel).filter(|old| weight > 0.0 && old.length > 0.0 && old.is_finite()) else {
            continue;
        };
        weights += weight;
        let share = weight / weights;
        sum.averages.long = lerp(sum.averages.long, old.averages.long, share);
        sum.averages.short = lerp(sum.averages.short, old.averages.short, share);
        sum.length += share * (old.length - sum.length);
        sum.brightest = sum.brightest.max(old.brightest);
        let rest = 1.0 - f64::from(share);
        let mut moments = Moments::default();
        moments.add(&sum.moments, rest);
        moments.add(&old.moments, f64::from(share));
        sum.moments = moments;
    }
    sum
}

/// A pixel with this frame's light in its history; without light the history as it is.
fn advanced(mut past: Past, light: Option<[f32; 3]>) -> Past {
    let Some(light) = light else { return past };
    past.length = (past.length + 1.0).min(LONG);
    let alpha = 1.0 / past.length;
    past.averages.long = lerp(past.averages.long, light, alpha);
    past.averages.short = lerp(past.averages.short, light, alpha.max(1.0 / SHORT));
    past.moments.push(light.map(f64::from), alpha.into());
    past
}

/// Variance of the long averages around `pixel`, about their mean.
fn variance_around(grid: &Grid, seen: &[Seen], past: &[Past], pixel: usize, radius: i32) -> f32 {
    let (mut count, mut mean, mut squares) = (0u32, [0.0f32; 3], 0.0f32);
    let same = |other: &usize| seen[pixel].is_same_surface(&seen[*other]) && past[*other].length > 0.0;
    for other in grid.around(pixel, radius).filter(same) {
        let color = past[other].averages.long;
        count += 1;
        let off = difference(color, mean);
        mean = lerp(mean, color, 1.0 / count as f32);
        // The square of the distance from the mean before times its share that the new mean leaves.
        squares += squared(off.map(f64::from)) as f32 * (1.0 - 1.0 / count as f32);
    }
    if count < 2 { 0.0 } else { squares.max(0.0) / (count - 1) as f32 }
}

/// Variance of the mean of a pixel whose single samples have the variance that those around it have, each about its own
/// mean: a pixel that has seen nothing yet among others that have is not certain to be black. `None` where too few
/// found light: a share p of samples that find the same have the relative variance 1/p - 1, so that n of them have
/// found n / (1 + variance / mean²) times.
fn variance_pooled(grid: &Grid, seen: &[Seen], past: &[Past], pixel: usize, radius: i32) -> Option<f32> {
    let (mut sum, mut mean, mut freedom) = (0.0f64, [0.0f64; 3], 0.0f64);
    for other in grid.around(pixel, radius).filter(|&other| seen[pixel].is_same_surface(&seen[other])) {
        let moments = &past[other].moments;
        if let Some(variance) = moments.variance() {
            // Of n samples alike n - 1 are free, the share 1 - 1/n of them.
            let free = 1.0 / moments.squares - 1.0;
            sum += free * variance;
            mean = [0, 1, 2].map(|k| mean[k] + free * moments.mean[k]);
            freedom += free;
        }
    }
    let of_mean = squared(mean.map(|c| c / freedom));
    // Of no samples, or of none that found light, it is no number.
    let found = freedom * of_mean / (of_mean + sum / freedom);
    (found >= LEAST_FOUND).then(|| (sum / freedom * past[pixel].moments.squares) as f32)
}

/// The variance of a pixel's average, and whether samples are too few to tell it.
fn variance(grid: &Grid, seen: &[Seen], past: &[Past], pixel: usize, kind: Kind) -> (f32, bool) {
    let Past { moments, length, .. } = &past[pixel];
    let of_time = match kind.is_sparse {
        true => variance_pooled(grid, seen, past, pixel, kind.variance_radius),
        false => moments.variance_of_mean().filter(|_| *length >= FEW).map(|variance| variance as f32),
    };
    let of_space = || variance_around(grid, seen, past, pixel, kind.variance_radius);
    (of_time.unwrap_or_else(of_space), kind.is_sparse && of_time.is_none())
}

impl Layer {
    /// Takes the light of a frame, in which `taps` say where surfaces were before, and filters it.
    pub fn frame(
        &mut self,
        grid: &Grid,
        seen: &[Seen],
        taps: &[Option<Taps>],
        light: Vec<Option<[f32; 3]>>,
        kind: Kind,
    ) -> (Vec<[f32; 3]>, LayerReport) {
        let non_finite = self.past.iter().filter(|past| !past.is_finite()).count() as u64;
        let mut report = LayerReport { non_finite, ..LayerReport::default() };
        let mut known = grid.map(|pixel| recall(&self.past, taps[pixel].as_ref()));
        let brightest: Vec<f32> = known.iter().map(|past| past.brightest).collect();
        for (past, light) in known.iter_mut().zip(&light) {
            past.brightest = (FADE * past.brightest).max(light.map_or(0.0, size));
        }
        let light = if kind.is_sparse { cut(grid, seen, light, &brightest, &mut report) } else { light };
        let mut now = grid.map(|pixel| match seen[pixel].is_hit() {
            true => advanced(known[pixel], light[pixel]),
            false => Past::default(),
        });
        let averages: Vec<Averages> = now.iter().map(|past| past.averages).collect();
        let steady = grid.map(|pixel| {
            let mut past = now[pixel];
            if past.length > SHORT {
                let change = change(grid, seen, &averages, pixel);
                past.averages.long = held(grid, seen, &averages, pixel, change);
                // The more has changed, the sooner new frames outweigh both averages; at 1 they begin anew.
                past.length = past.length.min((1.0 - change) / change.max(f32::MIN_POSITIVE));
            }
            past
        });
        now = steady;
        let lit = grid.map(|pixel| {
            let (variance, is_young) = variance(grid, seen, &now, pixel, kind);
            Lit { color: now[pixel].averages.long, variance, is_young, length: now[pixel].length.max(1.0) }
        });
        let mut filtered = atrous::level(grid, seen, &lit, 0, kind.tolerance);
        for (past, lit) in now.iter_mut().zip(&filtered) {
            past.averages.long = lit.color;
        }
        self.past = now;
        for level in 1..atrous::LEVELS {
            filtered = atrous::level(grid, seen, &filtered, level, kind.tolerance);
        }
        (filtered.into_iter().map(|lit| lit.color).collect(), report)
    }
}

/// Light without fireflies.
fn cut(
    grid: &Grid,
    seen: &[Seen],
    light: Vec<Option<[f32; 3]>>,
    brightest: &[f32],
    report: &mut LayerReport,
) -> Vec<Option<[f32; 3]>> {
    let limits = grid.map(|pixel| firefly::limit(grid, seen, &light, brightest, pixel));
    let mut cut = light;
    for ((light, limit), seen) in cut.iter_mut().zip(limits).zip(seen) {
        let Some(color) = light else { continue };
        let l = size(*color);
        if l > limit {
            let kept = color.map(|x| x * (limit / l));
            let lost = [0, 1, 2].map(|k| seen.albedo[k] * (color[k] - kept[k]));
            report.fireflies += 1;
            report.energy_lost += f64::from(luminance(lost));
            *color = kept;
        }
    }
    cut
}
