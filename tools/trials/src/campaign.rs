//! Many slices of several kinds, side by side: each kind gets as much time as the others.

use crate::kind::Kind;
use crate::slice::{self, How, Slice};
use crate::tally::{Finding, Line, Range, Tally};
use crate::worker::Told;
use anyhow::Result;
use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Seconds of a slice of inputs, and of kills.
const SLICE_SECONDS: [f64; 2] = [10.0, 45.0];

/// Findings of one sort that are written down in one campaign; further ones are counted.
const MOST_OF_A_SORT: u64 = 3;

/// What a campaign tries.
pub struct Plan<'a> {
    /// The kinds.
    pub kinds: Vec<&'a dyn Kind>,
    /// Seconds in all.
    pub seconds: f64,
    /// Most trials of a kind.
    pub count: Option<u64>,
    /// The first seed; `None`: behind those that were tried.
    pub seed: Option<u64>,
    /// Workers side by side.
    pub jobs: usize,
    /// How trials are made.
    pub how: How,
}

/// What a campaign did.
#[derive(Debug, Default)]
pub struct Done {
    /// Ranges and findings.
    pub lines: Vec<Line>,
}

struct State<'a> {
    /// Of each kind: the next seed, the trials left, whether it is in work, and seconds so far.
    kinds: Vec<(u64, u64, bool, f64)>,
    sorts: BTreeMap<(String, String), u64>,
    tally: Option<&'a mut Tally>,
    done: Done,
    failed: Option<anyhow::Error>,
}

/// The command that repeats a trial.
pub fn command(kind: &str, seed: u64) -> String {
    format!("brickwalk-trials --only {kind} --seed {seed} --count 1")
}

/// Runs a plan; ranges and findings are also appended to `tally`, and findings handed to `tell`.
///
/// # Errors
/// Workers cannot be started; the tally cannot be written.
pub fn run(plan: &Plan, tally: Option<&mut Tally>, tell: &(dyn Fn(&Finding) + Sync)) -> Result<Done> {
    let start = Instant::now();
    let first = |kind: &&dyn Kind| plan.seed.or(tally.as_ref().map(|tally| tally.next(kind.name()))).unwrap_or(0);
    let kinds = plan.kinds.iter().map(|kind| (first(kind), plan.count.unwrap_or(u64::MAX), false, 0.0)).collect();
    let state = Mutex::new(State { kinds, sorts: BTreeMap::new(), tally, done: Done::default(), failed: None });
    std::thread::scope(|scope| {
        for _ in 0..plan.jobs.max(1) {
            scope.spawn(|| work(plan, &state, start, tell));
        }
    });
    let state = state.into_inner().unwrap_or_else(PoisonError::into_inner);
    state.failed.map_or(Ok(state.done), Err)
}

fn lock<'a, 'b>(state: &'a Mutex<State<'b>>) -> MutexGuard<'a, State<'b>> {
    state.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Takes slices until there is nothing left to do.
fn work(plan: &Plan, state: &Mutex<State>, start: Instant, tell: &(dyn Fn(&Finding) + Sync)) {
    loop {
        let left = plan.seconds - start.elapsed().as_secs_f64();
        let taken = {
            let mut state = lock(state);
            if left <= 0.0 || state.failed.is_some() || state.kinds.iter().all(|kind| kind.1 == 0) {
                return;
            }
            let free = (0..plan.kinds.len()).filter(|&at| !state.kinds[at].2 && state.kinds[at].1 > 0);
            let least = free.min_by(|&a, &b| state.kinds[a].3.total_cmp(&state.kinds[b].3));
            least.map(|at| {
                state.kinds[at].2 = true;
                (at, state.kinds[at].0, state.kinds[at].1)
            })
        };
        let Some((at, from, count)) = taken else {
            // Every kind is in work.
            std::thread::sleep(Duration::from_millis(50));
            continue;
        };
        let kind = plan.kinds[at];
        let share = SLICE_SECONDS[usize::from(kind.name().starts_with("kills/"))];
        // Short campaigns come to every kind.
        let fair = (plan.seconds * plan.jobs as f64 / plan.kinds.len() as f64).max(0.5);
        let ended = slice::run(kind, &plan.how, from, count, share.min(fair).min(left));
        let mut state = lock(state);
        state.kinds[at].2 = false;
        match ended.and_then(|slice| note(&mut state, (at, from), kind, slice, tell)) {
            Ok(()) => {}
            Err(error) => state.failed = Some(error),
        }
    }
}

/// Adds what a slice did.
fn note(
    state: &mut State,
    (at, from): (usize, u64),
    kind: &dyn Kind,
    slice: Slice,
    tell: &(dyn Fn(&Finding) + Sync),
) -> Result<()> {
    let trials = slice.to - from;
    let row = &mut state.kinds[at];
    *row = (slice.to, row.1.saturating_sub(trials), false, row.3 + slice.seconds);
    let commit = brickwalk::COMMIT.to_owned();
    for Told { seed, what, text } in slice.findings {
        let sort = state.sorts.entry((kind.name().into(), what.clone())).or_default();
        *sort += 1;
        if *sort > MOST_OF_A_SORT {
            continue;
        }
        let command = command(kind.name(), seed);
        let finding = Finding { kind: kind.name().into(), seed, what, text, command, commit: commit.clone() };
        tell(&finding);
        push(state, Line::Finding(finding))?;
    }
    if trials == 0 {
        return Ok(());
    }
    let Slice { to, passed, stopped, found, seconds, peak_bytes, .. } = slice;
    let time = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_secs());
    let kind = kind.name().into();
    push(state, Line::Trials(Range { kind, from, to, passed, stopped, found, seconds, peak_bytes, commit, time }))
}

fn push(state: &mut State, line: Line) -> Result<()> {
    if let Some(tally) = &mut state.tally {
        tally.push(line.clone())?;
    }
    state.done.lines.push(line);
    Ok(())
}
