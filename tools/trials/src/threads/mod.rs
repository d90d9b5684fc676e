//! What threads share, under one order of threads after the other.
//!
//! The files of brickwalk are compiled here once more, with locks and flags of [shuttle](https://docs.rs/shuttle) in
//! place of the system's: it runs one thread at a time, chooses at random which goes on at every lock and flag, and
//! finds deadlocks. A seed is some orders, always the same ones. The pools of rayon are not among it: what runs in them
//! meets in these places, or in atomic counters.

mod kinds;

// As the files call what lies beside them.
mod item {
    pub use brickwalk::stream::Item;
}
use brickwalk::view::studio::{Ask, Wish};

#[allow(dead_code, missing_docs)]
#[path = "../../../../src/stream/host_cache.rs"]
mod host_cache;
#[allow(dead_code, missing_docs)]
#[path = "../../../../src/view/studio/inbox.rs"]
mod inbox;

pub use kinds::{HostCaches, Inboxes};
