//! The schedule `demand`: every ray from the root, over what is resident; then each asks for the missing bricks that it
//! enters before its hit. The nearest are loaded, a few at a time, and met by the rays that asked for any, and what is
//! still pending asks again.
//!
//! An occlusion query for a tile is answered here by the traversal itself: no lists, no pairs. A ray that asked for
//! nothing needs no brick that is missing, as hits only move nearer, so batches leave it out.

use super::{ExecutorError, Step, Tracer};

/// Traces the rays of a pass, after the steps in `first` have made them.
///
/// # Errors
/// What the executor says.
pub fn trace(t: &mut Tracer, first: &[Step]) -> Result<(), ExecutorError> {
    let resident_before = t.cache.resident_geometry();
    let on = &t.tracing.optimisations;
    let some_missing = !t.cache.states.all_geometry_resident();
    let query = on.query(Step::IntersectAllBatch);
    let mut steps = first.to_vec();
    steps.push(Step::CountRays);
    match (some_missing, on.resident_first) {
        (false, _) => steps.push(Step::IntersectAll),
        (true, true) => steps.extend([Step::IntersectAllResident, query]),
        (true, false) => steps.push(query),
    }
    let report = if some_missing { t.run(&steps)? } else { t.run_whole(&steps)? };
    if !some_missing || on.resident_first {
        t.cache.finish_resident(&report.used, some_missing, t.stats);
    }
    t.load_and_intersect(Step::IntersectAllBatch, report)?;
    t.measure_needed(&resident_before)
}
