//! Everything a walk or a trace works with, opened from the command line's options.

use super::args::{Schedule as ScheduleArg, StreamArgs};
use crate::gpu::device::Gpu;
use crate::gpu::executor::{GpuExecutor, Setup};
use crate::gpu::probe;
use crate::gpu::rays::Extent;
use crate::render::Schedule;
use crate::schedule::cache::{BrickBytes, Cache};
use crate::stream::{HostCache, Policy, Residency, Trace, Workers};
use anyhow::{Context, Result, bail};
use bricks::SceneFile;
use std::path::Path;
use std::sync::Arc;

/// A scene on a device.
pub struct Session {
    /// The scene.
    pub scene: Arc<SceneFile>,
    /// The executor.
    pub executor: GpuExecutor,
    /// The cache.
    pub cache: Cache,
    /// The schedule in force.
    pub schedule: Schedule,
}

/// Opens a scene file.
///
/// # Errors
/// It is missing, no scene, or damaged.
pub fn open_scene(path: &Path) -> Result<Arc<SceneFile>> {
    Ok(Arc::new(SceneFile::open(path)?))
}

/// Bytes of every brick's payloads.
pub fn brick_bytes(scene: &SceneFile) -> Vec<BrickBytes> {
    let record = |b: &bricks::Brick| BrickBytes {
        bvh: u64::from(b.node_count) * size_of::<bricks::Node>() as u64,
        geometry: b.geometry.bytes,
        attributes: b.attributes.bytes,
    };
    scene.resident().bricks.iter().map(record).collect()
}

impl Session {
    /// Opens device, cache and workers for `scene`.
    ///
    /// # Errors
    /// No device, a device that fails the start-up probe, a cache too small or too large.
    pub fn open(scene: Arc<SceneFile>, path: &Path, args: &StreamArgs, extent: Extent) -> Result<Self> {
        let name = path.display();
        let gpu = Gpu::open(args.adapter.as_deref())?;
        let report = probe::run(&gpu.device, &gpu.queue);
        let failures = report.failures();
        if !failures.is_empty() {
            bail!(
                "{} does not compute as exact rendering needs: {}; choose another with --adapter",
                gpu.info.name,
                failures.join(", ")
            );
        }
        let bytes = brick_bytes(&scene);
        let sizes: Vec<(u64, u64)> = bytes.iter().map(|b| (b.geometry, b.attributes)).collect();
        let all: u64 = sizes.iter().map(|s| s.0 + s.1).sum();
        let page_bytes = gpu.page_bytes();
        let for_all = Residency::budget_for_all(&sizes, page_bytes);
        let asked = args.cache.bytes(all);
        // Pages end before what does not fit into them: a cache that is to hold everything gets that room, too.
        let budget = if asked >= all { asked.max(for_all).min(for_all.max(16)) } else { asked };
        let schedule = match args.schedule {
            ScheduleArg::Plain if budget < for_all => bail!(
                "{name}: --schedule plain keeps everything resident and needs --cache {for_all} (or 100%), not {budget}; \
                 give it that, or use --schedule chc"
            ),
            ScheduleArg::Plain => Schedule::Plain,
            ScheduleArg::Chc | ScheduleArg::Auto => Schedule::Chc,
        };
        let policy = if args.evict == "lru" { Policy::Lru } else { Policy::RoundRobin };
        let residency =
            Residency::new(&sizes, budget, page_bytes, policy).with_context(|| format!("{name}: --cache"))?;
        let trace = args.requests_out.is_some().then(|| Trace::new(sizes, budget, page_bytes, policy));
        let host = HostCache::new(args.host_cache);
        let workers = Workers::new(scene.clone(), host, args.worker_count(), 0)?;
        // The threshold counts pixels of a tile of 200 x 200.
        let threshold = (f64::from(args.query_threshold) * f64::from(extent.tile).powi(2) / 40_000.0) as u32;
        let setup = Setup { extent, threshold, count: false };
        let page_sizes: Vec<u64> = residency.page_sizes().collect();
        let executor = GpuExecutor::new(gpu, scene.clone(), workers, page_sizes.into_iter(), setup)
            .with_context(|| format!("{name}"))?;
        Ok(Self { scene, executor, cache: Cache::new(residency, bytes, trace), schedule })
    }
}
