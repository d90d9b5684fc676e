//! A scene with a light and a cache, of which every way makes pictures.

use super::args::{Effect, Scale};
use super::plan::{Job, Way, base, rays};
use crate::counters::Record;
use crate::frame::{FrameOutput, FrameWatch, Methods, RenderError, Renderer};
use crate::lab::bench::scenes::empty_cache;
use crate::lab::console::{Console, Stopped};
use crate::metrics::Image;
use crate::picture::denoise::Resolve;
use crate::scene::{Camera, CameraPath};
use crate::secondary::Method;
use crate::secondary::dvf::Options;
use crate::secondary::dvf::prepare::{Walk, prepare};
use crate::session::Settings;
use crate::session::lighting::lighting;
use crate::session::opened::{Opened, scaled_threshold};
use crate::session::renderer::{lit_renderer, methods, render_settings};
use crate::settings::{Adapter, CacheSize, ImageSize, Schedule};
use anyhow::{Context, Result, bail};
use bricks::SceneFile;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;
use tempfile::TempDir;

/// Frames of a still camera before a picture by a filter that looks back at them.
const BEFORE: u32 = 7;

/// What is common to all pictures of a study.
#[derive(Clone, Copy)]
pub struct Place<'a> {
    /// The scene file.
    pub file: &'a Path,
    /// The scene, without levels of detail.
    pub scene: &'a Arc<SceneFile>,
    /// Where the camera goes.
    pub path: &'a CameraPath,
    /// Sizes and counts.
    pub scale: &'a Scale,
    /// What renders.
    pub adapter: &'a Adapter,
    /// Whom it talks to.
    pub console: Console<'a>,
}

/// Fields of visibility that were made, by their options and the percent of all bricks that the cache held: the file,
/// and the seconds that it took. They depend on nothing else of a job.
pub struct Fields {
    folder: TempDir,
    made: BTreeMap<(String, u32), (PathBuf, f64)>,
}

impl Fields {
    /// With none made.
    ///
    /// # Errors
    /// There is no room for temporary files.
    pub fn new() -> Result<Self> {
        Ok(Self { folder: tempfile::tempdir()?, made: BTreeMap::new() })
    }
}

/// A way on its turn.
pub struct Party {
    /// The way.
    pub way: Way,
    /// Its settings.
    pub settings: Settings,
    /// Seconds that were spent before its first picture: on a field of visibility.
    pub making: f64,
    methods: Methods,
    /// What its filters have seen before a warm picture; `None` before the first.
    seen: Option<Resolve>,
}

/// A picture.
pub struct Picture {
    /// Radiance.
    pub image: Image,
    /// Seconds that it took, with everything it needed.
    pub seconds: f64,
    /// What its passes did.
    pub records: Vec<Record>,
}

/// Settings of a way.
///
/// # Errors
/// Options that do not go together.
pub fn settings(place: &Place, effect: Effect, way: &Way, cache: u32) -> Result<Settings> {
    let text = format!("--quality exact {} {} {}", base(effect), rays(effect, way.rays), way.options);
    let settings = Settings::from_options(&text)?;
    let (size, adapter) = (place.scale.size, place.adapter.clone());
    let settings = Settings { size, adapter, cache: CacheSize::Percent(cache.into()), ..settings };
    settings.check()?;
    Ok(settings.suited(&place.scene.resident().manifest))
}

/// A scene with a light and a cache, opened without levels of detail, and with them where a way takes some.
pub struct View<'a> {
    place: Place<'a>,
    number: u32,
    camera: Camera,
    exact: Renderer,
    levelled: Option<Renderer>,
}

impl<'a> View<'a> {
    /// That of a job.
    ///
    /// # Errors
    /// The scene's, the device's.
    pub fn open(place: Place<'a>, job: &Job) -> Result<Self> {
        let way = job.ways.first().context("a job has ways")?;
        let settings = settings(&place, job.effect, way, job.cache)?;
        let camera = place.path.frame(job.view, place.scale.views);
        let exact = opened(&place, place.scene.clone(), &settings)?;
        Ok(Self { place, number: job.view, camera, exact, levelled: None })
    }

    /// Bytes of the cache.
    pub fn cache_bytes(&self) -> u64 {
        self.exact.cache.residency.budget_bytes()
    }

    /// What renders a way.
    fn side(&mut self, settings: &Settings) -> Result<&mut Renderer> {
        if settings.lod == 0.0 {
            return Ok(&mut self.exact);
        }
        if self.levelled.is_none() {
            let mut scene = self.place.scene.duplicate();
            scene.use_levels();
            self.levelled = Some(opened(&self.place, Arc::new(scene), settings)?);
        }
        self.levelled.as_mut().context("the scene is opened")
    }

