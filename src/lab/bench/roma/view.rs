//! Pictures of a view, by one renderer, with what their passes took and how far they are from each other.

use super::args::Settings as Scale;
use super::plan::{Job, Way};
use super::seams::Seams;
use crate::counters::Record;
use crate::frame::Renderer;
use crate::lab::bench::scenes::{Place, View as Path, empty_cache, open};
use crate::lab::bench::store::Values;
use crate::lab::console::Console;
use crate::metrics::{Image, PIXELS_PER_DEGREE, flip_ldr, pixel_errors};
use crate::scene::{Camera, CameraPath};
use crate::secondary::df::answer::Df;
use crate::secondary::occupancy::BaseMaps;
use crate::secondary::roma::answer::Roma;
use crate::session::Settings;
use crate::session::renderer::{methods, render_settings};
use crate::settings::{Adapter, CacheSize, Schedule};
use anyhow::{Context, Result, bail};
use std::path::PathBuf;

/// A scene, a light, a cache and a camera.
pub struct View<'a> {
    job: &'a Job,
    scene: PathBuf,
    renderer: Renderer,
    path: CameraPath,
    camera: Camera,
    settings: &'a Scale,
    adapter: &'a Adapter,
    console: Console<'a>,
}

/// A picture and what its pass took.
pub struct Picture {
    image: Image,
    /// Distances along the rays through the middles of pixels, world units; of jobs that ask for them.
    depth: Vec<f32>,
    /// Of the pass, by name.
    pub values: Values,
}

impl<'a> View<'a> {
    /// Opens the view of a job.
    ///
    /// # Errors
    /// The scene's, the device's.
    pub fn open(
        job: &'a Job,
        place: &Place,
        settings: &'a Scale,
        adapter: &'a Adapter,
        console: Console<'a>,
    ) -> Result<Self> {
        let scene = place.scene.clone();
        let own = of_job(job, &job.settings, &Way::Exact, settings, adapter);
        let renderer = open(&scene, &own)?;
        let path = place.path(Path::Near)?;
        let camera = path.frame(job.frames[0], 30);
        Ok(Self { job, scene, renderer, path, camera, settings, adapter, console })
    }

    /// Takes the camera of another of thirty frames of the path.
    pub fn look(&mut self, frame: u32) {
        self.camera = self.path.frame(frame, 30);
    }

    /// A picture of `samples` a pixel with the seed `seed`.
    ///
    /// # Errors
    /// A brick that cannot be read, the device's, pixels that are not finite; the run is to come to an end.
    pub fn picture(&mut self, way: &Way, samples: u32, seed: u32) -> Result<Picture> {
        let Picture { mut image, depth, values } = self.whole(&self.job.settings, way, samples, seed)?;
        if let Some(without) = self.job.without.as_ref().filter(|_| self.job.errors) {
            let without = self.whole(without, way, samples, seed)?.image;
            for (with, without) in image.rgb.as_flattened_mut().iter_mut().zip(without.rgb.as_flattened()) {
                *with -= without;
            }
        }
        Ok(Picture { image, depth, values })
    }

