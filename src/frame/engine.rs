//! What passes are traced with: a scene, an executor, a cache, a schedule.

use super::{Answers, Budgeted, Captures, Effects, Light, Moved};
use crate::counters::Counters;
use crate::kernels::{FrameExecutor, Lod, reflectance};
use crate::schedule::auto::Auto;
use crate::schedule::cache::Cache;
#[cfg(feature = "lab")]
use crate::schedule::fronts::{FrontPass, Fronts};
use crate::schedule::{self, ExecutorError, Pass, Report, Shading, Step, Tracer, Tracing};
use bricks::SceneFile;
use glam::DVec3;
use std::ops::Range;
use std::sync::Arc;
use std::time::Instant;

pub use crate::settings::{FrameBudget, Schedule};

/// How frames are rendered.
#[derive(Clone, Copy, Debug)]
pub struct RenderSettings {
    /// Say which pixels saw a surface.
    pub coverage: bool,
    /// The schedule of every pass.
    pub schedule: Schedule,
    /// What is traced beside camera rays.
    pub effects: Effects,
    /// Samples a pixel; with `noise` at most.
    pub samples: u32,
    /// Noise below which pixels take no more samples, as a part of their value: [`super::noise`].
    pub noise: Option<f64>,
    /// Seed of all random numbers.
    pub seed: u32,
    /// Ask which bricks every pass needed; which optimisations are on.
    pub tracing: Tracing,
    /// Read depth, normals, ids and albedo back.
    pub aov: bool,
    /// What levels of detail are selected by.
    pub lod: Lod,
    /// Of so many blocks one is traced exactly, too, to correct what levels of detail show; 0: none.
    pub correct_one_in: u32,
    /// Only the blocks that correct others are rendered: [`super::correct`].
    pub only_chosen: bool,
    /// Read back what guides denoising and temporal anti-aliasing, and give every pixel directions of its own for ao
    /// and diffuse.
    pub guides: bool,
    /// Samples lie at other points of their pixels in every frame.
    pub taa: bool,
    /// What a frame may load. What is resident stands in for the rest ([`super::PixelState`]).
    pub budget: Option<FrameBudget>,
    /// Secondary rays start from one pixel in four, and what they bring is spread to the others: [`super::half_rate`].
    pub half_rate: bool,
    /// A point and the unit normal of a plane, world space: what the normal points to is there for no ray.
    pub clip: Option<(DVec3, DVec3)>,
}

/// A scene, an executor and a cache that passes are traced with. It knows no method of secondary visibility.
pub struct Engine {
    /// The scene.
    pub scene: Arc<SceneFile>,
    /// The executor.
    pub executor: Box<dyn FrameExecutor>,
    /// The cache.
    pub cache: Cache,
    /// Settings of all frames.
    pub settings: RenderSettings,
    /// Sun and sky.
    pub light: Light,
    /// Picture size in pixels.
    pub size: (u32, u32),
    /// Rows that are rendered at a time, which the executor has room for: those of the picture, or of a band of it,
    /// whole tiles.
    pub band_rows: u32,
    /// The rows that are rendered, from the edge of a tile on; `None`: all of the picture's.
    pub only_rows: Option<Range<u32>>,
    /// Edge of a tile in pixels.
    pub tile: u32,
    /// The temporal fronts, when they are on.
    #[cfg(feature = "lab")]
    pub fronts: Option<Fronts>,
    /// What frames with a budget keep; they are traced by no other schedule.
    pub budgeted: Option<Budgeted>,
    /// What [`Schedule::Auto`] has measured.
    pub auto: Auto,
    /// What the effects of the frame did, where that is to be compared; taken between passes, outside of their times.
    pub captures: Option<Captures>,
    /// Who answered the secondary rays of the last frame, where that is asked for.
    pub answers: Option<Answers>,
    /// What has moved since the frame before.
    pub moved: Moved,
}

impl Engine {
    /// The rows that are rendered.
    pub fn rows(&self) -> Range<u32> {
        self.only_rows.clone().unwrap_or(0..self.size.1)
    }

    /// The rows of the bands that pictures are rendered in, from the top; one band has them all.
    pub fn bands(&self) -> impl ExactSizeIterator<Item = Range<u32>> + use<> {
        let (Range { start, end }, rows) = (self.rows(), self.band_rows);
        let first = move |band| start + band * rows;
        (0..(end - start).div_ceil(rows)).map(move |band| first(band)..first(band + 1).min(end))
    }

    /// Whether what levels of detail show is corrected.
    pub fn corrects(&self) -> bool {
        self.settings.correct_one_in > 0 && self.settings.lod.pixels > 0.0 && !self.settings.only_chosen
    }

    /// Whether secondary rays start from one pixel in four: of pictures of one sample, of which it is known what they
    /// show.
    pub fn halves(&self) -> bool {
        self.settings.half_rate && self.settings.samples == 1 && self.settings.aov
    }

    /// Whether the rays of paths that go on come together. They keep their places where something is known of these
    /// from pass to pass.
    pub fn compacts(&self) -> bool {
        #[cfg(feature = "lab")]
        if self.fronts.is_some() {
            return false;
        }
        self.budgeted.is_none() && self.captures.is_none() && !self.halves()
    }

    /// Rays that are traced at a time.
    pub fn rays(&self) -> usize {
        self.size.0 as usize * self.band_rows as usize
    }

