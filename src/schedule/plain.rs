//! The schedules `plain` and `plain-bvh2`: everything resident, every ray from the root. The baselines.

use super::cache::Cache;
use super::{Executor, ExecutorError, Step, Tracer};
use crate::counters::Counters;
use crate::stream::Item;

/// Loads every brick's geometry that is missing.
///
/// # Errors
/// What the executor says. The caller has made sure that everything fits.
pub fn make_all_resident(
    executor: &mut dyn Executor,
    cache: &mut Cache,
    stats: &mut Counters,
) -> Result<(), ExecutorError> {
    let missing: Vec<Item> = (0..cache.states.len())
        .filter(|&b| cache.states.geometry(b).is_none())
        .map(|b| Item::geometry(b as u32))
        .collect();
    let mut rest = &missing[..];
    while !rest.is_empty() {
        let count = cache.load(executor, rest, 64, stats)?;
        rest = &rest[count..];
    }
    Ok(())
}

/// Traces the rays of a pass by `intersect`, after the steps in `first` have made them.
///
/// # Errors
/// What the executor says.
pub fn trace(t: &mut Tracer, intersect: Step, first: &[Step]) -> Result<(), ExecutorError> {
    let resident_before = t.cache.resident_geometry();
    make_all_resident(t.executor, t.cache, t.stats)?;
    let report = t.executor.run(t.pass, &[first, &[Step::CountRays, intersect]].concat(), &t.cache.states)?;
    t.cache.finish_resident(&report.used, false, t.stats);
    t.stats.add(report);
    t.measure_needed(&resident_before)
}
