//! A kind of light with its history: averaged over frames, then filtered.

use super::antilag::{Averages, change, held};
use super::atrous::{self, Lit};
use super::grid::Grid;
use super::reproject::Taps;
use super::{Moments, Seen, firefly, is_finite, lerp, luminance};

/// Frames that the long average weighs alike; after them a new one weighs 1/12.
const LONG: f32 = 12.0;
/// Frames of the short average.
const SHORT: f32 = 4.0;

/// How a kind of light is filtered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kind {
    /// With fewer frames the variance is that of the neighbourhood.
    few: f32,
    /// The neighbourhood for that, pixels to each side.
    variance_radius: i32,
    /// Standard deviations of luminance that the filter takes as alike (σ_l of the paper).
    tolerance: f32,
    /// Whether single pixels may be far brighter than what they stand for.
    has_fireflies: bool,
}

impl Kind {
    /// The light of lamps: most of its variance in a neighbourhood is that of the edges of shadows, which are to stay, so that the
    /// variance over frames is taken as soon as there is one. Its samples are bounded by what shines: there are no fireflies.
    pub const LAMPS: Self = Self { few: 2.0, variance_radius: 1, tolerance: 1.0, has_fireflies: false };
    /// All other light.
    pub const OTHER: Self = Self { few: 4.0, variance_radius: 3, tolerance: 4.0, has_fireflies: true };
}

/// What is kept of a pixel from frame to frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Past {
    /// The averages; the long one after the first level of the filter.
    pub averages: Averages,
    /// Of the luminance of single frames.
    pub moments: Moments,
    /// Frames that the long average has, 0 where there is none.
    pub length: f32,
}

impl Past {
    fn is_finite(&self) -> bool {
        let Self { averages, moments, length } = self;
        let sum = moments.mean + moments.spread + moments.squares;
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
    past.moments.push(luminance(light).into(), alpha.into());
    past
}

/// Variance of the luminance of the long averages around `pixel`, about their mean.
fn variance_around(grid: &Grid, seen: &[Seen], past: &[Past], pixel: usize, radius: i32) -> f32 {
    let (mut count, mut mean, mut squares) = (0u32, 0.0f32, 0.0f32);
    let same = |other: &usize| seen[pixel].is_same_surface(&seen[*other]) && past[*other].length > 0.0;
    for other in grid.around(pixel, radius).filter(same) {
        let l = luminance(past[other].averages.long);
        count += 1;
        let delta = l - mean;
        mean += delta / count as f32;
        squares += delta * (l - mean);
    }
    if count < 2 { 0.0 } else { squares.max(0.0) / (count - 1) as f32 }
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
        let light = if kind.has_fireflies { cut(grid, seen, light, &mut report) } else { light };
        let past = &self.past;
        let mut now = grid.map(|pixel| match seen[pixel].is_hit() {
            true => advanced(recall(past, taps[pixel].as_ref()), light[pixel]),
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
            let Past { averages, moments, length } = now[pixel];
            let of_time = moments.variance_of_mean().filter(|_| length >= kind.few).map(|variance| variance as f32);
            let variance = of_time.unwrap_or_else(|| variance_around(grid, seen, &now, pixel, kind.variance_radius));
            Lit { color: averages.long, variance }
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
fn cut(grid: &Grid, seen: &[Seen], light: Vec<Option<[f32; 3]>>, report: &mut LayerReport) -> Vec<Option<[f32; 3]>> {
    let limits = grid.map(|pixel| firefly::limit(grid, seen, &light, pixel));
    let mut cut = light;
    for ((light, limit), seen) in cut.iter_mut().zip(limits).zip(seen) {
        let Some(color) = light else { continue };
        let l = luminance(*color);
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
