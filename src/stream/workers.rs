//! The worker threads: the only ones that touch the scene file.
//!
//! A load is answered from the host cache, else copied from the source, verified in the copy, and handed to its
//! destination; only then is it kept in the host cache, so that caching is not on the way of a frame. Each worker
//! copies into one buffer that it keeps, so a load neither allocates nor clears memory unless its payload is cached.
//!
//! What is looked up and what room is reserved in the host cache is decided by the caller of [`Workers::load_each`], in
//! the order of requests, before a worker sees any of them: the counters do not depend on timing.

use super::host_cache::{HostCache, Reservation};
use super::item::Item;
use super::source::{PayloadSource, SourceError};
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::any::Any;
use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Where a payload goes, such as a mapped, write-only range of a staging buffer.
pub trait Destination: Send + 'static {
    /// Whether the destination keeps payloads as they are in host memory, shared with the host cache.
    const SHARES: bool = false;

    /// Takes the verified payload. Called once, on a worker thread, and not at all when the payload cannot be had.
    fn fill(&mut self, bytes: &[u8]);

    /// Takes the verified payload in memory of its own, in place of [`Self::fill`], where it lies in such.
    fn share(&mut self, payload: Arc<[u8]>) {
        self.fill(&payload);
    }
}

/// A place in host memory, shared with the host cache.
#[derive(Default)]
pub struct Shared(pub Option<Arc<[u8]>>);

impl Destination for Shared {
    const SHARES: bool = true;

    fn fill(&mut self, bytes: &[u8]) {
        self.share(Arc::from(bytes));
    }

    fn share(&mut self, payload: Arc<[u8]>) {
        self.0 = Some(payload);
    }
}

/// Why something was not loaded.
#[derive(Debug, thiserror::Error)]
pub enum StreamError {
    /// The payload is corrupt or cannot be read.
    #[error("{reason}")]
    Payload {
        /// The item.
        item: Item,
        /// What is wrong with it; names the item.
        reason: SourceError,
    },
    /// The scene has no such brick or tile.
    #[error("{item} does not exist: the scene has {bricks} bricks and {tiles} tiles")]
    NoSuchItem {
        /// The item.
        item: Item,
        /// Number of bricks of the scene.
        bricks: u32,
        /// Number of tiles of its textures.
        tiles: u32,
    },
    /// A worker panicked over it; it goes on with other items.
    #[error("{item}: the worker panicked: {message}")]
    Panicked {
        /// The item.
        item: Item,
        /// Text of the panic.
        message: String,
    },
    /// A worker thread could not be started.
    #[error("cannot start a worker thread")]
    Spawn(#[from] rayon::ThreadPoolBuildError),
}

/// The answer to one request.
#[derive(Debug)]
pub struct Loaded<D> {
    /// What was requested.
    pub item: Item,
    /// The destination given with it. After an error its contents are unspecified.
    pub destination: D,
    /// Whether the destination holds the payload.
    pub result: Result<(), StreamError>,
}

/// What the workers did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WorkersStats {
    /// Payloads loaded from the source.
    pub read: u64,
    /// Bytes of those as loaded, attributes decoded.
    pub read_bytes: u64,
    /// Payloads loaded from the host cache.
    pub cached: u64,
    /// Bytes of those.
    pub cached_bytes: u64,
    /// Loads that failed.
    pub failed: u64,
}

thread_local! {
    /// What a worker copies into; it only ever grows.
    static BUFFER: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
}

/// A pool of threads that load payloads into destinations. Dropping it ends them.
pub struct Workers {
    threads: ThreadPool,
    source: Arc<dyn PayloadSource>,
    host_cache: Arc<HostCache>,
    stats: Mutex<WorkersStats>,
}

impl Workers {
    /// Starts `threads` ≥ 1 threads (0 is taken as 1) over `source`.
    ///
    /// # Errors
    /// [`StreamError::Spawn`] when a thread cannot be started.
    pub fn new(
        source: Arc<dyn PayloadSource>,
        host_cache: Arc<HostCache>,
        threads: usize,
    ) -> Result<Self, StreamError> {
        let name = |number| format!("brick worker {number}");
        let threads = ThreadPoolBuilder::new().num_threads(threads.max(1)).thread_name(name).build()?;
        Ok(Self { threads, source, host_cache, stats: Mutex::default() })
    }

