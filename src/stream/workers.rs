//! The worker threads: the only ones that touch the scene file.
//!
//! A load is answered from the host cache, else copied from the source, verified in the copy, and handed to its
//! destination; only then is it kept in the host cache, so that caching is not on the way of a frame. Each worker
//! copies into one buffer that it keeps, so a load neither allocates nor clears memory unless its payload is cached.
//!
//! What is looked up and what room is reserved in the host cache is decided by the caller of [`Workers::load_each`], in
//! the order of requests, before a worker sees any of them: the counters do not depend on timing.

use std::any::Any;
use std::convert::Infallible;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::JoinHandle;

use crossbeam::channel::{Receiver, Sender, bounded, select};

use super::host_cache::{HostCache, Reservation};
use super::item::Item;
use super::source::{PayloadSource, SourceError};

/// Jobs waiting per thread before [`Workers::load_each`] waits with handing out more.
const QUEUED_JOBS_PER_THREAD: usize = 4;

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

/// What frames ask of workers beside loads, whatever their destinations.
pub trait WorkerPool {
    /// As [`Workers::host_cache`].
    fn host_cache(&self) -> &Arc<HostCache>;
}

impl<D: Destination> WorkerPool for Workers<D> {
    fn host_cache(&self) -> &Arc<HostCache> {
        Self::host_cache(self)
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
    /// The worker threads ended before they answered.
    #[error("{item}: lost, because the worker threads ended")]
    Lost {
        /// The item.
        item: Item,
    },
    /// A worker thread could not be started.
    #[error("cannot start a worker thread")]
    Spawn(#[from] std::io::Error),
}

/// The answer to one request.
#[derive(Debug)]
pub struct Loaded<D> {
    /// What was requested.
    pub item: Item,
    /// The destination given with it; `None` only if it was lost ([`StreamError::Lost`]). After an error its contents
    /// are unspecified.
    pub destination: Option<D>,
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

#[derive(Debug, Default)]
struct Tally {
    read: AtomicU64,
    read_bytes: AtomicU64,
    cached: AtomicU64,
    cached_bytes: AtomicU64,
    failed: AtomicU64,
}

/// Adds to a counter; counters order nothing.
fn add(counter: &AtomicU64, amount: u64) {
    counter.fetch_add(amount, Ordering::Relaxed);
}

/// A worker's answer: which request, its destination, how it went.
pub(super) type Answer<D> = (usize, D, Result<(), StreamError>);

/// A request on its way to a worker.
pub(super) struct Job<D> {
    index: usize,
    item: Item,
    bytes: usize,
    destination: D,
    cached: Option<Arc<[u8]>>,
    reservation: Option<Reservation>,
    /// Holds every answer of its batch, so that a worker never waits for the caller.
    answers: Sender<Answer<D>>,
}

/// What the threads share.
pub(super) struct Shared {
    source: Arc<dyn PayloadSource>,
    host_cache: Arc<HostCache>,
    tally: Tally,
}

/// A pool of threads that load payloads into destinations. Dropping it ends them.
pub struct Workers<D: Destination> {
    /// `None` only while dropping.
    jobs: Option<Sender<Job<D>>>,
    /// Carries nothing; closed when the last thread has ended.
    ended: Receiver<Infallible>,
    threads: Vec<JoinHandle<()>>,
    shared: Arc<Shared>,
}

impl<D: Destination> Workers<D> {
    /// Starts `threads` ≥ 1 threads (0 is taken as 1) over `source`.
    ///
    /// # Errors
    /// [`StreamError::Spawn`] when a thread cannot be started.
    pub fn new(
        source: Arc<dyn PayloadSource>,
        host_cache: Arc<HostCache>,
        threads: usize,
    ) -> Result<Self, StreamError> {
        Self::with_body(source, host_cache, threads, work)
    }

    /// [`Self::new`] with what a thread does.
    pub(super) fn with_body(
        source: Arc<dyn PayloadSource>,
        host_cache: Arc<HostCache>,
        threads: usize,
        body: fn(&Shared, &Receiver<Job<D>>),
    ) -> Result<Self, StreamError> {
        let count = threads.max(1);
        let shared = Arc::new(Shared { source, host_cache, tally: Tally::default() });
        // The pool keeps no receiver of jobs, so that sending fails, and does not wait, when the last thread has ended.
        let (jobs, job_queue) = bounded::<Job<D>>(count.saturating_mul(QUEUED_JOBS_PER_THREAD));
        let (alive, ended) = bounded(0);
        let mut workers = Self { jobs: Some(jobs), ended, threads: Vec::new(), shared };
        for number in 0..count {
            let (job_queue, alive, shared) = (job_queue.clone(), alive.clone(), workers.shared.clone());
            let thread = std::thread::Builder::new().name(format!("brick worker {number}")).spawn(move || {
                // Dropped however the thread ends.
                let _alive: Sender<Infallible> = alive;
                body(&shared, &job_queue);
            })?;
            workers.threads.push(thread);
        }
        Ok(workers)
    }

    /// Loads every item into its destination, waits for all, and answers in the order of requests.
    ///
    /// Several threads may call it at once.
    pub fn load_each(&self, requests: Vec<(Item, D)>) -> Vec<Loaded<D>> {
        let shared = &*self.shared;
        let (bricks, tiles) = (shared.source.brick_count(), shared.source.tile_count());
        let cache = &shared.host_cache;
        let known = |item: Item| shared.source.has(item);
        // First every look-up, then every reservation: what this batch finds is in use and not evicted by it.
        let found: Vec<_> =
            requests.iter().map(|&(item, _)| if known(item) { cache.get(item) } else { None }).collect();
        let plans: Vec<_> = requests
            .iter()
            .zip(found)
            .map(|(&(item, _), cached)| {
                let bytes = if known(item) { shared.source.bytes(item) } else { 0 };
                let reservation = if cached.is_none() && known(item) { cache.reserve(item, bytes) } else { None };
                (bytes as usize, cached, reservation)
            })
            .collect();
        let (answers, answered) = bounded(requests.len());
        let mut items = Vec::with_capacity(requests.len());
        for (index, ((item, destination), (bytes, cached, reservation))) in requests.into_iter().zip(plans).enumerate()
        {
            items.push(item);
            if !known(item) {
                // Never blocks nor fails: there is room for one answer a request, and `answered` is alive.
                let _ = answers.send((index, destination, Err(StreamError::NoSuchItem { item, bricks, tiles })));
                continue;
            }
            let job = Job { index, item, bytes, destination, cached, reservation, answers: answers.clone() };
            let sent = match &self.jobs {
                Some(jobs) => jobs.send(job).map_err(|back| back.0),
                None => Err(job),
            };
            if let Err(job) = sent {
                let _ = answers.send((index, job.destination, Err(StreamError::Lost { item })));
            }
        }
        drop(answers);
        let loaded = collect(&items, &answered, &self.ended);
        add(&shared.tally.failed, loaded.iter().filter(|one| one.result.is_err()).count() as u64);
        loaded
    }

    /// Loads every item into its destination and waits for all; returns them in the order of requests.
    ///
    /// # Errors
    /// The first error in the order of requests, after everything else has been loaded. [`Self::load_each`] gives back
    /// the destinations of the others as well.
    pub fn load(&self, requests: Vec<(Item, D)>) -> Result<Vec<(Item, D)>, StreamError> {
        self.load_each(requests)
            .into_iter()
            .map(|Loaded { item, destination, result }| {
                result?;
                destination.map(|destination| (item, destination)).ok_or(StreamError::Lost { item })
            })
            .collect()
    }

    /// The host cache.
    pub fn host_cache(&self) -> &Arc<HostCache> {
        &self.shared.host_cache
    }

    /// What was done so far.
    pub fn stats(&self) -> WorkersStats {
        let tally = &self.shared.tally;
        let get = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        WorkersStats {
            read: get(&tally.read),
            read_bytes: get(&tally.read_bytes),
            cached: get(&tally.cached),
            cached_bytes: get(&tally.cached_bytes),
            failed: get(&tally.failed),
        }
    }
}

impl<D: Destination> Drop for Workers<D> {
    fn drop(&mut self) {
        self.jobs = None;
        for thread in self.threads.drain(..) {
            // A thread that panicked has already been answered for.
            let _ = thread.join();
        }
    }
}

/// Puts answers, which arrive in any order, into the order of `items`; what never arrives is lost.
///
/// Returns when every sender is gone, and each job holds one until it is answered; or when the threads have `ended`,
/// because jobs that they left in the queue keep theirs.
pub(super) fn collect<D>(
    items: &[Item],
    answers: &Receiver<Answer<D>>,
    ended: &Receiver<Infallible>,
) -> Vec<Loaded<D>> {
    let mut loaded: Vec<Loaded<D>> =
        items.iter().map(|&item| Loaded { item, destination: None, result: Err(StreamError::Lost { item }) }).collect();
    let mut put = |(index, destination, result): Answer<D>| {
        loaded[index].destination = Some(destination);
        loaded[index].result = result;
    };
    loop {
        select! {
            recv(answers) -> answer => match answer {
                Ok(answer) => put(answer),
                Err(_) => break,
            },
            recv(ended) -> _ => {
                // Answers sent before the last thread ended are here by now.
                answers.try_iter().for_each(put);
                break;
            }
        }
    }
    loaded
}

/// A worker thread.
fn work<D: Destination>(shared: &Shared, jobs: &Receiver<Job<D>>) {
    let mut buffer = Vec::new();
    while let Ok(job) = jobs.recv() {
        answer(shared, job, &mut buffer);
    }
}

/// Loads one item and sends the answer.
fn answer<D: Destination>(shared: &Shared, job: Job<D>, buffer: &mut Vec<u8>) {
    let Job { index, item, bytes, mut destination, cached, reservation, answers } = job;
    // The destination stays outside, so that it comes back whatever happens; the buffer is overwritten by its next use,
    // and the reservation gives its room back when dropped.
    let outcome = catch_unwind(AssertUnwindSafe(|| match cached {
        Some(payload) => {
            add(&shared.tally.cached, 1);
            add(&shared.tally.cached_bytes, payload.len() as u64);
            destination.share(payload);
            Ok(())
        }
        None => {
            if D::SHARES {
                // Zeroed in place: the payload is read into the memory in which it stays.
                let mut payload: Arc<[u8]> = std::iter::repeat_n(0, bytes).collect();
                if let Some(memory) = Arc::get_mut(&mut payload).filter(|memory| !memory.is_empty()) {
                    shared.source.copy(item, memory)?;
                }
                if let Some(reservation) = reservation {
                    reservation.share(payload.clone());
                }
                destination.share(payload);
            } else {
                let payload = read(shared, item, bytes, buffer)?;
                destination.fill(payload);
                if let Some(reservation) = reservation {
                    reservation.fill(payload);
                }
            }
            add(&shared.tally.read, 1);
            add(&shared.tally.read_bytes, bytes as u64);
            Ok(())
        }
    }));
    let result = match outcome {
        Ok(result) => result.map_err(|reason| StreamError::Payload { item, reason }),
        Err(panic) => Err(StreamError::Panicked { item, message: panic_text(panic) }),
    };
    // Everything the batch held in the host cache is released by now. The caller waits for the answer.
    let _ = answers.send((index, destination, result));
}

/// Copies and verifies a payload into the buffer, which only ever grows.
fn read<'a>(shared: &Shared, item: Item, bytes: usize, buffer: &'a mut Vec<u8>) -> Result<&'a [u8], SourceError> {
    if buffer.len() < bytes {
        buffer.resize(bytes, 0);
    }
    let payload = &mut buffer[..bytes];
    if bytes > 0 {
        shared.source.copy(item, payload)?;
    }
    Ok(payload)
}

/// The text of a panic.
fn panic_text(panic: Box<dyn Any + Send>) -> String {
    match panic.downcast::<String>() {
        Ok(text) => *text,
        Err(panic) => match panic.downcast::<&'static str>() {
            Ok(text) => (*text).to_owned(),
            Err(panic) => {
                // Dropping what somebody panicked with may panic again and would end the thread.
                std::mem::forget(panic);
                "no text".to_owned()
            }
        },
    }
}
