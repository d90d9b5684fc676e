//! Attributes and textures of what was hit. Attributes are asked for once a pass and loaded in batches as large as the
//! cache allows. Then lookups name the tiles that they need: each of a hit's textures is looked up once all of its
//! tiles are resident together, so that what it gives does not depend on what else is, and the hit waits for the last.
//! Where a frame may load so many bytes of tiles only, coarser levels stand for the tiles that it does not load.

use super::cache::{Allowance, Cache};
use super::{Executor, ExecutorError, Lamp, Pass, Report, Step, TileDemand};
use crate::counters::Counters;
use crate::stream::Item;
use std::cmp::Reverse;

/// Reads the attributes of all hits of `pass`, a pass of set 0 or 1, and looks their textures up.
///
/// # Errors
/// What the executor says.
pub fn resolve(
    executor: &mut dyn Executor,
    cache: &mut Cache,
    pass: Pass,
    stats: &mut Counters,
) -> Result<(), ExecutorError> {
    // Steps that shade work on the hits of the set before.
    let next = if pass.set() == 0 { Pass::Shadow(Lamp::Sun) } else { Pass::BounceShadow(Lamp::Sun) };
    let report = executor.run(pass, &[Step::QueryHits], &cache.states)?;
    stats.add(&report);
    let hit = report.hit;
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
    match cache.allowance {
        None => sample(executor, cache, next, report, stats)?,
        Some(_) => sample_within(executor, cache, next, report, stats)?,
    }
    stats.bricks_hit.extend(hit);
    Ok(())
}

/// Loads the tiles that hits wait for, and looks these hits up, until none waits. `report`: of the first
/// [`Step::Sample`].
///
/// A batch takes tiles in the order of the rays that need them and then of their numbers, resident ones as well, which
/// then stay: all tiles of one texture of the first hit are in it, so every batch brings at least that lookup to an
/// end.
fn sample(
    executor: &mut dyn Executor,
    cache: &mut Cache,
    next: Pass,
    mut report: Report,
    stats: &mut Counters,
) -> Result<(), ExecutorError> {
    let mut before = None;
    loop {
        let tiles = note(report, cache, stats);
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

/// Loads the tiles that most hits wait for, as far as the frame's allowance goes, and has coarser levels stand for the
/// others. What was not used of it is left to the passes that follow. `report`: of the first [`Step::Sample`].
fn sample_within(
    executor: &mut dyn Executor,
    cache: &mut Cache,
    next: Pass,
    mut report: Report,
    stats: &mut Counters,
) -> Result<(), ExecutorError> {
    loop {
        let left = cache.allowance.as_ref().map_or(0, Allowance::left);
        let mut tiles = note(report, cache, stats);
        tiles.retain(|tile| tile.rays > 0);
        if tiles.is_empty() {
            break;
        }
        tiles.sort_unstable_by_key(|tile| (Reverse(tile.rays), tile.tile));
        let mut bytes = 0;
        // What is resident costs nothing, and is to stay.
        let items: Vec<Item> = (tiles.iter().map(|tile| Item::tile(tile.tile)))
            .take_while(|&item| {
                bytes += if cache.residency.slot(item).is_some() { 0 } else { cache.residency.bytes(item) };
                bytes <= left
            })
            .collect();
        let before = stats.bytes_textures;
        cache.load(executor, &items, usize::MAX, stats)?;
        let loaded = stats.bytes_textures - before;
        cache.spend(loaded);
        if loaded == 0 {
            let report = executor.run(next, &[Step::SampleCoarser], &cache.states)?;
            note(report, cache, stats);
            break;
        }
        report = executor.run(next, &[Step::Sample], &cache.states)?;
    }
    Ok(())
}

/// Notes the use of tiles that were read; what lookups ask of tiles.
fn note(mut report: Report, cache: &mut Cache, stats: &mut Counters) -> Vec<TileDemand> {
    let tiles = std::mem::take(&mut report.tiles);
    stats.add(report);
    for tile in tiles.iter().filter(|tile| tile.is_used) {
        cache.touch(Item::tile(tile.tile));
    }
    tiles
}
