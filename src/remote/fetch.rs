//! Fetches ranges of an object at the same time, again where that helps, and names what does not.

use super::held::Failure;
use super::names::Place;
use super::store::{ANSWERED, NO_CONNECTION, NO_RANGES, Note, Object};
use super::traffic::{Counters, add};
use anyhow::{Context, Result};
use bytes::Bytes;
use object_store::{Error, Extensions, GetOptions, GetRange, ObjectMeta};
use std::io::ErrorKind;
use std::ops::Range;
use std::sync::{Arc, mpsc};
use std::time::{Duration, Instant};
use tokio::runtime::{Builder, Runtime};
use tokio::sync::Semaphore;

/// How long what is waited for, and how often it is tried.
#[derive(Clone, Debug)]
pub(super) struct Limits {
    /// Time for a connection.
    pub connect: Duration,
    /// Longest silence of a server that is to answer.
    pub silence: Duration,
    /// Requests that are repeated after a failure of the network or the server.
    pub retries: usize,
    /// No request is repeated after this time.
    pub retry_time: Duration,
    /// First pause before a request is repeated; each is about twice the one before.
    pub first_pause: Duration,
    /// Longest pause.
    pub longest_pause: Duration,
    /// How often a range is asked for whose answers were cut off.
    pub tries: u32,
    /// Longest time for a range in all.
    pub patience: Duration,
    /// Requests at a time.
    pub requests: usize,
    /// Bytes that are fetched at a time and held until they are read.
    pub batch_bytes: u64,
}

impl Default for Limits {
    fn default() -> Self {
        let seconds = Duration::from_secs;
        Self {
            connect: seconds(5),
            silence: seconds(20),
            retries: 6,
            retry_time: seconds(40),
            first_pause: Duration::from_millis(100),
            longest_pause: seconds(5),
            tries: 6,
            patience: seconds(600),
            requests: 64,
            batch_bytes: 128 << 20,
        }
    }
}

/// Which version of an object is read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Pin {
    /// Length of the object.
    pub bytes: u64,
    etag: Option<String>,
    /// Seconds since 1970; 0 where the server tells none.
    modified: i64,
}

impl Pin {
    fn of(meta: &ObjectMeta) -> Self {
        Self { bytes: meta.size, etag: meta.e_tag.clone(), modified: meta.last_modified.timestamp() }
    }

    /// What asks for this version alone. A weak ETag never matches: then the answer's is compared alone.
    fn condition(&self) -> Option<String> {
        self.etag.clone().filter(|etag| !etag.starts_with("W/"))
    }

    /// What tells it from other versions, as far as the server says.
    pub fn told(&self) -> String {
        format!("{} {} {}", self.etag.as_deref().unwrap_or_default(), self.modified, self.bytes)
    }
}

/// An object that is open, in one process: a fork has neither its threads nor its connections.
pub(super) struct Live {
    process: u32,
    object: Object,
    /// `None` while it is dropped.
    runtime: Option<Runtime>,
    requests: Arc<Semaphore>,
    limits: Limits,
    counters: Arc<Counters>,
}

/// The bytes of a range and the version that they are of.
type Answer = Result<(Bytes, Pin), Failure>;

/// Threads that carry what arrives.
const THREADS: usize = 2;

impl Live {
    /// Opens what `place` names. No request is made yet.
    ///
    /// # Errors
    /// The URL or the environment is wrong.
    pub fn new(place: &Place, limits: &Limits) -> Result<Self> {
        let runtime = Builder::new_multi_thread().worker_threads(THREADS).thread_name("remote").enable_all().build();
        Ok(Self {
            process: std::process::id(),
            object: Object::new(&place.url, limits, &place.counters)?,
            runtime: Some(runtime.context("cannot start threads")?),
            requests: Arc::new(Semaphore::new(limits.requests)),
            limits: limits.clone(),
            counters: place.counters.clone(),
        })
    }

    /// Whether it was opened by this process.
    pub fn is_own(&self) -> bool {
        self.process == std::process::id()
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        match self.runtime.take() {
            // Waiting for its threads is not allowed on all threads, and those of another process never end.
            Some(runtime) if self.is_own() => runtime.shutdown_background(),
            other => std::mem::forget(other),
        }
    }
}

