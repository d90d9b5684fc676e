//! Makes levels, each as soon as its children are written, and writes them in order.

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
use rayon::Scope;
use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Batches of triangles of a step of the journal.
const STEP_BATCHES: usize = 16;

/// The levels of a scene.
#[derive(Debug, Default)]
pub(crate) struct Levels {
    /// Their records, in the order of their plan.
    pub records: Vec<Level>,
}

/// Writes levels.
pub(crate) struct LevelWriter<'a> {
    /// Makes them.
    pub maker: Maker<'a>,
    /// The scene file.
    pub writer: &'a mut Writer,
    /// Triangles a thread works on before what it made is written, which bounds the memory.
    pub batch_triangles: usize,
}

impl LevelWriter<'_> {
    /// Makes and writes all levels, in steps of `journal` if there is one.
    pub fn write(&mut self, plan: &Plan, mut journal: Option<&mut Journal>) -> Result<Levels, BuildError> {
        let mut levels = Levels::default();
        self.maker.progress.phase("levels", plan.levels.len() as u64);
        let Some(journal) = &mut journal else {
            self.write_some(&plan.levels, &mut levels)?;
            return Ok(levels);
        };
        let mut rest = plan.levels.as_slice();
        while let Some(first) = rest.first() {
            let depth = &rest[..rest.partition_point(|planned| planned.depth <= first.depth)];
            let (some, after) = rest.split_at(self.step_length(depth, &levels.records));
            rest = after;
            self.step(some, &mut levels, journal)?;
        }
        Ok(levels)
    }

    /// Makes and writes levels whose children are all written, or takes them from an earlier run.
    fn step(&mut self, some: &[Planned], levels: &mut Levels, journal: &mut Journal) -> Result<(), BuildError> {
        let first = levels.records.len();
        let words = journal.step(Step::Levels, || {
            self.write_some(some, levels)?;
            Ok(to_words(self.writer.checkpoint()?, &levels.records[first..]))
        })?;
        if levels.records.len() == first {
            levels.records.extend(take_written(&words).ok_or_else(|| journal.damaged())?);
            self.maker.progress.advance(some.len() as u64);
        }
        if levels.records.len() == first + some.len() { Ok(()) } else { Err(journal.damaged()) }
    }

    /// Makes and writes levels, the children of each written before it or among them.
    fn write_some(&mut self, planned: &[Planned], levels: &mut Levels) -> Result<(), BuildError> {
        let threads = rayon::current_num_threads();
        let work = Work { maker: &self.maker, written: self.writer.written()? };
        let line = Mutex::new(Line {
            planned,
            begun: VecDeque::new(),
            in_work: 0,
            threads,
            most_triangles: 2 * self.batch_triangles * threads,
            records: &mut levels.records,
            writer: Some(&mut *self.writer),
            error: None,
        });
        rayon::scope(|scope| go_on(scope, &line, &work));
        let line = line.into_inner().unwrap_or_else(PoisonError::into_inner);
        // Children come before their parents in a plan, so that one can always be begun.
        assert!(line.error.is_some() || line.planned.is_empty() && line.begun.is_empty(), "all levels are written");
        line.error.map_or(Ok(()), Err)
    }

    /// How many of the next levels make up a step.
    fn step_length(&self, planned: &[Planned], levels: &[Level]) -> usize {
        let budget = self.batch_triangles * rayon::current_num_threads() * STEP_BATCHES;
        let mut triangles = 0;
        let is_within = |planned: &&Planned| {
            let before = triangles;
            triangles += triangles_of(&planned.children, self.maker.bricks, levels);
            before < budget
        };
        planned.iter().take_while(is_within).count()
    }
}

/// Levels that are made side by side and written in the order of their plan, each begun as soon as its children are
/// written.
struct Line<'a> {
    /// Those that are not begun.
    planned: &'a [Planned],
    /// Those that are begun and not written, in order.
    begun: VecDeque<Begun<'a>>,
    /// Threads that make one.
    in_work: usize,
    /// Threads there are.
    threads: usize,
    /// Triangles of the children of those that are begun at which none is begun, which bounds the memory.
    most_triangles: usize,
    /// Records of those that are written.
    records: &'a mut Vec<Level>,
    /// Where they are written; taken while a thread writes.
    writer: Option<&'a mut Writer>,
    /// What went wrong first.
    error: Option<BuildError>,
}

/// A level that is begun.
struct Begun<'a> {
    planned: &'a Planned,
    /// Triangles of its children.
    triangles: usize,
    made: Option<Simplified>,
}

impl<'a> Line<'a> {
    /// Takes the next level, if one can be begun: where its record will be, and the records of its children.
    fn begin(&mut self, maker: &Maker) -> Option<(usize, &'a Planned, Vec<Brick>)> {
        let (planned, after) = self.planned.split_first()?;
        let triangles: usize = self.begun.iter().map(|begun| begun.triangles).sum();
        if self.error.is_some() || self.in_work >= self.threads || triangles >= self.most_triangles {
            return None;
        }
        let index = self.records.len() + self.begun.len();
        let first = maker.bricks.len() + self.records.len();
        if planned.children.iter().any(|child| child.brick as usize >= first) {
            return None;
        }
        if let Err(error) = maker.progress.check() {
            self.error = Some(error.into());
            return None;
        }
        let children = planned.children.iter().map(|child| *brick_of(child, maker.bricks, self.records)).collect();
        let triangles = triangles_of(&planned.children, maker.bricks, self.records);
        self.planned = after;
        self.in_work += 1;
        self.begun.push_back(Begun { planned, triangles, made: None });
        Some((index, planned, children))
    }

