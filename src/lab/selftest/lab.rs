//! What cases work with: a device, scenes built for them, sessions that trace or render.

use super::case::Checks;
use super::defects::{Defect, Faulty};
use super::rays::Targets;
use crate::counters::Counters;
use crate::cpu::CpuExecutor;
use crate::frame::Renderer;
use crate::gpu::executor::GpuExecutor;
use crate::gpu::kernels::Kernels;
use crate::gpu::wgsl::Pages;
use crate::kernels::frame::Frame;
use crate::kernels::layout::{Hit, NONE, Params, Ray, T_INFINITE};
use crate::kernels::{Directions, FrameExecutor, View};
use crate::reference::{Tally, Truth, TruthRay, judge, judge_any};
use crate::scene::Camera;
use crate::session::Settings;
use crate::session::device::Device;
use crate::session::opened::{Needs, Opened, Room, open_scene};
use crate::session::renderer::renderer;
use crate::session::trace::{EXTENT, for_rays, trace_device};
use crate::settings::{Adapter, CacheSize, Effect, EffectList, ImageSize, Schedule};
use crate::stream::Workers;
use anyhow::{Context, Result, bail};
use bricks::SceneFile;
use brickwalk_convert::build::{BuildSettings, BuildSummary, LatticeStep, build};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{Primitive, SourceScene};
use brickwalk_scenes::{Rng, one_mesh};
use glam::DVec3;
use rayon::prelude::*;
use std::ops::{Deref, DerefMut};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A device and what was asked of the test.
pub struct Lab {
    /// The device.
    pub device: Device,
    /// Seed of scenes and rays.
    pub seed: u64,
    /// Rays of the largest case.
    pub rays: usize,
    /// What is planted.
    pub defect: Option<Defect>,
    /// The submission of executors made from now on whose results never come back.
    pub fails_at: Option<u32>,
    folder: tempfile::TempDir,
    kernels: Vec<Arc<Kernels>>,
    scenes: u32,
}

/// A scene that was built.
pub struct Built {
    /// The file.
    pub file: Arc<SceneFile>,
    /// Where it lies.
    pub path: PathBuf,
    /// What the builder says of it.
    pub summary: BuildSummary,
}

/// A scene file on a device, for rays that are given.
pub struct Stage {
    /// The file.
    pub file: Arc<SceneFile>,
    /// What traces.
    pub opened: Opened,
    /// The frame of rays: that of a viewer at the origin, unless another place was asked for.
    pub frame: Frame,
}

/// A stage whose hits are judged.
pub struct Judged {
    /// The stage.
    pub stage: Stage,
    /// Truth of its scene.
    pub truth: Truth,
    /// Its triangles.
    pub targets: Targets,
    /// The viewer's place in the frame, device units.
    pub middle: DVec3,
}

impl Lab {
    /// Opens the device.
    ///
    /// # Errors
    /// There is none; a defect of kernels on the processor, which has none to be changed.
    pub fn open(adapter: &Adapter, seed: u64, rays: usize, defect: Option<Defect>) -> Result<Self> {
        let device = Device::open(adapter)?;
        if let (Device::Cpu, Some(defect)) = (&device, defect.filter(|d| d.is_of_kernels())) {
            bail!("--plant {}: it is planted in kernels; name a graphics adapter with --adapter", defect.name());
        }
        let folder = tempfile::tempdir().context("cannot make a temporary folder")?;
        Ok(Self { device, seed, rays, defect, fails_at: None, folder, kernels: Vec::new(), scenes: 0 })
    }

    /// A stream of random numbers for the part `key` of a case.
    pub fn random(&self, key: &[i64]) -> Rng {
        Rng::new(self.seed, key)
    }

    /// At most `most` rays, and no more than a fiftieth of those of the largest case.
    pub fn share(&self, most: usize) -> usize {
        most.min((self.rays / 50).max(500))
    }

