//! Traces of requests: recorded per pass, written as JSON lines, replayed against other caches.
//!
//! The file's first line describes the cache, every other line one pass:
//!
//! ```text
//! {"format":4,"policy":"round-robin","budget_bytes":65536,"page_bytes":65536,"passes":1,"sizes":[[8,4]],"tiles":[]}
//! {"frame":0,"pass":"primary","requests":["g0","g1","a1","t0"],"batches":[1,3]}
//! ```
//!
//! `passes` is the number of lines that follow; `sizes` are the bytes of geometry and attributes of every brick, as
//! loaded, `tiles` those of the tiles of textures; `g1` is the geometry of brick 1, `a1` its attributes, `t1` tile 1. A
//! request is one use of an item by a pass: of a resident one that rays met, or a load. `batches` are the positions in
//! `requests` at which a batch of loads began: what a batch loads is not evicted before the next one begins.
//!
//! A pass meets what is resident before it loads, first geometry, then attributes; so does a replay, whatever the order
//! of the lines. Tiles come last, and in their order: a lookup needs several at once, so a pass may ask for one again
//! that it had and lost. Which missing bricks a pass asks for depends a little on what was resident, as hits hide what
//! lies behind: a replay shows what another cache makes of these requests, which are nearly those of the same frames.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{BufRead, Write};
use std::path::Path;

use bricks::one_line;
use serde::{Deserialize, Serialize};

use super::item::{Item, Kind};
use super::residency::{Residency, ResidencyError};
use super::sizes::Sizes;
use crate::output::atomic;
use crate::settings::Policy;

/// The format number of a trace.
const FORMAT: u32 = 4;

/// Why a trace cannot be written, read or replayed.
#[derive(Debug, thiserror::Error)]
pub enum TraceError {
    /// The file cannot be read or written.
    #[error("cannot read or write the recorded requests")]
    Io(#[from] std::io::Error),
    /// A line is not what it should be.
    #[error("line {line} of the request trace: {reason}")]
    Line {
        /// The line, from 1.
        line: usize,
        /// What is wrong.
        reason: String,
    },
    /// A request names a brick or a tile that has no size.
    #[error("the request trace asks for {item}, yet there are {bricks} bricks and {tiles} tiles")]
    NoSuchItem {
        /// The request.
        item: Item,
        /// Number of bricks.
        bricks: usize,
        /// Number of tiles.
        tiles: usize,
    },
    /// The cache to replay against cannot be made.
    #[error(transparent)]
    Cache(#[from] ResidencyError),
}

/// The requests of one pass, in order: a line.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PassRequests {
    /// The frame, from 0.
    pub frame: u32,
    /// The pass, such as `primary`.
    pub pass: String,
    /// What it used.
    pub requests: Vec<Item>,
    /// Positions in `requests` at which batches of loads begin, ascending.
    pub batches: Vec<usize>,
}

/// The sequence of requests of a walk.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Trace {
    /// Bytes of everything.
    pub sizes: Sizes,
    /// The budget it was recorded with, bytes.
    pub budget_bytes: u64,
    /// The length of its pages, bytes.
    pub page_bytes: u64,
    /// The policy it was recorded with.
    pub policy: Policy,
    /// The passes.
    pub passes: Vec<PassRequests>,
}

/// The first line.
#[derive(Serialize, Deserialize)]
struct Head {
    format: u32,
    policy: String,
    budget_bytes: u64,
    page_bytes: u64,
    passes: usize,
    sizes: Vec<(u64, u64)>,
    tiles: Vec<u64>,
}

/// The part of the first line by which another format is told.
#[derive(Deserialize)]
struct Format {
    format: u32,
}

impl Trace {
    /// An empty trace of a walk with this cache.
    pub fn new(sizes: impl Into<Sizes>, budget_bytes: u64, page_bytes: u64, policy: Policy) -> Self {
        Self { sizes: sizes.into(), budget_bytes, page_bytes, policy, passes: Vec::new() }
    }

