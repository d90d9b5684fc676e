//! Queries of geometry, exact and out of core: what rays meet, what is nearest to points, what they lie in.
//!
//! They run on the processor, in f64, over the vertices of the scene file. Whether a ray meets a triangle is decided by
//! exact signs ([`crate::math::crossing`]), and nothing steps by an epsilon. A batch is brought into the order of
//! bricks, answered, and handed back in the order in which it was given. Bricks come through a cache of the size that
//! is asked for, so that memory grows with what the caller holds and not with the scene.
//!
//! They are of geometry: of what materials say only those that look for one hit, cast and any, take note.
//!
//! | query | answers by |
//! | --- | --- |
//! | cast, any, visibility | `cast.rs`, by `rounds.rs`: the bricks that are needed, each once |
//! | the same where there is room for all | `turns.rs`, over `flat.rs`: the scene as one tree |
//! | closest points, distance | `nearest.rs`, likewise |
//! | count, list | `rays.rs`, over `sweep.rs`: all bricks on the way, each once |
//! | occupancy, signed distance | `inside.rs`: winding along an axis; `closed.rs` says whether it has a meaning |

mod aim;
mod aims;
mod cast;
mod closed;
mod flat;
mod given;
mod hits;
mod inside;
mod near;
mod nearest;
mod packet;
mod rays;
mod room;
mod rounds;
mod space;
mod store;
mod sweep;
mod top;
mod turns;
mod walk;

#[cfg(test)]
mod tests;

pub use closed::Surface;
pub use given::Rays;

use crate::cpu::available_memory;
use crate::output::npy::Hit;
use crate::session::trace::check;
use crate::settings::CacheSize;
use anyhow::{Context, Result, bail};
use bricks::{Payload, SceneFile};
use flat::Flat;
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::sync::atomic::AtomicU64;
use std::sync::{Arc, Mutex, OnceLock};
use store::Store;
use top::Top;

/// Bytes of a cache where nothing is known of the machine's memory.
const UNKNOWN: u64 = 1 << 30;

/// Bytes that a cache of everything has beside it, for what is in use.
const BESIDE: u64 = 8 << 20;

/// Rays or points that are answered at a time where bricks may have to be read again for the next.
const BATCH: usize = 1 << 22;

/// And where none has: what is known of so many stays in a processor's own caches.
const NEAR_BATCH: usize = 1 << 16;

/// Rays that are checked at a time.
const CHECKED: usize = 1 << 12;

/// Is told how many more items are done; 0 says that work goes on. An error ends the work and is handed back.
pub type Watch<'a> = dyn FnMut(u64) -> Result<()> + 'a;

/// A scene that is asked about its geometry.
///
/// Several threads may ask at once.
pub struct Queries {
    scene: Arc<SceneFile>,
    store: Store,
    threads: ThreadPool,
    /// Whether some triangle lies in several bricks.
    has_copies: bool,
    surfaces: OnceLock<Vec<Surface>>,
    top: OnceLock<Top>,
    /// The scene as one tree, made when rays enough have come; `None` where there is none after all.
    flat: OnceLock<Option<Flat>>,
    /// Bytes that it takes, where there is room for it.
    flat_bytes: Option<u64>,
    /// Held by who makes it.
    making: Mutex<()>,
    /// How many rays have come.
    rays: AtomicU64,
}

/// All that rays meet.
#[derive(Clone, Debug, PartialEq)]
pub struct Intersections {
    /// Where the hits of each ray begin, and where the last end: one more than there are rays.
    pub starts: Vec<u64>,
    /// Hits, ray by ray.
    pub hits: Vec<Hit>,
}

/// The point of a scene that is nearest to a given one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Closest {
    /// The point, world units; of a scene without triangles no number.
    pub point: [f64; 3],
    /// Its distance, world units; +inf in a scene without triangles.
    pub distance: f64,
    /// Global id of its triangle; 4294967295 in a scene without.
    pub triangle: u32,
    /// Weight of vertex 1 of the source's order.
    pub u: f32,
    /// Weight of vertex 2.
    pub v: f32,
    /// The triangle's unit normal, as of [`Hit`].
    pub normal: [f32; 3],
}

