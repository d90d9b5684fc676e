//! The frame loop.

use super::{Light, camera_view};
use crate::gpu::executor::GpuExecutor;
use crate::gpu::layout::{GBuffer, Hit, NONE, Ray, Surface};
use crate::scene::Camera;
use crate::schedule::cache::Cache;
use crate::schedule::fronts::{FrontPass, Fronts};
use crate::schedule::{Executor, ExecutorError, Pass, PassStats, Step, attributes, chc, plain};
use crate::stats::Record;
use bricks::SceneFile;
use std::sync::Arc;
use std::time::Instant;
use thiserror::Error;

/// Which schedule traces a pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Schedule {
    /// Tile lists, queries, loads nearest first.
    Chc,
    /// Everything resident, every ray from the root.
    Plain,
}

/// How frames are rendered.
#[derive(Clone, Copy, Debug)]
pub struct RenderSettings {
    /// The schedule of every pass.
    pub schedule: Schedule,
    /// Whether sun shadows are traced.
    pub shadows: bool,
    /// Samples a pixel.
    pub samples: u32,
    /// Seed of all random numbers.
    pub seed: u32,
    /// Ask which bricks every pass needed.
    pub measure_needed: bool,
    /// Read depth, normals, ids and albedo back.
    pub aov: bool,
}

/// Why a frame could not be rendered.
#[derive(Debug, Error)]
pub enum RenderError {
    /// The executor's error.
    #[error(transparent)]
    Executor(#[from] ExecutorError),
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

/// A frame and its records.
#[derive(Clone, Debug, Default)]
pub struct FrameOutput {
    /// The pixels.
    pub pixels: Pixels,
    /// One record a pass.
    pub records: Vec<Record>,
}

/// A scene, an executor and a cache that frames are rendered with.
pub struct Renderer {
    /// The scene.
    pub scene: Arc<SceneFile>,
    /// The executor.
    pub executor: GpuExecutor,
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
}

impl Renderer {
    /// Renders one frame. Exact: pixels depend on scene, camera, lights and settings alone.
    ///
    /// # Errors
    /// A brick that cannot be read, or the device's.
    pub fn frame(&mut self, frame: u32, camera: &Camera) -> Result<FrameOutput, RenderError> {
        let mut output = FrameOutput::default();
        let mut primary = PassRecord::new(frame, "primary");
        let mut shadow = PassRecord::new(frame, "shadow");
        for sample in 0..self.settings.samples {
            let seed = self.settings.seed.wrapping_add(frame.wrapping_mul(0x9E37_79B9));
            let view = camera_view(self.scene.resident(), camera, &self.light, self.size, sample, seed);
            self.executor.begin_frame(&view);
            primary.measure(self, |r, stats| {
                r.trace(frame, Pass::Primary, stats)?;
                attributes::resolve(&mut r.executor, &mut r.cache, stats)
            })?;
            if self.settings.shadows {
                shadow.measure(self, |r, stats| {
                    r.trace(frame, Pass::Shadow, stats)?;
                    let steps = [Step::QueryHits, Step::Shade { shadows: true }];
                    let report = r.executor.run(Pass::Shadow, &steps, &r.cache.states)?;
                    stats.bricks_hit.get_or_insert_default().extend(report.demand.iter().map(|d| d.0));
                    stats.add(report);
                    Ok(())
                })?;
            } else {
                primary.measure_more(self, |r, stats| {
                    let report = r.executor.run(Pass::Shadow, &[Step::Shade { shadows: false }], &r.cache.states)?;
                    stats.add(report);
                    Ok(())
                })?;
            }
            if sample == 0 && self.settings.aov {
                self.read_aovs(view.frame.unit, &mut output.pixels)?;
            }
        }
        let radiance = self.executor.read_radiance()?;
        output.pixels.radiance = radiance.iter().map(|c| [c[0] / c[3], c[1] / c[3], c[2] / c[3]]).collect();
        output.records.push(primary.finish(self));
        if self.settings.shadows {
            output.records.push(shadow.finish(self));
        }
        Ok(output)
    }

    /// Traces the generated rays of a pass by the schedule in force.
    fn trace(&mut self, frame: u32, pass: Pass, stats: &mut PassStats) -> Result<(), ExecutorError> {
        let needed = self.settings.measure_needed;
        let first = [Step::Generate];
        match (self.settings.schedule, &mut self.fronts) {
            (Schedule::Plain, _) => plain::trace(&mut self.executor, &mut self.cache, pass, &first, needed, stats),
            (Schedule::Chc, None) => chc::trace(&mut self.executor, &mut self.cache, pass, &first, needed, stats),
            (Schedule::Chc, Some(fronts)) => {
                let resident = self.scene.resident();
                let extent = (self.size.0, self.size.1, self.tile);
                let setup = FrontPass { resident, extent, frame, pass, measure_needed: needed };
                fronts.trace(&mut self.executor, &mut self.cache, &setup, &first, stats)
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

/// Collects the statistics of one effect of a frame over its samples.
struct PassRecord {
    frame: u32,
    name: &'static str,
    stats: PassStats,
    resident_start: Option<u64>,
    resident_end: u64,
}

impl PassRecord {
    fn new(frame: u32, name: &'static str) -> Self {
        Self { frame, name, stats: PassStats::default(), resident_start: None, resident_end: 0 }
    }

    fn measure(
        &mut self,
        renderer: &mut Renderer,
        work: impl FnOnce(&mut Renderer, &mut PassStats) -> Result<(), ExecutorError>,
    ) -> Result<(), ExecutorError> {
        self.resident_start.get_or_insert(renderer.cache.residency.resident().count() as u64);
        renderer.cache.begin_pass(self.name, self.frame);
        self.measure_more(renderer, work)
    }

    fn measure_more(
        &mut self,
        renderer: &mut Renderer,
        work: impl FnOnce(&mut Renderer, &mut PassStats) -> Result<(), ExecutorError>,
    ) -> Result<(), ExecutorError> {
        let start = Instant::now();
        work(renderer, &mut self.stats)?;
        self.stats.ms += start.elapsed().as_secs_f64() * 1e3;
        self.resident_end = renderer.cache.residency.resident().count() as u64;
        Ok(())
    }

    fn finish(self, renderer: &Renderer) -> Record {
        let mut record = Record::of(self.frame, self.name, &self.stats);
        record.cache_bytes = renderer.cache.residency.budget_bytes();
        record.cache_used_bytes = renderer.cache.residency.used_bytes();
        record.bricks_resident_start = self.resident_start.unwrap_or(0);
        record.bricks_resident_end = self.resident_end;
        record
    }
}
