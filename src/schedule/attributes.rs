//! Attributes and textures of what was hit. Attributes are asked for once a pass and loaded in batches as large as the cache
//! allows. Then lookups name the tiles that they need: each of a hit's textures is looked up once all of its tiles are resident together, so
//! that what it gives does not depend on what else is, and the hit waits for the last.

use super::cache::Cache;
use super::{Executor, ExecutorError, Lamp, Pass, PassStats, Report, Step};
use crate::stream::Item;

/// Reads the attributes of all hits of `pass`, a pass of set 0 or 1, and looks their textures up.
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
    // What is resident is read before a load can overwrite it. Lookups follow when everything is read.
    let items: Vec<Item> = missing.iter().map(|&brick| Item::attributes(brick)).collect();
    let mut rest = &items[..];
    let last = |rest: &[Item]| if rest.is_empty() { &[Step::Resolve, Step::Sample][..] } else { &[Step::Resolve] };
    let mut report = executor.run(next, &[&[Step::ClearAttributes], last(rest)].concat(), &cache.states)?;
    while !rest.is_empty() {
        stats.add(report);
        let count = cache.load(executor, rest, usize::MAX, stats)?;
        rest = &rest[count..];
        report = executor.run(next, last(rest), &cache.states)?;
    }
    sample(executor, cache, next, report, stats)?;
    stats.bricks_hit.get_or_insert_default().extend(hit);
    Ok(())
}

/// Loads the tiles that hits wait for, and looks these hits up, until none waits. `report`: of the first [`Step::Sample`].
///
/// A batch takes tiles in the order of the rays that need them and then of their numbers, resident ones as well, which then stay: all
/// tiles of one texture of the first hit are in it, so every batch brings at least that lookup to an end.
fn sample(
    executor: &mut dyn Executor,
    cache: &mut Cache,
    next: Pass,
    mut report: Report,
    stats: &mut PassStats,
) -> Result<(), ExecutorError> {
    let mut before = None;
    loop {
        let tiles = std::mem::take(&mut report.tiles);
        stats.add(report);
        for tile in tiles.iter().filter(|tile| tile.is_used) {
            cache.touch(Item::tile(tile.tile));
        }
        let mut wanted: Vec<_> =
            tiles.iter().filter(|tile| tile.rays > 0).map(|tile| (tile.first, tile.tile)).collect();
        wanted.sort_unstable();
        let Some(&(first, _)) = wanted.first() else { return Ok(()) };
        let of_first = wanted.iter().filter(|wanted| wanted.0 == first).count();
        if before.is_some_and(|(hit, tiles)| hit == first && tiles <= of_first) {
            let text = "cannot hold the tiles of one texture lookup beside each other; give a larger --cache";
            return Err(ExecutorError::Device(text.into()));
        }
        before = Some((first, of_first));
        let items: Vec<Item> = wanted.iter().map(|&(_, tile)| Item::tile(tile)).collect();
        cache.load(executor, &items, usize::MAX, stats)?;
        report = executor.run(next, &[Step::Sample], &cache.states)?;
    }
}