    /// Takes back what was made of the level whose record will be there.
    fn end(&mut self, index: usize, made: Result<Simplified, BuildError>) {
        self.in_work -= 1;
        match made {
            Ok(made) => self.begun[index - self.records.len()].made = Some(made),
            Err(error) => self.error = self.error.take().or(Some(error)),
        }
    }

    /// The level that is to be written next, if it is made, and where; until that is given back no other thread writes.
    fn take_made(&mut self) -> Option<(Simplified, &'a mut Writer)> {
        if self.writer.is_none() || self.error.is_some() {
            return None;
        }
        let made = self.begun.front_mut()?.made.take()?;
        self.writer.take().map(|writer| (made, writer))
    }
}

fn locked<'s, 'a>(line: &'s Mutex<Line<'a>>) -> MutexGuard<'s, Line<'a>> {
    // After a panic nothing is made of what the line holds.
    line.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What levels are made with, and the payloads that they are made from.
struct Work<'a> {
    maker: &'a Maker<'a>,
    written: Written,
}

/// Begins levels, as many as can be.
fn go_on<'s, 'a>(scope: &Scope<'s>, line: &'s Mutex<Line<'a>>, work: &'s Work<'a>) {
    let maker = work.maker;
    let mut begin = locked(line);
    while let Some((index, planned, children)) = begin.begin(maker) {
        scope.spawn(move |scope| {
            let made = maker.make(&work.written, planned, &children);
            maker.progress.advance(1);
            locked(line).end(index, made);
            write_made(line, maker);
            go_on(scope, line, work);
        });
    }
}

/// Writes levels that are made, unless another thread does.
fn write_made(line: &Mutex<Line>, maker: &Maker) {
    loop {
        let Some((level, writer)) = locked(line).take_made() else { return };
        let placed = place(writer, level);
        let mut line = locked(line);
        line.writer = Some(writer);
        let result = placed.map(|(brick, lengths)| {
            if let Some(Begun { planned, .. }) = line.begun.pop_front() {
                let record = maker.record(planned, brick, lengths, line.records);
                line.records.push(record);
            }
        });
        line.error = result.err().or(line.error.take());
    }
}

/// For the journal: first how far the scene file is written and the payloads.
pub(super) fn to_words(position: u64, records: &[Level]) -> Vec<u64> {
    let spans = records.iter().flat_map(|level| [level.brick.geometry, level.brick.attributes]);
    let mut words = Words::default();
    words.put(position).put_records(&spans.collect::<Vec<Span>>()).put_records(records);
    words.0
}

/// The levels of a step from the journal; see [`Journal::written`] for what comes before them.
pub(super) fn take_written(words: &[u64]) -> Option<Vec<Level>> {
    let mut words = WordReader(words);
    words.take()?;
    words.take_records::<Span>()?;
    words.take_records()
}

/// What is measured of a level, in steps.
pub(super) struct Lengths {
    pub error: f64,
    pub bound: f64,
    pub color: f64,
}

/// The record of a child.
pub(super) fn brick_of<'a>(child: &Leaf, bricks: &'a [Brick], levels: &'a [Level]) -> &'a Brick {
    level_of(child, bricks, levels).map_or_else(|| &bricks[child.brick as usize], |level| &level.brick)
}

/// The level that a child is, if it is one.
fn level_of<'a>(child: &Leaf, bricks: &[Brick], levels: &'a [Level]) -> Option<&'a Level> {
    child.brick.checked_sub(bricks.len() as u32).map(|level| &levels[level as usize])
}

/// Triangles of children.
pub(super) fn triangles_of(children: &[Leaf], bricks: &[Brick], levels: &[Level]) -> usize {
    children.iter().map(|child| brick_of(child, bricks, levels).triangle_count as usize).sum()
}

/// What levels are made from, but for payloads.
pub(crate) struct Maker<'a> {
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
    /// Who watches.
    pub progress: &'a Progress,
}

impl Maker<'_> {
    /// Makes a level of its children, whose payloads are `written`.
    pub(super) fn make(
        &self,
        written: &Written,
        planned: &Planned,
        children: &[Brick],
    ) -> Result<Simplified, BuildError> {
        let children: Vec<Child> =
            planned.children.iter().zip(children).map(|(child, brick)| self.child(child, brick)).collect();
        let context = &self.contexts[planned.object as usize];
        simplify(written, &children, (context, self.flattened), self.brick_triangles)
    }

    fn child<'c>(&'c self, child: &Leaf, brick: &'c Brick) -> Child<'c> {
        let lattice = &self.contexts[brick.object as usize].lattice;
        let placed = (child.instance != NONE).then(|| &self.instances[child.instance as usize]);
        Child { brick, lattice, placed }
    }

    /// The record of a level that is written.
    pub(super) fn record(&self, planned: &Planned, brick: Brick, made: Lengths, levels: &[Level]) -> Level {
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

/// Writes the payloads of a level, so that they can be read.
fn place(writer: &mut Writer, level: Simplified) -> Result<(Brick, Lengths), BuildError> {
    let geometry = writer.write(&level.encoded.geometry)?;
    let attributes = writer.write(&level.encoded.attributes)?;
    writer.checkpoint()?;
    let brick = Brick { geometry, attributes, proxies: Span::default(), ..level.encoded.record };
    Ok((brick, Lengths { error: level.error, bound: level.bound, color: level.color }))
}
