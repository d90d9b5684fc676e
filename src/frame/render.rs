//! The frame loop.

use super::pass_record::FrameRecords;
use super::{Accumulation, BATCH_SAMPLES, Captures, Effects, Light, Moved, camera_view};
use crate::counters::Record;
use crate::kernels::FrameExecutor;
use crate::kernels::layout::{GBuffer, Hit, NONE, Ray, Surface};
use crate::picture::denoise::{GuideReader, Guides, taa_jitter};
use crate::scene::Camera;
use crate::schedule::auto::{Auto, Fixed};
use crate::schedule::cache::Cache;
use crate::schedule::fronts::{FrontPass, Fronts};
use crate::schedule::{
    ExecutorError, Lamp, Pass, PassStats, RomaPart, Shading, Sift, Step, Tracing, attributes, chc, demand, plain,
};
use crate::secondary::df::FieldSettings;
use crate::secondary::df::answer::Field;
use crate::secondary::dvf::answer::Dvf;
use crate::secondary::roma::answer::Roma;
use crate::secondary::roma::handover::{PILOTS, Trust};
use crate::secondary::roma::{Role, RomaPass, RomaSettings};
use crate::secondary::rsm::answer::Rsm;
use bricks::SceneFile;
use std::sync::Arc;
use std::time::Instant;
use thiserror::Error;

/// Which schedule traces a pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Schedule {
    /// Tile lists, queries, loads nearest first.
    Chc,
    /// Every ray from the root over what is resident, then asking for what is missing.
    Demand,
    /// Everything resident, every ray from the root.
    Plain,
    /// Everything resident, every ray from the root, over binary trees; the executor has been made ready for it.
    PlainBinary,
    /// The cheapest of the first three, pass by pass.
    Auto,
}

/// How frames are rendered.
#[derive(Clone, Copy, Debug)]
pub struct RenderSettings {
    /// The schedule of every pass.
    pub schedule: Schedule,
    /// What is traced beside camera rays.
    pub effects: Effects,
    /// Samples a pixel.
    pub samples: u32,
    /// Seed of all random numbers.
    pub seed: u32,
    /// Ask which bricks every pass needed; which optimisations are on.
    pub tracing: Tracing,
    /// Read depth, normals, ids and albedo back.
    pub aov: bool,
    /// Read back what guides denoising and temporal anti-aliasing, and give every pixel directions of its own for ao
    /// and diffuse.
    pub guides: bool,
    /// Samples lie at other points of their pixels in every frame.
    pub taa: bool,
    /// Interactive: bytes of tiles of textures that a frame may load. Coarser levels stand for the others, and the
    /// frame is exact only where `unresolved_pixels` says 0.
    pub tile_bytes: Option<u64>,
    /// Occlusion and diffuse rays and those to the sun and emitters are answered by occupancy maps; none of them asks
    /// for bricks.
    pub roma: Option<RomaSettings>,
    /// The same rays are answered by distance fields.
    pub field: Option<FieldSettings>,
}

/// Why a frame could not be rendered.
#[derive(Debug, Error)]
pub enum RenderError {
    /// The executor's error.
    #[error(transparent)]
    Executor(#[from] ExecutorError),
    /// Whoever watched the frame wished it to stop.
    #[error("interrupted")]
    Interrupted,
}

/// What a frame shows, row by row from the top.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pixels {
    /// Linear Rec. 709 radiance, the mean of the samples.
    pub radiance: Vec<[f32; 3]>,
    /// Distance along the ray through the pixel's centre, world units; infinite on a miss. Empty without AOVs.
    pub depth: Vec<f32>,
    /// Geometric unit normal toward the camera, world space; zero on a miss. Empty without AOVs.
    pub normal: Vec<[f32; 3]>,
    /// Global triangle id, 4294967295 on a miss. Empty without AOVs.
    pub id: Vec<u32>,
    /// Linear base colour; zero on a miss. Empty without AOVs.
    pub albedo: Vec<[f32; 3]>,
}

impl Pixels {
    /// How many pixels have a value that is no number: radiance, normals and colours are finite, depths at most
    /// infinite.
    pub fn not_finite(&self) -> u64 {
        let count = |values: &[[f32; 3]]| values.iter().filter(|v| !v.iter().all(|x| x.is_finite())).count();
        let depths = self.depth.iter().filter(|d| d.is_nan() || **d == f32::NEG_INFINITY).count();
        (count(&self.radiance) + count(&self.normal) + count(&self.albedo) + depths) as u64
    }
}