/// Fetches ranges of the version `pin`, or of whichever there is, and waits for all.
pub(super) fn fetch(live: &Arc<Live>, ranges: &[Range<u64>], pin: Option<&Pin>) -> Vec<(Range<u64>, Answer)> {
    let start = Instant::now();
    let (sender, receiver) = mpsc::channel();
    for range in ranges {
        let (sender, own, range, pin) = (sender.clone(), live.clone(), range.clone(), pin.cloned());
        let Some(runtime) = &live.runtime else { continue };
        runtime.spawn(async move {
            let permit = own.requests.acquire().await;
            let fetched = tokio::time::timeout(own.limits.patience, one(&own, &range, pin.as_ref())).await;
            drop(permit);
            let late = || failure(ErrorKind::TimedOut, "the answer took too long; try again later");
            drop(own);
            // Nobody waits any more: nothing is lost.
            let _ = sender.send((range, fetched.unwrap_or_else(|_| Err(late()))));
        });
    }
    drop(sender);
    let all = receiver.into_iter().collect();
    add(&live.counters.round_trips, 1);
    add(&live.counters.nanoseconds_waiting, start.elapsed().as_nanos() as u64);
    all
}

fn failure(kind: ErrorKind, text: &str) -> Failure {
    Failure { kind, text: text.into() }
}

/// Whether another try may do better, and what is said if there is none.
enum Trouble {
    Fatal(Failure),
    Passing(Failure),
}

/// Fetches a range, in several tries if need be.
async fn one(live: &Live, range: &Range<u64>, pin: Option<&Pin>) -> Answer {
    let note = Note::default();
    let mut pause = live.limits.first_pause;
    let start = Instant::now();
    for _ in 1..live.limits.tries {
        match attempt(live, range, pin, &note).await {
            // The store repeats requests, too.
            Err(Trouble::Passing(failure)) if start.elapsed() > live.limits.retry_time => return Err(failure),
            Err(Trouble::Passing(failure)) => {
                tracing::info!("bytes {} to {}: {}; trying again", range.start, range.end, failure.text);
                tokio::time::sleep(pause).await;
                pause = (2 * pause).min(live.limits.longest_pause);
            }
            Err(Trouble::Fatal(failure)) => return Err(failure),
            Ok(fetched) => return Ok(fetched),
        }
    }
    attempt(live, range, pin, &note).await.map_err(|trouble| match trouble {
        Trouble::Fatal(failure) | Trouble::Passing(failure) => failure,
    })
}

async fn attempt(live: &Live, range: &Range<u64>, pin: Option<&Pin>, note: &Note) -> Result<(Bytes, Pin), Trouble> {
    let mut extensions = Extensions::new();
    extensions.insert(note.clone());
    let options = GetOptions {
        range: Some(GetRange::Bounded(range.clone())),
        if_match: pin.and_then(Pin::condition),
        extensions,
        ..GetOptions::default()
    };
    let got = live.object.store.get_opts(&live.object.path, options).await;
    let got = got.map_err(|error| trouble(&error, note))?;
    let found = Pin::of(&got.meta);
    // An object may be shorter than the first request supposes.
    let expected = range.start..range.end.min(found.bytes);
    if pin.is_some_and(|pin| *pin != found) {
        return Err(Trouble::Fatal(changed()));
    }
    let bytes = got.bytes().await.map_err(|error| trouble(&error, note))?;
    if bytes.len() as u64 != expected.end - expected.start {
        return Err(Trouble::Passing(failure(ErrorKind::Other, "the answer was cut off; check the network")));
    }
    Ok((bytes, found))
}

fn changed() -> Failure {
    failure(ErrorKind::Other, "the object was replaced after it was opened; open it again")
}

/// What is made of an error of the store. Its own text may hold what is secret, and is not shown.
fn trouble(error: &Error, note: &Note) -> Trouble {
    let told = note.take();
    let fatal = |kind, text: &str| Trouble::Fatal(failure(kind, text));
    match error {
        Error::NotFound { .. } => fatal(ErrorKind::NotFound, "there is no such object; check the URL"),
        Error::Precondition { .. } => Trouble::Fatal(changed()),
        Error::PermissionDenied { .. } | Error::Unauthenticated { .. } => {
            let text = "access was denied; give credentials by the environment, see docs/remote.md";
            fatal(ErrorKind::PermissionDenied, text)
        }
        _ => match told {
            Some(told) if told == NO_RANGES => {
                fatal(ErrorKind::Unsupported, &format!("{NO_RANGES}; download the scene, or use another server"))
            }
            Some(told) => {
                let failure = failure(ErrorKind::Other, &format!("{told}; check URL and network, or try again later"));
                // The store has repeated these by itself.
                let is_final = told.starts_with(ANSWERED) || told == NO_CONNECTION;
                if is_final { Trouble::Fatal(failure) } else { Trouble::Passing(failure) }
            }
            None => {
                let text = "no answer that is of use; check URL and credentials, see docs/remote.md";
                fatal(ErrorKind::Other, text)
            }
        },
    }
}
