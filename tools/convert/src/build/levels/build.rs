//! Makes levels depth by depth and writes them in order.

use super::flat::Flattened;
use super::merge::Child;
use super::plan::{Plan, Planned};
use super::simplify::{Simplified, simplify};
use crate::build::disk::journal::{Journal, Step, WordReader, Words};
use crate::build::encode::brick::BrickContext;
use crate::build::error::BuildError;
use crate::build::input::matrix::Affine;
use crate::build::triangles::lattice::pow2;
use crate::progress::Progress;
use bricks::{Brick, Instance, Leaf, Level, NONE, Span, Writer, Written};
use rayon::prelude::*;

/// Batches of a step of the journal.
const STEP_BATCHES: usize = 16;

/// The levels of a scene.
#[derive(Debug, Default)]
pub(crate) struct Levels {
    /// Their records, in the order of their plan.
    pub records: Vec<Level>,
}

/// Writes levels.
pub(crate) struct LevelWriter<'a> {
    /// The scene file.
    pub writer: &'a mut Writer,
    /// The bricks, which are written.
    pub bricks: &'a [Brick],
    /// The instances, the world's first.
    pub instances: &'a [Instance],
    /// What bricks of each object have in common, with the materials of `flattened`.
    pub contexts: &'a [BrickContext<'a>],
    /// Materials of levels.
    pub flattened: &'a Flattened<'a>,
    /// Most triangles of a level.
    pub brick_triangles: u32,
    /// Triangles a thread works on before what it made is written, which bounds the memory.
    pub batch_triangles: usize,
    /// Who watches.
    pub progress: &'a Progress,
}

impl LevelWriter<'_> {
    /// Makes and writes all levels, in steps of `journal` if there is one.
    pub fn write(&mut self, plan: &Plan, mut journal: Option<&mut Journal>) -> Result<Levels, BuildError> {
        let mut levels = Levels::default();
        self.progress.phase("levels", plan.levels.len() as u64);
        let mut rest = plan.levels.as_slice();
        while let Some(first) = rest.first() {
            let depth = &rest[..rest.partition_point(|planned| planned.depth <= first.depth)];
            let step = self.batch_length(depth, &levels.records, STEP_BATCHES);
            let (some, after) = rest.split_at(step);
            rest = after;
            match &mut journal {
                None => self.write_some(some, &mut levels)?,
                Some(journal) => self.step(some, &mut levels, journal)?,
            }
        }
        Ok(levels)
    }

    /// Makes and writes levels whose children are all written, or takes them from an earlier run.
    fn step(&mut self, some: &[Planned], levels: &mut Levels, journal: &mut Journal) -> Result<(), BuildError> {
        let first = levels.records.len();
        let words = journal.step(Step::Levels, || {
            self.write_some(some, levels)?;
            let records = &levels.records[first..];
            let spans = records.iter().flat_map(|level| [level.brick.geometry, level.brick.attributes]);
            let mut words = Words::default();
            words.put(self.writer.checkpoint()?).put_records(&spans.collect::<Vec<Span>>()).put_records(records);
            Ok(words.0)
        })?;
        if levels.records.len() == first {
            levels.records.extend(take_written(&words).ok_or_else(|| journal.damaged())?);
            self.progress.advance(some.len() as u64);
        }
        if levels.records.len() == first + some.len() { Ok(()) } else { Err(journal.damaged()) }
    }

    /// Makes and writes levels whose children are all written. One batch is written while the next is made.
    fn write_some(&mut self, planned: &[Planned], levels: &mut Levels) -> Result<(), BuildError> {
        let written = self.writer.written()?;
        let mut ready: Vec<(Simplified, &Planned)> = Vec::new();
        let mut rest = planned;
        while !rest.is_empty() || !ready.is_empty() {
            self.progress.check()?;
            let (batch, after) = rest.split_at(self.batch_length(rest, &levels.records, 1));
            rest = after;
            let (writer, before) = (&mut *self.writer, std::mem::take(&mut ready));
            let (records, progress) = (&levels.records, self.progress);
            let from = From { written: &written, bricks: self.bricks, instances: self.instances, levels: records };
            let how = (self.contexts, self.flattened, self.brick_triangles);
            let (placed, made) = rayon::join(
                || place(writer, before),
                || {
                    let make = |planned| {
                        let made = make(planned, &from, how);
                        progress.advance(1);
                        made.map(|made| (made, planned))
                    };
                    batch.par_iter().with_max_len(1).map(make).collect::<Result<Vec<_>, _>>()
                },
            );
            let placed = placed?;
            ready = made?;
            for (placed, planned, simplified) in placed {
                let record = self.record(planned, placed, simplified, &levels.records);
                levels.records.push(record);
            }
        }
        Ok(())
    }

    /// How many of the next levels make up so many batches: those that are made before they are written.
    fn batch_length(&self, planned: &[Planned], levels: &[Level], batches: usize) -> usize {
        let budget = self.batch_triangles * rayon::current_num_threads() * batches;
        let mut triangles = 0;
        let is_within = |planned: &&Planned| {
            let before = triangles;
            let children = planned.children.iter().map(|child| brick_of(child, self.bricks, levels));
            triangles += children.map(|brick| brick.triangle_count as usize).sum::<usize>();
            before < budget
        };
        planned.iter().take_while(is_within).count()
    }

    fn record(&self, planned: &Planned, brick: Brick, made: Lengths, levels: &[Level]) -> Level {
        let step = pow2(self.contexts[planned.object as usize].lattice.step_log2);
        let mut children = [Leaf { instance: NONE, brick: NONE }; bricks::LEVEL_CHILDREN];
        children[..planned.children.len()].copy_from_slice(&planned.children);
        let (mut error, mut bound) = (0.0f64, 0.0f64);
        for child in &planned.children {
            let Some(level) = level_of(child, self.bricks, levels) else { continue };
            let scale = match child.instance {
                NONE => 1.0,
                // Rounded up.
                index => Affine(self.instances[index as usize].world_from_object).largest_scale() * (1.0 + 1e-12),
            };
            (error, bound) = (error.max(level.error * scale), bound.max(level.bound * scale));
        }
        Level {
            brick,
            children,
            error: error.max(made.error * step + 0.5 * error),
            bound: made.bound * step + bound,
            color: made.color.min(1.0) as f32,
            _reserved: 0,
        }
    }
}