    /// Begins a pass; requests count towards it.
    pub fn begin_pass(&mut self, frame: u32, pass: &str) {
        self.passes.push(PassRequests { frame, pass: pass.to_owned(), ..PassRequests::default() });
    }

    /// Notes that a batch of loads begins with the next request: what it loads is pinned until the next batch.
    pub fn begin_batch(&mut self) {
        if let Some(pass) = self.passes.last_mut() {
            pass.batches.push(pass.requests.len());
        }
    }

    /// Notes a request of the pass that began last; before the first one it is dropped.
    pub fn request(&mut self, item: Item) {
        if let Some(pass) = self.passes.last_mut() {
            pass.requests.push(item);
        }
    }

    /// All requests in order.
    pub fn requests(&self) -> impl Iterator<Item = Item> + '_ {
        self.passes.iter().flat_map(|pass| pass.requests.iter().copied())
    }

    /// Writes the lines.
    ///
    /// # Errors
    /// What `out` answers.
    pub fn write(&self, mut out: impl Write) -> Result<(), TraceError> {
        let head = Head {
            format: FORMAT,
            policy: self.policy.name().to_owned(),
            budget_bytes: self.budget_bytes,
            page_bytes: self.page_bytes,
            passes: self.passes.len(),
            sizes: self.sizes.bricks.clone(),
            tiles: self.sizes.tiles.clone(),
        };
        let mut line = |value: serde_json::Result<String>| writeln!(out, "{}", value.map_err(std::io::Error::from)?);
        line(serde_json::to_string(&head))?;
        for pass in &self.passes {
            line(serde_json::to_string(pass))?;
        }
        Ok(out.flush()?)
    }

    /// Writes the lines to a file, which appears complete or not at all.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write_file(&self, path: &Path) -> anyhow::Result<()> {
        atomic::write_with(path, |out| Ok(self.write(out)?))
    }

    /// Reads what [`Self::write`] wrote.
    ///
    /// # Errors
    /// [`TraceError::Line`] says which line is wrong.
    pub fn read(input: impl BufRead) -> Result<Self, TraceError> {
        let mut trace: Option<(Self, usize)> = None;
        for (number, text) in input.split(b'\n').enumerate() {
            let text = text?;
            let wrong = |reason: String| TraceError::Line { line: number + 1, reason };
            match &mut trace {
                None => {
                    let Format { format } = parse(&text).map_err(wrong)?;
                    if format != FORMAT {
                        return Err(wrong(format!("format {format}, expected {FORMAT}; record it again")));
                    }
                    let head: Head = parse(&text).map_err(wrong)?;
                    let policy = head.policy.parse().map_err(wrong)?;
                    let sizes = Sizes { bricks: head.sizes, tiles: head.tiles };
                    trace = Some((Self::new(sizes, head.budget_bytes, head.page_bytes, policy), head.passes));
                }
                Some((trace, _)) => {
                    let pass: PassRequests = parse(&text).map_err(wrong)?;
                    if !pass.batches.is_sorted() || pass.batches.last().is_some_and(|&at| at > pass.requests.len()) {
                        return Err(wrong("batches are not ascending positions in the requests".to_owned()));
                    }
                    trace.passes.push(pass);
                }
            }
        }
        let wrong = |line, reason: String| TraceError::Line { line, reason };
        let (trace, passes) = trace.ok_or_else(|| wrong(1, "the file is empty".to_owned()))?;
        if trace.passes.len() != passes {
            let found = trace.passes.len();
            return Err(wrong(
                found + 1,
                format!("it is the last of {found} passes, expected {passes}; copy it again"),
            ));
        }
        Ok(trace)
    }
}

/// A line's value; the error has the column alone, as the caller names the line.
fn parse<T: serde::de::DeserializeOwned>(line: &[u8]) -> Result<T, String> {
    serde_json::from_slice(line).map_err(|error| {
        let text = error.to_string();
        let reason = text.split(" at line ").next().unwrap_or(&text);
        format!("{} at column {}; is it what --requests-out wrote?", one_line(reason), error.column())
    })
}

