//! What cases work with: a device, scenes built for them, sessions that trace or render.

use super::defects::{Defect, Faulty};
use crate::counters::Counters;
use crate::cpu::CpuExecutor;
use crate::frame::Renderer;
use crate::gpu::executor::GpuExecutor;
use crate::gpu::kernels::Kernels;
use crate::gpu::wgsl::Pages;
use crate::kernels::FrameExecutor;
use crate::kernels::frame::Frame;
use crate::kernels::layout::{Hit, NONE, Ray, T_INFINITE};
use crate::reference::{Tally, Truth, TruthRay, judge, judge_any};
use crate::session::Settings;
use crate::session::device::Device;
use crate::session::opened::{Needs, Opened, Room, open_scene};
use crate::session::renderer::renderer;
use crate::session::trace::{EXTENT, for_rays, trace_device};
use crate::settings::{Adapter, CacheSize, Effect, EffectList, ImageSize, Schedule};
use crate::stream::Workers;
use anyhow::{Context, Result, bail};
use bricks::SceneFile;
use brickwalk_convert::build::{BuildSettings, BuildSummary, build};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::SourceScene;
use brickwalk_scenes::Rng;
use glam::DVec3;
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A device and what was asked of the test.
pub struct Lab {
    /// The device.
    pub device: Device,
    /// The adapter that it was chosen by.
    pub adapter: Adapter,
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

/// A scene file on a device, for rays that are given.
pub struct Stage {
    /// The file.
    pub file: Arc<SceneFile>,
    /// What traces.
    pub opened: Opened,
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
        let adapter = adapter.clone();
        Ok(Self { device, adapter, seed, rays, defect, fails_at: None, folder, kernels: Vec::new(), scenes: 0 })
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
    pub fn build(
        &mut self,
        source: SourceScene,
        settings: &BuildSettings,
    ) -> Result<(Arc<SceneFile>, PathBuf, BuildSummary)> {
        let path = self.scene_path();
        let summary = build(source, settings, &path, &Progress::hidden())?;
        Ok((open_scene(&path)?, path, summary))
    }

    /// Builds a scene and opens it for rays.
    ///
    /// # Errors
    /// The builder's, the cache's, the device's.
    pub fn stage(&mut self, source: SourceScene, build: &BuildSettings, settings: &Settings) -> Result<Stage> {
        let (file, path, _) = self.build(source, build)?;
        self.open_stage(file, &path, settings)
    }

    /// Opens a scene for rays.
    ///
    /// # Errors
    /// The cache's, the device's.
    pub fn open_stage(&mut self, file: Arc<SceneFile>, path: &Path, settings: &Settings) -> Result<Stage> {
        let opened = self.opened(file.clone(), path, &for_rays(settings))?;
        Ok(Stage { file, opened })
    }

    /// Opens a scene for frames.
    ///
    /// # Errors
    /// The cache's, the device's.
    pub fn renderer(&mut self, file: &Arc<SceneFile>, path: &Path, settings: &Settings) -> Result<Renderer> {
        let opened = self.opened(file.clone(), path, settings)?;
        renderer(opened, path, settings)
    }

    fn opened(&mut self, file: Arc<SceneFile>, path: &Path, settings: &Settings) -> Result<Opened> {
        let room = Room { page_bytes: self.device.page_bytes(), bytes: self.device.room() };
        Opened::open_on(file, path, settings, room, |needs| self.executor(needs))
    }

    fn executor(&mut self, needs: Needs) -> Result<Box<dyn FrameExecutor>> {
        let Needs { scene, host, threads, page_sizes, setup } = needs;
        let executor: Box<dyn FrameExecutor> = match &self.device {
            Device::Cpu => {
                let workers = Workers::new(scene.clone(), host, threads)?;
                Box::new(CpuExecutor::new(scene.clone(), workers, setup)?)
            }
            Device::Gpu(gpu) => {
                // One set of pipelines serves all scenes with so many pages.
                let pages = Pages { cache: page_sizes.len().max(1), texels: 1, opacity: false, gloss: false };
                let known = self.kernels.iter().find(|kernels| kernels.pages == pages).cloned();
                let kernels = match (known, self.defect) {
                    (Some(kernels), _) => kernels,
                    (None, Some(defect)) => Arc::new(defect.kernels(gpu, pages)?),
                    (None, None) => Arc::new(Kernels::new(gpu, pages, false)),
                };
                if !self.kernels.iter().any(|known| known.pages == pages) {
                    self.kernels.push(kernels.clone());
                }
                let workers = Workers::new(scene.clone(), host, threads)?;
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
    Settings { cache: CacheSize::Percent(percent.into()), ..Settings::default() }
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

impl Stage {
    /// The frame of a viewer at a point of the world.
    pub fn frame(&self, position: DVec3) -> Frame {
        Frame::near(self.file.resident(), position)
    }

    /// Truth of the scene.
    ///
    /// # Errors
    /// A damaged file.
    pub fn truth(&self) -> Result<Truth> {
        Ok(Truth::load(&self.file)?)
    }

    /// The hits of rays in `frame`.
    ///
    /// # Errors
    /// The device's.
    pub fn trace(&mut self, frame: &Frame, rays: &[Ray], any: bool) -> Result<Vec<Hit>> {
        let mut hits = Vec::with_capacity(rays.len());
        for chunk in rays.chunks(EXTENT.rays()) {
            hits.extend(trace_device(&mut self.opened.traced(), frame, chunk, any, &mut Counters::default())?);
        }
        Ok(hits)
    }

    /// Traces rays for closest hits and judges them.
    ///
    /// # Errors
    /// The device's.
    pub fn judge(&mut self, truth: &Truth, frame: &Frame, rays: &[Ray]) -> Result<(Tally, Vec<Hit>)> {
        let hits = self.trace(frame, rays, false)?;
        let pairs: Vec<(&Ray, &Hit)> = rays.iter().zip(&hits).collect();
        let verdicts: Vec<_> =
            pairs.par_iter().map(|(ray, hit)| judge(truth, &truth_ray(frame, ray), found(hit))).collect();
        Ok((verdicts.into_iter().collect(), hits))
    }

    /// Traces rays for any hit and judges the answers.
    ///
    /// # Errors
    /// The device's.
    pub fn judge_any(&mut self, truth: &Truth, frame: &Frame, rays: &[Ray]) -> Result<Tally> {
        let hits = self.trace(frame, rays, true)?;
        let pairs: Vec<(&Ray, &Hit)> = rays.iter().zip(&hits).collect();
        let verdicts: Vec<_> =
            pairs.par_iter().map(|(ray, hit)| judge_any(truth, &truth_ray(frame, ray), hit.id != NONE)).collect();
        Ok(verdicts.into_iter().collect())
    }
}

/// A ray as truth takes it.
pub fn truth_ray(frame: &Frame, ray: &Ray) -> TruthRay {
    let t_max = if ray.t_max >= T_INFINITE { f32::INFINITY } else { ray.t_max };
    TruthRay::from_f32(frame.origin.to_array(), frame.unit, ray.origin, ray.direction, ray.t_min, t_max)
}

/// A hit as the judge takes it.
pub fn found(hit: &Hit) -> Option<(u32, f64)> {
    (hit.id != NONE).then_some((hit.id, f64::from(hit.t)))
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
    let lattice_log2 = (lattice != 0).then_some(lattice);
    BuildSettings { brick_triangles, lattice_log2, memory_bytes: Some(1 << 30), ..BuildSettings::default() }
}
