//! Settings that change while a session is open, and pictures of a camera that nobody has planned: what a window needs.
//! A picture is that of a walk whose only frame it is, so that what is seen in the end is what `walk` writes.

use super::Session;
use super::bands;
use super::hidden;
use super::lighting::lighting;
use super::open::Frame;
use super::renderer::render_settings;
use crate::frame::{Answered, Answers, Budgeted, RenderError, RenderSettings};
use crate::kernels::Extent;
use crate::kernels::layout::{Hit, NONE, Surface};
use crate::kernels::shade::more;
use crate::picture::denoise::Resolve;
use crate::picture::exposure::Meter;
use crate::scene::Camera;
use crate::schedule::Pass;
use crate::session::{Settings, Watch};
use crate::settings::{Entry, Group, Heading};
use anyhow::{Context, Result};
use std::sync::Arc;

/// Settings under other headings that may change while a session is open.
const ALSO: [&str; 8] = ["size", "fov", "clip", "hide", "only", "aov", "frame_budget", "interactive"];

/// Whether a setting may change while a session is open.
fn is_live(entry: &Entry) -> bool {
    let of_heading = matches!(entry.field.heading, Heading::Effects | Heading::Light | Heading::Quality);
    let key = entry.key();
    key != "opaque" && ((of_heading && entry.table.is_empty()) || ALSO.contains(&key.as_str()))
}

impl Settings {
    /// The first setting that differs in `other` and that a session takes when it is opened only.
    pub fn needs_opening(&self, other: &Self) -> Option<Entry> {
        let is_other = |entry: &Entry| self.get(&entry.key()) != other.get(&entry.key());
        Self::entries().into_iter().find(|entry| !is_live(entry) && is_other(entry))
    }

    /// Whether `other` asks for other light.
    fn lights_otherwise(&self, other: &Self) -> bool {
        let is_light = |entry: &Entry| entry.field.heading == Heading::Light || entry.field.key == "effects";
        let is_other = |entry: &Entry| self.get(&entry.key()) != other.get(&entry.key());
        Self::entries().iter().any(|entry| is_light(entry) && is_other(entry))
    }
}

impl Session {
    /// Whether `settings` differ from those of the session in what it takes when it is opened only.
    pub fn needs_opening(&self, settings: &Settings) -> bool {
        self.given.needs_opening(settings).is_some()
    }

    /// Takes other settings for the pictures to come: size, effects, light, quality, budget. The device and its cache
    /// stay as they are, and so does what is set when a session is opened ([`Settings::needs_opening`]).
    ///
    /// # Errors
    /// Settings that do not go together; an environment that cannot be read; a picture that memory does not hold.
    /// The session then keeps those it had.
    pub fn set(&mut self, settings: &Settings) -> Result<()> {
        if *settings == self.given {
            return Ok(());
        }
        settings.check()?;
        let suited = settings.suited(&self.renderer.scene.resident().manifest);
        let is_on_host = self.renderer.executor.device().backend == "cpu";
        let has_more = more::is_needed(self.renderer.scene.resident());
        bands::check_whole(&suited, &self.settings, (is_on_host, has_more))?;
        let lighting = match self.settings.lights_otherwise(&suited) {
            true => Some(lighting(&suited, &self.renderer.scene, &self.file)?),
            false => None,
        };
        let is_hidden_otherwise = (&self.settings.hide, &self.settings.only) != (&suited.hide, &suited.only);
        let hidden = hidden::bounds(&suited, &self.renderer.scene.resident().manifest)?;
        let engine = &mut self.renderer.engine;
        let size = (suited.size.width, suited.size.height);
        if size != engine.size {
            let extent = Extent { width: size.0, height: size.1, tile: engine.tile };
            engine.executor.set_extent(extent).with_context(|| self.file.display().to_string())?;
            (engine.size, engine.band_rows) = (size, size.1);
        }
        if is_hidden_otherwise {
            engine.executor.set_hidden(&hidden).with_context(|| self.file.display().to_string())?;
            engine.budgeted = None;
        }
        let render = render_settings(&suited, engine.settings.schedule);
        if render.effects.has_bounces() && !engine.settings.effects.has_bounces() {
            engine.executor.allow_bounces();
        }
        match (render.budget, &engine.budgeted) {
            (None, _) => {
                engine.budgeted = None;
                engine.executor.mark_leaves(&Arc::from([]));
            }
            (Some(_), None) => engine.budgeted = Some(Budgeted::new(engine.scene.resident(), !suited.hides())),
            (Some(_), Some(_)) => {}
        }
        engine.settings = RenderSettings { half_rate: engine.settings.half_rate, ..render };
        if let Some(lighting) = lighting {
            engine.light = lighting.light.clone();
            self.warnings.extend(lighting.warnings.iter().cloned());
            self.lighting = lighting;
        }
        (self.settings, self.given) = (suited, settings.clone());
        Ok(())
    }

