//! Brings the triangles of neighbouring bricks together on the scratch disk.
//!
//! Bricks are taken together in *chunks*, and chunks in *groups*. A task reads some runs of the source and writes a
//! shard for each group, whose blocks are labelled with chunks. Whoever encodes a chunk reads its blocks from the
//! shards of all tasks. A shard goes when the last chunk of its group is encoded.

use super::budget;
use super::cuts::{Bounded, BoundedCuts};
use crate::build::crew::Tasks;
use crate::build::disk::journal::{Journal, Step, WordReader, Words};
use crate::build::disk::shard::ShardWriter;
use crate::build::encode::brick::BrickContext;
use crate::build::encode::jobs::Job;
use crate::build::error::BuildError;
use crate::build::input::objects::{Piece, Placed};
use crate::build::triangles::triangle::{Stored, Triangle};
use crate::source::PART_TRIANGLES;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicU32, Ordering};

/// No brick.
const NONE: u32 = u32::MAX;

/// Shards that a task writes at most: more are sooner removed, fewer are sooner opened.
const MOST_GROUPS: usize = 16;

/// Slots of a block of the bricks of a window.
const SLOT_BLOCK: usize = 1 << 16;

/// A run of triangles within all objects.
struct Run<'a> {
    object: usize,
    pieces: Vec<Piece<'a>>,
    /// Its first slot, objects counted one after the other.
    first: u64,
    slots: u64,
}

/// How triangles are distributed over chunks of bricks.
pub(crate) struct Distribution<'a> {
    pub(super) bounded: &'a Bounded<'a>,
    pub(super) jobs: &'a [Job],
    pub(super) contexts: &'a [BrickContext<'a>],
    /// Bricks of each chunk.
    pub(super) chunks: Vec<Range<usize>>,
    runs: Vec<Run<'a>>,
    /// Runs of each window.
    windows: Vec<Range<usize>>,
    chunk_of: Vec<u32>,
    groups: usize,
}

/// The bricks of the slots of a window.
enum WindowBricks {
    /// In memory, from its first slot on.
    Loaded(Vec<u32>),
    /// In its shard.
    Stored,
}