    /// A file name that no other scene has.
    pub fn scene_path(&mut self) -> PathBuf {
        self.scenes += 1;
        self.folder.path().join(format!("{}.bricks", self.scenes))
    }

    /// Builds a scene.
    ///
    /// # Errors
    /// The builder's.
    pub fn build(&mut self, source: SourceScene, settings: &BuildSettings) -> Result<Built> {
        let path = self.scene_path();
        let summary = build(source, settings, &path, &Progress::hidden())?;
        Ok(Built { file: open_scene(&path)?, path, summary })
    }

    /// Builds a scene and opens it for rays.
    ///
    /// # Errors
    /// The builder's, the cache's, the device's.
    pub fn stage(&mut self, source: SourceScene, build: &BuildSettings, settings: &Settings) -> Result<Stage> {
        let built = self.build(source, build)?;
        self.open_stage(built.file, &built.path, settings)
    }

    /// Opens a scene for rays.
    ///
    /// # Errors
    /// The cache's, the device's.
    pub fn open_stage(&mut self, file: Arc<SceneFile>, path: &Path, settings: &Settings) -> Result<Stage> {
        let opened = self.opened(file.clone(), path, &for_rays(settings))?;
        let frame = Frame::near(file.resident(), DVec3::ZERO);
        Ok(Stage { file, opened, frame })
    }

    /// A stage for rays that maps answer; nothing of its scene is met.
    ///
    /// # Errors
    /// As of [`Self::stage`].
    pub fn bare_stage(&mut self) -> Result<Stage> {
        self.stage(triangles("triangle", &[GOOD]), &settings(4, 0), &cached(100))
    }

    /// Builds a scene and opens it for rays that are judged.
    ///
    /// # Errors
    /// As of [`Self::stage`].
    pub fn judged(&mut self, source: SourceScene, build: &BuildSettings, settings: &Settings) -> Result<Judged> {
        self.stage(source, build, settings)?.judged(DVec3::ZERO)
    }

    /// Opens a scene for frames.
    ///
    /// # Errors
    /// The cache's, the device's.
    pub fn renderer(&mut self, scene: &Built, settings: &Settings) -> Result<Renderer> {
        let opened = self.opened(scene.file.clone(), &scene.path, settings)?;
        renderer(opened, &scene.path, settings)
    }

    fn opened(&mut self, file: Arc<SceneFile>, path: &Path, settings: &Settings) -> Result<Opened> {
        let rows = settings.size.height;
        let room = Room { page_bytes: self.device.page_bytes(), bytes: self.device.room(), rows };
        Opened::open_on(file, path, settings, room, |needs| self.executor(needs))
    }

    fn executor(&mut self, needs: Needs) -> Result<Box<dyn FrameExecutor>> {
        let Needs { scene, host, threads, page_sizes, setup } = needs;
        let workers = Workers::new(scene.clone(), host, threads)?;
        let executor: Box<dyn FrameExecutor> = match &self.device {
            Device::Cpu => Box::new(CpuExecutor::new(scene.clone(), workers, setup)?),
            Device::Gpu(gpu) => {
                // One set of pipelines serves all scenes with so many pages.
                let pages = Pages {
                    cache: page_sizes.len().max(1),
                    texels: 1,
                    opacity: false,
                    gloss: false,
                    layers: false,
                    levels: false,
                    hides: false,
                };
                let known = self.kernels.iter().find(|kernels| kernels.pages == pages).cloned();
                let kernels = match (known, self.defect) {
                    (Some(kernels), _) => kernels,
                    (None, Some(defect)) => Arc::new(defect.kernels(gpu, pages)?),
                    (None, None) => Arc::new(Kernels::new(gpu, pages, false)),
                };
                if !self.kernels.iter().any(|known| known.pages == pages) {
                    self.kernels.push(kernels.clone());
                }
                let gpu = gpu.as_ref().clone();
                Box::new(GpuExecutor::with_kernels(gpu, kernels, scene.clone(), workers, page_sizes, setup)?)
            }
        };
        let (defect, fails_at) = (self.defect, self.fails_at);
        if defect.is_none() && fails_at.is_none() {
            return Ok(executor);
        }
        Ok(Box::new(Faulty { inner: executor, defect, fails_at, submissions: 0, scene, reference: DVec3::ZERO }))
    }
}

