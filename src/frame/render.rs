//! The frame loop.

use super::bands::Joint;
use super::correct::correct;
use super::engine::RenderSettings;
use super::half_rate;
use super::noise::{LEAST, Noise};
use super::{
    Accumulation, BATCH_SAMPLES, Effects, Engine, FrameRecords, GuideReader, Guides, Methods, Moved, PixelState,
    Pixels, camera_view,
};
use crate::counters::{Counters, Record};
use crate::kernels::Lod;
use crate::kernels::layout::{GBuffer, Hit, NONE, Ray, Surface};
use crate::math::sampling::pixel_jitter;
use crate::scene::Camera;
use crate::schedule::{ExecutorError, Lamp, Pass, Shading, Step};
use bricks::MATERIAL_REFRACTS;
use std::ops::{Deref, DerefMut};
use std::sync::LazyLock;
use thiserror::Error;

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

/// Who watches a frame being made, and may stop it. `()` does neither.
pub trait FrameWatch {
    /// So many passes of the frame's about so many are done, over all samples; whether to go on.
    fn passes(&mut self, _done: u32, _about: u32) -> bool {
        true
    }

    /// So many samples are finished, and this is their sum: after every [`BATCH_SAMPLES`] and at the end; whether to go
    /// on. Not of frames that are rendered in bands.
    fn samples(&mut self, _finished: u32, _sum: &Accumulation) -> bool {
        true
    }
}

impl FrameWatch for () {}

/// Counts the passes of a frame and tells who watches.
struct Passes<'a> {
    watch: &'a mut dyn FrameWatch,
    done: u32,
    about: u32,
}

impl<'a> Passes<'a> {
    fn new(watch: &'a mut dyn FrameWatch, engine: &Engine) -> Self {
        let effects = &engine.settings.effects;
        let occlusion = effects.occlusion.map_or(0, |occlusion| occlusion.rays);
        let a_sample = 2 + occlusion + effects.diffuse.unwrap_or(0) + u32::from(effects.glossy);
        let times = if engine.corrects() { 2 } else { 1 };
        let samples = engine.settings.samples.saturating_mul(engine.bands().len() as u32 * times);
        Self { watch, done: 0, about: samples.saturating_mul(a_sample) }
    }

    /// One more pass.
    fn advance(&mut self) -> Result<(), RenderError> {
        self.done += 1;
        if self.watch.passes(self.done, self.about) { Ok(()) } else { Err(RenderError::Interrupted) }
    }
}

/// A frame and its records.
#[derive(Clone, Debug, Default)]
pub struct FrameOutput {
    /// The pixels.
    pub pixels: Pixels,
    /// One record a pass.
    pub records: Vec<Record>,
    /// Whether the ray through the pixel's centre met a surface, where settings ask for it; else empty.
    pub coverage: Vec<bool>,
    /// What it saw, where settings ask for it.
    pub guides: Option<Guides>,
}

/// Renders frames: an engine, and the methods that answer secondary rays in place of tracing them.
pub struct Renderer {
    /// What passes are traced with; a renderer derefs to it.
    pub engine: Engine,
    /// The methods; without any, all rays are traced.
    pub methods: Methods,
}

impl Deref for Renderer {
    type Target = Engine;

    fn deref(&self) -> &Engine {
        &self.engine
    }
}

impl DerefMut for Renderer {
    fn deref_mut(&mut self) -> &mut Engine {
        &mut self.engine
    }
}

impl Renderer {
    /// Renders one frame. Without ROMA and distance fields it is exact; with them, too, pixels depend on scene, camera,
    /// lights and settings alone, unless [`super::RenderSettings::budget`] bounds what is loaded.
    ///
    /// # Errors
    /// A brick that cannot be read, or the device's.
    pub fn frame(&mut self, frame: u32, camera: &Camera) -> Result<FrameOutput, RenderError> {
        self.frame_watched(frame, camera, &[], &mut ())
    }

