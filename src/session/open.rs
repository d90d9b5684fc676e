//! A scene, opened for frames and for rays.

use super::auto::{Auto, Wanted};
use super::checkpoints::{Checkpoint, ErrorMeter, References};
use super::left_out;
use super::lighting::{Lighting, lighting};
use super::motion::SceneMotion;
use super::opened::{Opened, open_scene};
use super::renderer::{finest_cell, lit_renderer};
use super::trace::{self, Traced};
use super::viewpoint;
use crate::counters::Record;
use crate::frame::{Accumulation, Captures, Engine, FrameOutput, FrameWatch, Light, Pixels, RenderError, Renderer};
use crate::kernels::Lod;
use crate::output::npy::{Hit, Ray};
use crate::output::{exr, png, srgb};
use crate::picture::denoise::Resolve;
use crate::picture::exposure::Meter;
use crate::picture::tone_map::ToneMap;
use crate::remote;
use crate::scene::Camera;
use crate::scene::Picture;
use crate::scene::path::CameraPath;
use crate::secondary::dvf::prepare::{Note, Walk, prepare};
use crate::secondary::roma::LEAST_CELLS;
use crate::secondary::roma::answer::Roma;
use crate::secondary::{EffectMethods, Method};
use crate::session::Settings;
use anyhow::{Context, Result, anyhow, bail};
use bricks::SceneFile;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Who watches long work, and may stop it. `()` does neither.
pub trait Watch: FrameWatch {
    /// So many rays of a field of visibility have been traced, of about so many; whether to go on.
    fn field(&mut self, _rays: u64, _about: u64) -> bool {
        true
    }
}

impl Watch for () {}

/// Measures the errors of a frame's checkpoints while somebody watches it.
struct Metered<'a> {
    watch: &'a mut dyn Watch,
    meter: Option<ErrorMeter<'a>>,
    failed: Option<anyhow::Error>,
}

impl FrameWatch for Metered<'_> {
    fn passes(&mut self, done: u32, about: u32) -> bool {
        self.watch.passes(done, about)
    }

    fn samples(&mut self, finished: u32, sum: &Accumulation) -> bool {
        self.failed = self.meter.as_mut().and_then(|meter| meter.note(finished, sum).err());
        self.failed.is_none() && self.watch.samples(finished, sum)
    }
}

/// A rendered frame.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Its number.
    pub number: u32,
    /// Width and height in pixels.
    pub size: (u32, u32),
    /// Radiance, and what else the settings ask for.
    pub pixels: Pixels,
    /// What each pass did.
    pub records: Vec<Record>,
    /// Its errors after fewer samples, where the settings ask for them.
    pub checkpoints: Vec<Checkpoint>,
    /// Stops (EV) that pictures of it are exposed by.
    pub exposure_ev: f64,
    /// How pictures of it show what is brighter than a display.
    pub tone_map: ToneMap,
}

impl Frame {
    /// The picture, 8-bit sRGB, row by row from the top.
    pub fn picture(&self) -> Vec<[u8; 3]> {
        developed(&self.pixels.radiance, self.exposure_ev, self.tone_map)
    }

    /// Writes the picture as a PNG.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write_png(&self, file: &Path) -> Result<()> {
        png::write(file, self.size.0, self.size.1, &self.picture())
    }

    /// Writes radiance, depth, normals, ids and albedo as an EXR; of a frame that was rendered with `aov`.
    ///
    /// # Errors
    /// The file cannot be written; the frame has no AOVs.
    pub fn write_exr(&self, file: &Path) -> Result<()> {
        let Pixels { radiance, depth, normal, id, albedo, state } = &self.pixels;
        if depth.len() != radiance.len() {
            bail!("{}: the frame has no AOVs; render it with aov", file.display());
        }
        let (width, height) = self.size;
        let state: Vec<u32> = state.iter().map(|&state| state as u32).collect();
        let state = (!state.is_empty()).then_some(&state[..]);
        exr::write(file, &exr::Aovs { width, height, radiance, depth, normal, triangle: id, albedo, state })
    }
}