    /// A picture of all that `settings` ask for.
    fn whole(&mut self, settings: &Settings, way: &Way, samples: u32, seed: u32) -> Result<Picture> {
        self.console.go_on()?;
        let own = of_job(self.job, settings, way, self.settings, self.adapter);
        let own = Settings { spp: samples, seed: seed.into(), ..own };
        let renderer = &mut self.renderer;
        renderer.settings = render_settings(&own, Schedule::Chc);
        let warm = renderer.methods.remove::<Roma>();
        // A distance field stays as long as the camera does: its making is measured.
        renderer.methods = methods(&own, renderer.scene.resident());
        if let (Some(roma), Some(warm)) = (renderer.methods.get_mut::<Roma>(), warm) {
            roma.keep(warm, self.job.is_cold);
        }
        if self.job.is_cold {
            empty_cache(renderer)?;
        }
        let output = renderer.frame(0, &self.camera).with_context(|| self.scene.display().to_string())?;
        let effect = self.job.effect;
        if *settings == self.job.settings && !output.records.iter().any(|record| record.pass == effect) {
            bail!("no rays of {effect} were traced");
        }
        // With what its hits are lit by, and the maps of lamps.
        let of_hits = format!("{effect}-shadow");
        let is_of_maps = |record: &Record| record.pass == "rsm";
        let own = || output.records.iter().filter(|record| record.pass == effect || record.pass == of_hits);
        let maps = || output.records.iter().filter(|record| effect == "diffuse" && is_of_maps(record));
        let sum = |value: fn(&Record) -> f64| own().map(value).sum::<f64>();
        let loaded = |value: fn(&Record) -> f64| own().chain(maps()).map(value).sum::<f64>();
        let is_exact = way.is_traced();
        if output.records.iter().any(|record| record.non_finite > 0) {
            bail!("{}: {way}: pixels were not finite; this is a bug in brickwalk", self.scene.display());
        }
        let values = [
            (
                "rays",
                output.records.iter().filter(|record| record.pass == effect).map(|record| record.rays() as f64).sum(),
            ),
            ("ms", sum(|record| record.ms)),
            ("ms_generation", if is_exact { 0.0 } else { sum(|record| record.ms_phase1) }),
            ("ms_trace", if is_exact { sum(|record| record.ms) } else { sum(|record| record.ms_phase3) }),
            ("ms_lamps", maps().map(|record| record.ms).sum()),
            ("bricks_loaded", loaded(|record| record.bricks_loaded as f64)),
            ("bytes_loaded", loaded(|record| (record.bytes_bvh + record.bytes_geometry) as f64)),
            ("rays_capped", sum(|record| record.rays_capped as f64)),
        ];
        let (width, height) = (renderer.size.0 as usize, renderer.size.1 as usize);
        let image = Image { width, height, rgb: output.pixels.radiance };
        let depth = output.pixels.depth;
        Ok(Picture { image, depth, values: values.map(|(name, value)| (name.to_string(), value)).into() })
    }

    /// Length of rays of occlusion, in cells that bricks have; of other effects none.
    pub fn cells(&mut self) -> Option<(String, f64)> {
        let renderer = &mut self.renderer;
        let cell = BaseMaps::default().brick_cell(&renderer.scene).filter(|_| self.job.effect == "ao");
        cell.map(|cell| ("cells".into(), self.job.length / cell))
    }

    /// Adds the errors of the picture that was made last by the distance from sides of its base maps.
    pub fn add_seams(&self, seams: &mut Seams, one: &Picture, reference: &Picture) {
        let (width, height) = self.renderer.size;
        let basis = self.camera.ray_basis(width, height);
        let point = |(i, &depth): (usize, &f32)| {
            let [x, y] = [i as u32 % width, i as u32 / width].map(|x| f64::from(x) + 0.5);
            let along = basis.direction(x, y).normalize();
            depth.is_finite().then(|| (self.camera.position + along * f64::from(depth)).to_array())
        };
        let points: Vec<Option<[f64; 3]>> = one.depth.iter().enumerate().map(point).collect();
        let methods = &self.renderer.methods;
        let of_roma = methods.get::<Roma>().map(|roma| &roma.base);
        if let Some(base) = of_roma.or(methods.get::<Df>().map(|df| &df.base)) {
            seams.add(base.levels(), &points, &one.image, &reference.image);
        }
    }

    /// Errors of a picture against another, named after what it is.
    ///
    /// # Errors
    /// None of pictures of this view.
    pub fn errors(&self, name: &str, one: &Picture, reference: &Picture) -> Result<Vec<(String, f64)>> {
        let errors = pixel_errors(&one.image, &reference.image)?;
        let flip = flip_ldr(&one.image, &reference.image, PIXELS_PER_DEGREE)?;
        let mean = reference.image.rgb.as_flattened().iter().map(|x| f64::from(*x)).sum::<f64>();
        let mean = mean / reference.image.rgb.as_flattened().len().max(1) as f64;
        let relative = |x: f64| if mean > 0.0 { x / mean } else { 0.0 };
        Ok(vec![
            (format!("flip_{name}"), flip.mean()),
            (format!("bias_{name}"), relative(errors.bias)),
            (format!("rmse_{name}"), relative(errors.rmse)),
        ])
    }
}

/// The settings of a picture.
fn of_job(job: &Job, settings: &Settings, way: &Way, scale: &Scale, adapter: &Adapter) -> Settings {
    Settings {
        cache: CacheSize::Percent(job.cache.into()),
        schedule: Schedule::Chc,
        tile: scale.tile,
        size: scale.size,
        adapter: adapter.clone(),
        ..way.over(settings)
    }
}
