//! The schedule `chc`: lists per tile, resident bricks first, then missing ones nearest first with a query before each
//! batch.

use super::by_tile::run;
use super::cache::{BATCH_BRICKS, Cache};
use super::{Demand, Executor, ExecutorError, Optimisations, Pass, Query, Report, Step, Tracing};
use crate::counters::Counters;
use crate::stream::Item;
use std::time::Instant;

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
    let resident_before = cache.resident_geometry();
    let optimisations = &tracing.optimisations;
    let some_missing = !cache.states.all_geometry_resident();
    let resident_first = optimisations.resident_first || !some_missing;
    let mut steps = first.to_vec();
    let is_short = optimisations.root_walk && optimisations.by_tile && optimisations.front_to_back;
    steps.push(if is_short { Step::ShortLists } else { Step::Lists });
    if !optimisations.front_to_back {
        steps.push(Step::SortByNumber);
    }
    if resident_first {
        steps.push(Step::IntersectResident);
    }
    let batches = Batches::new(pass, Step::IntersectBatch, optimisations);
    if some_missing {
        steps.extend([Step::CullPairs { undone: !resident_first }, batches.query()]);
    }
    let report = run(executor, pass, &steps, &cache.states, optimisations, stats)?;
    if resident_first {
        cache.finish_resident(&report.used, some_missing, stats);
    }
    batches.load_and_intersect(executor, cache, report, stats)?;
    if tracing.measure_needed {
        measure_needed(executor, cache, pass, &[Step::Lists], &resident_before, stats)?;
    }
    Ok(())
}

/// How the bricks that queries want are taken, in batches.
pub struct Batches<'a> {
    pass: Pass,
    /// Intersects a batch.
    intersect: Step,
    on: &'a Optimisations,
}

impl<'a> Batches<'a> {
    /// Of the rays of `pass`, met by the step `intersect`.
    pub fn new(pass: Pass, intersect: Step, optimisations: &'a Optimisations) -> Self {
        Self { pass, intersect, on: optimisations }
    }

    /// Asks for what is wanted. Where what is loaded is asked for again, and nearest first, a ray need not know what
    /// lies behind the next that it enters.
    pub fn query(&self) -> Step {
        let Self { intersect, on, .. } = *self;
        Step::Query(Query {
            from_root: intersect == Step::IntersectAllBatch,
            undone: !on.resident_first,
            up_to_next: on.requery && on.nearest_first,
        })
    }

    /// Loads of what the queries in `report` want, nearest first, those bricks that some ray enters before any other
    /// that it wants: what lies behind them may turn out to be hidden. Each batch is intersected and the rest asked for
    /// again, until nothing is wanted. Without the re-query what was wanted at first is loaded whole: hits only move
    /// nearer, so no ray wants anything else later.
    ///
    /// # Errors
    /// What the executor says.
    pub fn load_and_intersect(
        &self,
        executor: &mut dyn Executor,
        cache: &mut Cache,
        mut report: Report,
        stats: &mut Counters,
    ) -> Result<(), ExecutorError> {
        let on = self.on;
        let (mut wanted, mut most) = in_order(&report.demand, on.nearest_first);
        stats.add(&report);
        while !wanted.is_empty() {
            let count = cache.load(executor, &wanted, if on.requery { most } else { BATCH_BRICKS }, stats)?;
            let rest = wanted.split_off(count);
            let batch: Vec<u32> = wanted.iter().map(|item| item.number).collect();
            if let Some(lowest) = rest.iter().map(|item| item.number).min() {
                stats.bricks_nearest_first += batch.iter().filter(|&&brick| brick > lowest).count() as u64;
            }
            cache.states.set_batch(&batch);
            stats.bricks_entered.extend(batch.iter().copied());
            if on.requery {
                report = run(executor, self.pass, &[self.intersect, self.query()], &cache.states, on, stats)?;
                let still = |item: &&Item| report.demand.binary_search_by_key(&item.number, |d| d.brick).is_ok();
                stats.bricks_no_longer_wanted += (rest.len() - rest.iter().filter(still).count()) as u64;
                (wanted, most) = in_order(&report.demand, on.nearest_first);
            } else {
                report = run(executor, self.pass, &[self.intersect], &cache.states, on, stats)?;
                wanted = rest;
            }
            stats.add(&report);
        }
        Ok(())
    }
}

