//! The statistics of the effects of one frame.

use super::Engine;
use crate::counters::{Counters, Record};
use crate::schedule::ExecutorError;
use std::time::Instant;

/// Collects the statistics of the effects of a frame, each over all its samples, directions and lamps.
pub struct FrameRecords {
    frame: u32,
    effects: Vec<EffectRecord>,
}

struct EffectRecord {
    name: &'static str,
    stats: Counters,
}

/// What is done as a part of an effect, and counts for it.
pub trait Work: FnOnce(&mut Engine, &mut Counters) -> Result<(), ExecutorError> {}

impl<W: FnOnce(&mut Engine, &mut Counters) -> Result<(), ExecutorError>> Work for W {}

impl FrameRecords {
    /// Of nothing yet.
    pub fn new(frame: u32) -> Self {
        Self { frame, effects: Vec::new() }
    }

    /// The frame.
    pub fn frame(&self) -> u32 {
        self.frame
    }

    /// Does `work`, a pass over rays of its own, as a part of the effect `name`.
    ///
    /// # Errors
    /// The work's.
    pub fn pass(&mut self, engine: &mut Engine, name: &'static str, work: impl Work) -> Result<(), ExecutorError> {
        engine.cache.begin_pass(name, self.frame);
        self.more(engine, name, work)
    }

    /// Does `work`, passes of a method that add nothing to the picture, as a part of the effect `name`.
    ///
    /// # Errors
    /// The work's.
    pub fn work(&mut self, engine: &mut Engine, name: &'static str, work: impl Work) -> Result<(), ExecutorError> {
        engine.cache.begin_pass(name, self.frame);
        self.count(engine, name, work)
    }

    /// Does `work`, which goes on with a pass, as a part of the effect `name`.
    ///
    /// # Errors
    /// The work's.
    pub fn more(&mut self, engine: &mut Engine, name: &'static str, work: impl Work) -> Result<(), ExecutorError> {
        self.count(engine, name, work)?;
        match &mut engine.captures {
            Some(captures) => captures.note(&mut *engine.executor, name),
            None => Ok(()),
        }
    }

    /// Does `work` and counts it for the effect `name`.
    fn count(&mut self, engine: &mut Engine, name: &'static str, work: impl Work) -> Result<(), ExecutorError> {
        let resident = |engine: &Engine| engine.cache.residency.resident().count() as u64;
        let index = self.effects.iter().position(|effect| effect.name == name).unwrap_or_else(|| {
            let stats = Counters { bricks_resident_start: resident(engine), ..Counters::default() };
            self.effects.push(EffectRecord { name, stats });
            self.effects.len() - 1
        });
        let stats = &mut self.effects[index].stats;
        let start = Instant::now();
        work(engine, stats)?;
        stats.ms += start.elapsed().as_secs_f64() * 1e3;
        stats.cache_passes = stats.cache_passes.max(engine.cache.residency.fillings());
        stats.bricks_resident_end = resident(engine);
        Ok(())
    }

    /// The records, in the order in which effects began.
    pub fn finish(self, engine: &Engine) -> Vec<Record> {
        let residency = &engine.cache.residency;
        let record = |EffectRecord { name, stats }| {
            let (cache_bytes, cache_used_bytes) = (residency.budget_bytes(), residency.used_bytes());
            Record::of(self.frame, name, Counters { cache_bytes, cache_used_bytes, ..stats })
        };
        self.effects.into_iter().map(record).collect()
    }
}
