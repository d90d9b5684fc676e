//! Encodes distributed triangles chunk by chunk and writes the bricks in order.

use super::budget;
use super::cuts::Bounded;
use super::distribute::Distribution;
use crate::build::crew::Tasks;
use crate::build::disk::journal::{Journal, Step, WordReader, Words};
use crate::build::disk::shard::Shard;
use crate::build::encode::brick::{self, EncodedBrick};
use crate::build::encode::jobs::{self, BrickWriter, Job};
use crate::build::error::BuildError;
use crate::build::triangles::triangle::{Stored, Triangle};
use bricks::{Brick, Occupancy, Span, Writer};
use std::sync::mpsc::sync_channel;

/// Bricks that are written: their records and, if they have proxies, their occupancy.
#[derive(Debug, Default)]
pub(crate) struct WrittenBricks {
    pub records: Vec<Brick>,
    pub occupancy: Vec<Occupancy>,
}

impl Distribution<'_> {
    /// Encodes and writes the bricks of all chunks. A process that does a task of another's conversion has no `writer`.
    pub fn encode<T: Stored>(
        &self,
        writer: Option<&mut Writer>,
        journal: &mut Journal,
    ) -> Result<WrittenBricks, BuildError> {
        budget::give_back();
        let Bounded { hands, progress, .. } = self.bounded;
        progress.phase("bricks", self.triangles(0..self.chunks.len()));
        let mut written = WrittenBricks::default();
        let done = self.chunks.len().min(journal.left());
        for chunk in 0..done {
            let words = journal.step(Step::Encode, || Ok(Vec::new()))?;
            written.add(&words).ok_or_else(|| journal.damaged())?;
            progress.advance(self.triangles(chunk..chunk + 1));
        }
        if hands.are_many() {
            self.encode_by_many::<T>(done, writer, &mut written, journal)?;
        } else if let Some(writer) = writer {
            self.encode_here::<T>(done, writer, &mut written, journal)?;
        }
        Ok(written)
    }

    /// Triangles of chunks.
    fn triangles(&self, chunks: std::ops::Range<usize>) -> u64 {
        let jobs = self.chunks[chunks].iter().flat_map(|jobs| &self.jobs[jobs.clone()]);
        jobs.map(|job| job.count as u64).sum()
    }

    /// Encodes the chunks from `done` on. While one is encoded the next is read.
    fn encode_here<T: Stored>(
        &self,
        done: usize,
        writer: &mut Writer,
        written: &mut WrittenBricks,
        journal: &mut Journal,
    ) -> Result<(), BuildError> {
        std::thread::scope(|scope| {
            // The other end goes with this closure, so that the thread ends after an error too.
            let (sender, receiver) = sync_channel(0);
            let read_ahead = move || {
                for chunk in done..self.chunks.len() {
                    if sender.send((chunk, self.load::<T>(chunk))).is_err() {
                        break;
                    }
                }
            };
            std::thread::Builder::new().spawn_scoped(scope, read_ahead).map_err(BuildError::ReadAhead)?;
            for (chunk, loaded) in receiver {
                let loaded = loaded?;
                let words = journal.step(Step::Encode, || {
                    let mut bricks = BrickWriter::new(writer, self.contexts.len(), self.bounded.budget.batch);
                    self.encode_loaded(chunk, &loaded, &mut bricks)?;
                    let BrickWriter { records, occupancy, .. } = bricks;
                    Ok(to_words(writer.checkpoint()?, &records, &occupancy))
                })?;
                written.add(&words).ok_or_else(|| journal.damaged())?;
                self.discard(chunk);
            }
            Ok(())
        })
    }

    /// Has the chunks from `done` on encoded, and copies what they are in order.
    fn encode_by_many<T: Stored>(
        &self,
        done: usize,
        mut writer: Option<&mut Writer>,
        written: &mut WrittenBricks,
        journal: &mut Journal,
    ) -> Result<(), BuildError> {
        let Bounded { scratch, hands, .. } = self.bounded;
        let tasks = Tasks {
            step: Step::Encode,
            position: journal.position(),
            count: self.chunks.len() - done,
            shards: &|task| vec![name(done + task)],
            work: &|task| self.encode_shard::<T>(done + task),
        };
        if tasks.count == 0 {
            return Ok(());
        }
        hands.perform(scratch, &tasks, &mut |task| {
            self.bounded.progress.check()?;
            let (chunk, name) = (done + task, name(done + task));
            let shard = scratch.shard(&name)?;
            let words = journal.step(Step::Encode, || match &mut writer {
                Some(writer) => copy(&shard, writer),
                None => Err(shard.damaged()),
            })?;
            written.add(&words).ok_or_else(|| journal.damaged())?;
            scratch.remove(&[name]);
            self.discard(chunk);
            self.bounded.note(self.triangles(chunk..chunk + 1));
            Ok(())
        })
    }

    /// Encodes a chunk into its shard.
    fn encode_shard<T: Stored>(&self, chunk: usize) -> Result<(), BuildError> {
        let scratch = self.bounded.scratch;
        let loaded = self.load::<T>(chunk)?;
        let mut shard = scratch.write(&name(chunk))?;
        let mut bricks = BrickWriter::new(&mut shard, self.contexts.len(), self.bounded.budget.batch);
        self.encode_loaded(chunk, &loaded, &mut bricks)?;
        let BrickWriter { records, occupancy, .. } = bricks;
        let mut words = Words::default();
        words.put_records(&records).put_records(&occupancy);
        scratch.finish(shard, &words.0)
    }

    fn encode_loaded<T: Stored>(
        &self,
        chunk: usize,
        loaded: &Loaded<T>,
        bricks: &mut BrickWriter,
    ) -> Result<(), BuildError> {
        let encode = |job: &Job| -> (Option<EncodedBrick>, u32) {
            let (triangles, count) = loaded.brick(job.index);
            let context = &self.contexts[job.object as usize];
            // What has no area was counted before.
            ((count > 0).then(|| brick::encode(context, triangles, count)), 0)
        };
        bricks.write(&self.jobs[self.chunks[chunk].clone()], encode, self.bounded.progress)
    }

    /// Reads the triangles of a chunk.
    fn load<T: Stored>(&self, chunk: usize) -> Result<Loaded<T>, BuildError> {
        // No more than that: what rounding drops is not there.
        let mut triangles = Vec::with_capacity(self.triangles(chunk..chunk + 1) as usize);
        for (name, window, task) in self.shards(chunk) {
            let before = triangles.len();
            match self.read(&name, chunk, &mut triangles) {
                // What cannot be used is made again, by whoever meets it.
                Err(BuildError::ScratchDamaged { .. }) if self.bounded.hands.are_many() => {
                    triangles.truncate(before);
                    self.again::<T>(window, task)?;
                    self.read(&name, chunk, &mut triangles)?;
                }
                read => read?,
            }
        }
        Ok(Loaded::of(triangles))
    }

    /// Appends the triangles of a chunk in a shard.
    fn read<T: Stored>(&self, name: &str, chunk: usize, triangles: &mut Vec<T>) -> Result<(), BuildError> {
        let shard = self.bounded.scratch.shard(name)?;
        let spans: Vec<Span> = shard.spans(chunk as u64).collect();
        if spans.is_empty() {
            return Ok(());
        }
        let reader = shard.reader()?;
        spans.into_iter().try_for_each(|span| reader.read(span, triangles))
    }

    /// Removes the shards of a group of chunks after the last of them.
    fn discard(&self, chunk: usize) {
        if self.is_last_of_group(chunk) {
            let names: Vec<String> = self.shards(chunk).map(|(name, ..)| name).collect();
            self.bounded.scratch.remove(&names);
        }
    }
}