/// Settings with a cache of so many per cent.
pub fn cached(percent: u32) -> Settings {
    Settings { cache: CacheSize::Percent(percent.into()), ..Settings::exact() }
}

/// The same by a schedule.
pub fn scheduled(percent: u32, schedule: Schedule) -> Settings {
    Settings { schedule, ..cached(percent) }
}

/// Settings of a small picture in tiles of 16 pixels.
pub fn picture(width: u32, height: u32, percent: u32) -> Settings {
    Settings { size: ImageSize { width, height }, tile: 16, ..cached(percent) }
}

/// The same with several effects of so many rays, and AOVs.
pub fn lit(width: u32, height: u32, percent: u32, rays: u32) -> Settings {
    let effects = EffectList::of(&[Effect::Shadow, Effect::Ao, Effect::Diffuse]);
    Settings { effects, ao_rays: rays, diffuse_rays: rays, aov: true, ..picture(width, height, percent) }
}

/// The same of primary rays alone, by a schedule.
pub fn primary(width: u32, height: u32, percent: u32, schedule: Schedule) -> Settings {
    Settings { schedule, effects: EffectList::PRIMARY, ..picture(width, height, percent) }
}

/// A camera whose up is Y.
pub fn camera(position: [f64; 3], target: DVec3, fov_y: f64) -> Camera {
    Camera { position: position.into(), target, up: DVec3::Y, fov_y }
}

/// A scene of one mesh.
pub fn mesh(name: &str, positions: Vec<[f64; 3]>, indices: Vec<u32>) -> SourceScene {
    one_mesh(name, Primitive { positions, indices, ..Primitive::default() })
}

/// A scene of triangles that share no vertices.
pub fn triangles(name: &str, corners: &[[[f64; 3]; 3]]) -> SourceScene {
    let positions = corners.as_flattened().to_vec();
    let indices = (0..positions.len() as u32).collect();
    mesh(name, positions, indices)
}

