//! The schedule `plain`: everything resident, every ray from the root. The baseline.

use super::cache::Cache;
use super::{Executor, ExecutorError, Pass, PassStats, Step};
use crate::stream::Item;

/// Loads every brick's geometry that is missing.
///
/// # Errors
/// What the executor says. The caller has made sure that everything fits.
pub fn make_all_resident(
    executor: &mut dyn Executor,
    cache: &mut Cache,
    stats: &mut PassStats,
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
    measure_needed: bool,
    stats: &mut PassStats,
) -> Result<(), ExecutorError> {
    make_all_resident(executor, cache, stats)?;
    let mut steps = first.to_vec();
    steps.push(Step::IntersectAll);
    let report = executor.run(pass, &steps, &cache.states)?;
    stats.bricks_intersected.extend(cache.states.finish_resident());
    stats.add(report);
    if measure_needed {
        let report = executor.run(pass, &[Step::Lists, Step::QueryNeeded], &cache.states)?;
        let needed: Vec<u32> = report.demand.iter().map(|d| d.0).collect();
        stats.bytes_needed += needed.iter().map(|&b| cache.bytes[b as usize].geometry).sum::<u64>();
        stats.bricks_needed.get_or_insert_default().extend(needed);
    }
    Ok(())
}
