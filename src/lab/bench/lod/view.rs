//! A scene with a cache, opened twice: without levels of detail and with them.

use super::measures::Seen;
use super::places::Place;
use super::plan::Way;
use super::scale::Settings;
use crate::counters::Record;
use crate::frame::{FrameOutput, Renderer};
use crate::lab::bench::scenes::{View as Path, empty_cache};
use crate::lab::console::Console;
use crate::metrics::Image;
use crate::scene::Camera;
use crate::scene::path::CameraPath;
use crate::schedule::Pass;
use crate::session::Settings as WalkSettings;
use crate::session::opened::Opened;
use crate::session::renderer::{render_settings, renderer};
use crate::settings::{Adapter, CacheSize};
use crate::stream::{PayloadSource, Residency};
use anyhow::{Context, Result, bail};
use bricks::SceneFile;
use std::sync::Arc;

/// Frames of the walk that a path is made for: the camera moves as fast in a shorter one, which ends earlier.
const PATH_FRAMES: u32 = 30;

/// A scene that is opened.
pub struct View<'a> {
    /// The scene's name.
    pub name: &'static str,
    /// Share of the cache, per cent.
    pub cache: u32,
    /// The scene.
    pub place: Place,
    base: WalkSettings,
    settings: &'a Settings,
    console: Console<'a>,
    exact: Option<Renderer>,
    levelled: Option<Renderer>,
}

/// What a frame of a walk took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cost {
    /// Wall time, milliseconds.
    pub ms: f64,
    /// Bytes loaded.
    pub bytes: f64,
    /// Bricks that camera rays entered.
    pub bricks: f64,
    /// Pairs of a tile and a brick that were intersected, of all effects.
    pub pairs: f64,
}

impl Cost {
    /// Of the passes of a frame.
    pub fn of(records: &[Record]) -> Self {
        let bytes = |r: &Record| r.bytes_bvh + r.bytes_geometry + r.bytes_attributes + r.bytes_textures;
        let primary = records.iter().filter(|record| record.pass == "primary");
        Self {
            ms: records.iter().map(|record| record.ms).sum(),
            bytes: records.iter().map(|record| bytes(record) as f64).sum(),
            bricks: primary.map(|record| record.bricks_needed.count() as f64).sum(),
            pairs: records.iter().map(|record| record.pairs_intersected as f64).sum(),
        }
    }
}