/// A frame and its records.
#[derive(Clone, Debug, Default)]
pub struct FrameOutput {
    /// The pixels.
    pub pixels: Pixels,
    /// One record a pass.
    pub records: Vec<Record>,
    /// What it saw, where settings ask for it.
    pub guides: Option<Guides>,
}

/// A scene, an executor and a cache that frames are rendered with.
pub struct Renderer {
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
    /// Edge of a tile in pixels.
    pub tile: u32,
    /// The temporal fronts, when they are on.
    pub fronts: Option<Fronts>,
    /// What [`Schedule::Auto`] has measured.
    pub auto: Auto,
    /// What the effects of the frame did, where that is to be compared; taken between passes, outside of their times.
    pub captures: Option<Captures>,
    /// What has moved since the frame before.
    pub moved: Moved,
    /// The occupancy maps, where settings ask for them or for distance fields.
    pub roma: Roma,
    /// The distance fields, where settings ask for them.
    pub field: Field,
    /// The field of visibility, where one has been made or read.
    pub dvf: Dvf,
    /// The reflective shadow maps, where diffuse rays are answered by occupancy maps.
    pub rsm: Rsm,
}

impl Renderer {
    /// Renders one frame. Without ROMA and distance fields it is exact; with them, too, pixels depend on scene, camera,
    /// lights and settings alone, unless [`RenderSettings::tile_bytes`] bounds what is loaded.
    ///
    /// # Errors
    /// A brick that cannot be read, or the device's.
    pub fn frame(&mut self, frame: u32, camera: &Camera) -> Result<FrameOutput, RenderError> {
        self.frame_watched(frame, camera, &mut |_, _| true)
    }

    /// [`Renderer::frame`]; `watch` is told the number of finished samples, and their sum, after every
    /// [`BATCH_SAMPLES`] and at the end, and says whether to go on.
    ///
    /// # Errors
    /// As those of [`Renderer::frame`], or `watch` said no.
    pub fn frame_watched(
        &mut self,
        frame: u32,
        camera: &Camera,
        watch: &mut dyn FnMut(u32, &Accumulation) -> bool,
    ) -> Result<FrameOutput, RenderError> {
        if let Some(captures) = &mut self.captures {
            captures.clear();
        }
        self.cache.begin_frame(self.settings.tile_bytes);
        let mut output = FrameOutput::default();
        let mut records = FrameRecords::new(frame);
        let effects = self.settings.effects;
        let mut accumulation = Accumulation::default();
        self.executor.set_lamps(&self.light.lamps)?;
        let mut guides = self.settings.guides.then(|| GuideReader::new(camera, self.size, &self.moved));
        for sample in 0..self.settings.samples {
            if sample.is_multiple_of(BATCH_SAMPLES)
                && let Some(captures) = &mut self.captures
            {
                captures.begin_batch();
            }
            let seed = self.settings.seed.wrapping_add(frame.wrapping_mul(0x9E37_79B9));
            let mut view = camera_view(self.scene.resident(), camera, &self.light, &effects, self.size, sample, seed);
            view.directions.scatter = self.settings.guides;
            if self.settings.taa {
                let [x, y] = taa_jitter(frame, sample, self.settings.samples);
                view.params.jitter = [x, y, 0.0, 0.0];
            }
            self.executor.begin_frame(&view);
            self.roma.begin(camera.position, &view);
            self.dvf.begin(&view);
            if sample == 0 && effects.diffuse.is_some() {
                self.prepare_rsm(&mut records, &view)?;
            }
            records.pass(self, "primary", |r, stats| {
                r.trace(frame, Pass::Primary, &[Step::Generate], stats)?;
                attributes::resolve(&mut *r.executor, &mut r.cache, Pass::Primary, stats)?;
                let sky = effects.occlusion.is_none() && effects.diffuse.is_none() && !r.draws_environment();
                let shading =
                    Shading { sun: !effects.shadow, sky, emission: true, miss: true, environment: false, gloss: false };
                r.shade(Pass::Shadow(Lamp::Sun), shading, stats)
            })?;
            if sample == 0 {
                self.renew_dvf(&mut records, &view)?;
            }
            self.light(&mut records, ["primary", "shadow", "environment"], Pass::Shadow)?;
            if let Some(guides) = &mut guides {
                guides.lamps(&mut *self.executor, sample)?;
            }
            let directions = |count: u32| sample * count..(sample + 1) * count;
            for index in directions(effects.occlusion.map_or(0, |occlusion| occlusion.rays)) {
                records.pass(self, "ao", |r, stats| r.trace_and_add(frame, Pass::Occlusion(index), stats))?;
            }
            for index in directions(effects.diffuse.unwrap_or(0)) {
                let names = ["diffuse", "diffuse-shadow", "diffuse-environment"];
                match self.settings.roma.and_then(|roma| roma.diffuse) {
                    Some(roma) => self.gather(&mut records, names, index, roma)?,
                    None => self.bounce(&mut records, names, Pass::Diffuse(index))?,
                }
            }
            if effects.glossy {
                self.bounce(&mut records, ["glossy", "glossy-shadow", "glossy-environment"], Pass::Glossy)?;
            }
            if sample == 0 && self.settings.aov {
                self.read_aovs(view.frame.unit, &mut output.pixels)?;
            }
            if let Some(guides) = &mut guides {
                guides.sample(
                    &mut *self.executor,
                    &self.scene.resident().materials,
                    &view,
                    (sample, self.settings.samples),
                )?;
            }
            let finished = sample + 1;
            if finished.is_multiple_of(BATCH_SAMPLES) || finished == self.settings.samples {
                accumulation.add(&self.executor.read_radiance()?);
                if !watch(finished, &accumulation) {
                    return Err(RenderError::Interrupted);
                }
            }
        }
        output.pixels.radiance = accumulation.mean();
        output.guides = guides.map(GuideReader::finish);
        output.records = records.finish(self);
        self.moved = Moved::default();
        // Kernels count light that is not finite and leave it out; this finds what came about in any other way.
        if let Some(primary) = output.records.iter_mut().find(|record| record.pass == "primary") {
            primary.non_finite += output.pixels.not_finite();
        }
        Ok(output)
    }

