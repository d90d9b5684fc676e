//! The schedule `demand`: every ray from the root, over what is resident; then each asks for the missing bricks that it enters
//! before its hit. The nearest are loaded, a few at a time, and met by the rays that asked for any, and what is still pending
//! asks again.
//!
//! An occlusion query for a tile is answered here by the traversal itself: no lists, no pairs. A ray that asked for nothing needs
//! no brick that is missing, as hits only move nearer, so batches leave it out.

use super::cache::Cache;
use super::chc::{load_and_intersect, measure_needed};
use super::{Executor, ExecutorError, Pass, PassStats, Step};
use crate::stream::Item;

/// Traces the rays of `pass`, after the steps in `first` have made them.
///
/// # Errors
/// What the executor says.
pub fn trace(
    executor: &mut dyn Executor,
    cache: &mut Cache,
    pass: Pass,
    first: &[Step],
    needed: bool,
    stats: &mut PassStats,
) -> Result<(), ExecutorError> {
    let resident_before = cache.resident_geometry();
    let mut steps = first.to_vec();
    steps.push(Step::CountRays);
    if cache.states.all_geometry_resident() {
        steps.push(Step::IntersectAll);
    } else {
        steps.extend([Step::IntersectAllResident, Step::QueryAll]);
    }
    let report = executor.run(pass, &steps, &cache.states)?;
    let resident = cache.states.finish_resident();
    for &brick in &resident {
        cache.touch(Item::geometry(brick));
    }
    stats.bricks_intersected.extend(resident);
    load_and_intersect(executor, cache, pass, &[Step::IntersectAllBatch, Step::QueryAll], report, stats)?;
    if needed {
        measure_needed(executor, cache, pass, &[Step::Lists], &resident_before, stats)?;
    }
    Ok(())
}
