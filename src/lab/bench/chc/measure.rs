//! Walks of the bench: one renderer a scene, cache and tile, in which the cases take turns.

use super::cells::{Passes, PictureError};
use super::paper::THRESHOLDS;
use super::plan::{Case, PLAIN, PLAIN_BVH2, Variant};
use crate::counters::{Counters, Record};
use crate::frame::{Engine, Renderer};
use crate::lab::bench::args::Settings;
use crate::lab::bench::scenes::{self, Place, empty_cache};
use crate::lab::console::Console;
use crate::output::srgb;
use crate::scene::path::CameraPath;
use crate::schedule::auto::Auto;
use crate::schedule::fronts::Fronts;
use crate::session::Settings as WalkSettings;
use crate::session::opened::{is_of_device, scaled_threshold};
use crate::session::renderer::render_settings;
use crate::settings::{Adapter, CacheSize, EffectList, Turn};
use crate::stream::Item;
use anyhow::{Context, Result, bail};

/// Frames of the walk that a path is made for: the camera moves as fast in a shorter one, which ends earlier.
const PATH_FRAMES: u32 = 30;

/// Payloads that are loaded at a time.
const AT_A_TIME: usize = 64;

/// Fields of the records that are kept.
const FIELDS: [&str; 17] = [
    "ms",
    "ms_phase1",
    "ms_phase2",
    "ms_phase3",
    "ms_stream",
    "rays_traced",
    "queries",
    "multi_queries",
    "pairs_intersected",
    "round_trips",
    "bricks_needed",
    "bricks_loaded",
    "bytes_needed",
    "bytes_needed_missing",
    "bytes_bvh",
    "bytes_geometry",
    "bytes_attributes",
];

/// A scene on the device.
pub struct Bench<'a> {
    renderer: Renderer,
    settings: &'a Settings,
    place: Place,
    adapter: &'a Adapter,
    /// Whether the binary trees could be made; else why not.
    binary: Result<(), String>,
}

/// Why a scene is not measured with a cache: the device holds less.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct DoesNotFit(pub String);

impl<'a> Bench<'a> {
    /// Opens the scene of `case` with its cache and tile. `wants_binary`: some case will walk binary trees.
    ///
    /// # Errors
    /// [`DoesNotFit`]: the device does not hold the cache. Else the scene's, and the device's.
    pub fn open(
        case: &Case,
        place: Place,
        settings: &'a Settings,
        adapter: &'a Adapter,
        wants_binary: bool,
    ) -> Result<Self> {
        let open = |variant: Variant| -> Result<Renderer> {
            let mut renderer = scenes::open(&place.scene, &of_case(&Case { variant, ..*case }, settings, adapter))?;
            renderer.executor.allow_bounces();
            Ok(renderer)
        };
        let mut binary = Ok(());
        let mut opened = open(if wants_binary { PLAIN_BVH2 } else { case.variant });
        if let Err(error) = &opened
            && wants_binary
            && is_of_device(error)
        {
            binary = Err(format!("{error:#}"));
            opened = open(PLAIN);
        }
        let renderer = match opened {
            Ok(renderer) => renderer,
            Err(error) if is_of_device(&error) => return Err(DoesNotFit(format!("{error:#}")).into()),
            Err(error) => return Err(error),
        };
        let mut bench = Self { renderer, settings, place, adapter, binary };
        if case.cache == 100 {
            bench.load_all()?;
        }
        Ok(bench)
    }

    /// Why `variant` cannot be measured here, if it cannot.
    pub fn refuses(&self, variant: &Variant) -> Option<&str> {
        self.binary.as_ref().err().filter(|_| variant.schedule == PLAIN_BVH2.schedule).map(String::as_str)
    }

    /// Makes everything resident, so that walks in core begin alike.
    fn load_all(&mut self) -> Result<()> {
        let Engine { executor, cache, .. } = &mut self.renderer.engine;
        let items: Vec<Item> = cache.sizes.items().map(|(item, _)| item).collect();
        Ok(cache.load_all(&mut **executor, &items, AT_A_TIME, &mut Counters::default())?)
    }

    /// Sets the renderer up for a walk; a cache that does not hold everything is emptied.
    fn prepare(&mut self, case: &Case) -> Result<()> {
        let own = of_case(case, self.settings, self.adapter);
        let renderer = &mut self.renderer;
        renderer.settings = render_settings(&own, own.schedule);
        renderer.fronts = case.variant.fronts.then(Fronts::default);
        renderer.auto = Auto::default();
        renderer.executor.tuning().threshold = scaled_threshold(case.variant.threshold, case.tile);
        if case.cache < 100 {
            empty_cache(renderer)?;
        }
        Ok(())
    }