    /// Loads every item into its destination, waits for all, and answers in the order of requests.
    ///
    /// Several threads may call it at once.
    pub fn load_each<D: Destination>(&self, requests: Vec<(Item, D)>) -> Vec<Loaded<D>> {
        let (bricks, tiles) = (self.source.brick_count(), self.source.tile_count());
        let known = |item: Item| self.source.has(item);
        // First every look-up, then every reservation: what this batch finds is in use and not evicted by it.
        let found: Vec<_> =
            requests.iter().map(|&(item, _)| if known(item) { self.host_cache.get(item) } else { None }).collect();
        let plan = |((item, destination), cached): ((Item, D), Option<Arc<[u8]>>)| {
            let reserves = cached.is_none() && known(item);
            let reservation = if reserves { self.host_cache.reserve(item, self.source.bytes(item)) } else { None };
            (item, destination, cached, reservation)
        };
        let jobs: Vec<_> = requests.into_iter().zip(found).map(plan).collect();
        let answer = |(item, mut destination, cached, reservation)| {
            let result = match known(item) {
                true => self.answer(item, &mut destination, cached, reservation),
                false => Err(StreamError::NoSuchItem { item, bricks, tiles }),
            };
            Loaded { item, destination, result }
        };
        let copied = |(item, _, cached, _): &(Item, D, Option<Arc<[u8]>>, Option<Reservation>)| {
            (cached.is_none() && known(*item)).then_some(*item)
        };
        let mut loaded = Vec::with_capacity(jobs.len());
        let mut jobs = jobs.into_iter().peekable();
        while jobs.peek().is_some() {
            // All of them, unless their source is far away: then as many as may be announced together.
            let (mut part, mut bytes) = (Vec::new(), 0u64);
            while let Some(job) = jobs.next_if(|job| {
                bytes = bytes.saturating_add(copied(job).map_or(0, |item| self.source.bytes(item)));
                part.is_empty() || self.source.announced_bytes().is_none_or(|most| bytes <= most)
            }) {
                part.push(job);
            }
            if self.source.announced_bytes().is_some() {
                self.source.announce(&part.iter().filter_map(copied).collect::<Vec<_>>());
            }
            loaded
                .extend(self.threads.install(|| part.into_par_iter().with_max_len(1).map(answer).collect::<Vec<_>>()));
        }
        self.noted().failed += loaded.iter().filter(|one| one.result.is_err()).count() as u64;
        loaded
    }

    /// Loads every item into its destination and waits for all; returns them in the order of requests.
    ///
    /// # Errors
    /// The first error in the order of requests, after everything else has been loaded. [`Self::load_each`] gives back
    /// the destinations of the others as well.
    pub fn load<D: Destination>(&self, requests: Vec<(Item, D)>) -> Result<Vec<(Item, D)>, StreamError> {
        let loaded = self.load_each(requests).into_iter();
        loaded.map(|Loaded { item, destination, result }| result.map(|()| (item, destination))).collect()
    }

    /// The host cache.
    pub fn host_cache(&self) -> &Arc<HostCache> {
        &self.host_cache
    }

    /// What was done so far.
    pub fn stats(&self) -> WorkersStats {
        *self.noted()
    }

    /// Every change of it is complete, so that a poisoned lock guards a sound state.
    fn noted(&self) -> MutexGuard<'_, WorkersStats> {
        self.stats.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Loads one item, on a worker thread. Everything that it held in the host cache is released when it returns.
    fn answer<D: Destination>(
        &self,
        item: Item,
        destination: &mut D,
        cached: Option<Arc<[u8]>>,
        reservation: Option<Reservation>,
    ) -> Result<(), StreamError> {
        // The destination stays outside, so that it comes back whatever happens; the reservation gives its room back
        // when dropped.
        let outcome = catch_unwind(AssertUnwindSafe(|| {
            if let Some(payload) = cached {
                let mut stats = self.noted();
                stats.cached += 1;
                stats.cached_bytes += payload.len() as u64;
                drop(stats);
                destination.share(payload);
                return Ok(());
            }
            let bytes = self.source.bytes(item) as usize;
            if D::SHARES {
                // Zeroed in place: the payload is read into the memory in which it stays.
                let mut payload: Arc<[u8]> = std::iter::repeat_n(0, bytes).collect();
                if let Some(memory) = Arc::get_mut(&mut payload).filter(|memory| !memory.is_empty()) {
                    self.source.copy(item, memory)?;
                }
                if let Some(reservation) = reservation {
                    reservation.share(payload.clone());
                }
                destination.share(payload);
            } else {
                let mut buffer = BUFFER.take();
                buffer.resize(buffer.len().max(bytes), 0);
                let payload = &mut buffer[..bytes];
                if bytes > 0 {
                    self.source.copy(item, payload)?;
                }
                destination.fill(payload);
                if let Some(reservation) = reservation {
                    reservation.fill(payload);
                }
                BUFFER.set(buffer);
            }
            let mut stats = self.noted();
            stats.read += 1;
            stats.read_bytes += bytes as u64;
            Ok(())
        }));
        match outcome {
            Ok(result) => result.map_err(|reason| StreamError::Payload { item, reason }),
            Err(panic) => Err(StreamError::Panicked { item, message: panic_text(panic) }),
        }
    }
}

/// The text of a panic.
fn panic_text(panic: Box<dyn Any + Send>) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str).or(panic.downcast_ref::<&str>().copied());
    let text = text.unwrap_or("no text").to_owned();
    // Dropping what somebody panicked with may panic again and would end the thread.
    std::mem::forget(panic);
    text
}