/// What queries took so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct QueryStats {
    /// Payloads of bricks that were read from the file.
    pub payloads_read: u64,
    /// Bytes of those.
    pub bytes_read: u64,
    /// Most bytes of payloads, and of what was made of them, that were held at a time.
    pub most_bytes: u64,
}

impl Queries {
    /// Asks `scene`, with a cache of host memory, of which what is in use takes a quarter or 4 MiB; on so many threads,
    /// 0 for as many as the processor has. By itself the cache holds all or takes a quarter of the memory that is
    /// available. All is geometry and attributes, and room for what is in use beside them; and where there is room, or
    /// 100 % is asked for and it fits into that quarter, the scene as one tree, in which many rays take less time.
    ///
    /// # Errors
    /// A thread cannot be started.
    pub fn new(scene: Arc<SceneFile>, cache: CacheSize, threads: usize) -> Result<Self> {
        let all = all_bytes(&scene);
        let room = available_memory().map_or(UNKNOWN, |bytes| bytes / 4);
        let bricks = all + all / 2 + BESIDE;
        // A share is of bricks: who asks for all of them need not have so much more memory.
        let may_have = |tree: u64| matches!(cache, CacheSize::Bytes(_)) || tree <= room;
        let has_room = |&tree: &u64| may_have(tree) && cache.bytes(bricks + tree, room) >= bricks + tree;
        let flat_bytes = flat::bytes(scene.resident()).filter(has_room);
        let tree = flat_bytes.unwrap_or(0);
        let cache_bytes = cache.bytes(bricks + tree, room) - tree;
        let name = |number| format!("query {number}");
        let threads = ThreadPoolBuilder::new().num_threads(threads).thread_name(name).build()?;
        let store = Store::new(scene.clone(), cache_bytes, threads.current_num_threads())?;
        let has_copies = closed::has_copies(scene.resident());
        Ok(Self {
            scene,
            store,
            threads,
            has_copies,
            surfaces: OnceLock::new(),
            top: OnceLock::new(),
            flat: OnceLock::new(),
            flat_bytes,
            making: Mutex::new(()),
            rays: AtomicU64::new(0),
        })
    }

    /// The scene.
    pub fn scene(&self) -> &Arc<SceneFile> {
        &self.scene
    }

    /// How many rays or points are best given at a time, of those that are too many to be near together: fewer where
    /// the cache keeps all bricks.
    pub fn batch(&self) -> usize {
        if self.store.keeps(all_bytes(&self.scene)) { NEAR_BATCH } else { BATCH }
    }

    /// The top level, made when it is first asked for.
    fn top(&self) -> &Top {
        self.top.get_or_init(|| Top::new(self.scene.resident()))
    }

    /// Refuses rays that are none.
    fn check_rays(&self, rays: Rays) -> Result<()> {
        let parts = (0..rays.len().div_ceil(CHECKED)).into_par_iter();
        let bad_in = |part: usize| rays.first_bad(part * CHECKED, rays.len().min((part + 1) * CHECKED));
        let bad = self.threads.install(|| parts.find_map_first(bad_in));
        bad.map_or(Ok(()), |number| check(&rays.get(number)).with_context(|| format!("ray {number}")))
    }

    /// What was read and held so far.
    pub fn stats(&self) -> QueryStats {
        let (payloads_read, bytes_read, most_bytes) = self.store.read();
        QueryStats { payloads_read, bytes_read, most_bytes }
    }
}

/// Bytes of the payloads of all bricks.
fn all_bytes(scene: &SceneFile) -> u64 {
    let bytes = |brick| scene.loaded_bytes(Payload::Geometry(brick)) + scene.loaded_bytes(Payload::Attributes(brick));
    (0..scene.resident().exact_bricks() as u32).map(bytes).sum()
}

/// Refuses points that are not numbers.
fn check_points(points: &[[f64; 3]]) -> Result<()> {
    if let Some(number) = points.iter().position(|point| point.iter().any(|x| !x.is_finite())) {
        bail!("point {number}: {:?} is not finite", points[number]);
    }
    Ok(())
}
