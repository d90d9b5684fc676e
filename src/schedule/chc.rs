//! The schedule `chc`: lists per tile, resident bricks first, then missing ones nearest first with a query before each
//! batch.

use super::cache::{BATCH_BRICKS, Cache};
use super::{Executor, ExecutorError, Pass, PassStats, Step};
use crate::stream::Item;

/// Traces the rays of `pass`, after the steps in `first` have made them.
///
/// With `measure_needed` one more query asks, from the final hits, which bricks the pass needed.
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
    let resident_before: Option<Vec<bool>> =
        measure_needed.then(|| (0..cache.states.len()).map(|b| cache.states.geometry(b).is_some()).collect());
    let mut steps = first.to_vec();
    steps.extend([Step::Lists, Step::IntersectResident]);
    if !cache.states.all_geometry_resident() {
        steps.push(Step::QueryMissing);
    }
    let mut report = executor.run(pass, &steps, &cache.states)?;
    let resident = cache.states.finish_resident();
    for &brick in &resident {
        cache.touch(Item::geometry(brick));
    }
    stats.bricks_intersected.extend(resident);
    loop {
        let items = nearest_first(&report.demand);
        stats.add(report);
        if items.is_empty() {
            break;
        }
        let count = cache.load(executor, &items, BATCH_BRICKS, stats)?;
        let batch: Vec<u32> = items[..count].iter().map(|item| item.brick).collect();
        cache.states.set_batch(&batch);
        stats.bricks_intersected.extend(&batch);
        report = executor.run(pass, &[Step::IntersectBatch, Step::QueryMissing], &cache.states)?;
    }
    if let Some(resident_before) = resident_before {
        let report = executor.run(pass, &[Step::QueryNeeded], &cache.states)?;
        let needed: Vec<u32> = report.demand.iter().map(|d| d.0).collect();
        let missing = needed.iter().filter(|&&b| !resident_before[b as usize]);
        stats.bytes_needed += needed.iter().map(|&b| cache.bytes[b as usize].geometry).sum::<u64>();
        stats.bytes_needed_missing += missing.map(|&b| cache.bytes[b as usize].geometry).sum::<u64>();
        stats.bricks_needed.get_or_insert_default().extend(needed);
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