    /// [`Renderer::frame`], watched; the sum of samples is told after as many as `checkpoints` name, too.
    ///
    /// # Errors
    /// As those of [`Renderer::frame`], or `watch` said no.
    pub fn frame_watched(
        &mut self,
        frame: u32,
        camera: &Camera,
        checkpoints: &[u32],
        watch: &mut dyn FrameWatch,
    ) -> Result<FrameOutput, RenderError> {
        let Self { engine, methods } = self;
        let mut passes = Passes::new(watch, engine);
        if let Some(captures) = &mut engine.captures {
            captures.clear();
        }
        if let Some(answers) = &mut engine.answers {
            answers.pixels.clear();
        }
        engine.begin_budget();
        let mut output = FrameOutput::default();
        let mut records = FrameRecords::new(frame);
        engine.executor.set_lamps(&engine.light.lamps)?;
        let width = engine.size.0 as usize;
        let picture = width * engine.rows().len();
        for rows in engine.bands() {
            let joint = Joint { band: width * rows.len(), picture };
            let band = Band { frame, camera, first_row: rows.start, checkpoints };
            output.append(band.render(engine, methods, &mut records, &mut passes)?, joint);
        }
        if engine.corrects() {
            let exact = exact_blocks(engine, methods, (frame, camera), &mut records, &mut passes)?;
            let (one_in, seed) = (engine.settings.correct_one_in, frame_seed(engine.settings.seed, frame));
            correct(&mut output.pixels.radiance, &exact, width, one_in, seed);
        }
        output.records = records.finish(engine);
        engine.moved = Moved::default();
        engine.end_budget(camera, &mut output.pixels)?;
        if engine.halves() {
            half_rate::note_states(width, &mut output.pixels);
        }
        // Kernels count light that is not finite and leave it out; this finds what came about in any other way.
        if let Some(primary) = output.records.iter_mut().find(|record| record.pass == "primary") {
            primary.non_finite += output.pixels.not_finite();
            let of = |state| output.pixels.state.iter().filter(|own| **own == state).count() as u64;
            (primary.pixels_exact, primary.pixels_bounded) = (of(PixelState::Exact), of(PixelState::Bounded));
        }
        Ok(output)
    }
}

/// Seed of the random numbers of a frame.
fn frame_seed(seed: u32, frame: u32) -> u32 {
    seed.wrapping_add(frame.wrapping_mul(0x9E37_79B9))
}

/// The radiance of the blocks that correct what levels of detail show, exactly.
fn exact_blocks(
    engine: &mut Engine,
    methods: &mut Methods,
    (frame, camera): (u32, &Camera),
    records: &mut FrameRecords,
    passes: &mut Passes,
) -> Result<Vec<[f32; 3]>, RenderError> {
    let (settings, captures) = (engine.settings, engine.captures.take());
    let lod = Lod { pixels: 0.0, ..settings.lod };
    engine.settings = RenderSettings { lod, only_chosen: true, aov: false, guides: false, coverage: false, ..settings };
    let mut output = FrameOutput::default();
    let width = engine.size.0 as usize;
    let picture = width * engine.rows().len();
    let rendered = engine.bands().try_for_each(|rows| {
        let joint = Joint { band: width * rows.len(), picture };
        let band = Band { frame, camera, first_row: rows.start, checkpoints: &[] };
        output.append(band.render(engine, methods, records, passes)?, joint);
        Ok(())
    });
    (engine.settings, engine.captures) = (settings, captures);
    rendered.map(|()| output.pixels.radiance)
}

/// Rows of a frame that are rendered at a time, all samples of them: the frame, or a band of it.
struct Band<'a> {
    frame: u32,
    camera: &'a Camera,
    first_row: u32,
    /// Samples after which the sum is told, too.
    checkpoints: &'a [u32],
}

