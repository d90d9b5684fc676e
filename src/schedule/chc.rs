//! The schedule `chc`: lists per tile, resident bricks first, then missing ones nearest first with a query before each
//! batch.

use super::cache::{BATCH_BRICKS, Cache};
use super::{Executor, ExecutorError, Pass, PassStats, Report, Step};
use crate::stream::Item;

/// Traces the rays of `pass`, after the steps in `first` have made them.
///
/// With `needed` one more query asks, from the final hits, which bricks the pass needed.
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
    steps.extend([Step::Lists, Step::IntersectResident]);
    if !cache.states.all_geometry_resident() {
        steps.push(Step::QueryMissing);
    }
    let report = executor.run(pass, &steps, &cache.states)?;
    let resident = cache.states.finish_resident();
    for &brick in &resident {
        cache.touch(Item::geometry(brick));
    }
    stats.bricks_intersected.extend(resident);
    load_and_intersect(executor, cache, pass, &BATCH_STEPS, report, stats)?;
    if needed {
        measure_needed(executor, cache, pass, &[], &resident_before, stats)?;
    }
    Ok(())
}

/// Intersects a batch and asks again, by tiles' lists.
pub const BATCH_STEPS: [Step; 2] = [Step::IntersectBatch, Step::QueryMissing];

/// Loads what the queries in `report` want, nearest first, a few at a time; each batch is intersected and the rest asked for
/// again by `steps`, until nothing is wanted.
///
/// # Errors
/// What the executor says.
pub fn load_and_intersect(
    executor: &mut dyn Executor,
    cache: &mut Cache,
    pass: Pass,
    steps: &[Step],
    mut report: Report,
    stats: &mut PassStats,
) -> Result<(), ExecutorError> {
    loop {
        let items = nearest_first(&report.demand);
        stats.add(report);
        if items.is_empty() {
            return Ok(());
        }
        let count = cache.load(executor, &items, BATCH_BRICKS, stats)?;
        let batch: Vec<u32> = items[..count].iter().map(|item| item.brick).collect();
        cache.states.set_batch(&batch);
        stats.bricks_intersected.extend(&batch);
        report = executor.run(pass, steps, &cache.states)?;
    }
}

/// Asks, from the final hits, which bricks the pass needed, and what of that was missing when it began. Not part of the
/// pass: it counts in none of its statistics.
///
/// # Errors
/// What the executor says.
pub fn measure_needed(
    executor: &mut dyn Executor,
    cache: &Cache,
    pass: Pass,
    first: &[Step],
    resident_before: &[bool],
    stats: &mut PassStats,
) -> Result<(), ExecutorError> {
    let mut steps = first.to_vec();
    steps.push(Step::QueryNeeded);
    let report = executor.run(pass, &steps, &cache.states)?;
    for &(brick, ..) in &report.demand {
        let bytes = cache.bytes[brick as usize].geometry;
        stats.bytes_needed += bytes;
        if !resident_before[brick as usize] {
            stats.bytes_needed_missing += bytes;
        }
        stats.bricks_needed.get_or_insert_default().push(brick);
    }
    Ok(())
}

/// The wanted bricks' geometry, nearest entry first, then by number.
fn nearest_first(demand: &[(u32, u32, f32)]) -> Vec<Item> {
    let mut wanted = demand.to_vec();
    wanted.sort_by(|a, b| a.2.total_cmp(&b.2).then(a.0.cmp(&b.0)));
    wanted.iter().map(|d| Item::geometry(d.0)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn demand_is_served_nearest_first_then_by_number() {
        let items = nearest_first(&[(4, 1, 2.0), (7, 9, 0.5), (2, 1, 2.0)]);
        assert_eq!(items.iter().map(|i| i.brick).collect::<Vec<_>>(), [7, 2, 4]);
    }
}
