//! How fine pictures are while the camera moves, and how they become finer when it rests.

use crate::secondary::EffectMethods;
use crate::session::Settings;
use crate::settings::{EffectList, FrameBudget, ImageSize};
use std::time::Duration;

/// Factors of width and height that pictures of a moving camera have.
const SCALES: [f64; 8] = [1.0, 0.75, 0.5, 0.375, 0.25, 0.1875, 0.125, 0.0625];
/// Samples of the first picture of a camera that rests; each one after it has four times as many.
const STEP: u32 = 4;
/// A picture that is expected to take less than this share of the time may be larger the next time.
const HEADROOM: f64 = 0.8;
/// Weight of the latest picture in what is known of the time that they take.
const LATEST: f64 = 0.4;
/// Of that time, what pictures take however small they are.
const FIXED: f64 = 0.25;

/// What time pictures have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pace {
    /// While the camera moves, a picture.
    pub moving: Duration,
    /// What pictures of a moving camera load at most, where settings say nothing.
    pub budget: FrameBudget,
    /// What pictures of a resting camera load at most.
    pub resting: FrameBudget,
    /// Secondary rays of one pixel in four while the camera moves, where nothing else answers them.
    pub half_rate: bool,
    /// A camera that has not moved for so long rests.
    pub pause: Duration,
}

impl Default for Pace {
    fn default() -> Self {
        Self {
            moving: Duration::from_millis(50),
            budget: FrameBudget::Time(25.0),
            resting: FrameBudget::Time(150.0),
            half_rate: true,
            pause: Duration::from_millis(80),
        }
    }
}

/// Whether frames of these settings may load less than they need.
fn may_have_budget(settings: &Settings) -> bool {
    settings.secondary == EffectMethods::EXACT && settings.lod_correct.is_none()
}

/// What frames of `settings` load at most: what they say, else `usual`, or all where they must.
fn budget(settings: &Settings, usual: FrameBudget) -> Option<FrameBudget> {
    settings.frame_budget().or(Some(usual)).filter(|_| may_have_budget(settings))
}

impl Pace {
    /// The settings that a session is opened with to show pictures of `settings`.
    pub fn opening(&self, settings: &Settings) -> Settings {
        Settings {
            frame_budget: budget(settings, self.budget),
            interactive: None,
            noise: None,
            aov: !settings.taa,
            ..settings.clone()
        }
    }

    /// The same while the camera moves: `scale` times the width and height. Where no levels of detail stand in for what
    /// is missing, more of it is waited for.
    pub fn of_moving(&self, settings: &Settings, scale: f64, has_levels: bool) -> Settings {
        let of = |edge: u32| ((f64::from(edge) * scale).round() as u32).max(1);
        let size = ImageSize { width: of(settings.size.width), height: of(settings.size.height) };
        // What the light of few samples is worth falls with the pixels.
        let takes_levels = may_have_budget(settings) && !settings.hides();
        let lod = if takes_levels { settings.lod.max(1.0) } else { settings.lod };
        let frame_budget = budget(settings, if has_levels && takes_levels { self.budget } else { self.resting });
        let opening = self.opening(&Settings { taa: false, ..settings.clone() });
        Settings { size, spp: 1, lod, frame_budget, ..opening }
    }

    /// Whether pictures of a moving camera have secondary rays of one pixel in four.
    pub fn halves(&self, settings: &Settings) -> bool {
        self.half_rate && settings.effects != EffectList::PRIMARY && may_have_budget(settings)
    }

    /// The same of a camera that rests, of so many samples; `waits`: everything is waited for.
    pub fn of_resting(&self, settings: &Settings, samples: u32, waits: bool) -> Settings {
        let frame_budget = budget(settings, self.resting).filter(|_| !waits);
        Settings {
            spp: samples,
            frame_budget,
            taa: false,
            ..self.opening(&Settings { taa: false, ..settings.clone() })
        }
    }
}

/// Chooses the scale of pictures by how long they took.
#[derive(Clone, Copy, Debug, Default)]
pub struct Scale {
    number: usize,
    /// Milliseconds of a picture of the full size; `None`: not known.
    full_ms: Option<f64>,
}

/// The share of the time of a full picture that one of this scale takes.
fn cost(scale: f64) -> f64 {
    FIXED + (1.0 - FIXED) * scale * scale
}

impl Scale {
    /// Before anything is known: small, so that the first picture comes soon.
    pub fn new() -> Self {
        Self { number: 2, full_ms: None }
    }

    /// The factor of width and height.
    pub fn factor(&self) -> f64 {
        SCALES[self.number]
    }

