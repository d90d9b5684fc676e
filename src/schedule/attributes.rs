//! Attributes of what was hit: asked for once a pass, loaded in batches as large as the cache allows.

use super::cache::Cache;
use super::{Executor, ExecutorError, Lamp, Pass, PassStats, Step};
use crate::stream::Item;

/// Reads the attributes of all hits of `pass`, a pass of set 0 or 1.
///
/// # Errors
/// What the executor says.
pub fn resolve(
    executor: &mut dyn Executor,
    cache: &mut Cache,
    pass: Pass,
    stats: &mut PassStats,
) -> Result<(), ExecutorError> {
    // Steps that shade work on the hits of the set before.
    let next = if pass.set() == 0 { Pass::Shadow(Lamp::Sun) } else { Pass::BounceShadow(Lamp::Sun) };
    let report = executor.run(pass, &[Step::QueryHits], &cache.states)?;
    let hit: Vec<u32> = report.demand.iter().map(|d| d.brick).collect();
    stats.add(report);
    let (resident, missing): (Vec<u32>, Vec<u32>) =
        hit.iter().partition(|&&brick| cache.states.attributes(brick as usize).is_some());
    for &brick in &resident {
        cache.touch(Item::attributes(brick));
    }
    // What is resident is read before a load can overwrite it.
    stats.add(executor.run(next, &[Step::ClearAttributes, Step::Resolve], &cache.states)?);
    let items: Vec<Item> = missing.iter().map(|&brick| Item::attributes(brick)).collect();
    let mut rest = &items[..];
    while !rest.is_empty() {
        let count = cache.load(executor, rest, usize::MAX, stats)?;
        rest = &rest[count..];
        stats.add(executor.run(next, &[Step::Resolve], &cache.states)?);
    }
    stats.bricks_hit.get_or_insert_default().extend(hit);
    Ok(())
}