impl<'a> View<'a> {
    /// A view of a scene, which is opened when it is looked at; `base` says what is traced.
    pub fn new(
        (name, place): (&'static str, Place),
        cache: u32,
        base: WalkSettings,
        settings: &'a Settings,
        adapter: &Adapter,
        console: Console<'a>,
    ) -> Self {
        let &Settings { size, tile, schedule, .. } = settings;
        let base = WalkSettings { size, tile, schedule, adapter: adapter.clone(), ..base };
        Self { name, cache, place, base, settings, console, exact: None, levelled: None }
    }

    /// Whether it is one of the same scene, cache, effects and counting.
    pub fn is_of(&self, name: &str, cache: u32, base: &WalkSettings) -> bool {
        let is_same = self.base.effects == base.effects && self.base.count == base.count;
        self.name == name && self.cache == cache && is_same
    }

    /// The cache of both: the share of the bricks without levels, and what the two largest bricks of either need.
    fn budget(&self, scene: &SceneFile) -> Result<CacheSize> {
        if self.cache == 100 {
            return Ok(CacheSize::Percent(100.0));
        }
        let mut levelled = scene.duplicate();
        levelled.use_levels();
        let (own, levelled) = (scene.sizes(), levelled.sizes());
        let least = Residency::least_budget(&own).max(Residency::least_budget(&levelled));
        let share = (f64::from(self.cache) * 0.01 * own.sum() as f64) as u64;
        Ok(CacheSize::Bytes(share.max(least)))
    }

    /// What renders a way.
    ///
    /// # Errors
    /// The scene's, the device's.
    pub fn side(&mut self, way: Way) -> Result<&mut Renderer> {
        let is_levelled = way.is_levelled();
        let side = if is_levelled { &self.levelled } else { &self.exact };
        let renderer = match side {
            Some(_) => None,
            None => Some(self.opened(is_levelled)?),
        };
        let side = if is_levelled { &mut self.levelled } else { &mut self.exact };
        if let Some(renderer) = renderer {
            *side = Some(renderer);
        }
        side.as_mut().context("the scene is opened")
    }

    fn opened(&self, is_levelled: bool) -> Result<Renderer> {
        let file = &self.place.file;
        let mut scene = SceneFile::open(file)?;
        let cache = self.budget(&scene)?;
        if is_levelled {
            scene.use_levels();
        }
        let own = WalkSettings { cache, ..self.base.clone() };
        renderer(Opened::open(Arc::new(scene), file, &own)?, file, &own)
    }

    /// A frame with so many samples a pixel; `frame` and `seed` say by which rays. `aov`: what the rays through the
    /// centres of pixels see as well.
    ///
    /// # Errors
    /// A brick that cannot be read, the device's, pixels that are not finite; the run is to come to an end.
    pub fn frame(
        &mut self,
        way: Way,
        (samples, seed): (u32, u64),
        (frame, camera): (u32, &Camera),
        aov: bool,
    ) -> Result<FrameOutput> {
        self.console.go_on()?;
        let Way { pixels: lod, blend: lod_blend, correct: lod_correct } = way;
        let own = WalkSettings { spp: samples, seed, aov, lod, lod_blend, lod_correct, ..self.base.clone() };
        let (file, schedule) = (self.place.file.clone(), self.settings.schedule);
        let renderer = self.side(way)?;
        renderer.settings = render_settings(&own, schedule);
        let output = renderer.frame(frame, camera).with_context(|| file.display().to_string())?;
        if output.records.iter().any(|record| record.non_finite > 0) {
            bail!("{}: {way}: pixels were not finite; this is a bug in brickwalk", file.display());
        }
        Ok(output)
    }

    /// Empties the cache of what renders a way.
    ///
    /// # Errors
    /// As of [`Self::side`].
    pub fn empty(&mut self, way: Way) -> Result<()> {
        empty_cache(self.side(way)?)
    }

    /// A walk of as many frames as the settings have, one sample a pixel.
    ///
    /// # Errors
    /// As of [`Self::frame`], and those of the path.
    pub fn walk(&mut self, way: Way, view: Path) -> Result<Vec<Cost>> {
        let (path, frames) = (self.place.path(view)?, self.settings.frames);
        let camera = |frame| path.frame(frame, frames.max(PATH_FRAMES));
        (0..frames).map(|k| Ok(Cost::of(&self.frame(way, (1, 0), (k, &camera(k)), false)?.records))).collect()
    }

    /// A picture of a frame's radiance.
    pub fn image(&self, output: FrameOutput) -> Image {
        let size = self.settings.size;
        Image { width: size.width as usize, height: size.height as usize, rgb: output.pixels.radiance }
    }

    /// What the rays through the centres of pixels see, of a frame with AOVs.
    pub fn seen(&self, output: &FrameOutput, camera: &Camera) -> Seen {
        let (width, height) = (self.settings.size.width, self.settings.size.height);
        let basis = camera.ray_basis(width, height);
        let cosine = |(i, normal): (u32, &[f32; 3])| {
            let way = basis.direction(f64::from(i % width) + 0.5, f64::from(i / width) + 0.5).normalize();
            let normal = glam::DVec3::from_array(normal.map(f64::from));
            way.dot(normal).abs() as f32
        };
        let cosine = (0..).zip(&output.pixels.normal).map(cosine).collect();
        Seen { width: width as usize, depth: output.pixels.depth.clone(), cosine }
    }

    /// The angle of a pixel in the middle of the picture, radians.
    pub fn angle(&self, camera: &Camera) -> f64 {
        2.0 * (0.5 * camera.fov_y).tan() / f64::from(self.settings.size.height)
    }

    /// Instance and brick of what every camera ray of the last exact frame has hit, where it has hit something; empty
    /// where pictures are rendered in bands.
    ///
    /// # Errors
    /// The device's.
    pub fn hit(&mut self) -> Result<Vec<Option<(u32, u32)>>> {
        let renderer = self.side(super::plan::EXACT)?;
        if renderer.bands().len() > 1 {
            return Ok(Vec::new());
        }
        let surfaces = renderer.executor.read_surfaces(Pass::Primary)?;
        let leaves = &renderer.scene.resident().leaves;
        let place = |leaf: u32| leaves.get(leaf as usize).map(|leaf| (leaf.instance, leaf.brick));
        Ok(surfaces.iter().map(|surface| place(surface.leaf)).collect())
    }

    /// The camera of the first frame of a path.
    ///
    /// # Errors
    /// The path's.
    pub fn path(&self, view: Path) -> Result<CameraPath> {
        self.place.path(view)
    }
}
