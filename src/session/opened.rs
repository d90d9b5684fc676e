//! A scene on a device: file, executor, cache and schedule, as settings ask for them.

use super::bands::Bands;
use super::device::Device;
use super::hidden;
use crate::cpu::available_memory;
use crate::kernels::flat::FlatBrick;
use crate::kernels::shade::more;
use crate::kernels::{Extent, FrameExecutor, Keep, Setup};
use crate::output::atomic;
use crate::remote;
use crate::schedule::ExecutorError;
use crate::schedule::cache::Cache;
use crate::session::Settings;
use crate::settings::sizes::{counted, human_bytes, option_bytes};
use crate::settings::{CacheSize, Schedule};
use crate::stream::{HostCache, PayloadSource, Residency, ResidencyError, Sizes, Trace};
use anyhow::{Context, Result, anyhow, bail};
use bricks::{Access, Resident, SceneFile};
use std::path::Path;
use std::sync::Arc;
use tracing::info;

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
    /// Rays of a dispatch, those of a band or of the picture, and their tiles.
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

/// Opens a scene: a file, or a URL ([`remote`]).
///
/// # Errors
/// It is missing, no scene, or damaged.
pub fn open_scene(path: &Path) -> Result<Arc<SceneFile>> {
    Ok(Arc::new(if remote::is_url(path) { remote::open(path)? } else { SceneFile::open(path)? }))
}

/// As [`open_scene`], without a map: what is read counts as this program's memory only while it is held.
///
/// # Errors
/// As [`open_scene`].
pub fn open_unmapped(path: &Path) -> Result<Arc<SceneFile>> {
    Ok(Arc::new(if remote::is_url(path) { remote::open(path)? } else { SceneFile::open_with(path, Access::Read)? }))
}

/// Room for which an allocation that fails is not tried with half of it.
const LEAST_ROOM: u64 = 16 << 20;

/// What a device has room for.
#[derive(Clone, Copy, Debug)]
pub struct Room {
    /// Most bytes of a page of the cache.
    pub page_bytes: u64,
    /// Bytes of a cache that is made without being asked how large.
    pub bytes: u64,
    /// Rows of a picture that are rendered at a time.
    pub rows: u32,
}

/// Whether the device is what an error is about.
pub fn is_of_device(error: &anyhow::Error) -> bool {
    error.chain().any(|cause| matches!(cause.downcast_ref(), Some(ExecutorError::Device(_))))
}

/// Bytes of the cache that `--cache` asks for, of a scene with bricks and tiles of `sizes`, on a device that has `room`
/// for so many: a share never less than the least that works. Pages end before what does
/// not fit into them: a cache that is to hold everything gets that room, too, and no more.
pub fn cache_budget(cache: CacheSize, sizes: &Sizes, page_bytes: u64, room: u64) -> u64 {
    let all = sizes.sum();
    let for_all = Residency::budget_for_all(sizes, page_bytes);
    let asked = cache.bytes(all, room);
    match cache {
        _ if asked >= all => for_all.max(16),
        CacheSize::Bytes(_) => asked,
        CacheSize::Auto | CacheSize::Percent(_) => asked.max(Residency::least_budget(sizes)),
    }
}