impl<'a> Distribution<'a> {
    /// Of these bricks; nothing is done yet.
    pub fn new(bounded: &'a Bounded<'a>, jobs: &'a [Job], contexts: &'a [BrickContext<'a>]) -> Self {
        let chunks = chunks(jobs, bounded.budget.chunk);
        let chunk_of = (0u32..).zip(&chunks).flat_map(|(chunk, jobs)| jobs.clone().map(move |_| chunk)).collect();
        let groups = chunks.len().min(MOST_GROUPS);
        let runs = runs(bounded);
        let windows = windows(&runs, bounded.budget.window);
        Self { bounded, jobs, contexts, chunks, runs, windows, chunk_of, groups }
    }

    /// Writes all triangles into shards. Returns by object the number of triangles that rounding leaves without area.
    pub fn distribute<T: Stored>(&self, cuts: &BoundedCuts, journal: &mut Journal) -> Result<Vec<u32>, BuildError> {
        budget::give_back();
        let Bounded { scratch, hands, progress, .. } = self.bounded;
        progress.phase("distribute", self.runs.iter().map(|run| run.slots).sum());
        let mut dropped = vec![0u32; self.contexts.len()];
        for (window, runs) in self.windows.iter().enumerate() {
            let words = journal.shared_step(Step::Distribute, |position| {
                let mut more = vec![0u64; dropped.len()];
                let bricks = self.window_bricks(window, cuts)?;
                let tasks = Tasks {
                    step: Step::Distribute,
                    position,
                    count: self.tasks(window),
                    shards: &|task| (0..self.groups).map(|group| name(window, task, group)).collect(),
                    work: &|task| self.task::<T>(window, task, &bricks),
                };
                hands.perform(scratch, &tasks, &mut |task| {
                    // All shards of the task must be there; the first says what was dropped.
                    for group in (0..self.groups).rev() {
                        let shard = scratch.shard(&name(window, task, group))?;
                        if group == 0 {
                            let lost = take_dropped(shard.facts(), more.len()).ok_or_else(|| shard.damaged())?;
                            lost.into_iter().for_each(|(object, lost)| more[object] += lost);
                        }
                    }
                    let own = self.task_runs(window, task);
                    self.bounded.note(self.runs[own].iter().map(|run| run.slots).sum());
                    Ok(())
                })?;
                let mut words = Words::default();
                words.put(runs.len() as u64).put_all(more.into_iter());
                Ok(words.0)
            })?;
            let mut words = WordReader(&words);
            let read = words.take().zip(words.take_all());
            let known = read.filter(|(count, more)| *count == runs.len() as u64 && more.len() == dropped.len());
            let (_, more) = known.ok_or_else(|| journal.damaged())?;
            dropped.iter_mut().zip(more).for_each(|(dropped, more)| *dropped += more as u32);
        }
        Ok(dropped)
    }

    /// The names of all shards with triangles of a chunk, and of which task of which window each is.
    pub(super) fn shards(&self, chunk: usize) -> impl Iterator<Item = (String, usize, usize)> {
        let group = self.group(chunk);
        let tasks = (0..self.windows.len()).flat_map(|window| (0..self.tasks(window)).map(move |task| (window, task)));
        tasks.map(move |(window, task)| (name(window, task, group), window, task))
    }

    /// Whether no later chunk has its triangles in the same shards.
    pub(super) fn is_last_of_group(&self, chunk: usize) -> bool {
        chunk + 1 == self.chunks.len() || self.group(chunk + 1) != self.group(chunk)
    }

    /// Writes the shards of a task again, whose input is still there if many processes do the work.
    pub(super) fn again<T: Stored>(&self, window: usize, task: usize) -> Result<(), BuildError> {
        self.task::<T>(window, task, &WindowBricks::Stored)
    }

    fn group(&self, chunk: usize) -> usize {
        chunk * self.groups / self.chunks.len()
    }

    fn runs_per_task(&self, window: usize) -> usize {
        self.bounded.hands.runs_per_task(self.windows[window].len())
    }

    fn tasks(&self, window: usize) -> usize {
        self.windows[window].len().div_ceil(self.runs_per_task(window))
    }

    /// The runs of a task.
    fn task_runs(&self, window: usize, task: usize) -> Range<usize> {
        let (runs, length) = (&self.windows[window], self.runs_per_task(window));
        let first = runs.start + task * length;
        first..runs.end.min(first + length)
    }

    /// The bricks of the slots of a window; where other processes need them, in a shard.
    fn window_bricks(&self, window: usize, cuts: &BoundedCuts) -> Result<WindowBricks, BuildError> {
        let Bounded { scratch, hands, .. } = self.bounded;
        if hands.is_task() {
            return Ok(WindowBricks::Stored);
        }
        let brick_of = self.brick_of(&self.runs[self.windows[window].clone()], cuts)?;
        if !hands.are_many() {
            return Ok(WindowBricks::Loaded(brick_of));
        }
        let shard = scratch.write(&bricks_name(window))?;
        brick_of.chunks(SLOT_BLOCK).try_for_each(|slots| shard.append(0, slots).map(drop))?;
        scratch.finish(shard, &[])?;
        scratch.settle()?;
        Ok(WindowBricks::Stored)
    }

    /// The bricks, by index among all, of the slots of runs that follow each other.
    fn brick_of(&self, runs: &[Run], cuts: &BoundedCuts) -> Result<Vec<u32>, BuildError> {
        let start = runs.first().map_or(0, |run| run.first);
        let end = runs.last().map_or(start, |run| run.first + run.slots);
        let mut brick_of = vec![NONE; (end - start) as usize];
        let slots = self.bounded.plan.objects.iter().map(|object| u64::from(object.slots));
        let bases: Vec<u64> = slots
            .scan(0, |base, slots| {
                *base += slots;
                Some(*base - slots)
            })
            .collect();
        let blocks = self.bounded.scratch.blocks::<u32>(&cuts.order)?;
        let (mut job, mut left, mut slots) = (0, self.jobs.first().map_or(0, |job| job.count), Vec::new());
        for block in 0..blocks.len() {
            slots.clear();
            blocks.read(block, &mut slots)?;
            for &slot in &slots {
                while left == 0 {
                    job += 1;
                    left = self.jobs.get(job).ok_or_else(|| blocks.damaged(block))?.count;
                }
                left -= 1;
                let place = (bases[self.jobs[job].object as usize] + u64::from(slot)).checked_sub(start);
                if let Some(brick) = place.and_then(|place| brick_of.get_mut(place as usize)) {
                    *brick = job as u32;
                }
            }
        }
        Ok(brick_of)
    }

    /// The bricks of so many slots of a window from `first` on, counted from its first, from its shard.
    fn stored_bricks(&self, window: usize, first: usize, count: usize) -> Result<Vec<u32>, BuildError> {
        let blocks = self.bounded.scratch.blocks::<u32>(&[bricks_name(window)])?;
        let (start, mut bricks) = (first / SLOT_BLOCK, Vec::with_capacity(count + 2 * SLOT_BLOCK));
        (start..(first + count).div_ceil(SLOT_BLOCK).min(blocks.len()))
            .try_for_each(|block| blocks.read(block, &mut bricks))?;
        let own = first - start * SLOT_BLOCK;
        let found = bricks.get(own..own + count).ok_or_else(|| blocks.damaged(start))?;
        Ok(found.to_vec())
    }

    /// Writes the triangles of the runs of a task.
    fn task<T: Stored>(&self, window: usize, task: usize, bricks: &WindowBricks) -> Result<(), BuildError> {
        let scratch = self.bounded.scratch;
        let runs = &self.runs[self.task_runs(window, task)];
        let start = runs.first().map_or(0, |run| run.first);
        let slots: u64 = runs.iter().map(|run| run.slots).sum();
        let first = (start - self.runs[self.windows[window].start].first) as usize;
        let stored;
        let bricks = match bricks {
            WindowBricks::Loaded(all) => &all[first..][..slots as usize],
            WindowBricks::Stored => {
                stored = self.stored_bricks(window, first, slots as usize)?;
                &stored[..]
            }
        };
        let shards = (0..self.groups).map(|group| scratch.write(&name(window, task, group)));
        let shards = shards.collect::<Result<Vec<ShardWriter>, _>>()?;
        let dropped: Vec<AtomicU32> = self.contexts.iter().map(|_| AtomicU32::new(0)).collect();
        runs.par_iter().with_max_len(1).try_for_each(|run| {
            let own = &bricks[(run.first - start) as usize..][..run.slots as usize];
            let lost = self.distribute_run::<T>(run, own, &shards)?;
            dropped[run.object].fetch_add(lost, Ordering::Relaxed);
            Ok::<_, BuildError>(())
        })?;
        let mut words = Words::default();
        for (object, lost) in (0u64..).zip(dropped) {
            let lost = lost.into_inner();
            if lost > 0 {
                words.put(object).put(lost.into());
            }
        }
        // The first shard goes last: what it says is of a task whose shards are all there.
        for (group, shard) in shards.into_iter().enumerate().rev() {
            scratch.finish(shard, if group == 0 { &words.0 } else { &[] })?;
        }
        Ok(())
    }

    /// Writes the triangles of a run; `bricks` are those of its slots. Returns how many rounding leaves without area.
    fn distribute_run<T: Stored>(&self, run: &Run, bricks: &[u32], shards: &[ShardWriter]) -> Result<u32, BuildError> {
        let Bounded { reader, budget, progress, .. } = self.bounded;
        progress.check()?;
        let context = &self.contexts[run.object];
        let mut pending: Vec<Vec<T>> = vec![Vec::new(); self.chunks.len()];
        let (mut count, mut dropped, mut slots) = (0, 0, bricks.iter());
        for piece in &run.pieces {
            let primitive = reader.get(piece)?;
            let placed = Placed { part: piece.part, primitive: &primitive };
            let wants = context.wants[primitive.material as usize];
            for (triangle, &brick) in (piece.first..piece.end).zip(&mut slots) {
                if brick == NONE {
                    continue;
                }
                match Triangle::round(&placed, triangle, &context.lattice, brick, wants) {
                    Some(triangle) => pending[self.chunk_of[brick as usize] as usize].push(T::of(&triangle)),
                    None => dropped += 1,
                }
                count += 1;
                if count == budget.pending {
                    self.append(&mut pending, shards)?;
                    count = 0;
                }
            }
        }
        self.append(&mut pending, shards)?;
        progress.advance(run.slots);
        Ok(dropped)
    }

    /// Appends what is pending to the shards of its chunks.
    fn append<T: Stored>(&self, pending: &mut [Vec<T>], shards: &[ShardWriter]) -> Result<(), BuildError> {
        for (chunk, triangles) in pending.iter_mut().enumerate() {
            // The memory is given back too: the next triangles may be of other chunks.
            shards[self.group(chunk)].append(chunk as u64, &std::mem::take(triangles))?;
        }
        Ok(())
    }
}

/// The name of a shard of triangles.
fn name(window: usize, task: usize, group: usize) -> String {
    format!("triangles-{window}-{task}-{group}")
}

/// The name of the shard of the bricks of the slots of a window.
fn bricks_name(window: usize) -> String {
    format!("bricks-{window}")
}

/// Objects and how many triangles of each were dropped.
fn take_dropped(words: &[u64], objects: usize) -> Option<Vec<(usize, u64)>> {
    let pairs = words.chunks_exact(2).map(|pair| (pair[0] as usize, pair[1]));
    let all: Vec<(usize, u64)> = pairs.filter(|(object, _)| *object < objects).collect();
    (all.len() * 2 == words.len()).then_some(all)
}

/// Runs of bricks that follow each other, of about so many triangles.
fn chunks(jobs: &[Job], most_triangles: u64) -> Vec<Range<usize>> {
    let (mut chunks, mut start, mut triangles) = (Vec::new(), 0, 0);
    for (index, job) in jobs.iter().enumerate() {
        triangles += job.count as u64;
        if triangles >= most_triangles || index + 1 == jobs.len() {
            chunks.push(start..index + 1);
            (start, triangles) = (index + 1, 0);
        }
    }
    chunks
}

fn runs<'a>(bounded: &Bounded<'a>) -> Vec<Run<'a>> {
    let mut first = 0;
    let objects = bounded.plan.objects.iter().enumerate();
    let runs =
        objects.flat_map(|(object, plan)| plan.runs(PART_TRIANGLES).into_iter().map(move |pieces| (object, pieces)));
    runs.map(|(object, pieces)| {
        let slots = pieces.iter().map(|piece| u64::from(piece.end - piece.first)).sum();
        first += slots;
        Run { object, pieces, first: first - slots, slots }
    })
    .collect()
}

/// Runs that follow each other, of at most so many slots unless one has more.
fn windows(runs: &[Run], most_slots: u64) -> Vec<Range<usize>> {
    let (mut windows, mut start) = (Vec::new(), 0);
    while let Some(first) = runs.get(start) {
        let fits = |run: &&Run| run.first + run.slots - first.first <= most_slots;
        let count = runs[start..].iter().take_while(fits).count().max(1);
        windows.push(start..start + count);
        start += count;
    }
    windows
}
