//! A scene on a device: file, executor, cache and schedule, as settings ask for them.

use super::device::Device;
use crate::kernels::{Extent, FrameExecutor, Keep, Setup};
use crate::schedule::cache::{BrickBytes, Cache, SceneBytes};
use crate::session::Settings;
use crate::settings::sizes::option_bytes;
use crate::settings::{CacheSize, Schedule};
use crate::stream::{HostCache, Residency, ResidencyError, Sizes, Trace};
use anyhow::{Context, Result, anyhow, bail};
use bricks::SceneFile;
use std::path::Path;
use std::sync::Arc;

/// A scene on a device.
pub struct Opened {
    /// The scene.
    pub scene: Arc<SceneFile>,
    /// The executor.
    pub executor: Box<dyn FrameExecutor>,
    /// The cache.
    pub cache: Cache,
    /// The schedule in force.
    pub schedule: Schedule,
    /// Rays of a dispatch, and their tiles.
    pub extent: Extent,
    /// What a person should know, a line each.
    pub warnings: Vec<String>,
}

/// What an executor is made for.
pub struct Needs<'a> {
    /// The scene.
    pub scene: Arc<SceneFile>,
    /// The host's cache.
    pub host: Arc<HostCache>,
    /// Threads that read payloads.
    pub threads: usize,
    /// Bytes of the cache's pages.
    pub page_sizes: &'a [u64],
    /// Picture, tiles and counting.
    pub setup: Setup,
}

/// Opens a scene file.
///
/// # Errors
/// It is missing, no scene, or damaged.
pub fn open_scene(path: &Path) -> Result<Arc<SceneFile>> {
    Ok(Arc::new(SceneFile::open(path)?))
}

/// Bytes of every brick's payloads as they are loaded.
pub fn brick_bytes(scene: &SceneFile) -> Vec<BrickBytes> {
    let record = |b: &bricks::Brick| BrickBytes {
        bvh: u64::from(b.node_count) * size_of::<bricks::Node>() as u64,
        geometry: b.geometry.bytes,
        attributes: bricks::AttributeLayout::of(b).bytes,
    };
    scene.resident().bricks.iter().map(record).collect()
}

/// Bytes of everything that is streamed of a scene, as it is loaded.
pub fn scene_bytes(scene: &SceneFile) -> SceneBytes {
    let tiles = scene.resident().tiles.iter().map(|tile| tile.bytes).collect();
    SceneBytes { bricks: brick_bytes(scene), tiles }
}

/// Bytes of the cache that `--cache` asks for, of a scene with bricks and tiles of `sizes`. Pages end before what does
/// not fit into them: a cache that is to hold everything gets that room, too, and no more.
pub fn cache_budget(cache: CacheSize, sizes: &Sizes, page_bytes: u64) -> u64 {
    let all = sizes.sum();
    let for_all = Residency::budget_for_all(sizes, page_bytes);
    let asked = cache.bytes(all);
    if asked >= all { asked.max(for_all).min(for_all.max(16)) } else { asked }
}

/// The rays of a tile with edges of `tile` rays that `--query-threshold` comes to: it counts those of a tile of 200 x
/// 200.
pub fn scaled_threshold(threshold: u32, tile: u32) -> u32 {
    (f64::from(threshold) * f64::from(tile).powi(2) / 40_000.0) as u32
}

impl Opened {
    /// Opens device, cache and workers for `scene`, the file `path`.
    ///
    /// # Errors
    /// No device, a device that fails the start-up probe, a cache too small or too large.
    pub fn open(scene: Arc<SceneFile>, path: &Path, settings: &Settings) -> Result<Self> {
        Self::open_keeping(scene, path, settings, Keep::default())
    }