/// A triangle that nothing is wrong with.
pub const GOOD: [[f64; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

impl Stage {
    /// With rays in the frame of a viewer at a point of the world, and truth.
    ///
    /// # Errors
    /// A damaged file.
    pub fn judged(self, position: DVec3) -> Result<Judged> {
        let frame = Frame::near(self.file.resident(), position);
        let truth = Truth::load(&self.file)?;
        let targets = Targets::of(&truth, &frame);
        let middle = (position - frame.origin) / frame.unit;
        Ok(Judged { stage: Self { frame, ..self }, truth, targets, middle })
    }

    /// One step of the world's lattice in device units.
    pub fn step(&self) -> f64 {
        let world = &self.file.resident().objects[0];
        f64::from(world.step_log2 - world.unit_log2).exp2()
    }

    /// Begins a frame that has no rays of its own.
    pub fn begin_frame(&mut self) {
        let view = View { frame: self.frame, params: Params::default(), directions: Directions::default(), rays: None };
        self.opened.executor.begin_frame(&view);
    }

    /// The hits of rays.
    ///
    /// # Errors
    /// The device's.
    pub fn trace(&mut self, rays: &[Ray], any: bool) -> Result<Vec<Hit>> {
        let mut hits = Vec::with_capacity(rays.len());
        for chunk in rays.chunks(EXTENT.rays()) {
            hits.extend(trace_device(&mut self.opened.traced(), &self.frame, chunk, any, &mut Counters::default())?);
        }
        Ok(hits)
    }
}

impl Deref for Judged {
    type Target = Stage;

    fn deref(&self) -> &Stage {
        &self.stage
    }
}

impl DerefMut for Judged {
    fn deref_mut(&mut self) -> &mut Stage {
        &mut self.stage
    }
}

impl Judged {
    /// `count` rays at random targets from a cube of half side `half`, world units, around the viewer: half of the
    /// origins on the lattice, the others anywhere.
    pub fn aimed(&self, rng: &mut Rng, half: f64, count: usize) -> Vec<Ray> {
        self.targets.aimed(rng, (self.middle, half / self.frame.unit), self.step(), count)
    }

    /// Traces rays for closest hits and judges them.
    ///
    /// # Errors
    /// The device's.
    pub fn judge(&mut self, rays: &[Ray]) -> Result<(Tally, Vec<Hit>)> {
        let hits = self.trace(rays, false)?;
        Ok((tally(&self.truth, &self.frame, rays, &hits), hits))
    }

    /// The same, and notes what the judge said.
    ///
    /// # Errors
    /// The device's.
    pub fn note(&mut self, checks: &mut Checks, what: &str, rays: &[Ray]) -> Result<Vec<Hit>> {
        let (tally, hits) = self.judge(rays)?;
        checks.judged(what, &tally);
        Ok(hits)
    }

    /// Traces rays for closest hits and for any hit, and notes what the judge said of both.
    ///
    /// # Errors
    /// The device's.
    pub fn note_both(&mut self, checks: &mut Checks, rays: &[Ray]) -> Result<()> {
        self.note(checks, "closest hits", rays)?;
        let hits = self.trace(rays, true)?;
        let (truth, frame) = (&self.truth, self.frame);
        let verdict = |(ray, hit): (&Ray, &Hit)| judge_any(truth, &truth_ray(&frame, ray), hit.id != NONE);
        let verdicts: Vec<_> = rays.par_iter().zip(&hits).map(verdict).collect();
        checks.judged("any hits", &verdicts.into_iter().collect());
        Ok(())
    }
}

/// What the judge says of hits.
pub fn tally(truth: &Truth, frame: &Frame, rays: &[Ray], hits: &[Hit]) -> Tally {
    let verdict = |(ray, hit): (&Ray, &Hit)| {
        let found = (hit.id != NONE).then_some((hit.id, f64::from(hit.t)));
        judge(truth, &truth_ray(frame, ray), found)
    };
    let verdicts: Vec<_> = rays.par_iter().zip(hits).map(verdict).collect();
    verdicts.into_iter().collect()
}

/// A ray as truth takes it.
pub fn truth_ray(frame: &Frame, ray: &Ray) -> TruthRay {
    let t_max = if ray.t_max >= T_INFINITE { f32::INFINITY } else { ray.t_max };
    TruthRay::from_f32(frame.origin.to_array(), frame.unit, ray.origin, ray.direction, ray.t_min, t_max)
}

/// How many hits differ in any bit.
pub fn different(a: &[Hit], b: &[Hit]) -> u64 {
    let bits = |h: &Hit| [h.t.to_bits(), h.id, h.u.to_bits(), h.v.to_bits()];
    a.iter().zip(b).filter(|(a, b)| bits(a) != bits(b)).count() as u64 + a.len().abs_diff(b.len()) as u64
}

/// How many of these are misses.
pub fn misses(hits: &[Hit]) -> u64 {
    hits.iter().filter(|hit| hit.id == NONE).count() as u64
}

/// Settings of the builder with bricks of so many triangles and, unless it is 0, a lattice of 2^`lattice`.
pub fn settings(brick_triangles: u32, lattice: i32) -> BuildSettings {
    let lattice = (lattice != 0).then_some(LatticeStep::Log2(lattice));
    BuildSettings { brick_triangles, lattice, memory_bytes: Some(1 << 30), ..BuildSettings::default() }
}
