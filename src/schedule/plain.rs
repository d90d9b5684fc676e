//! The schedules `plain` and `plain-bvh2`: everything resident, every ray from the root. The baselines.

use super::{ExecutorError, Step, Tracer};
use crate::stream::Item;

/// Traces the rays of a pass by `intersect`, after the steps in `first` have made them.
///
/// # Errors
/// What the executor says.
pub fn trace(t: &mut Tracer, intersect: Step, first: &[Step]) -> Result<(), ExecutorError> {
    let resident_before = t.cache.resident_geometry();
    let states = &t.cache.states;
    let bricks = (0..states.len()).filter(|&brick| states.geometry(brick).is_none());
    let missing: Vec<Item> = bricks.map(|brick| Item::geometry(brick as u32)).collect();
    t.cache.load_all(t.executor, &missing, 64, t.stats)?;
    let report = t.run_whole(&[first, &[Step::CountRays, intersect]].concat())?;
    t.cache.finish_resident(&report.used, false, t.stats);
    t.stats.add(report);
    t.measure_needed(&resident_before)
}