/// Asks, from the final hits, which bricks the pass needed, and what of that was missing when it began. Not part of the
/// pass: it counts in none of its statistics, and its time is taken off the pass's.
///
/// # Errors
/// What the executor says.
pub fn measure_needed(
    executor: &mut dyn Executor,
    cache: &Cache,
    pass: Pass,
    first: &[Step],
    resident_before: &[bool],
    stats: &mut Counters,
) -> Result<(), ExecutorError> {
    let start = Instant::now();
    let mut steps = first.to_vec();
    steps.push(Step::QueryNeeded);
    let report = executor.run(pass, &steps, &cache.states)?;
    for &Demand { brick, .. } in &report.demand {
        let bytes = cache.bytes.bricks[brick as usize].geometry;
        stats.bytes_needed += bytes;
        if !resident_before[brick as usize] {
            stats.bytes_needed_missing += bytes;
        }
        stats.bricks_needed.extend([brick]);
    }
    stats.ms -= start.elapsed().as_secs_f64() * 1e3;
    Ok(())
}

/// The wanted bricks' geometry by number; or nearest entry first, then by number, those ahead that some ray enters
/// next. Also how many of them to load before the next query: only what some ray enters next.
fn in_order(demand: &[Demand], nearest_first: bool) -> (Vec<Item>, usize) {
    let mut wanted = demand.to_vec();
    let mut most = BATCH_BRICKS;
    if nearest_first {
        let hidden = |d: &Demand| d.next == 0;
        wanted.sort_by(|a, b| {
            hidden(a).cmp(&hidden(b)).then(a.nearest.total_cmp(&b.nearest)).then(a.brick.cmp(&b.brick))
        });
        let needed = wanted.iter().filter(|d| !hidden(d)).count();
        if needed > 0 {
            most = needed;
        }
    }
    (wanted.iter().map(|d| Item::geometry(d.brick)).collect(), most)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bricks(demand: &[(u32, f32, u32)], nearest_first: bool) -> (Vec<u32>, usize) {
        let demand: Vec<Demand> =
            demand.iter().map(|&(brick, nearest, next)| Demand { brick, rays: 9, nearest, next }).collect();
        let (items, most) = in_order(&demand, nearest_first);
        (items.iter().map(|i| i.number).collect(), most)
    }

    #[test]
    fn demand_is_served_nearest_first_then_by_number() {
        let demand = [(2, 2.0, 1), (4, 2.0, 1), (7, 0.5, 9)];
        assert_eq!(bricks(&demand, true), (vec![7, 2, 4], 3));
        assert_eq!(bricks(&demand, false), (vec![2, 4, 7], BATCH_BRICKS));
    }

    #[test]
    fn what_no_ray_enters_next_waits() {
        let demand = [(2, 2.0, 1), (4, 0.5, 0), (7, 0.7, 9)];
        assert_eq!(bricks(&demand, true), (vec![7, 2, 4], 2));
        assert_eq!(bricks(&demand, false), (vec![2, 4, 7], BATCH_BRICKS));
    }

    #[test]
    fn where_no_brick_is_entered_next_the_nearest_are_taken() {
        assert_eq!(bricks(&[(2, 2.0, 0), (4, 0.5, 0)], true), (vec![4, 2], BATCH_BRICKS));
    }

    #[test]
    fn all_that_is_needed_is_loaded() {
        let demand: Vec<_> = (0..100).map(|brick| (brick, 1.0, 1)).collect();
        assert_eq!(bricks(&demand, true).1, 100);
    }
}