    /// A picture of this scale took `ms` of at most `most`.
    pub fn note(&mut self, ms: f64, most: f64) {
        let full = ms / cost(self.factor());
        let known = self.full_ms.map_or(full, |known| known + (full - known) * LATEST);
        self.full_ms = Some(known);
        let fits = |number: usize, share: f64| known * cost(SCALES[number]) <= most * share;
        if !fits(self.number, 1.0) {
            self.number = (self.number..SCALES.len()).find(|&number| fits(number, 1.0)).unwrap_or(SCALES.len() - 1);
        } else if self.number > 0 && fits(self.number - 1, HEADROOM) {
            // One at a time: what grows too fast falls back, which is seen.
            self.number -= 1;
        }
    }
}

/// The pictures of a camera that rests: more and more samples, each until all pixels are exact.
#[derive(Clone, Copy, Debug)]
pub struct Refinement {
    samples: u32,
    all: u32,
    /// The most pixels that were exact, and how many pictures ago.
    best: u64,
    stalled: u32,
    waits: bool,
}

/// Pictures without one more exact pixel, after which everything is waited for: the cache does not hold it at once.
const MOST_STALLED: u32 = 8;

impl Refinement {
    /// Up to `all` samples.
    pub fn new(all: u32) -> Self {
        Self { samples: 1, all: all.max(1), best: 0, stalled: 0, waits: false }
    }

    /// Samples of the next picture, and whether everything is waited for.
    pub fn next(&self) -> (u32, bool) {
        (self.samples.min(self.all), self.waits)
    }

    /// The picture had so many exact pixels of so many. Whether it was the last.
    pub fn note(&mut self, exact: u64, pixels: u64) -> bool {
        if exact == pixels {
            if self.samples >= self.all {
                return true;
            }
            self.samples = self.samples.saturating_mul(STEP);
            (self.best, self.stalled) = (0, 0);
            return false;
        }
        self.stalled = if exact > self.best { 0 } else { self.stalled + 1 };
        self.best = self.best.max(exact);
        if self.stalled >= MOST_STALLED {
            (self.waits, self.stalled) = (true, 0);
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn resolution_falls_at_once_and_comes_back_by_steps() {
        let mut scale = Scale::new();
        let frame = |scale: &Scale, full: f64| full * cost(scale.factor());
        for _ in 0..4 {
            let ms = frame(&scale, 1000.0);
            scale.note(ms, 50.0);
        }
        // Even the least takes longer than there is.
        assert_eq!(scale.factor(), SCALES[SCALES.len() - 1]);
        let mut factors = Vec::new();
        for _ in 0..40 {
            let ms = frame(&scale, 55.0);
            scale.note(ms, 50.0);
            factors.push(scale.factor());
        }
        assert!(factors.is_sorted(), "{factors:?}");
        assert_eq!(*factors.last().unwrap(), 0.75);
        // It stays where it is, without swinging.
        for _ in 0..20 {
            let ms = frame(&scale, 55.0);
            scale.note(ms, 50.0);
            assert_eq!(scale.factor(), 0.75);
        }
    }

    #[test]
    fn a_camera_at_rest_comes_to_what_was_asked() {
        let mut steps = Refinement::new(6);
        let mut samples = Vec::new();
        loop {
            samples.push(steps.next().0);
            if steps.note(10, 10) {
                break;
            }
        }
        assert_eq!(samples, [1, 4, 6]);
        // Where pixels do not become exact one waits for all.
        let mut steps = Refinement::new(1);
        for exact in [1, 5, 7, 7, 6, 7, 5, 7, 7, 7] {
            assert!(!steps.next().1 && !steps.note(exact, 10));
        }
        assert!(!steps.note(7, 10) && steps.next().1);
        assert!(steps.note(10, 10));
    }

    #[test]
    fn settings_follow_what_can_be_shown() {
        let pace = Pace::default();
        let asked = Settings::from_options("--size 640x360 --spp 16 --taa").unwrap();
        let moving = pace.of_moving(&asked, 0.25, true);
        assert_eq!((moving.size.width, moving.size.height, moving.spp, moving.lod), (160, 90, 1, 1.0));
        assert!(moving.check().is_ok() && moving.aov && moving.frame_budget == Some(pace.budget));
        assert_eq!(pace.of_moving(&asked, 0.25, false).frame_budget, Some(pace.resting));
        assert!(pace.of_resting(&asked, 4, true).frame_budget.is_none());
        assert_eq!(pace.of_resting(&asked, 4, false).lod, 0.0);
        // What excludes a budget has none.
        for options in ["--secondary roma", "--lod 1 --lod-correct 16"] {
            let asked = Settings::from_options(options).unwrap();
            for of in [pace.opening(&asked), pace.of_moving(&asked, 0.5, true), pace.of_resting(&asked, 1, false)] {
                assert!(of.check().is_ok() && of.frame_budget.is_none(), "{options}");
            }
        }
        let own = Settings::from_options("--interactive 1M").unwrap();
        assert_eq!(pace.of_moving(&own, 1.0, false).frame_budget, Some(FrameBudget::Bytes(1 << 20)));
        assert!(pace.opening(&asked).needs_opening(&moving).is_none());
    }
}