    /// [`Opened::open`] with what `keep` says though the scene does not need it.
    ///
    /// # Errors
    /// As [`Opened::open`].
    pub fn open_keeping(scene: Arc<SceneFile>, path: &Path, settings: &Settings, keep: Keep) -> Result<Self> {
        if let Some(file) = &settings.requests_out {
            // Said before the work rather than after it.
            let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty());
            if folder.is_some_and(|folder| !folder.is_dir()) || file.is_dir() {
                bail!("{}: --requests-out needs a file in a folder that exists", file.display());
            }
        }
        let device = Device::open(&settings.adapter)?;
        let page_bytes = device.page_bytes();
        let mut opened = Self::open_on(scene, path, settings, page_bytes, |needs| {
            device.executor(needs.scene, needs.host, needs.threads, needs.page_sizes, Setup { keep, ..needs.setup })
        })?;
        opened.cache.states.keep_asking(keep.queries);
        Ok(opened)
    }

    /// As [`Opened::open`], on the executor that `make` makes, of a device with pages of at most `page_bytes`.
    ///
    /// # Errors
    /// As [`Opened::open`].
    pub fn open_on(
        scene: Arc<SceneFile>,
        path: &Path,
        settings: &Settings,
        page_bytes: u64,
        make: impl FnOnce(Needs) -> Result<Box<dyn FrameExecutor>>,
    ) -> Result<Self> {
        let name = path.display();
        let extent = Extent { width: settings.size.width, height: settings.size.height, tile: settings.tile };
        let bytes = scene_bytes(&scene);
        let sizes = bytes.sizes();
        let for_all = Residency::budget_for_all(&sizes, page_bytes);
        let budget = cache_budget(settings.cache, &sizes, page_bytes);
        let schedule = match settings.schedule {
            Schedule::Plain | Schedule::PlainBinary if budget < for_all => bail!(
                "{name}: --schedule {} keeps everything resident: give --cache 100% ({for_all} bytes) rather than \
                 {budget} bytes, or use --schedule chc",
                settings.schedule
            ),
            // Fronts and thresholds belong to chc; with a threshold the schedule shows in the picture.
            Schedule::Auto if settings.fronts || settings.query_threshold > 0 => Schedule::Chc,
            schedule => schedule,
        };
        let policy = settings.evict;
        let residency = Residency::new(&sizes, budget, page_bytes, policy).map_err(|error| match error {
            ResidencyError::CacheTooSmall { what, needed, given } => anyhow!(
                "{name}: a cache of {given} bytes is too small: {what} need {needed} bytes; give --cache {} or more, or \
                 convert the scene with fewer --brick-triangles",
                option_bytes(needed)
            ),
            other => anyhow!(other).context(format!("{name}: --cache")),
        })?;
        let trace = settings.requests_out.is_some().then(|| Trace::new(sizes, budget, page_bytes, policy));
        let threshold = scaled_threshold(settings.query_threshold, extent.tile);
        let mut warnings = Vec::new();
        if settings.query_threshold > threshold && threshold == 0 {
            warnings.push(format!(
                "--query-threshold {} is less than one ray of a tile of {}: nothing is left out; use a larger --tile",
                settings.query_threshold, extent.tile
            ));
        }
        let setup = Setup { extent, threshold, count: settings.count, keep: Keep::default() };
        let page_sizes: Vec<u64> = residency.page_sizes().collect();
        let host = HostCache::new(settings.host_cache);
        let threads = settings.worker_count();
        let needs = Needs { scene: scene.clone(), host, threads, page_sizes: &page_sizes, setup };
        let mut executor = make(needs).with_context(|| format!("{name}"))?;
        if schedule == Schedule::PlainBinary {
            executor.make_binary().with_context(|| format!("{name}"))?;
        }
        Ok(Self { scene, executor, cache: Cache::new(residency, bytes, trace), schedule, extent, warnings })
    }

    /// Writes the trace of requests, if the settings ask for one.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write_requests(settings: &Settings, cache: &Cache) -> Result<()> {
        if let (Some(file), Some(trace)) = (&settings.requests_out, &cache.trace) {
            trace.write_file(file).with_context(|| file.display().to_string())?;
        }
        Ok(())
    }
}
