//! The statistics of the effects of one frame.

use super::Renderer;
use crate::counters::Record;
use crate::schedule::{ExecutorError, PassStats};
use std::time::Instant;

/// Collects the statistics of the effects of a frame, each over all its samples, directions and lamps.
pub struct FrameRecords {
    frame: u32,
    effects: Vec<EffectRecord>,
}

struct EffectRecord {
    name: &'static str,
    stats: PassStats,
    resident_start: u64,
    resident_end: u64,
}

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
    pub fn pass(
        &mut self,
        renderer: &mut Renderer,
        name: &'static str,
        work: impl FnOnce(&mut Renderer, &mut PassStats) -> Result<(), ExecutorError>,
    ) -> Result<(), ExecutorError> {
        renderer.cache.begin_pass(name, self.frame);
        self.more(renderer, name, work)
    }

    /// Does `work`, which goes on with a pass, as a part of the effect `name`.
    ///
    /// # Errors
    /// The work's.
    pub fn more(
        &mut self,
        renderer: &mut Renderer,
        name: &'static str,
        work: impl FnOnce(&mut Renderer, &mut PassStats) -> Result<(), ExecutorError>,
    ) -> Result<(), ExecutorError> {
        let resident = |renderer: &Renderer| renderer.cache.residency.resident().count() as u64;
        let before = resident(renderer);
        let index = self.effects.iter().position(|effect| effect.name == name).unwrap_or_else(|| {
            let stats = PassStats::default();
            self.effects.push(EffectRecord { name, stats, resident_start: before, resident_end: before });
            self.effects.len() - 1
        });
        let effect = &mut self.effects[index];
        let start = Instant::now();
        work(renderer, &mut effect.stats)?;
        effect.stats.ms += start.elapsed().as_secs_f64() * 1e3;
        effect.stats.cache_passes = effect.stats.cache_passes.max(renderer.cache.residency.fillings());
        effect.resident_end = effect.resident_end + resident(renderer) - before;
        // Maps of lamps and fields of visibility add nothing to the picture, whose last sum they come before.
        let adds = ![crate::secondary::rsm::answer::EFFECT, crate::secondary::dvf::answer::EFFECT].contains(&name);
        if let Some(captures) = renderer.captures.as_mut().filter(|_| adds) {
            captures.note(&mut *renderer.executor, name)?;
        }
        Ok(())
    }

    /// The records, in the order in which effects began.
    pub fn finish(self, renderer: &Renderer) -> Vec<Record> {
        let residency = &renderer.cache.residency;
        let record = |effect: EffectRecord| Record {
            cache_bytes: residency.budget_bytes(),
            cache_used_bytes: residency.used_bytes(),
            bricks_resident_start: effect.resident_start,
            bricks_resident_end: effect.resident_end,
            ..Record::of(self.frame, effect.name, &effect.stats)
        };
        self.effects.into_iter().map(record).collect()
    }
}