    fn frame(&mut self, path: &CameraPath, frame: u32) -> Result<crate::frame::FrameOutput> {
        let camera = path.frame(frame, self.settings.frames.max(PATH_FRAMES));
        self.renderer.frame(frame, &camera).with_context(|| self.place.scene.display().to_string())
    }

    /// One walk.
    ///
    /// # Errors
    /// A brick that cannot be read, the device's, pixels that are not finite; the run is to come to an end.
    pub fn walk(&mut self, case: &Case, console: Console) -> Result<Passes> {
        self.prepare(case)?;
        let path = self.place.path(case.view)?;
        let mut passes = Passes::new();
        for frame in 0..self.settings.frames {
            console.go_on()?;
            for record in self.frame(&path, frame)?.records {
                if case.effects.iter().any(|effect| effect.name() == record.pass) {
                    note(&mut passes, &record)?;
                }
            }
        }
        Ok(passes)
    }

    /// How far the pictures of `case` are from those of threshold 0, in five frames along the walk; each is rendered
    /// from an empty cache. `None` for threshold 0.
    ///
    /// # Errors
    /// As [`Self::walk`].
    pub fn picture_error(&mut self, case: &Case, console: Console) -> Result<Option<PictureError>> {
        if case.variant.threshold == THRESHOLDS[0] {
            return Ok(None);
        }
        let path = self.place.path(case.view)?;
        let exact = Case { variant: Variant { threshold: THRESHOLDS[0], ..case.variant }, ..*case };
        let last = self.settings.frames - 1;
        let mut frames: Vec<u32> = (0..5).map(|k| k * last / 4).collect();
        frames.dedup();
        let mut all = PictureError::default();
        for &frame in &frames {
            console.go_on()?;
            let mut picture = |case: &Case| -> Result<Vec<[u8; 3]>> {
                self.prepare(case)?;
                let radiance = self.frame(&path, frame)?.pixels.radiance;
                Ok(srgb::pixels(&radiance))
            };
            let (a, b) = (picture(case)?, picture(&exact)?);
            let error = difference(&a, &b, self.settings.size.width as usize, case.tile as usize);
            all.mean += error.mean / frames.len() as f64;
            all.worst_tile = all.worst_tile.max(error.worst_tile);
        }
        Ok(Some(all))
    }
}

/// Mean absolute difference of two pictures of rows of `width` pixels, and that of the worst tile.
fn difference(a: &[[u8; 3]], b: &[[u8; 3]], width: usize, tile: usize) -> PictureError {
    let tiles_x = width.div_ceil(tile);
    let tiles = tiles_x * (a.len() / width.max(1)).div_ceil(tile);
    let mut sums = vec![(0u64, 0u64); tiles];
    for (i, (a, b)) in a.iter().zip(b).enumerate() {
        let (sum, count) = &mut sums[i / width / tile * tiles_x + i % width / tile];
        *sum += (0..3).map(|k| u64::from(a[k].abs_diff(b[k]))).sum::<u64>();
        *count += 3;
    }
    let mean = |(sum, count): (u64, u64)| sum as f64 / count.max(1) as f64;
    let all = sums.iter().fold((0, 0), |all, one| (all.0 + one.0, all.1 + one.1));
    PictureError { mean: mean(all), worst_tile: sums.into_iter().map(mean).fold(0.0, f64::max) }
}

/// Adds a frame's record of a pass.
fn note(passes: &mut Passes, record: &Record) -> Result<()> {
    if record.non_finite > 0 {
        bail!("{} pixels of frame {} were not finite; this is a bug in brickwalk", record.non_finite, record.frame);
    }
    let values = serde_json::to_value(record)?;
    let fields = passes.entry(record.pass.to_string()).or_default();
    for name in FIELDS {
        let value = values.get(name).and_then(serde_json::Value::as_f64).unwrap_or(0.0);
        // Times in steps of a microsecond keep the file readable.
        fields.entry(name.to_string()).or_default().push((value * 1e3).round() * 1e-3);
    }
    Ok(())
}

/// The settings of a walk.
fn of_case(case: &Case, settings: &Settings, adapter: &Adapter) -> WalkSettings {
    let Variant { schedule, threshold, rotation, without, needed, fronts } = case.variant;
    WalkSettings {
        effects: EffectList::of(case.effects),
        schedule,
        cache: CacheSize::Percent(case.cache.into()),
        tile: case.tile,
        size: settings.size,
        query_threshold: threshold,
        rotation: Turn(rotation as f32),
        ao_rays: settings.rays,
        diffuse_rays: settings.rays,
        fronts,
        measure_needed: needed,
        without: without.to_vec(),
        adapter: adapter.clone(),
        ..WalkSettings::exact()
    }
}