/// What to replay a trace against.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Replay {
    /// A [`Residency`] with this policy, pages and all.
    Cache(Policy),
    /// Bélády's rule: evict what the pass furthest ahead uses. Sizes differ, so this is the greedy bound: the optimum
    /// when all items have one size, else an estimate that an optimal choice may beat. Counts bytes alone: no pages, no
    /// fragmentation.
    Belady,
}

impl Replay {
    /// Everything to compare.
    pub const ALL: [Self; 4] =
        [Self::Cache(Policy::RoundRobin), Self::Cache(Policy::SecondChance), Self::Cache(Policy::Lru), Self::Belady];

    /// The name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cache(policy) => policy.name(),
            Self::Belady => "belady-greedy",
        }
    }
}

/// What a cache made of a trace. Requests for items of zero bytes are not counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReplayResult {
    /// Requests.
    pub requests: u64,
    /// Requests for what was resident.
    pub hits: u64,
    /// Requests for what had to be loaded.
    pub loads: u64,
    /// Bytes loaded.
    pub loaded_bytes: u64,
    /// Items evicted to make room.
    pub evicted: u64,
    /// Distinct items: no cache that begins empty loads fewer.
    pub distinct: u64,
    /// Bytes of the distinct items: no cache that begins empty loads fewer.
    pub distinct_bytes: u64,
}

impl ReplayResult {
    /// Hits ÷ requests; 1 without requests.
    pub fn hit_rate(&self) -> f64 {
        if self.requests == 0 { 1.0 } else { self.hits as f64 / self.requests as f64 }
    }

    /// Loads of what had been loaded before, in whatever pass. Not `bricks_reloaded` of records, which is within a
    /// pass.
    pub fn loaded_again(&self) -> u64 {
        self.loads - self.distinct
    }
}

/// Replays `trace` against a cache that begins empty: bricks and tiles of `sizes`, `budget_bytes` in pages of
/// `page_bytes`.
///
/// A cache with a policy pins batches as the walk did, and begins a new batch where one does not fit: with the recorded
/// sizes, budget, pages and policy it does exactly what the recorded cache did.
///
/// # Errors
/// A request for something without a size, or a cache that cannot be made ([`Residency::new`], for Bélády too).
pub fn replay(
    trace: &Trace,
    sizes: impl Into<Sizes>,
    budget_bytes: u64,
    page_bytes: u64,
    against: Replay,
) -> Result<ReplayResult, TraceError> {
    let policy = match against {
        Replay::Cache(policy) => policy,
        Replay::Belady => Policy::RoundRobin,
    };
    let sizes: Sizes = sizes.into();
    let mut cache = Residency::new(&sizes, budget_bytes, page_bytes, policy)?;
    if let Some(item) = trace.requests().find(|&item| sizes.of(item).is_none()) {
        return Err(TraceError::NoSuchItem { item, bricks: sizes.bricks.len(), tiles: sizes.tiles.len() });
    }
    let stages = stages(trace, |item| cache.bytes(item));
    let requests = stages.iter().map(|stage| stage.requests.len() as u64).sum();
    let mut result = ReplayResult { requests, ..ReplayResult::default() };
    let requests = stages.iter().flat_map(|stage| &stage.requests);
    for item in requests.map(|&(_, item)| item).collect::<BTreeSet<_>>() {
        result.distinct += 1;
        result.distinct_bytes += cache.bytes(item);
    }
    match against {
        Replay::Cache(_) => {
            for stage in &stages {
                result.hits += replay_stage(&mut cache, stage);
            }
            let counters = cache.counters().total();
            (result.loads, result.loaded_bytes) = (counters.loaded, counters.loaded_bytes);
            result.evicted = counters.evicted;
        }
        Replay::Belady => belady(&stages, cache.budget_bytes(), |item| cache.bytes(item), &mut result),
    }
    Ok(result)
}

