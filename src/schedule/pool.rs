//! The schedule of blocks of any-hit rays that can be made anew, more of them than are traced at once. Each block is
//! traced over what is resident when it is made first, and asks for what is missing; what its rays that wait ask for is
//! added to what those of other blocks do. Only when there is no room for more that wait, or no more blocks, are bricks
//! loaded, as many as the cache holds; all blocks in which rays wait are met with these, and ask again.
//!
//! The invariant of the module above, over all these blocks in place of one pass: what was resident and what was loaded
//! is done for all of them, so that any of it may be evicted and none is loaded twice until no ray waits.

use super::cache::Cache;
use super::{Executor, ExecutorError, Query, Report, Step};
use crate::counters::Counters;
use crate::stream::Item;
use std::cmp::Reverse;
use std::collections::BTreeMap;

/// Asks for the first brick that is missing; a ray that has been answered asks for none.
const QUERY: Step = Step::Query(Query { from_root: true, undone: false, up_to_next: true });

/// What the waiting rays of all blocks ask for.
#[derive(Default)]
pub struct Pool {
    /// How many of them enter each brick before any other that is missing.
    asked: BTreeMap<u32, u64>,
}

impl Pool {
    /// The steps that trace a block that has just been made, and whether any of its rays may wait after them.
    pub fn first(cache: &Cache) -> (&'static [Step], bool) {
        match cache.states.all_geometry_resident() {
            true => (&[Step::CountRays, Step::IntersectAll], false),
            false => (&[Step::CountRays, Step::IntersectAllResident, QUERY], true),
        }
    }

    /// The steps that meet the waiting rays of a block, made anew, with what [`Self::load`] has loaded.
    pub const NEXT: &[Step] = &[Step::IntersectAllBatch, QUERY];

    /// Adds what a block's rays ask for; how many of them wait.
    pub fn note(&mut self, report: &Report) -> u64 {
        for demand in report.demand.iter().filter(|demand| demand.next > 0) {
            *self.asked.entry(demand.brick).or_default() += u64::from(demand.next);
        }
        report.demand.iter().map(|demand| u64::from(demand.next)).sum()
    }

    /// Loads what is asked for, what most rays ask for first, as much as the cache holds; whether any was. All blocks
    /// in which rays wait are to be met with it, and noted, before the next.
    ///
    /// # Errors
    /// What the executor says.
    pub fn load(
        &mut self,
        executor: &mut dyn Executor,
        cache: &mut Cache,
        stats: &mut Counters,
    ) -> Result<bool, ExecutorError> {
        // All blocks have met what is resident.
        cache.states.finish_resident();
        let mut batch = in_order(std::mem::take(&mut self.asked));
        let items: Vec<Item> = batch.iter().map(|&brick| Item::geometry(brick)).collect();
        if items.is_empty() {
            return Ok(false);
        }
        batch.truncate(cache.fill(executor, &items, stats)?);
        cache.states.set_batch(&batch);
        stats.bricks_entered.extend(batch.iter().copied());
        Ok(true)
    }
}

/// Bricks that so many rays ask for, what most ask for first, then by number.
fn in_order(asked: BTreeMap<u32, u64>) -> Vec<u32> {
    let mut asked: Vec<(u32, u64)> = asked.into_iter().collect();
    asked.sort_by_key(|&(brick, rays)| (Reverse(rays), brick));
    asked.into_iter().map(|(brick, _)| brick).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::schedule::Demand;

    #[test]
    fn what_most_rays_of_all_blocks_wait_for_comes_first() {
        let mut pool = Pool::default();
        let report = |all: &[(u32, u32)]| Report {
            demand: all.iter().map(|&(brick, next)| Demand { brick, rays: 9, nearest: 1.0, next }).collect(),
            ..Report::default()
        };
        // Brick 8 is not the first for any ray.
        assert_eq!(pool.note(&report(&[(2, 3), (5, 4), (8, 0)])), 7);
        assert_eq!(pool.note(&report(&[(2, 2), (4, 5)])), 7);
        assert_eq!(in_order(pool.asked), [2, 4, 5]);
    }
}