/// Radiance as sRGB bytes: exposed by so many stops, mapped, encoded.
pub fn developed(radiance: &[[f32; 3]], stops: f64, tone_map: ToneMap) -> Vec<[u8; 3]> {
    if stops == 0.0 && tone_map == ToneMap::None {
        return srgb::pixels(radiance);
    }
    let gain = stops.exp2() as f32;
    let shown: Vec<[f32; 3]> = radiance.iter().map(|c| tone_map.apply(c.map(|x| x * gain))).collect();
    srgb::pixels(&shown)
}

/// A frame, or a band of it, as it is without any other.
#[derive(Default)]
pub(super) struct Rendered {
    pub output: FrameOutput,
    pub checkpoints: Vec<Checkpoint>,
}

/// What of all that rendering may need there was, as summaries list it.
#[derive(Clone, Debug, Default)]
pub struct LeftOut {
    /// What was there.
    pub kept: Vec<Value>,
    /// What was not.
    pub left_out: Vec<Value>,
    /// What leaving all of it out saves, where that was measured; else null.
    pub together: Value,
}

/// A scene on a device, with settings: it renders frames and traces rays.
pub struct Session {
    pub(super) file: PathBuf,
    /// As they were given.
    pub(super) given: Settings,
    /// With what suits the scene.
    pub(super) settings: Settings,
    pub(super) path: CameraPath,
    pub(super) renderer: Renderer,
    pub(super) lighting: Lighting,
    pub(super) resolve: Resolve,
    /// What is known of the field of visibility; `None` before it is prepared.
    pub(super) field: Option<Option<Note>>,
    /// The stops of every frame so far.
    pub(super) stops: Vec<f64>,
    /// Whether a frame has been rendered.
    has_rendered: bool,
    meter: Meter,
    motion: Option<SceneMotion>,
    /// What the samples of frames are measured against.
    references: Option<References>,
    /// Renders every frame exactly as well.
    reference: Option<Renderer>,
    /// Chooses methods, where settings leave that to it.
    pub(super) auto: Option<Auto>,
    /// What the first frame showed, to be rendered once more.
    first: Option<(Arc<SceneFile>, Light)>,
    pub(super) warnings: Vec<String>,
}

impl Session {
    /// Opens the scene file `file`, a device and a cache.
    ///
    /// # Errors
    /// Settings that do not go together; a bad scene, path, motion, environment or cache; the device's.
    pub fn open(file: impl AsRef<Path>, settings: &Settings) -> Result<Self> {
        let file = &remote::name(file.as_ref());
        settings.check()?;
        let references = References::open(settings)?;
        let scene = open_scene(file)?;
        check_data(&scene, file, settings)?;
        // What a scene suits was not chosen.
        let without_effect = settings.without_effect();
        let given = settings.clone();
        let settings = &settings.suited(&scene.resident().manifest);
        let mut path = match &settings.path {
            Some(file) => CameraPath::read(file)?,
            None => {
                let aspect = f64::from(settings.size.width) / f64::from(settings.size.height);
                viewpoint::path(&scene, Picture { aspect, fov_y_degrees: settings.fov })
            }
        };
        if let Some(fov) = settings.fov {
            path = path.with_fov_y_degrees(fov)?;
        }
        let lighting = lighting(settings, &scene, file)?;
        let (levelled, without_levels) = levelled(&scene, settings);
        let motion = settings.motion.as_ref().map(|file| SceneMotion::open(file, &levelled, &lighting.sources));
        let motion = motion.transpose()?;
        let opened = Opened::open(levelled.clone(), file, settings)?;
        let warnings = lighting.warnings.iter().chain(&opened.warnings).chain(&without_levels).cloned();
        let mut warnings: Vec<String> = without_effect.into_iter().chain(warnings).collect();
        if settings.frames > 1 && references.as_ref().is_some_and(|references| !references.is_of_all()) {
            warnings.push("--reference is a file: it is the reference of frame 0; name a folder to measure all".into());
        }
        let reference = settings.measure_error.then(|| reference(scene, file, settings, lighting.light.clone()));
        let mut renderer = lit_renderer(opened, settings, lighting.light.clone());
        renderer.captures = settings.measure_error.then(Captures::default);
        let auto = Auto::new(settings, file, &renderer)?;
        warnings.extend(auto.as_ref().and_then(Auto::warning));
        Ok(Self {
            file: file.into(),
            given,
            settings: settings.clone(),
            path,
            renderer,
            lighting,
            resolve: Resolve::new(settings.denoise, settings.taa),
            field: (!settings.secondary.has(Method::Dvf)).then_some(None),
            stops: Vec::new(),
            has_rendered: false,
            meter: Meter::new(settings.exposure, settings.tone_map.white()),
            motion,
            references,
            reference: reference.transpose()?,
            auto,
            first: None,
            warnings,
        })
    }

