//! The schedule `demand`: every ray from the root, over what is resident; then each asks for the missing bricks that it
//! enters before its hit. The nearest are loaded, a few at a time, and met by the rays that asked for any, and what is
//! still pending asks again.
//!
//! An occlusion query for a tile is answered here by the traversal itself: no lists, no pairs. A ray that asked for
//! nothing needs no brick that is missing, as hits only move nearer, so batches leave it out.

use super::cache::Cache;
use super::chc::{Batches, measure_needed};
use super::{Executor, ExecutorError, Pass, Step, Tracing};
use crate::counters::Counters;

/// Traces the rays of `pass`, after the steps in `first` have made them.
///
/// # Errors
/// What the executor says.
pub fn trace(
    executor: &mut dyn Executor,
    cache: &mut Cache,
    pass: Pass,
    first: &[Step],
    tracing: &Tracing,
    stats: &mut Counters,
) -> Result<(), ExecutorError> {
    let resident_before = cache.resident_geometry();
    let optimisations = &tracing.optimisations;
    let some_missing = !cache.states.all_geometry_resident();
    let batches = Batches::new(pass, Step::IntersectAllBatch, optimisations);
    let query = batches.query();
    let mut steps = first.to_vec();
    steps.push(Step::CountRays);
    match (some_missing, optimisations.resident_first) {
        (false, _) => steps.push(Step::IntersectAll),
        (true, true) => steps.extend([Step::IntersectAllResident, query]),
        (true, false) => steps.push(query),
    }
    let report = executor.run(pass, &steps, &cache.states)?;
    if !some_missing || optimisations.resident_first {
        cache.finish_resident(&report.used, some_missing, stats);
    }
    batches.load_and_intersect(executor, cache, report, stats)?;
    if tracing.measure_needed {
        measure_needed(executor, cache, pass, &[Step::Lists], &resident_before, stats)?;
    }
    Ok(())
}