/// The levels of a step from the journal; see [`Journal::written`] for what comes before them.
fn take_written(words: &[u64]) -> Option<Vec<Level>> {
    let mut words = WordReader(words);
    words.take()?;
    words.take_records::<Span>()?;
    words.take_records()
}

/// What is measured of a level, in steps.
struct Lengths {
    error: f64,
    bound: f64,
    color: f64,
}

/// The record of a child.
fn brick_of<'a>(child: &Leaf, bricks: &'a [Brick], levels: &'a [Level]) -> &'a Brick {
    level_of(child, bricks, levels).map_or_else(|| &bricks[child.brick as usize], |level| &level.brick)
}

/// The level that a child is, if it is one.
fn level_of<'a>(child: &Leaf, bricks: &[Brick], levels: &'a [Level]) -> Option<&'a Level> {
    child.brick.checked_sub(bricks.len() as u32).map(|level| &levels[level as usize])
}

/// What levels are made from.
struct From<'a> {
    written: &'a Written,
    bricks: &'a [Brick],
    instances: &'a [Instance],
    levels: &'a [Level],
}

fn make(
    planned: &Planned,
    from: &From,
    (contexts, flattened, brick_triangles): (&[BrickContext], &Flattened, u32),
) -> Result<Simplified, BuildError> {
    let child = |child: &Leaf| {
        let brick = brick_of(child, from.bricks, from.levels);
        let placed = (child.instance != NONE).then(|| &from.instances[child.instance as usize]);
        Child { brick, lattice: &contexts[brick.object as usize].lattice, placed }
    };
    let children: Vec<Child> = planned.children.iter().map(child).collect();
    simplify(from.written, &children, (&contexts[planned.object as usize], flattened), brick_triangles)
}

/// Writes the payloads of levels.
fn place<'a>(
    writer: &mut Writer,
    levels: Vec<(Simplified, &'a Planned)>,
) -> Result<Vec<(Brick, &'a Planned, Lengths)>, BuildError> {
    let mut placed = Vec::with_capacity(levels.len());
    for (level, planned) in levels {
        let geometry = writer.write(&level.encoded.geometry)?;
        let attributes = writer.write(&level.encoded.attributes)?;
        let brick = Brick { geometry, attributes, proxies: Span::default(), ..level.encoded.record };
        placed.push((brick, planned, Lengths { error: level.error, bound: level.bound, color: level.color }));
    }
    Ok(placed)
}