/// Bytes that bricks may take beside the cache in the form that the processor walks faster: those of all of them, where
/// the cache holds everything, `for_all` bytes, and there is room for these, too. A share is of bricks as they lie in
/// the file, so who asks for all of them gets the others where a cache that is not asked for would.
fn flat_bytes(cache: CacheSize, resident: &Resident, for_all: u64, room: u64) -> u64 {
    let bytes: u64 = resident.bricks.iter().filter_map(FlatBrick::bytes_of).sum();
    let asked = match cache {
        CacheSize::Bytes(bytes) => bytes,
        CacheSize::Percent(percent) if percent < 100.0 => 0,
        CacheSize::Auto | CacheSize::Percent(_) => room,
    };
    if for_all + bytes <= asked { bytes } else { 0 }
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
            if !atomic::folder_of(file).is_dir() || file.is_dir() {
                bail!("{}: --requests-out needs a file in a folder that exists", file.display());
            }
        }
        Self::open_with(&Device::open(&settings.adapter)?, scene, path, settings, keep)
    }

    /// [`Opened::open_keeping`] on a device that is open.
    ///
    /// # Errors
    /// As [`Opened::open`].
    pub fn open_with(
        device: &Device,
        scene: Arc<SceneFile>,
        path: &Path,
        settings: &Settings,
        keep: Keep,
    ) -> Result<Self> {
        let Bands { rows, room, why } = Bands::of(settings, device, more::is_needed(scene.resident()))?;
        let bytes = room.map_or(device.room(), |left| left.min(device.room()));
        let mut room = Room { page_bytes: device.page_bytes(), bytes, rows };
        let mut opened = loop {
            let made = Self::open_on(scene.clone(), path, settings, room, |needs| {
                let setup = Setup { keep, ..needs.setup };
                device.clone().executor(needs.scene, needs.host, needs.threads, needs.page_sizes, setup)
            });
            match made {
                // What a driver says is free is not trusted.
                Err(error) if settings.cache == CacheSize::Auto && room.bytes > LEAST_ROOM && is_of_device(&error) => {
                    room.bytes /= 2;
                    info!("cache: the allocation failed; trying {}", human_bytes(room.bytes));
                }
                made => break made?,
            }
        };
        opened.cache.states.keep_asking(keep.queries);
        opened.warnings.extend(why);
        Ok(opened)
    }

    /// As [`Opened::open`], on the executor that `make` makes, of a device with so much room.
    ///
    /// # Errors
    /// As [`Opened::open`].
    pub fn open_on(
        scene: Arc<SceneFile>,
        path: &Path,
        settings: &Settings,
        Room { page_bytes, bytes: room, rows }: Room,
        make: impl FnOnce(Needs) -> Result<Box<dyn FrameExecutor>>,
    ) -> Result<Self> {
        let name = path.display();
        let extent = Extent { width: settings.size.width, height: rows, tile: settings.tile };
        let sizes = scene.sizes();
        let for_all = Residency::budget_for_all(&sizes, page_bytes);
        let budget = cache_budget(settings.cache, &sizes, page_bytes, room);
        let schedule = match settings.schedule {
            schedule if schedule.is_plain() && budget < for_all => bail!(
                "{name}: --schedule {} keeps everything resident: give --cache 100% ({for_all} bytes) rather than \
                 {budget} bytes, or use --schedule chc",
                settings.schedule
            ),
            // Fronts and thresholds belong to chc; with a threshold the schedule shows in the picture.
            Schedule::Auto if settings.has_fronts() || settings.query_threshold > 0 => Schedule::Chc,
            schedule => schedule,
        };
        let policy = settings.evict;
        let residency = Residency::new(&sizes, budget, page_bytes, policy).map_err(|error| match error {
            ResidencyError::CacheTooSmall { what, needed, given } => anyhow!(
                "{name}: a cache of {given} bytes is too small: {what} need {needed} bytes; give --cache {} or more, \
                 or convert the scene with fewer --brick-triangles",
                option_bytes(needed)
            ),
            other => anyhow!(other).context(format!("{name}: --cache")),
        })?;
        let trace = settings.requests_out.is_some().then(|| Trace::new(sizes.clone(), budget, page_bytes, policy));
        let threshold = scaled_threshold(settings.query_threshold, extent.tile);
        let mut warnings = Vec::new();
        let asked = settings.cache.bytes(sizes.sum(), room);
        if matches!(settings.cache, CacheSize::Percent(_)) && asked < budget && budget < for_all {
            let [asked, budget] = [asked, budget].map(human_bytes);
            warnings.push(format!(
                "--cache {} is {asked}, less than the two largest bricks need; the cache has {budget}",
                settings.cache
            ));
        }
        if settings.query_threshold > threshold && threshold == 0 {
            warnings.push(format!(
                "--query-threshold {} is less than one ray of a tile of {} and has no effect; use a larger --tile",
                settings.query_threshold, extent.tile
            ));
        }
        let hidden = hidden::bounds(settings, &scene.resident().manifest).with_context(|| format!("{name}"))?;
        let setup = Setup {
            extent,
            threshold,
            count: settings.count,
            opaque: settings.opaque,
            hides: !hidden.is_empty(),
            flat_bytes: flat_bytes(settings.cache, scene.resident(), for_all, room),
            keep: Keep::default(),
        };
        let page_sizes: Vec<u64> = residency.page_sizes().collect();
        let host_bytes = settings.host_cache.bytes(available_memory());
        info!(
            "cache: {} of {} of bricks and tiles, {policy}, in {}; host cache {}",
            human_bytes(budget),
            human_bytes(sizes.sum()),
            counted(page_sizes.len() as u64, "page"),
            human_bytes(host_bytes)
        );
        info!("schedule: {schedule}");
        if rows < settings.size.height {
            let bands = settings.size.height.div_ceil(rows);
            info!("pictures: {} of {rows} rows", counted(bands.into(), "band"));
        }
        let host = HostCache::new(host_bytes);
        let threads = settings.worker_count();
        let needs = Needs { scene: scene.clone(), host, threads, page_sizes: &page_sizes, setup };
        let mut executor = make(needs).with_context(|| format!("{name}"))?;
        executor.set_hidden(&hidden).with_context(|| format!("{name}"))?;
        let node = size_of::<bricks::Node>() as u64;
        let nodes = scene.resident().bricks.iter().map(|brick| u64::from(brick.node_count) * node).collect();
        #[cfg(feature = "lab")]
        if schedule == Schedule::PlainBinary {
            executor.make_binary().with_context(|| format!("{name}"))?;
        }
        Ok(Self { scene, executor, cache: Cache::new(residency, sizes, nodes, trace), schedule, extent, warnings })
    }

    /// Writes the trace of requests, if the settings ask for one.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write_requests(settings: &Settings, cache: &Cache) -> Result<()> {
        if let (Some(file), Some(trace)) = (&settings.requests_out, &cache.trace) {
            trace.write_file(file)?;
        }
        Ok(())
    }
}