    /// A way, with what it needs before its first picture.
    ///
    /// # Errors
    /// A brick that cannot be read; the device's; the run is to come to an end.
    pub fn party(&mut self, job: &Job, way: &Way, fields: &mut Fields) -> Result<Party> {
        let place = self.place;
        let settings = settings(&place, job.effect, way, job.cache)?;
        let renderer = self.side(&settings)?;
        let mut own = methods(&settings, renderer.scene.resident());
        let mut making = 0.0;
        if settings.secondary.has(Method::Dvf) {
            let (key, number) = ((way.options.clone(), job.cache), fields.made.len());
            let kept = fields.made.get(&key).cloned();
            let file = kept.as_ref().map_or(fields.folder.path().join(format!("{number}.dvf")), |kept| kept.0.clone());
            let options = Options { file: Some(file.clone()), ..settings.dvf.clone() };
            let walk = Walk { path: place.path, frames: place.scale.views, is_moving: false };
            renderer.settings = render_settings(&settings, settings.schedule);
            std::mem::swap(&mut renderer.methods, &mut own);
            let console = place.console;
            let mut watch = |_, _| !console.is_stopped();
            let start = Instant::now();
            let made = prepare(renderer, place.file, &options, &walk, &mut Vec::new(), &mut watch);
            std::mem::swap(&mut renderer.methods, &mut own);
            if console.is_stopped() {
                return Err(Stopped.into());
            }
            made?;
            making = kept.map_or_else(|| start.elapsed().as_secs_f64(), |kept| kept.1);
            fields.made.insert(key, (file, making));
        }
        Ok(Party { way: way.clone(), settings, making, methods: own, seen: None })
    }

    /// A picture by a way; `is_cold`: beginning with an empty cache, and without what it has made for other pictures.
    /// Where filters look back at frames, it is the last of some that a still camera sees by rays of their own, and the
    /// time is that of the last; a cold one is the first. The frames before it are made once a party: all warm pictures
    /// of a party are of as many samples and of one seed.
    ///
    /// # Errors
    /// A brick that cannot be read; the device's; pixels that are not finite; the run is to come to an end.
    pub fn picture(&mut self, party: &mut Party, samples: u32, seed: u64, is_cold: bool) -> Result<Picture> {
        self.place.console.go_on()?;
        let (number, views) = (self.number, self.place.scale.views);
        let settings = Settings { spp: party.settings.spp * samples, seed, ..party.settings.clone() };
        let renderer = self.side(&settings)?;
        if is_cold {
            empty_cache(renderer)?;
            if !settings.secondary.has(Method::Dvf) {
                party.methods = methods(&settings, renderer.scene.resident());
            }
        }
        let schedule = if settings.query_threshold > 0 { Schedule::Chc } else { settings.schedule };
        renderer.settings = render_settings(&settings, schedule);
        renderer.executor.tuning().threshold = scaled_threshold(settings.query_threshold, renderer.tile);
        let mut resolve = match &party.seen {
            Some(seen) if !is_cold => seen.clone(),
            _ => Resolve::new(settings.denoise, settings.taa),
        };
        if !is_cold && party.seen.is_none() {
            let before = if settings.denoise || settings.taa { BEFORE } else { 0 };
            // Of all views, no two frames have the same number: it chooses the rays.
            for back in (1..=before).rev() {
                self.frame(party, &mut resolve, &settings, number + back * views)?;
            }
            party.seen = Some(resolve.clone());
        }
        let start = Instant::now();
        let output = self.frame(party, &mut resolve, &settings, number)?;
        let seconds = start.elapsed().as_secs_f64();
        if output.records.iter().any(|record| record.non_finite > 0) {
            bail!("{}: {:?}: pixels were not finite; this is a bug in brickwalk", self.file(), party.way);
        }
        let ImageSize { width, height } = settings.size;
        let image = Image { width: width as usize, height: height as usize, rgb: output.pixels.radiance };
        Ok(Picture { image, seconds, records: output.records })
    }

    /// A frame by a way, resolved.
    fn frame(
        &mut self,
        party: &mut Party,
        resolve: &mut Resolve,
        settings: &Settings,
        number: u32,
    ) -> Result<FrameOutput> {
        let (console, camera) = (self.place.console, self.camera);
        let renderer = self.side(settings)?;
        std::mem::swap(&mut renderer.methods, &mut party.methods);
        let output = renderer.frame_watched(number, &camera, &[], &mut UntilStopped(console));
        std::mem::swap(&mut renderer.methods, &mut party.methods);
        if matches!(output, Err(RenderError::Interrupted)) {
            return Err(Stopped.into());
        }
        let mut output = output.with_context(|| self.file())?;
        resolve.frame(&mut output);
        Ok(output)
    }

    /// The name of the scene file.
    fn file(&self) -> String {
        self.place.file.display().to_string()
    }
}

/// Pictures end early where the run should come to an end.
struct UntilStopped<'a>(Console<'a>);

impl FrameWatch for UntilStopped<'_> {
    fn passes(&mut self, _: u32, _: u32) -> bool {
        !self.0.is_stopped()
    }
}

/// What renders a scene.
fn opened(place: &Place, scene: Arc<SceneFile>, settings: &Settings) -> Result<Renderer> {
    let light = lighting(settings, &scene, place.file)?.light;
    Ok(lit_renderer(Opened::open(scene, place.file, settings)?, settings, light))
}