/// The requests of one kind of one pass: what is resident of them is met first, then the rest is loaded; tiles come in
/// order.
struct Stage<'a> {
    pass: &'a PassRequests,
    kind: Kind,
    /// Positions in the pass's requests, and items.
    requests: Vec<(usize, Item)>,
}

/// The stages of all passes, without items of zero bytes.
fn stages(trace: &Trace, bytes: impl Fn(Item) -> u64) -> Vec<Stage<'_>> {
    let of_kind = |pass: &PassRequests, kind: Kind| -> Vec<(usize, Item)> {
        let requests = pass.requests.iter().copied().enumerate();
        requests.filter(|&(_, item)| item.kind == kind && bytes(item) > 0).collect()
    };
    let all = trace.passes.iter().flat_map(|pass| Kind::ALL.map(|kind| (pass, kind)));
    all.map(|(pass, kind)| Stage { pass, kind, requests: of_kind(pass, kind) }).collect()
}

/// One stage against a cache; returns the hits.
fn replay_stage(cache: &mut Residency, stage: &Stage) -> u64 {
    // A pass begins with geometry.
    if stage.kind == Kind::Geometry {
        cache.begin_pass();
        cache.unpin_all();
    }
    let (present, missing): (Vec<_>, Vec<_>) =
        stage.requests.iter().copied().partition(|&(_, item)| stage.kind != Kind::Tile && cache.slot(item).is_some());
    for &(_, item) in &present {
        cache.touch(item);
    }
    let mut hits = present.len() as u64;
    let mut batches = stage.pass.batches.iter().peekable();
    let mut in_batch = false;
    for (position, item) in missing {
        while batches.next_if(|&&begin| begin <= position).is_some() {
            cache.unpin_all();
            in_batch = true;
        }
        if cache.slot(item).is_some() {
            // A tile, or asked for twice.
            hits += 1;
            cache.touch(item);
            if in_batch && stage.kind == Kind::Tile {
                cache.pin(item);
            }
            continue;
        }
        if cache.insert(item).is_err() {
            // The batch is full. With nothing pinned every item finds a place.
            cache.unpin_all();
            let placed = cache.insert(item);
            debug_assert!(placed.is_ok());
        }
        if in_batch {
            cache.pin(item);
        }
    }
    hits
}

/// Bélády's rule, greedily, into `result`. Every item fits into the budget alone.
fn belady(stages: &[Stage], budget: u64, bytes: impl Fn(Item) -> u64, result: &mut ReplayResult) {
    const NEVER: usize = usize::MAX;
    // Per stage and request: the next stage that asks for the same.
    let mut seen: BTreeMap<Item, usize> = BTreeMap::new();
    let mut next_use: Vec<Vec<usize>> = Vec::with_capacity(stages.len());
    for (now, stage) in stages.iter().enumerate().rev() {
        let next = |(_, item): &(usize, Item)| seen.get(item).copied().unwrap_or(NEVER);
        next_use.push(stage.requests.iter().map(next).collect());
        seen.extend(stage.requests.iter().map(|&(_, item)| (item, now)));
    }
    next_use.reverse();
    // (next use, item) of everything resident; the last is evicted first.
    let mut order: BTreeSet<(usize, Item)> = BTreeSet::new();
    let mut resident: BTreeMap<Item, usize> = BTreeMap::new();
    let mut used = 0;
    for (stage, next_use) in stages.iter().zip(&next_use) {
        let requests = stage.requests.iter().map(|&(_, item)| item).zip(next_use.iter().copied());
        let (present, missing): (Vec<_>, Vec<_>) = requests.partition(|(item, _)| resident.contains_key(item));
        for (item, next) in present.into_iter().chain(missing) {
            if let Some(old) = resident.insert(item, next) {
                result.hits += 1;
                order.remove(&(old, item));
            } else {
                result.loads += 1;
                result.loaded_bytes += bytes(item);
                used += bytes(item);
                while used > budget {
                    let Some((_, old)) = order.pop_last() else { break };
                    resident.remove(&old);
                    used -= bytes(old);
                    result.evicted += 1;
                }
            }
            order.insert((next, item));
        }
    }
}
