//! Queries of geometry, exact and out of core: what rays meet, what is nearest to points, what they lie in.
//!
//! They run on the processor, in f64, over the vertices of the scene file. Whether a ray meets a triangle is decided by
//! exact signs ([`crate::math::crossing`]), and nothing steps by an epsilon. A batch is brought into the order of
//! bricks, answered, and handed back in the order in which it was given. Bricks come through a cache of the size that
//! is asked for, so that memory grows with what the caller holds and not with the scene.
//!
//! They are of geometry alone: what materials say of opacity does not matter here. Closest hits as rendering finds them
//! are [`crate::Session::trace`]'s.
//!
//! | query | answers by |
//! | --- | --- |
//! | count, list, visibility | `rays.rs`, over `sweep.rs`: each brick once |
//! | closest points, distance | `nearest.rs`: nearest bricks first, by rounds |
//! | occupancy, signed distance | `inside.rs`: winding along an axis; `closed.rs` says whether it has a meaning |

mod closed;
mod hits;
mod inside;
mod nearest;
mod rays;
mod space;
mod store;
mod sweep;

#[cfg(test)]
mod tests;

pub use closed::Surface;

use crate::output::npy::Hit;
use anyhow::{Result, bail};
use bricks::SceneFile;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::sync::{Arc, OnceLock};
use store::Store;

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
    /// Most bytes of payloads that were held at a time.
    pub most_bytes: u64,
}

impl Queries {
    /// Asks `scene`, with a cache of `cache_bytes` for geometry, of which what is in use takes a quarter or 4 MiB; on
    /// so many threads, 0 for as many as the processor has.
    ///
    /// # Errors
    /// A thread cannot be started.
    pub fn new(scene: Arc<SceneFile>, cache_bytes: u64, threads: usize) -> Result<Self> {
        let name = |number| format!("query {number}");
        let threads = ThreadPoolBuilder::new().num_threads(threads).thread_name(name).build()?;
        let store = Store::new(scene.clone(), cache_bytes, threads.current_num_threads())?;
        let has_copies = closed::has_copies(scene.resident());
        Ok(Self { scene, store, threads, has_copies, surfaces: OnceLock::new() })
    }

    /// The scene.
    pub fn scene(&self) -> &Arc<SceneFile> {
        &self.scene
    }

    /// What was read and held so far.
    pub fn stats(&self) -> QueryStats {
        let (payloads_read, bytes_read, most_bytes) = self.store.read();
        QueryStats { payloads_read, bytes_read, most_bytes }
    }
}

/// Refuses points that are not numbers.
fn check_points(points: &[[f64; 3]]) -> Result<()> {
    if let Some(number) = points.iter().position(|point| point.iter().any(|x| !x.is_finite())) {
        bail!("point {number}: {:?} is not finite", points[number]);
    }
    Ok(())
}