    /// The camera path: that of the settings, or one made from the scene's bounds.
    pub fn path(&self) -> &CameraPath {
        &self.path
    }

    /// The settings.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// What renders, for measurements that go deeper.
    pub fn renderer(&mut self) -> &mut Renderer {
        &mut self.renderer
    }

    /// What a person should know since this was asked last, a line each.
    pub fn take_warnings(&mut self) -> Vec<String> {
        std::mem::take(&mut self.warnings)
    }

    /// Makes or reads what `--secondary dvf` needs, which may take long; the first frame does so otherwise.
    ///
    /// # Errors
    /// A brick that cannot be read; the device's; `watch` stopped it.
    pub fn prepare(&mut self, watch: &mut dyn Watch) -> Result<()> {
        if self.field.is_none() {
            let Self { file, settings, path, renderer, warnings, .. } = self;
            let walk = Walk { path, frames: settings.frames, is_moving: settings.motion.is_some() };
            let mut watch = |rays, about| watch.field(rays, about);
            let note = prepare(renderer, file, &settings.dvf, &walk, warnings, &mut watch)?;
            self.field = Some(note);
        }
        Ok(())
    }

    /// Renders the next frame, as `camera` sees it.
    ///
    /// # Errors
    /// A brick that cannot be read, or the device's.
    pub fn frame(&mut self, camera: &Camera) -> Result<Frame> {
        let number = self.stops.len() as u32;
        self.render(number, camera, &mut ())?.ok_or_else(|| anyhow!("interrupted"))
    }

    /// Renders frame `number` of the camera path, with what moves where it is then; `None`: `watch` stopped it.
    ///
    /// # Errors
    /// As [`Session::frame`]; a place that is too far out.
    pub fn frame_watched(&mut self, number: u32, watch: &mut dyn Watch) -> Result<Option<Frame>> {
        self.place(number)?;
        self.render(number, &self.path.frame(number, self.settings.frames), watch)
    }

    /// Places what moves where it is in a frame of the camera path.
    pub(super) fn place(&mut self, number: u32) -> Result<()> {
        if let Some(motion) = &self.motion {
            let time = self.path.time(number, self.settings.frames);
            motion.place(&mut self.renderer, time)?;
            if let Some(reference) = &mut self.reference {
                motion.place(reference, time)?;
            }
        }
        Ok(())
    }

    fn render(&mut self, number: u32, camera: &Camera, watch: &mut dyn Watch) -> Result<Option<Frame>> {
        match self.render_alone(number, camera, watch)? {
            Some(rendered) => self.go_on_with(number, rendered).map(Some),
            None => Ok(None),
        }
    }

    /// Renders a frame up to where earlier frames come in.
    pub(super) fn render_alone(
        &mut self,
        number: u32,
        camera: &Camera,
        watch: &mut dyn Watch,
    ) -> Result<Option<Rendered>> {
        self.prepare(watch)?;
        let name = || self.file.display().to_string();
        let is_first = !std::mem::replace(&mut self.has_rendered, true);
        let renderer = &mut self.renderer;
        if is_first && self.settings.measure_left_out {
            self.first = Some((renderer.scene.clone(), renderer.light.clone()));
        }
        let meter = self.references.as_ref().map(|references| references.meter(number)).transpose()?;
        let mut metered = Metered { watch, meter: meter.flatten(), failed: None };
        let (checkpoints, frames) = (&self.settings.checkpoints[..], self.settings.frames);
        let output = match &mut self.auto {
            Some(auto) => {
                let wanted = Wanted { number, camera, path: &self.path, frames, checkpoints };
                auto.frame(renderer, &wanted, &mut metered)
            }
            None => renderer.frame_watched(number, camera, checkpoints, &mut metered),
        };
        let Metered { meter, failed, .. } = metered;
        if let Some(error) = failed {
            return Err(error).with_context(name);
        }
        let mut output = match output {
            Err(RenderError::Interrupted) => return Ok(None),
            output => output.with_context(name)?,
        };
        let checkpoints = meter.map_or_else(Vec::new, ErrorMeter::finish);
        if is_first {
            let has_maps = !matches!(self.settings.secondary.ao, Method::Exact | Method::Auto);
            self.warnings.extend(short_rays(renderer).filter(|_| has_maps).into_iter().chain(dark_lamps(renderer)));
        }
        if let Some(reference) = &mut self.reference {
            reference.frame(number, camera).with_context(name)?;
            note_errors(&mut output.records, renderer, reference);
        }
        Ok(Some(Rendered { output, checkpoints }))
    }

