//! The schedules `plain` and `plain-bvh2`: everything resident, every ray from the root. The baselines.

use super::cache::Cache;
use super::chc::measure_needed;
use super::{Executor, ExecutorError, Pass, Step, Tracing};
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
    trace_by(Step::IntersectAll, executor, cache, pass, first, tracing, stats)
}

/// [`trace`] by binary trees, which the executor has been made ready for.
///
/// # Errors
/// What the executor says.
pub fn trace_binary(
    executor: &mut dyn Executor,
    cache: &mut Cache,
    pass: Pass,
    first: &[Step],
    tracing: &Tracing,
    stats: &mut Counters,
) -> Result<(), ExecutorError> {
    trace_by(Step::IntersectBinary, executor, cache, pass, first, tracing, stats)
}

fn trace_by(
    intersect: Step,
    executor: &mut dyn Executor,
    cache: &mut Cache,
    pass: Pass,
    first: &[Step],
    tracing: &Tracing,
    stats: &mut Counters,
) -> Result<(), ExecutorError> {
    let resident_before = cache.resident_geometry();
    make_all_resident(executor, cache, stats)?;
    let mut steps = first.to_vec();
    steps.extend([Step::CountRays, intersect]);
    let report = executor.run(pass, &steps, &cache.states)?;
    cache.finish_resident(&report.used, false, stats);
    stats.add(report);
    if tracing.measure_needed {
        measure_needed(executor, cache, pass, &[Step::Lists], &resident_before, stats)?;
    }
    Ok(())
}
