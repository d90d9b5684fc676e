//! What a scene by URL cost.

use serde::Serialize;
use std::sync::atomic::{AtomicU64, Ordering};

/// What was fetched of a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Traffic {
    /// Requests that were sent, those for credentials included.
    pub requests: u64,
    /// Requests that were sent once more, after a failure or wrong bytes.
    pub retries: u64,
    /// Bytes of answers that arrived, failed ones included.
    pub bytes_fetched: u64,
    /// Bytes that were asked for: those between joined spans and of failed answers are not among them.
    pub bytes_needed: u64,
    /// Batches of requests that were waited for together.
    pub round_trips: u64,
    /// Spans that the disk cache had.
    pub disk_cache_hits: u64,
    /// Bytes of those.
    pub disk_cache_bytes: u64,
    /// Seconds of waiting for answers.
    pub seconds_waiting: f64,
}

/// Counts [`Traffic`].
#[derive(Debug, Default)]
#[cfg_attr(not(feature = "remote"), allow(dead_code))]
pub(super) struct Counters {
    pub requests: AtomicU64,
    pub retries: AtomicU64,
    pub bytes_fetched: AtomicU64,
    pub bytes_needed: AtomicU64,
    pub round_trips: AtomicU64,
    pub disk_cache_hits: AtomicU64,
    pub disk_cache_bytes: AtomicU64,
    pub nanoseconds_waiting: AtomicU64,
}

/// Adds to a counter.
#[cfg(feature = "remote")]
pub(super) fn add(counter: &AtomicU64, value: u64) {
    counter.fetch_add(value, Ordering::Relaxed);
}

impl Counters {
    /// What was counted so far.
    pub fn now(&self) -> Traffic {
        let of = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        Traffic {
            requests: of(&self.requests),
            retries: of(&self.retries),
            bytes_fetched: of(&self.bytes_fetched),
            bytes_needed: of(&self.bytes_needed),
            round_trips: of(&self.round_trips),
            disk_cache_hits: of(&self.disk_cache_hits),
            disk_cache_bytes: of(&self.disk_cache_bytes),
            seconds_waiting: of(&self.nanoseconds_waiting) as f64 * 1e-9,
        }
    }
}