    /// Makes the next frame of what was rendered: filters and exposure, for which frames come in their order.
    pub(super) fn go_on_with(&mut self, number: u32, rendered: Rendered) -> Result<Frame> {
        let Rendered { mut output, checkpoints } = rendered;
        let renderer = &mut self.renderer;
        output.records.iter_mut().for_each(Record::forget_bricks);
        self.resolve.frame_on(&mut renderer.engine, &mut output).with_context(|| self.file.display().to_string())?;
        let seconds = self.path.frame_time(self.settings.frames);
        let stops = self.meter.stops(&output.pixels.radiance, &output.coverage, seconds);
        self.stops.push(stops);
        Ok(Frame {
            number,
            size: renderer.size,
            pixels: output.pixels,
            records: output.records,
            checkpoints,
            exposure_ev: stops,
            tone_map: self.settings.tone_map,
        })
    }

    /// Finds the closest hits of rays in world space, in their order; with `any` only whether there is one.
    ///
    /// # Errors
    /// A ray that is none, by its number; a brick that cannot be read; the device's.
    pub fn trace(&mut self, rays: &[Ray], any: bool) -> Result<Vec<Hit>> {
        for (number, ray) in rays.iter().enumerate() {
            trace::check(ray).with_context(|| format!("ray {number}"))?;
        }
        let most = self.renderer.rays();
        let Engine { scene, executor, cache, settings, .. } = &mut self.renderer.engine;
        // What frames may leave out given rays must find, and no level stands in for it.
        executor.mark_leaves(&Arc::from([]));
        cache.begin_frame(None);
        let threshold = std::mem::take(&mut executor.tuning().threshold);
        let mut traced =
            Traced { scene, executor: &mut **executor, cache, schedule: settings.schedule, most, lod: Lod::default() };
        let found = trace::trace(&mut traced, rays, any, &mut |_| ());
        self.renderer.executor.tuning().threshold = threshold;
        let (hits, _) = found.with_context(|| self.file.display().to_string())?;
        Ok(hits)
    }

    /// What of all that rendering may need was there and what was left out, and why, as summaries list it; what that
    /// saves is measured where settings ask for it and `watch` lets it go on.
    ///
    /// # Errors
    /// The device's.
    pub fn left_out(&mut self, watch: &mut dyn FrameWatch) -> Result<LeftOut> {
        let all = left_out::components(&mut self.renderer, &self.settings);
        let camera = self.path.frame(0, self.settings.frames);
        let measured = match &self.first {
            Some((scene, light)) => left_out::measure(&all, scene, &self.file, &self.settings, light, &camera, watch)?,
            None => left_out::Measured::default(),
        };
        let left_out = left_out::listed(&all, false, &measured.each);
        Ok(LeftOut { kept: left_out::listed(&all, true, &[]), left_out, together: measured.together })
    }

    /// Writes the trace of requests, if settings ask for one.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write_requests(&self) -> Result<()> {
        Opened::write_requests(&self.settings, &self.renderer.cache)
    }
}

/// Refuses a scene without what methods need.
fn check_data(scene: &SceneFile, file: &Path, settings: &Settings) -> Result<()> {
    let resident = scene.resident();
    let has_occupancy = resident.bricks.is_empty() || !resident.occupancy.is_empty();
    if settings.secondary.has_maps() && !has_occupancy {
        bail!(
            "{}: --secondary {} needs the occupancy of bricks; convert the scene again without --no-proxies",
            file.display(),
            settings.secondary
        );
    }
    if settings.secondary.has(Method::Displacement) && resident.displacement.is_empty() && !resident.bricks.is_empty() {
        bail!(
            "{0}: --secondary {1} needs displacement fields, and the scene has none; make them with \
             `brickwalk bake-displacement {0}`",
            file.display(),
            settings.secondary
        );
    }
    Ok(())
}