impl Band<'_> {
    /// What they show.
    fn render(
        &self,
        engine: &mut Engine,
        methods: &mut Methods,
        records: &mut FrameRecords,
        passes: &mut Passes,
    ) -> Result<FrameOutput, RenderError> {
        let &Self { frame, camera, first_row, checkpoints } = self;
        let effects = engine.settings.effects;
        let mut output = FrameOutput::default();
        let mut accumulation = Accumulation::default();
        // Nobody is told the sums of a part of the picture.
        let is_told = engine.bands().len() == 1 && !engine.settings.only_chosen;
        let rows = [engine.size.0 as usize, engine.band_rows as usize];
        let mut noise = engine.settings.noise.map(|target| Noise::new(target, rows));
        // So many samples stand for a pixel when textures are looked up.
        let shares = if noise.is_some() { LEAST } else { engine.settings.samples };
        let mut guides = engine.settings.guides.then(|| GuideReader::new(camera, engine.size, &engine.moved));
        for sample in 0..engine.settings.samples {
            if sample.is_multiple_of(BATCH_SAMPLES)
                && let Some(captures) = &mut engine.captures
            {
                captures.begin_batch();
            }
            let seed = frame_seed(engine.settings.seed, frame);
            let mut view =
                camera_view(engine.scene.resident(), camera, &engine.light, &effects, engine.size, sample, seed);
            view.params.first_row = first_row;
            view.directions.scatter |= engine.settings.guides;
            if engine.settings.only_chosen {
                view.params.traced_one_in = engine.settings.correct_one_in;
            }
            view.directions.lod = Lod { angle: view.params.step_y[3], ..engine.settings.lod };
            if let Some((point, normal)) = engine.settings.clip {
                let off = normal.dot(point - view.frame.origin) / view.frame.unit;
                view.params.clip = [normal.x as f32, normal.y as f32, normal.z as f32, off as f32];
            }
            // Each sample stands for its share of the pixel: textures are looked up by that.
            view.params.step_y[3] /= (shares as f32).sqrt();
            if engine.settings.taa {
                let [x, y] = pixel_jitter(frame, sample, engine.settings.samples);
                view.params.jitter = [x, y, 0.0, 0.0];
            }
            engine.executor.begin_frame(&view);
            methods.iter_mut().for_each(|method| method.begin(camera, &view));
            if sample == 0 {
                for method in methods.iter_mut() {
                    method.before_camera_rays(engine, records, &view)?;
                }
            }
            records.pass(engine, "primary", |r, stats| {
                let stop = noise.as_ref().and_then(Noise::step);
                let first: Vec<Step> = std::iter::once(Step::Generate).chain(stop).collect();
                r.trace(frame, Pass::Primary, [&first, &[]], stats)?;
                r.resolve(Pass::Primary, stats)?;
                let sky = effects.occlusion.is_none() && effects.diffuse.is_none() && !r.draws_environment();
                let shading =
                    Shading { sun: !effects.shadow, sky, emission: true, miss: true, environment: false, gloss: false };
                r.shade(Pass::Shadow(Lamp::Sun), shading, stats)
            })?;
            passes.advance()?;
            let before = if engine.halves() { Some(engine.executor.read_radiance()?) } else { None };
            if sample == 0 {
                for method in methods.iter_mut() {
                    method.after_camera_rays(engine, records, &view)?;
                }
            }
            light(engine, methods, records, ["primary", "shadow"], Pass::Shadow)?;
            if let Some(guides) = &mut guides {
                guides.lamps(&mut *engine.executor, &engine.scene.resident().materials, &view, sample)?;
            }
            light_environment(engine, methods, records, "environment", Pass::Shadow)?;
            passes.advance()?;
            let directions = |count: u32| sample * count..(sample + 1) * count;
            for index in directions(effects.occlusion.map_or(0, |occlusion| occlusion.rays)) {
                records
                    .pass(engine, "ao", |r, stats| trace_and_add(r, methods, frame, Pass::Occlusion(index), stats))?;
                passes.advance()?;
            }
            for index in directions(effects.diffuse.unwrap_or(0)) {
                let names = ["diffuse", "diffuse-shadow", "diffuse-environment"];
                bounces(engine, methods, records, names, Pass::Diffuse(index))?;
                passes.advance()?;
            }
            if effects.glossy {
                bounces(engine, methods, records, ["glossy", "glossy-shadow", "glossy-environment"], Pass::Glossy)?;
                passes.advance()?;
            }
            if sample == 0 && engine.settings.coverage {
                output.coverage = engine.executor.read_hits(Pass::Primary)?.iter().map(|hit| hit.id != NONE).collect();
            }
            if sample == 0 && engine.settings.aov {
                read_aovs(engine, view.frame.unit, &mut output.pixels)?;
            }
            if let Some(guides) = &mut guides {
                guides.sample(&mut *engine.executor)?;
            }
            let finished = sample + 1;
            if let Some(noise) = &mut noise {
                noise.note(&mut *engine.executor, finished)?;
            }
            let is_last = finished == engine.settings.samples || noise.as_ref().is_some_and(Noise::is_done);
            let is_batch = finished.is_multiple_of(BATCH_SAMPLES) || is_last;
            let goes_on = if is_batch {
                let mut sum = engine.executor.read_radiance()?;
                if let Some(before) = &before {
                    half_rate::spread(engine.size.0 as usize, &output.pixels, before, &mut sum);
                }
                accumulation.add(sum);
                !is_told || passes.watch.samples(finished, &accumulation)
            } else if is_told && checkpoints.contains(&finished) {
                let mut so_far = accumulation.clone();
                so_far.add(engine.executor.read_radiance()?);
                passes.watch.samples(finished, &so_far)
            } else {
                true
            };
            if !goes_on {
                return Err(RenderError::Interrupted);
            }
            if is_last {
                break;
            }
        }
        output.pixels.radiance = accumulation.mean();
        output.guides = guides.map(GuideReader::finish);
        Ok(output)
    }
}

