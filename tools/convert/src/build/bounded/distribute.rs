//! Brings the triangles of neighbouring bricks together on the scratch disk, and encodes them chunk by chunk.

use super::budget;
use super::cuts::{Bounded, BoundedCuts};
use crate::build::disk::journal::{Journal, Step, WordReader, Words};
use crate::build::disk::spill::Spill;
use crate::build::encode::brick::{self, BrickContext};
use crate::build::encode::jobs::{BrickWriter, Job};
use crate::build::error::BuildError;
use crate::build::input::objects::{Piece, Placed};
use crate::build::triangles::triangle::{Stored, Triangle};
use crate::source::PART_TRIANGLES;
use bricks::{Brick, Occupancy, Span};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::sync_channel;

/// No brick.
const NONE: u32 = u32::MAX;

/// Runs of consecutive bricks, each with a file of triangles.
pub(crate) struct Chunks<T> {
    /// Bricks of each.
    jobs: Vec<Range<usize>>,
    files: Vec<Spill<T>>,
}

/// A run of triangles within all objects.
struct Run<'a> {
    object: usize,
    pieces: Vec<Piece<'a>>,
    /// Its first slot, objects counted one after the other.
    first: u64,
    slots: u64,
}

impl Bounded<'_> {
    /// Appends all triangles to the files of their chunks. Returns those and by object the number of triangles that
    /// rounding leaves without area.
    pub fn distribute<T: Stored>(
        &self,
        cuts: &BoundedCuts,
        jobs: &[Job],
        contexts: &[BrickContext],
        journal: &mut Journal,
    ) -> Result<(Chunks<T>, Vec<u32>), BuildError> {
        budget::give_back();
        let mut chunks = self.chunks(jobs);
        let chunk_of: Vec<u32> =
            (0u32..).zip(&chunks.jobs).flat_map(|(chunk, jobs)| jobs.clone().map(move |_| chunk)).collect();
        let runs = self.runs();
        self.progress.phase("distribute", runs.iter().map(|run| run.slots).sum());
        let mut dropped = vec![0u32; contexts.len()];
        let mut rest = runs.as_slice();
        while let Some(first) = rest.first() {
            let count = rest.iter().take_while(|run| run.first + run.slots - first.first <= self.budget.window).count();
            let (window, after) = rest.split_at(count.max(1));
            rest = after;
            let words = journal.step(Step::Distribute, || {
                let more: Vec<AtomicU32> = contexts.iter().map(|_| AtomicU32::new(0)).collect();
                let brick_of = self.brick_of(window, cuts, jobs)?;
                let append = |run: &Run| -> Result<(), BuildError> {
                    let bricks = &brick_of[(run.first - first.first) as usize..][..run.slots as usize];
                    let lost = self.distribute_run(run, bricks, &chunk_of, &contexts[run.object], &chunks)?;
                    more[run.object].fetch_add(lost, Ordering::Relaxed);
                    Ok(())
                };
                window.par_iter().with_max_len(1).try_for_each(append)?;
                let mut words = Words::default();
                words.put_all(chunks.files.iter().map(Spill::length));
                words.put_all(more.into_iter().map(|more| u64::from(more.into_inner())));
                Ok(words.0)
            })?;
            let mut words = WordReader(&words);
            let (lengths, more) = words.take_all().zip(words.take_all()).ok_or_else(|| journal.damaged())?;
            if lengths.len() != chunks.files.len() || more.len() != dropped.len() {
                return Err(journal.damaged());
            }
            chunks.files = (0..).zip(lengths).map(|(chunk, length)| self.chunk_file(chunk, length)).collect();
            dropped.iter_mut().zip(more).for_each(|(dropped, more)| *dropped += more as u32);
        }
        Ok((chunks, dropped))
    }

    fn chunk_file<T: Stored>(&self, chunk: usize, length: u64) -> Spill<T> {
        self.scratch.spill(&format!("chunk-{chunk}"), length)
    }

    /// Chunks of as many bricks as the budget allows, without files yet.
    fn chunks<T: Stored>(&self, jobs: &[Job]) -> Chunks<T> {
        let mut chunks = Chunks { jobs: Vec::new(), files: Vec::new() };
        let (mut start, mut triangles) = (0, 0);
        for (index, job) in jobs.iter().enumerate() {
            triangles += job.count as u64;
            if triangles >= self.budget.chunk || index + 1 == jobs.len() {
                chunks.files.push(self.chunk_file(chunks.jobs.len(), 0));
                chunks.jobs.push(start..index + 1);
                (start, triangles) = (index + 1, 0);
            }
        }
        chunks
    }

    fn runs(&self) -> Vec<Run<'_>> {
        let mut first = 0;
        let runs = self
            .plan
            .objects
            .iter()
            .enumerate()
            .flat_map(|(object, plan)| plan.runs(PART_TRIANGLES).into_iter().map(move |pieces| (object, pieces)));
        runs.map(|(object, pieces)| {
            let slots = pieces.iter().map(|piece| u64::from(piece.end - piece.first)).sum();
            first += slots;
            Run { object, pieces, first: first - slots, slots }
        })
        .collect()
    }

    /// The bricks, by index among all, of the slots of a window.
    fn brick_of(&self, window: &[Run], cuts: &BoundedCuts, jobs: &[Job]) -> Result<Vec<u32>, BuildError> {
        let start = window[0].first;
        let end = window[window.len() - 1].first + window[window.len() - 1].slots;
        let mut brick_of = vec![NONE; (end - start) as usize];
        let bases: Vec<u64> = self
            .plan
            .objects
            .iter()
            .scan(0, |base, object| {
                *base += u64::from(object.slots);
                Some(*base - u64::from(object.slots))
            })
            .collect();
        let blocks = cuts.order.blocks()?;
        let (mut job, mut left, mut slots) = (0, jobs.first().map_or(0, |job| job.count), Vec::new());
        for block in 0..blocks.len() {
            slots.clear();
            blocks.read(block, &mut slots)?;
            for &slot in &slots {
                while left == 0 {
                    job += 1;
                    left = jobs.get(job).ok_or_else(|| cuts.order.damaged())?.count;
                }
                left -= 1;
                let place = (bases[jobs[job].object as usize] + u64::from(slot)).checked_sub(start);
                if let Some(brick) = place.and_then(|place| brick_of.get_mut(place as usize)) {
                    *brick = job as u32;
                }
            }
        }
        Ok(brick_of)
    }

    /// Appends the triangles of a run; `bricks` are those of its slots. Returns how many rounding leaves without area.
    fn distribute_run<T: Stored>(
        &self,
        run: &Run,
        bricks: &[u32],
        chunk_of: &[u32],
        context: &BrickContext,
        chunks: &Chunks<T>,
    ) -> Result<u32, BuildError> {
        self.progress.check()?;
        let mut pending: Vec<Vec<T>> = vec![Vec::new(); chunks.files.len()];
        let (mut count, mut dropped, mut slots) = (0, 0, bricks.iter());
        for piece in &run.pieces {
            let primitive = self.reader.get(piece)?;
            let placed = Placed { part: piece.part, primitive: &primitive };
            let wants = context.wants[primitive.material as usize];
            for (triangle, &brick) in (piece.first..piece.end).zip(&mut slots) {
                if brick == NONE {
                    continue;
                }
                match Triangle::round(&placed, triangle, &context.lattice, brick, wants) {
                    Some(triangle) => pending[chunk_of[brick as usize] as usize].push(T::of(&triangle)),
                    None => dropped += 1,
                }
                count += 1;
                if count == self.budget.pending {
                    append(&mut pending, chunks)?;
                    count = 0;
                }
            }
        }
        append(&mut pending, chunks)?;
        self.progress.advance(run.slots);
        Ok(dropped)
    }

    /// Encodes and writes the bricks of all chunks. While one is encoded the next is read.
    pub fn encode<T: Stored>(
        &self,
        jobs: &[Job],
        chunks: Chunks<T>,
        contexts: &[BrickContext],
        bricks: &mut BrickWriter,
        journal: &mut Journal,
    ) -> Result<(), BuildError> {
        budget::give_back();
        self.progress.phase("bricks", jobs.iter().map(|job| job.count as u64).sum());
        let Chunks { jobs: ranges, files } = chunks;
        let done = ranges.len().min(journal.left());
        for range in &ranges[..done] {
            let words = journal.step(Step::Encode, || Ok(Vec::new()))?;
            let (records, occupancy) = take_written(&words).ok_or_else(|| journal.damaged())?;
            bricks.records.extend(records);
            bricks.occupancy.extend(occupancy);
            self.progress.advance(jobs[range.clone()].iter().map(|job| job.count as u64).sum());
        }
        std::thread::scope(|scope| {
            // The other end goes with this closure, so that the thread ends after an error too.
            let (sender, receiver) = sync_channel(0);
            let rest = files.into_iter().zip(&ranges).skip(done);
            let read_ahead = move || {
                for (file, range) in rest {
                    if sender.send((range, Loaded::load(&file).map(|loaded| (file, loaded)))).is_err() {
                        break;
                    }
                }
            };
            std::thread::Builder::new().spawn_scoped(scope, read_ahead).map_err(BuildError::ReadAhead)?;
            for (range, loaded) in receiver {
                let (file, loaded) = loaded?;
                let (first, first_occupancy) = (bricks.records.len(), bricks.occupancy.len());
                journal.step(Step::Encode, || {
                    let encode = |job: &Job| {
                        let (triangles, count) = loaded.brick(job.index);
                        let context = &contexts[job.object as usize];
                        // What has no area was counted before.
                        ((count > 0).then(|| brick::encode(context, triangles, count)), 0)
                    };
                    bricks.write(&jobs[range.clone()], encode, self.progress)?;
                    let records = &bricks.records[first..];
                    let spans: Vec<Span> = records
                        .iter()
                        .flat_map(|record| [record.geometry, record.attributes, record.proxies])
                        .filter(|span| *span != Span::default())
                        .collect();
                    let mut words = Words::default();
                    words.put(bricks.writer.checkpoint()?).put_records(&spans).put_records(records);
                    words.put_records(&bricks.occupancy[first_occupancy..]);
                    Ok(words.0)
                })?;
                file.remove();
            }
            Ok(())
        })
    }
}

