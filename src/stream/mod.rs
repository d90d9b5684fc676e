//! Streaming: which payloads of bricks and textures are on the device, and how they get there.
//!
//! **Theory.** Out of core, CHC+RT keeps bricks in a round-robin cache: write at the next slot, wrap, mark what is
//! overwritten as out of core. A frame is exact whatever the cache holds, because hit distances persist while bricks
//! come and go; the cache decides time alone.
//!
//! **What we changed.** The cache is made of pages, each no larger than one storage binding, and what a batch is about
//! to use can be pinned so that a wrap in mid-batch never overwrites it. Geometry (what traversal reads), attributes
//! (what shading of hits reads) and tiles of textures are cached apart. Round robin with second chances and LRU are
//! offered beside round robin, and a recorded trace of requests can be replayed against all and against Bélády's greedy
//! bound.
//!
//! **Practice.** [`Residency`] is a pure state machine that says where a payload goes and what it overwrites.
//! [`Workers`] are the only threads that touch the scene file: they take a payload from the [`HostCache`] or copy and
//! verify it from its [`PayloadSource`], then hand it to a [`Destination`]. [`Trace`] records
//! requests.

mod host_cache;
mod item;
mod lru;
mod residency;
mod ring;
mod sizes;
mod source;
mod space;
pub mod sync;
mod trace;
mod workers;

#[cfg(test)]
mod tests;

pub use crate::settings::Policy;
pub use host_cache::{HostCache, HostCacheStats, Reservation};
pub use item::{Item, Kind, Slot};
pub use residency::{Counters, KindCounters, NoRoom, Placed, Residency, ResidencyError};
pub use sizes::Sizes;
pub use source::{PayloadSource, SourceError};
pub use trace::{PassRequests, Replay, ReplayResult, Trace, TraceError, replay};
pub use workers::{Destination, Loaded, Shared, StreamError, Workers, WorkersStats};