/// The name of the shard of an encoded chunk.
fn name(chunk: usize) -> String {
    format!("encoded-{chunk}")
}

/// Copies the payloads of an encoded chunk; returns the words of the step.
fn copy(shard: &Shard, writer: &mut Writer) -> Result<Vec<u64>, BuildError> {
    // Nothing of a damaged shard is written: what is written cannot be taken back.
    shard.verify()?;
    let mut facts = WordReader(shard.facts());
    let read = facts.take_records::<Brick>().zip(facts.take_records::<Occupancy>());
    let (mut records, occupancy) = read.ok_or_else(|| shard.damaged())?;
    let reader = shard.reader()?;
    for record in &mut records {
        for span in [&mut record.geometry, &mut record.attributes, &mut record.proxies] {
            jobs::copy(&reader, span, writer)?;
        }
    }
    Ok(to_words(writer.checkpoint()?, &records, &occupancy))
}

/// For the journal: first how far the scene file is written and the payloads.
fn to_words(position: u64, records: &[Brick], occupancy: &[Occupancy]) -> Vec<u64> {
    let spans = records.iter().flat_map(|record| [record.geometry, record.attributes, record.proxies]);
    let spans: Vec<Span> = spans.filter(|span| *span != Span::default()).collect();
    let mut words = Words::default();
    words.put(position).put_records(&spans).put_records(records).put_records(occupancy);
    words.0
}

impl WrittenBricks {
    /// Adds the bricks of a chunk from the journal; see [`Journal::written`] for what comes before them.
    fn add(&mut self, words: &[u64]) -> Option<()> {
        let mut words = WordReader(words);
        words.take()?;
        words.take_records::<Span>()?;
        self.records.extend(words.take_records::<Brick>()?);
        self.occupancy.extend(words.take_records::<Occupancy>()?);
        Some(())
    }
}

/// The triangles of a chunk.
struct Loaded<T> {
    triangles: Vec<T>,
    /// Brick and id of each triangle and its place, ascending.
    order: Vec<(u64, u32)>,
}

impl<T: Stored> Loaded<T> {
    fn of(triangles: Vec<T>) -> Self {
        let mut order: Vec<(u64, u32)> = triangles.iter().map(T::key).zip(0..).collect();
        order.sort_unstable();
        Self { triangles, order }
    }

    /// The triangles of a brick, and how many they are.
    fn brick(&self, brick: u32) -> (impl Iterator<Item = Triangle>, usize) {
        let start = |brick: u64| self.order.partition_point(|(key, _)| *key < brick << 32);
        let order = &self.order[start(u64::from(brick))..start(u64::from(brick) + 1)];
        (order.iter().map(|&(_, place)| self.triangles[place as usize].triangle()), order.len())
    }
}