/// The scene with its levels of detail in use, if they are asked for; what a person should know where there are none.
pub fn levelled(scene: &Arc<SceneFile>, settings: &Settings) -> (Arc<SceneFile>, Option<String>) {
    let has_budget = settings.frame_budget().is_some();
    if settings.lod == 0.0 && !has_budget {
        return (scene.clone(), None);
    }
    if scene.resident().levels.is_empty() {
        let text = match has_budget {
            true => {
                "--frame-budget shows nothing in place of bricks that have not arrived: the scene has no levels of \
                     detail; convert it with --lod on"
            }
            false => "--lod has no effect: the scene has no levels of detail; convert it with --lod on",
        };
        return (scene.clone(), Some(text.into()));
    }
    let mut levelled = scene.duplicate();
    levelled.use_levels();
    (Arc::new(levelled), None)
}

/// A renderer of the same frames, exactly, with a cache and a device session of its own.
fn reference(scene: Arc<SceneFile>, file: &Path, settings: &Settings, light: Light) -> Result<Renderer> {
    let settings = Settings {
        query_threshold: 0,
        lod: 0.0,
        requests_out: None,
        secondary: EffectMethods::EXACT,
        interactive: None,
        frame_budget: None,
        measure_needed: false,
        aov: false,
        ..settings.clone()
    };
    let opened = Opened::open(scene, file, &settings)?;
    let mut reference = lit_renderer(opened, &settings, light);
    reference.captures = Some(Captures::default());
    Ok(reference)
}

/// Enters how far the effects of the frame just rendered are from the `reference`'s.
fn note_errors(records: &mut [Record], renderer: &Renderer, reference: &Renderer) {
    let (Some(captures), Some(exact)) = (&renderer.captures, &reference.captures) else { return };
    for record in records {
        let samples = renderer.settings.samples;
        let error = captures.error(exact, record.pass, renderer.size.0, renderer.tile, samples);
        record.error_mean = error.mean;
        record.error_worst_tile = error.worst_tile;
        record.error_pixels = error.pixels;
    }
}

/// Says that rays of ao are too short for the cells that they are to meet.
fn short_rays(renderer: &Renderer) -> Option<String> {
    let length = renderer.settings.effects.occlusion.map_or(f64::INFINITY, |occlusion| occlusion.length);
    let cell = finest_cell(&renderer.methods).filter(|cell| length < LEAST_CELLS * cell)?;
    Some(format!(
        "--ao-length {length} is less than {LEAST_CELLS} cells of {cell}, the least that the scene's occupancy has \
         here: ao is coarse; make it longer, or use --secondary exact"
    ))
}

/// Says which lamps do not light what diffuse rays meet.
fn dark_lamps(renderer: &Renderer) -> Vec<String> {
    let Some(roma) = renderer.methods.get::<Roma>() else { return Vec::new() };
    let [others, areas] = roma.rsm.left_out();
    let others = (others > 0).then(|| {
        format!(
            "{others} weaker point, spot and distant lights have no map: what they light does not light other \
             surfaces; raise --rsm-lamps"
        )
    });
    let areas = (areas > 0).then(|| {
        format!(
            "{areas} area lights and surfaces that shine have no map: with --secondary roma what they light does not \
             light other surfaces; use --secondary exact"
        )
    });
    others.into_iter().chain(areas).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exposure_comes_before_the_tone_map() {
        let radiance = [[0.25, 0.5, 1.0], [0.0, 4.0, f32::NAN]];
        assert_eq!(developed(&radiance, 0.0, ToneMap::None), srgb::pixels(&radiance));
        assert_eq!(developed(&radiance, -1.0, ToneMap::None), srgb::pixels(&radiance.map(|c| c.map(|x| 0.5 * x))));
        let mapped = radiance.map(|c| ToneMap::Aces.apply(c.map(|x| 2.0 * x)));
        assert_eq!(developed(&radiance, 1.0, ToneMap::Aces), srgb::pixels(&mapped));
        // The control: the other way round it is something else.
        assert_ne!(srgb::pixels(&mapped), srgb::pixels(&radiance.map(|c| ToneMap::Aces.apply(c).map(|x| 2.0 * x))));
    }
}