    /// Whether rays lead to the environment.
    pub fn draws_environment(&self) -> bool {
        self.settings.effects.environment && self.light.lamps.environment.is_some()
    }

    /// Traces rays from primary hits whose own hits are shaded, and lights those: `names` are the effects that it
    /// counts for, as in [`Renderer::light`].
    fn bounce(
        &mut self,
        records: &mut FrameRecords,
        names: [&'static str; 3],
        pass: Pass,
    ) -> Result<(), ExecutorError> {
        let (frame, effects) = (records.frame(), self.settings.effects);
        records.pass(self, names[0], |r, stats| {
            r.trace(frame, pass, &[Step::Generate], stats)?;
            attributes::resolve(&mut *r.executor, &mut r.cache, pass, stats)?;
            let (is_diffuse, draws) = (matches!(pass, Pass::Diffuse(_)), r.draws_environment());
            // What rays to lamps bring to the surface itself must not come by diffuse rays as well, or be weighted.
            let shading = Shading {
                sun: !effects.shadow,
                sky: !is_diffuse && !draws,
                emission: !is_diffuse || !r.light.lamps.has_surfaces(),
                miss: true,
                environment: draws,
                gloss: pass == Pass::Glossy,
            };
            r.shade(Pass::BounceShadow(Lamp::Sun), shading, stats)
        })?;
        self.light(records, names, Pass::BounceShadow)
    }

    /// Lights the hits that the passes `of_lamp` start from by all lamps, with shadows if they are on; the environment
    /// has them always. The sun without shadows has been added before. Light without shadows counts for the first of
    /// the effects, rays to sun and emitters for the second, those to the environment for the third.
    fn light(
        &mut self,
        records: &mut FrameRecords,
        [name, shadow, environment]: [&'static str; 3],
        of_lamp: impl Fn(Lamp) -> Pass,
    ) -> Result<(), ExecutorError> {
        let frame = records.frame();
        let has_emitters = !self.light.lamps.emitters().is_empty();
        let lamps = [Some(Lamp::Sun), has_emitters.then_some(Lamp::Emitter)];
        for lamp in lamps.into_iter().flatten() {
            let pass = of_lamp(lamp);
            if self.settings.effects.shadow {
                records.pass(self, shadow, |r, stats| r.trace_and_add(frame, pass, stats))?;
            } else if lamp == Lamp::Emitter {
                records.more(self, name, |r, stats| {
                    stats.add(r.executor.run(pass, &[Step::Generate, Step::AddLight], &r.cache.states)?);
                    Ok(())
                })?;
            }
        }
        if self.draws_environment() {
            let pass = of_lamp(Lamp::Environment);
            records.pass(self, environment, |r, stats| r.trace_and_add(frame, pass, stats))?;
        }
        Ok(())
    }

    /// Traces any-hit rays, notes the bricks that were hit, and adds the light that comes through.
    fn trace_and_add(&mut self, frame: u32, pass: Pass, stats: &mut PassStats) -> Result<(), ExecutorError> {
        let (generate, add) = match pass {
            Pass::Occlusion(_) => (Step::Generate, Step::AddOcclusion),
            _ if self.dvf.is_paper(pass) => (Step::DvfCosine, Step::DvfLight),
            _ => (Step::Generate, Step::AddLight),
        };
        let roma = self.settings.roma.and_then(|settings| Roma::pass_of(&settings, pass));
        let (mut first, mut last) = (vec![generate], vec![Step::QueryHits]);
        let length = match (pass, self.settings.effects.occlusion) {
            (Pass::Occlusion(_), Some(occlusion)) => occlusion.length,
            _ => f64::INFINITY,
        };
        let is_short = |r: &mut Self| r.roma.is_short(&r.scene, length);
        let mut is_measured = false;
        if let Some(roma) = roma.filter(|roma| !roma.role.is_help() || !is_short(self)) {
            let RomaPass { grid, steps, role } = roma;
            first.extend(self.roma.prepare(&mut *self.executor, &self.scene, roma, length)?);
            let trace = |part| Step::RomaTrace { steps, part };
            match role {
                Role::Answer => {
                    let is_long = self.roma.is_long(&self.scene, length);
                    first.extend([trace(RomaPart::answering(pass, steps, is_long)), add]);
                    stats.add(self.executor.run(pass, &first, &self.cache.states)?);
                    return Ok(());
                }
                Role::Correct(one_in) => {
                    first.push(Step::RomaPilots { one_in });
                    last.push(trace(RomaPart::Correct { one_in }));
                }
                Role::Sift { most_wrong: None } => first.push(trace(RomaPart::Sift(Sift::default()))),
                Role::Sift { most_wrong: Some(most_wrong) } => {
                    is_measured = true;
                    let trust = self.roma.handover(pass).trust(most_wrong);
                    let near = match trust {
                        Trust::Beyond(cells) => Some(cells * grid.base_per_cell()),
                        Trust::Free | Trust::Nothing => None,
                    };
                    if trust != Trust::Nothing {
                        first.push(trace(RomaPart::Sift(Sift { near, pilots: PILOTS })));
                    }
                    last.push(Step::RomaMeasure { steps, pilots: PILOTS, cell: grid.base_per_cell() });
                    if near.is_some() {
                        last.push(trace(RomaPart::Far));
                    }
                }
            }
        }
        first.extend(self.dvf.prepare(&mut *self.executor, pass)?);
        if self.add_by_field(pass, add, stats)? {
            return Ok(());
        }
        self.trace(frame, pass, &first, stats)?;
        last.push(add);
        let report = self.executor.run(pass, &last, &self.cache.states)?;
        if is_measured {
            self.roma.handover(pass).note(report.pilots);
        }
        stats.bricks_hit.get_or_insert_default().extend(report.demand.iter().map(|d| d.brick));
        stats.add(report);
        Ok(())
    }

    /// Shades the hits of the set before that of `pass`.
    pub(crate) fn shade(&mut self, pass: Pass, light: Shading, stats: &mut PassStats) -> Result<(), ExecutorError> {
        stats.add(self.executor.run(pass, &[Step::Shade(light)], &self.cache.states)?);
        Ok(())
    }

    /// Traces the rays of a pass, which the steps in `first` make, by the schedule in force.
    fn trace(&mut self, frame: u32, pass: Pass, first: &[Step], stats: &mut PassStats) -> Result<(), ExecutorError> {
        let fixed = match self.settings.schedule {
            Schedule::Chc => Fixed::Chc,
            Schedule::Demand => Fixed::Demand,
            Schedule::Plain => Fixed::Plain,
            Schedule::PlainBinary => {
                let tracing = &self.settings.tracing;
                return plain::trace_binary(&mut *self.executor, &mut self.cache, pass, first, tracing, stats);
            }
            Schedule::Auto => {
                let chosen = self.auto.choose(pass, self.cache.states.all_geometry_resident());
                let start = Instant::now();
                // Neither loading nor the measurement of needs, which is taken off the pass's time, is a cost of the
                // schedule.
                let besides = stats.ms_stream - stats.ms;
                let rays = stats.report.rays;
                self.trace_by(chosen, frame, pass, first, stats)?;
                let ms = start.elapsed().as_secs_f64() * 1e3 - (stats.ms_stream - stats.ms - besides);
                self.auto.note(pass, ms, stats.report.rays - rays);
                return Ok(());
            }
        };
        self.trace_by(fixed, frame, pass, first, stats)
    }

    fn trace_by(
        &mut self,
        schedule: Fixed,
        frame: u32,
        pass: Pass,
        first: &[Step],
        stats: &mut PassStats,
    ) -> Result<(), ExecutorError> {
        let tracing = &self.settings.tracing;
        let (executor, cache) = (&mut *self.executor, &mut self.cache);
        match (schedule, &mut self.fronts) {
            (Fixed::Plain, _) => plain::trace(executor, cache, pass, first, tracing, stats),
            (Fixed::Demand, _) => demand::trace(executor, cache, pass, first, tracing, stats),
            (Fixed::Chc, None) => chc::trace(executor, cache, pass, first, tracing, stats),
            (Fixed::Chc, Some(fronts)) => {
                let resident = self.scene.resident();
                let extent = (self.size.0, self.size.1, self.tile);
                let setup = FrontPass { resident, extent, frame, pass, tracing };
                fronts.trace(executor, cache, &setup, first, stats)
            }
        }
    }

    fn read_aovs(&mut self, unit: f64, pixels: &mut Pixels) -> Result<(), ExecutorError> {
        let rays: Vec<Ray> = self.executor.read_rays(Pass::Primary)?;
        let hits: Vec<Hit> = self.executor.read_hits(Pass::Primary)?;
        let surfaces: Vec<Surface> = self.executor.read_surfaces(Pass::Primary)?;
        let gbuffer: Vec<GBuffer> = self.executor.read_gbuffer()?;
        pixels.id = hits.iter().map(|h| h.id).collect();
        pixels.depth = rays.iter().zip(&hits).map(|(r, h)| depth(r, h, unit)).collect();
        pixels.normal = surfaces.iter().map(|s| s.normal).collect();
        pixels.albedo = gbuffer.iter().map(|g| g.albedo).collect();
        Ok(())
    }
}

/// Distance along a ray in world units, from its parameter.
fn depth(ray: &Ray, hit: &Hit, unit: f64) -> f32 {
    if hit.id == NONE {
        return f32::INFINITY;
    }
    let length = ray.direction.iter().map(|&d| f64::from(d) * f64::from(d)).sum::<f64>().sqrt();
    (f64::from(hit.t) * length * unit) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_nan_anywhere_is_counted() {
        let sound = Pixels {
            radiance: vec![[1.0; 3]; 2],
            depth: vec![f32::INFINITY, 2.0],
            normal: vec![[0.0; 3]; 2],
            id: vec![1, 2],
            albedo: vec![[0.5; 3]; 2],
        };
        assert_eq!(sound.not_finite(), 0);
        let spoil: [fn(&mut Pixels); 5] = [
            |p| p.radiance[1][2] = f32::NAN,
            |p| p.radiance[0][0] = f32::INFINITY,
            |p| p.depth[0] = f32::NAN,
            |p| p.normal[1][0] = f32::NAN,
            |p| p.albedo[0][1] = f32::NEG_INFINITY,
        ];
        for spoil in spoil {
            let mut pixels = sound.clone();
            spoil(&mut pixels);
            assert_eq!(pixels.not_finite(), 1);
        }
    }
}