/// What the rays of bounces from the second on count for, those to lamps, and those to the environment.
static PATHS: LazyLock<Vec<[&'static str; 3]>> = LazyLock::new(|| {
    let name = |number: u32, of: &str| &*format!("bounce-{number}{of}").leak();
    (2..=Effects::MOST_BOUNCES + 1).map(|number| ["", "-shadow", "-environment"].map(|of| name(number, of))).collect()
});

/// Traces rays from primary hits, and as many bounces from theirs as are asked for: `names` are the effects that the
/// first counts for, as in [`light`] and [`light_environment`]. From the last hits light through facets is followed by
/// one more ray, as no ray to a lamp brings it; what that meets shows its emission alone.
fn bounces(
    engine: &mut Engine,
    methods: &mut Methods,
    records: &mut FrameRecords,
    names: [&'static str; 3],
    pass: Pass,
) -> Result<(), ExecutorError> {
    let (frame, count) = (records.frame(), engine.settings.effects.bounces);
    let to_lamps = |number: u32| if number < count { Pass::PathShadow } else { Pass::BounceShadow };
    if !bounce(engine, methods, records, names, pass, to_lamps(1))? {
        return Ok(());
    }
    let bends = |engine: &Engine| {
        let materials = &engine.scene.resident().materials;
        engine.settings.effects.refracts() && materials.iter().any(|m| m.flags & MATERIAL_REFRACTS != 0)
    };
    let last = if bends(engine) { count + 1 } else { count };
    for (number, names) in (2..=last).zip(&*PATHS) {
        let (of_lamp, is_lit) = (to_lamps(number), number <= count);
        let mut rays = 0;
        records.pass(engine, names[0], |r, stats| {
            let from = if is_lit { Pass::PathShadow } else { Pass::BounceShadow };
            let steps = [Step::Continue(number), Step::MovePaths { compact: r.compacts() }];
            stats.add(r.executor.run(from(Lamp::Sun), &steps, &r.cache.states)?);
            let before = stats.rays_traced;
            r.trace(frame, Pass::Path(number), [&[], &[]], stats)?;
            rays = stats.rays_traced - before;
            r.resolve(Pass::Path(number), stats)?;
            let (shadow, environment) = (r.settings.effects.shadow, r.shares_environment());
            // What lamps bring to the hits before is weighted where these rays meet it.
            let shading =
                Shading { sun: is_lit && !shadow, sky: false, emission: true, miss: true, environment, gloss: true };
            r.shade(of_lamp(Lamp::Sun), shading, stats)
        })?;
        if rays == 0 || !is_lit {
            // All paths have ended.
            break;
        }
        light(engine, methods, records, [names[0], names[1]], of_lamp)?;
        light_environment(engine, methods, records, names[2], of_lamp)?;
    }
    Ok(())
}

/// Traces rays from primary hits whose own hits are shaded, and lights those by passes of `of_lamp`; whether rays were
/// traced, so that paths may go on.
fn bounce(
    engine: &mut Engine,
    methods: &mut Methods,
    records: &mut FrameRecords,
    names: [&'static str; 3],
    pass: Pass,
    of_lamp: fn(Lamp) -> Pass,
) -> Result<bool, ExecutorError> {
    let (frame, effects) = (records.frame(), engine.settings.effects);
    let goes_on = of_lamp(Lamp::Sun) == Pass::PathShadow(Lamp::Sun);
    let mut lit = None;
    records.pass(engine, names[0], |r, stats| {
        let plan = methods.plan(r, pass)?;
        stats.methods.add(&plan.methods);
        let draws = r.draws_environment();
        if plan.is_whole {
            stats.add(r.executor.run(pass, &plan.first(), &r.cache.states)?);
            r.note_answers(pass, true)?;
            lit = Some(plan.light);
            // What is met shows nothing by itself.
            let shading = Shading { miss: true, environment: r.shares_environment(), ..Shading::default() };
            return r.shade(of_lamp(Lamp::Sun), shading, stats);
        }
        r.trace(frame, pass, [&plan.first(), &[]], stats)?;
        r.note_answers(pass, false)?;
        r.resolve(pass, stats)?;
        let is_diffuse = matches!(pass, Pass::Diffuse(_));
        // What rays to lamps bring to the surface itself must not come by diffuse rays as well, or be weighted.
        let shading = Shading {
            sun: !effects.shadow,
            sky: !is_diffuse && !draws && !goes_on,
            emission: !is_diffuse || !r.light.lamps.has_surfaces(),
            miss: true,
            environment: r.shares_environment(),
            gloss: pass == Pass::Glossy,
        };
        r.shade(of_lamp(Lamp::Sun), shading, stats)
    })?;
    if let Some(steps) = lit {
        records.pass(engine, names[1], |r, stats| {
            stats.add(r.executor.run(of_lamp(Lamp::Sun), &steps, &r.cache.states)?);
            Ok(())
        })?;
        return Ok(false);
    }
    light(engine, methods, records, [names[0], names[1]], of_lamp)?;
    light_environment(engine, methods, records, names[2], of_lamp)?;
    Ok(true)
}

/// Lights the hits that the passes `of_lamp` start from by sun and emitters, with shadows if they are on. The sun
/// without shadows has been added before. Light without shadows counts for the first of the effects, rays to lamps for
/// the second.
fn light(
    engine: &mut Engine,
    methods: &mut Methods,
    records: &mut FrameRecords,
    [name, shadow]: [&'static str; 2],
    of_lamp: impl Fn(Lamp) -> Pass,
) -> Result<(), ExecutorError> {
    let frame = records.frame();
    let has_emitters = !engine.light.lamps.emitters().is_empty();
    let lamps = [Some(Lamp::Sun), has_emitters.then_some(Lamp::Emitter)];
    for lamp in lamps.into_iter().flatten() {
        let pass = of_lamp(lamp);
        if engine.settings.effects.shadow {
            records.pass(engine, shadow, |r, stats| trace_and_add(r, methods, frame, pass, stats))?;
        } else if lamp == Lamp::Emitter {
            records.more(engine, name, |r, stats| {
                stats.add(r.executor.run(pass, &[Step::Generate, Step::AddLight], &r.cache.states)?);
                Ok(())
            })?;
        }
    }
    Ok(())
}

/// Lights the same hits by the environment, which always has shadows, if it is drawn; counts for the effect `name`.
fn light_environment(
    engine: &mut Engine,
    methods: &mut Methods,
    records: &mut FrameRecords,
    name: &'static str,
    of_lamp: impl Fn(Lamp) -> Pass,
) -> Result<(), ExecutorError> {
    let pass = of_lamp(Lamp::Environment);
    if engine.draws_environment_in(pass) {
        let frame = records.frame();
        records.pass(engine, name, |r, stats| trace_and_add(r, methods, frame, pass, stats))?;
    }
    Ok(())
}

/// Traces any-hit rays that no method answers, notes the bricks that were hit, and adds the light that comes through.
fn trace_and_add(
    engine: &mut Engine,
    methods: &mut Methods,
    frame: u32,
    pass: Pass,
    stats: &mut Counters,
) -> Result<(), ExecutorError> {
    let plan = methods.plan(engine, pass)?;
    stats.methods.add(&plan.methods);
    if plan.is_whole {
        let steps = [&plan.first()[..], &[plan.add]].concat();
        stats.add(engine.executor.run(pass, &steps, &engine.cache.states)?);
        return engine.note_answers(pass, true);
    }
    let last = [&[Step::QueryHits], &plan.after[..], &[plan.add]].concat();
    let report = engine.trace(frame, pass, [&plan.first(), &last], stats)?;
    methods.learn(pass, &report);
    stats.bricks_hit.extend(report.hit);
    engine.note_answers(pass, false)
}

fn read_aovs(engine: &mut Engine, unit: f64, pixels: &mut Pixels) -> Result<(), ExecutorError> {
    let rays: Vec<Ray> = engine.executor.read_rays(Pass::Primary)?;
    let hits: Vec<Hit> = engine.executor.read_hits(Pass::Primary)?;
    let surfaces: Vec<Surface> = engine.executor.read_surfaces(Pass::Primary)?;
    let gbuffer: Vec<GBuffer> = engine.executor.read_gbuffer()?;
    pixels.id = hits.iter().map(|h| h.id).collect();
    pixels.depth = rays.iter().zip(&hits).map(|(r, h)| depth(r, h, unit)).collect();
    pixels.normal = surfaces.iter().map(|s| s.normal).collect();
    pixels.albedo = gbuffer.iter().map(|g| g.albedo).collect();
    Ok(())
}

/// Distance along a ray in world units, from its parameter.
fn depth(ray: &Ray, hit: &Hit, unit: f64) -> f32 {
    if hit.id == NONE {
        return f32::INFINITY;
    }
    let length = ray.direction.iter().map(|&d| f64::from(d) * f64::from(d)).sum::<f64>().sqrt();
    (f64::from(hit.t) * length * unit) as f32
}