    /// What `camera` sees, as a walk shows it whose only frame this is; `None`: `watch` stopped it. With a budget
    /// ([`Settings::frame_budget`]) pixels say how exact they are, and the same again brings more of them.
    ///
    /// # Errors
    /// A brick that cannot be read, or the device's.
    pub fn picture(&mut self, camera: &Camera, watch: &mut dyn Watch) -> Result<Option<Frame>> {
        let name = || self.file.display().to_string();
        let mut output = match self.renderer.frame_watched(0, camera, &[], watch) {
            Err(RenderError::Interrupted) => return Ok(None),
            output => output.with_context(name)?,
        };
        let Settings { denoise, taa, exposure, tone_map, .. } = self.settings;
        Resolve::new(denoise, taa).frame_on(&mut self.renderer.engine, &mut output).with_context(name)?;
        let stops = Meter::new(exposure, tone_map.white()).stops(&output.pixels.radiance, &output.coverage, 0.0);
        let (size, pixels, records) = (self.renderer.size, output.pixels, output.records);
        Ok(Some(Frame { number: 0, size, pixels, records, checkpoints: Vec::new(), exposure_ev: stops, tone_map }))
    }

    /// The name of the device.
    pub fn device(&self) -> String {
        self.renderer.engine.executor.device().name
    }

    /// Traces the secondary rays of one pixel in four from now on, and spreads what they bring, in pictures of one
    /// sample with AOVs; or all of them.
    pub fn set_half_rate(&mut self, is_half: bool) {
        self.renderer.engine.settings.half_rate = is_half;
    }

    /// Notes who answers the secondary rays of pictures from now on, or stops to.
    pub fn note_answers(&mut self, notes: bool) {
        let answers = &mut self.renderer.engine.answers;
        *answers = answers.take().filter(|_| notes).or(notes.then(Answers::default));
    }

    /// Who answered the secondary rays of the last picture; `None`: that was not noted.
    pub fn answers(&self) -> Option<&[Answered]> {
        self.renderer.engine.answers.as_ref().map(|answers| &answers.pixels[..])
    }

    /// The brick that the last camera ray of each pixel of the last picture hit, and whether it is in the cache now;
    /// `None`: it hit nothing.
    ///
    /// # Errors
    /// The device's.
    pub fn bricks_seen(&mut self) -> Result<Vec<Option<(u32, bool)>>> {
        let engine = &mut self.renderer.engine;
        let hits = engine.executor.read_hits(Pass::Primary)?;
        let surfaces = engine.executor.read_surfaces(Pass::Primary)?;
        let leaves = &engine.scene.resident().leaves;
        let brick = |leaf: u32| leaves.get(leaf as usize).map(|leaf| leaf.brick);
        let of = |(hit, surface): (&Hit, &Surface)| {
            let brick = brick(surface.leaf).filter(|_| hit.id != NONE)?;
            Some((brick, engine.cache.states.geometry(brick as usize).is_some()))
        };
        Ok(hits.iter().zip(&surfaces).map(of).collect())
    }
}
