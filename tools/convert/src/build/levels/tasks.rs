//! Levels that several processes make: depth by depth, since a level is made from those below it.

use super::build::{Lengths, Levels, Maker, brick_of, take_written, to_words, triangles_of};
use super::plan::{Plan, Planned};
use crate::build::crew::{Hands, Tasks};
use crate::build::disk::journal::{Journal, Step, WordReader, Words};
use crate::build::disk::scratch::Scratch;
use crate::build::disk::shard::Shard;
use crate::build::encode::jobs::{self, Payloads};
use crate::build::error::BuildError;
use bricks::{Brick, Level, Span, Writer, Written};
use rayon::prelude::*;
use std::ops::Range;
use std::path::Path;

/// Triangles of the children of the levels of a task, about.
const TASK_TRIANGLES: usize = 1 << 19;

/// Has levels made by several processes, and writes them.
pub(crate) struct LevelTasks<'a> {
    /// Makes them.
    pub maker: Maker<'a>,
    /// The scene file, which the process that leads writes.
    pub writer: Option<&'a mut Writer>,
    /// Who makes them.
    pub hands: Hands<'a>,
    /// Where tasks leave them.
    pub scratch: &'a Scratch,
    /// What the scene file will be called.
    pub partial: &'a Path,
}

impl LevelTasks<'_> {
    /// Makes and writes all levels, a depth in each step.
    pub fn write(mut self, plan: &Plan, journal: &mut Journal) -> Result<Levels, BuildError> {
        let mut levels = Levels::default();
        self.maker.progress.phase("levels", plan.levels.len() as u64);
        let mut rest = plan.levels.as_slice();
        while let Some(first) = rest.first() {
            let (depth, after) = rest.split_at(rest.partition_point(|planned| planned.depth <= first.depth));
            rest = after;
            let left = journal.left();
            let words = self.step(depth, &levels.records, journal)?;
            if left > 0 {
                self.maker.progress.advance(depth.len() as u64);
            }
            levels.records.extend(take_written(&words).ok_or_else(|| journal.damaged())?);
        }
        if levels.records.len() == plan.levels.len() { Ok(levels) } else { Err(journal.damaged()) }
    }

    /// Makes and writes the levels of a depth; `below` are those of smaller ones.
    fn step(&mut self, depth: &[Planned], below: &[Level], journal: &mut Journal) -> Result<Vec<u64>, BuildError> {
        let Self { maker, writer, hands, scratch, partial } = self;
        let groups = groups(depth, maker, below);
        let name = |task: usize| format!("levels-{}-{task}", below.len());
        journal.shared_step(Step::Levels, |position| {
            if let Some(writer) = writer {
                // Tasks read what is written.
                writer.sync()?;
            }
            let mut records = Vec::with_capacity(depth.len());
            let tasks = Tasks {
                step: Step::Levels,
                position,
                count: groups.len(),
                shards: &|task| vec![name(task)],
                work: &|task| {
                    let written = Written::partial(*partial)?;
                    make(&depth[groups[task].clone()], maker, below, &written, (scratch, &name(task)))
                },
            };
            hands.perform(scratch, &tasks, &mut |task| {
                maker.progress.check()?;
                let shard = scratch.shard(&name(task))?;
                let Some(writer) = writer else { return Err(shard.damaged()) };
                let planned = &depth[groups[task].clone()];
                for (planned, (brick, lengths)) in planned.iter().zip(copy(&shard, planned.len(), writer)?) {
                    records.push(maker.record(planned, brick, lengths, below));
                }
                scratch.remove(&[name(task)]);
                maker.progress.advance(planned.len() as u64);
                Ok(())
            })?;
            let position = writer.as_deref_mut().map_or(Ok(0), Writer::checkpoint)?;
            Ok(to_words(position, &records))
        })
    }
}

/// Levels that follow each other, by tasks.
fn groups(depth: &[Planned], maker: &Maker, below: &[Level]) -> Vec<Range<usize>> {
    let (mut groups, mut start, mut triangles) = (Vec::new(), 0, 0);
    for (index, planned) in depth.iter().enumerate() {
        triangles += triangles_of(&planned.children, maker.bricks, below);
        if triangles >= TASK_TRIANGLES || index + 1 == depth.len() {
            groups.push(start..index + 1);
            (start, triangles) = (index + 1, 0);
        }
    }
    groups
}

/// Makes levels from payloads that are `written`, into a shard of this name.
fn make(
    planned: &[Planned],
    maker: &Maker,
    below: &[Level],
    written: &Written,
    (scratch, name): (&Scratch, &str),
) -> Result<(), BuildError> {
    let make = |planned: &Planned| {
        maker.progress.check()?;
        let children: Vec<Brick> = planned.children.iter().map(|child| *brick_of(child, maker.bricks, below)).collect();
        maker.make(written, planned, &children)
    };
    let all: Vec<_> = planned.par_iter().with_max_len(1).map(make).collect();
    let mut shard = scratch.write(name)?;
    let (mut bricks, mut lengths) = (Vec::with_capacity(all.len()), Words::default());
    for level in all {
        let level = level?;
        let geometry = shard.put(&level.encoded.geometry)?;
        let attributes = shard.put(&level.encoded.attributes)?;
        bricks.push(Brick { geometry, attributes, proxies: Span::default(), ..level.encoded.record });
        lengths.put_point([level.error, level.bound, level.color]);
    }
    let mut words = Words::default();
    words.put_records(&bricks).0.extend(lengths.0);
    scratch.finish(shard, &words.0)
}

/// Copies the payloads of the `count` levels of a shard; returns where they lie now.
fn copy(shard: &Shard, count: usize, writer: &mut Writer) -> Result<Vec<(Brick, Lengths)>, BuildError> {
    // Nothing of a damaged shard is written: what is written cannot be taken back.
    shard.verify()?;
    let mut facts = WordReader(shard.facts());
    let bricks = facts.take_records::<Brick>().filter(|bricks| bricks.len() == count);
    let lengths: Option<Vec<[f64; 3]>> = (0..count).map(|_| facts.take_point()).collect();
    let (bricks, lengths) = bricks.zip(lengths).ok_or_else(|| shard.damaged())?;
    let reader = shard.reader()?;
    let copied = bricks.into_iter().zip(lengths).map(|(mut brick, [error, bound, color])| {
        jobs::copy(&reader, &mut brick.geometry, writer)?;
        jobs::copy(&reader, &mut brick.attributes, writer)?;
        Ok((brick, Lengths { error, bound, color }))
    });
    copied.collect()
}
