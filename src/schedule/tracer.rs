//! How any schedule traces a pass: what it works with, and what is done about missing bricks.

use super::cache::{BATCH_BRICKS, Cache};
use super::{Demand, Executor, ExecutorError, Optimisations, Pass, Query, Report, Step, Tracing};
use crate::counters::Counters;
use crate::stream::Item;
use std::time::Instant;

/// Most dispatches with one leaf a tile that go into a submission.
const MOST_SINGLE_LEAVES: usize = 24;

/// What a schedule works with.
pub struct Tracer<'a> {
    /// Runs steps.
    pub executor: &'a mut dyn Executor,
    /// What is resident.
    pub cache: &'a mut Cache,
    /// Which rays.
    pub pass: Pass,
    /// Measurements and optimisations.
    pub tracing: &'a Tracing,
    /// What is counted.
    pub stats: &'a mut Counters,
    /// Steps that follow once the hits are final. A schedule that knows its last submission beforehand appends them to
    /// it; a pass of more takes a round trip more for them.
    pub last: &'a [Step],
    /// What these reported, where they have been run.
    pub ended: Option<Report>,
}

impl Optimisations {
    /// Asks for what is wanted, where batches are met by the step `intersect`. Where what is loaded is asked for again,
    /// and nearest first, a ray need not know what lies behind the next that it enters.
    pub fn query(&self, intersect: Step) -> Step {
        Step::Query(Query {
            from_root: intersect == Step::IntersectAllBatch,
            undone: !self.resident_first,
            up_to_next: self.requery && self.nearest_first,
        })
    }
}

impl<'a> Tracer<'a> {
    /// Of a pass that nothing follows.
    pub fn new(
        executor: &'a mut dyn Executor,
        cache: &'a mut Cache,
        pass: Pass,
        tracing: &'a Tracing,
        stats: &'a mut Counters,
    ) -> Self {
        Self { executor, cache, pass, tracing, stats, last: &[], ended: None }
    }

    /// Runs `steps`. Without [`Optimisations::by_tile`] each intersection of selected leaves becomes dispatches of one
    /// leaf a tile, and one round trip more, which says how many. What came back before the last submission is counted.
    ///
    /// # Errors
    /// What the executor says.
    pub fn run(&mut self, steps: &[Step]) -> Result<Report, ExecutorError> {
        let Self { executor, cache, pass, tracing, stats, .. } = self;
        let mut run = |steps: &[Step]| executor.run(*pass, steps, &cache.states);
        if tracing.optimisations.by_tile {
            return run(steps);
        }
        let mut rest = Vec::new();
        let mut used = Vec::new();
        for &step in steps {
            let is_batch = match step {
                Step::IntersectResident => false,
                Step::IntersectBatch => true,
                other => {
                    rest.push(other);
                    continue;
                }
            };
            rest.push(if is_batch { Step::SelectBatch } else { Step::SelectResident });
            let report = run(&rest)?;
            let most = report.most_selected;
            used.extend(&report.used);
            stats.add(report);
            rest = (0..most).map(|leaf| Step::IntersectOne { leaf, is_batch }).collect();
            while rest.len() > MOST_SINGLE_LEAVES {
                let later = rest.split_off(MOST_SINGLE_LEAVES);
                let report = run(&rest)?;
                used.extend(&report.used);
                stats.add(report);
                rest = later;
            }
        }
        let mut report = if rest.is_empty() { Report::default() } else { run(&rest)? };
        report.used.append(&mut used);
        report.used.sort_unstable();
        report.used.dedup();
        Ok(report)
    }

    /// Runs the only submission of a pass: `steps`, and what follows the pass.
    ///
    /// # Errors
    /// What the executor says.
    pub fn run_whole(&mut self, steps: &[Step]) -> Result<Report, ExecutorError> {
        // What is measured after a pass asks of hits as tracing left them.
        let last = if self.tracing.measure_needed { &[] } else { self.last };
        let report = self.executor.run(self.pass, &[steps, last].concat(), &self.cache.states)?;
        if !last.is_empty() {
            self.ended = Some(report.clone());
        }
        Ok(report)
    }

    /// Loads of what the queries in `report` want, nearest first, those bricks that some ray enters before any other
    /// that it wants: what lies behind them may turn out to be hidden. Each batch is intersected and the rest asked for
    /// again, until nothing is wanted. Without the re-query what was wanted at first is loaded whole: hits only move
    /// nearer, so no ray wants anything else later.
    ///
    /// # Errors
    /// What the executor says.
    pub fn load_and_intersect(&mut self, intersect: Step, mut report: Report) -> Result<(), ExecutorError> {
        let on = &self.tracing.optimisations;
        let (mut wanted, mut most) = in_order(&report.demand, on.nearest_first);
        self.stats.add(&report);
        while !wanted.is_empty() {
            let most_now = if on.requery { most } else { BATCH_BRICKS };
            let count = self.cache.load(self.executor, &wanted, most_now, self.stats)?;
            let rest = wanted.split_off(count);
            let batch: Vec<u32> = wanted.iter().map(|item| item.number).collect();
            if let Some(lowest) = rest.iter().map(|item| item.number).min() {
                let ahead = batch.iter().filter(|&&brick| brick > lowest).count();
                self.stats.bricks_nearest_first += ahead as u64;
            }
            self.cache.states.set_batch(&batch);
            self.stats.bricks_entered.extend(batch.iter().copied());
            if on.requery {
                report = self.run(&[intersect, on.query(intersect)])?;
                let still = |item: &&Item| report.demand.binary_search_by_key(&item.number, |d| d.brick).is_ok();
                self.stats.bricks_no_longer_wanted += (rest.len() - rest.iter().filter(still).count()) as u64;
                (wanted, most) = in_order(&report.demand, on.nearest_first);
            } else {
                report = self.run(&[intersect])?;
                wanted = rest;
            }
            self.stats.add(&report);
        }
        Ok(())
    }

    /// Asks, from the final hits, which bricks the pass needed, and what of that was missing when it began, if that is
    /// to be measured. Not part of the pass: it counts in none of its statistics, and its time is taken off the pass's.
    ///
    /// # Errors
    /// What the executor says.
    pub fn measure_needed(&mut self, resident_before: &[bool]) -> Result<(), ExecutorError> {
        if !self.tracing.measure_needed {
            return Ok(());
        }
        let start = Instant::now();
        let report = self.executor.run(self.pass, &[Step::Lists, Step::QueryNeeded], &self.cache.states)?;
        for &Demand { brick, .. } in &report.demand {
            let bytes = self.cache.sizes.bricks[brick as usize].0;
            self.stats.bytes_needed += bytes;
            if !resident_before[brick as usize] {
                self.stats.bytes_needed_missing += bytes;
            }
            self.stats.bricks_needed.extend([brick]);
        }
        self.stats.ms -= start.elapsed().as_secs_f64() * 1e3;
        Ok(())
    }
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