/// The records of a chunk and their occupancy from the journal; see [`Journal::written`] for what comes before them.
fn take_written(words: &[u64]) -> Option<(Vec<Brick>, Vec<Occupancy>)> {
    let mut words = WordReader(words);
    words.take()?;
    words.take_records::<Span>()?;
    Some((words.take_records()?, words.take_records()?))
}

/// The triangles of a chunk.
struct Loaded<T> {
    triangles: Vec<T>,
    /// Brick and id of each triangle and its place, ascending.
    order: Vec<(u64, u32)>,
}

impl<T: Stored> Loaded<T> {
    fn load(file: &Spill<T>) -> Result<Self, BuildError> {
        let blocks = file.blocks()?;
        let mut triangles = Vec::with_capacity(blocks.records() as usize);
        (0..blocks.len()).try_for_each(|block| blocks.read(block, &mut triangles))?;
        let mut order: Vec<(u64, u32)> = triangles.iter().map(T::key).zip(0..).collect();
        order.sort_unstable();
        Ok(Self { triangles, order })
    }

    /// The triangles of a brick, and how many they are.
    fn brick(&self, brick: u32) -> (impl Iterator<Item = Triangle>, usize) {
        let start = |brick: u64| self.order.partition_point(|(key, _)| *key < brick << 32);
        let order = &self.order[start(u64::from(brick))..start(u64::from(brick) + 1)];
        (order.iter().map(|&(_, place)| self.triangles[place as usize].triangle()), order.len())
    }
}

/// Appends what is pending to the files of its chunks.
fn append<T: Stored>(pending: &mut [Vec<T>], chunks: &Chunks<T>) -> Result<(), BuildError> {
    for (triangles, file) in pending.iter_mut().zip(&chunks.files) {
        // The memory is given back too: the next triangles may be of other chunks.
        file.append(&std::mem::take(triangles))?;
    }
    Ok(())
}