    /// Whether rays lead to the environment.
    pub fn draws_environment(&self) -> bool {
        self.settings.effects.environment && self.light.lamps.environment.is_some()
    }

    /// Whether rays lead to the environment and share its light with rays that surfaces draw. An even one is brought in
    /// one way alone: by what surfaces draw, where they do.
    pub fn shares_environment(&self) -> bool {
        self.draws_environment() && !self.light.lamps.environment.as_ref().is_some_and(|own| own.is_even)
    }

    /// Whether the rays to the environment of `pass` bring anything.
    pub fn draws_environment_in(&self, pass: Pass) -> bool {
        let effects = &self.settings.effects;
        let brings = match pass {
            Pass::PathShadow(_) => false,
            Pass::Shadow(_) if effects.diffuse.is_some() => {
                !effects.glossy && reflectance::is_needed(self.scene.resident())
            }
            _ => true,
        };
        self.draws_environment() && (brings || self.shares_environment())
    }

    /// Notes who answered the rays of a pass that has just been traced, where that is asked for.
    pub(super) fn note_answers(&mut self, pass: Pass, is_whole: bool) -> Result<(), ExecutorError> {
        match &mut self.answers {
            Some(answers) => answers.note(&mut *self.executor, pass, is_whole),
            None => Ok(()),
        }
    }

    /// Shades the hits of the set before that of `pass`.
    pub fn shade(&mut self, pass: Pass, light: Shading, stats: &mut Counters) -> Result<(), ExecutorError> {
        stats.add(self.executor.run(pass, &[Step::Shade(light)], &self.cache.states)?);
        Ok(())
    }

    /// Traces the rays of a pass, which the steps in `first` make, by the schedule in force, and runs the steps in
    /// `last`; what these reported is counted, and returned.
    ///
    /// # Errors
    /// A brick that cannot be read, or the device's.
    pub fn trace(
        &mut self,
        frame: u32,
        pass: Pass,
        [first, last]: [&[Step]; 2],
        stats: &mut Counters,
    ) -> Result<Report, ExecutorError> {
        let after =
            [(self.settings.clip.is_some(), Step::ClipRays), (self.halves() && pass != Pass::Primary, Step::HalveRays)];
        let after = after.into_iter().filter_map(|(is_on, step)| is_on.then_some(step));
        let first: &[Step] = &first.iter().copied().chain(after).collect::<Vec<_>>();
        if let Some(mut budgeted) = self.budgeted.take() {
            let done = budgeted.trace(&mut self.tracer(pass, &[], stats), first);
            self.budgeted = Some(budgeted);
            done?;
            return self.run_last(pass, last, stats);
        }
        let schedule = self.settings.schedule;
        if schedule != Schedule::Auto {
            return self.trace_by(schedule, frame, pass, [first, last], stats);
        }
        let chosen = self.auto.choose(pass, self.cache.states.all_geometry_resident());
        let start = Instant::now();
        // Neither loading nor the measurement of needs, which is taken off the pass's time, is a cost of the schedule.
        let besides = stats.ms_stream - stats.ms;
        let rays = stats.rays_traced;
        let report = self.trace_by(chosen, frame, pass, [first, last], stats)?;
        let ms = start.elapsed().as_secs_f64() * 1e3 - (stats.ms_stream - stats.ms - besides);
        self.auto.note(pass, ms, stats.rays_traced - rays);
        Ok(report)
    }

    #[cfg_attr(not(feature = "lab"), expect(unused_variables))]
    fn trace_by(
        &mut self,
        schedule: Schedule,
        frame: u32,
        pass: Pass,
        [first, last]: [&[Step]; 2],
        stats: &mut Counters,
    ) -> Result<Report, ExecutorError> {
        #[cfg(feature = "lab")]
        if let Some(mut fronts) = self.fronts.take_if(|_| schedule == Schedule::Chc) {
            stats.schedule.push(schedule.name());
            let scene = self.scene.clone();
            let setup = FrontPass { resident: scene.resident(), extent: (self.size.0, self.size.1, self.tile), frame };
            let done = fronts.trace(&mut self.tracer(pass, &[], stats), &setup, first);
            self.fronts = Some(fronts);
            done?;
            return self.run_last(pass, last, stats);
        }
        let mut tracer = self.tracer(pass, last, stats);
        schedule::trace(&mut tracer, schedule, first)?;
        match tracer.ended {
            Some(report) => Ok(report),
            None => self.run_last(pass, last, stats),
        }
    }

    /// Runs what follows a pass in a submission of its own.
    fn run_last(&mut self, pass: Pass, last: &[Step], stats: &mut Counters) -> Result<Report, ExecutorError> {
        if last.is_empty() {
            return Ok(Report::default());
        }
        let report = self.executor.run(pass, last, &self.cache.states)?;
        stats.add(&report);
        Ok(report)
    }

    /// What a schedule works with to trace the rays of a pass, after which the steps in `last` follow.
    pub fn tracer<'a>(&'a mut self, pass: Pass, last: &'a [Step], stats: &'a mut Counters) -> Tracer<'a> {
        let Self { executor, cache, settings, .. } = self;
        Tracer { last, ..Tracer::new(&mut **executor, cache, pass, &settings.tracing, stats) }
    }
}
