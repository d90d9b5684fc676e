//! Frames that may load so much only: levels of detail that are resident stand in for what is not.
//!
//! *Theory*: a cut through the trees of levels. Rays pass an *open* level by as far as their cones ask for, and stop at
//! a closed one, which stands in for all below it. So a pass is traced over what is ready, geometry and attributes, in
//! one go, and loads nothing. Queries then ask, ray by ray, what stands in for the bricks that would be entered before
//! the hit. A ray that asks for nothing has the hit that it has with everything resident. What most rays ask for is
//! opened first, as far as the frame's allowance goes.
//!
//! A level opens when all of its children are ready. It closes when rays ask for something below it that has made room
//! for others meanwhile and cannot be loaded at once. So children that no ray enters take no room, and there is a hole
//! for as long only as it takes to close a level.
//!
//! The invariant: roots of the trees, what rays used last, and what is above it, stay while others make room. So detail
//! that is seen does not come and go, and where it does not all fit the cut rests where it is.

use super::cache::Cache;
use super::{Demand, Executor, ExecutorError, Pass, Step, Tracer};
use crate::counters::Counters;
use crate::stream::Item;
use bricks::{NONE, Resident};
use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

/// Share of the cache that the roots of the trees may take before rays ask for them: 1 in so many parts.
const ROOTS: u64 = 4;

/// Which levels are open, and what rays ask for.
#[derive(Debug)]
pub struct Cut {
    /// For each brick what it stands for; bricks that are no levels, and levels that stand for what has moved, for
    /// nothing.
    children: Vec<Vec<u32>>,
    /// For each brick the levels that stand for it.
    parents: Vec<Vec<u32>>,
    /// For each brick whether rays pass it by; no level stands for anything else.
    is_open: Vec<bool>,
    /// For each leaf of the top level its brick, and the leaf of the level that stands for it, or [`NONE`].
    leaves: Vec<(u32, u32)>,
    /// Leaves, parents before children.
    order: Vec<u32>,
    /// Bricks that no level stands for, where there are levels.
    roots: Vec<u32>,
    /// Rays that asked for each brick since the cut was refined last.
    asked: BTreeMap<u32, u64>,
    /// Bricks that rays entered in the passes of this frame, and of the one before.
    used: [Vec<bool>; 2],
    /// Whether the camera rays of the frame have still to be traced.
    is_first: bool,
}

impl Cut {
    /// Through the trees of a scene, all closed. Without levels in use, or where they may not stand in for anything, it
    /// has none.
    pub fn new(resident: &Resident, stands_in: bool) -> Self {
        let (first, count) = (resident.exact_bricks(), resident.bricks.len());
        let mut children = vec![Vec::new(); count];
        let mut parents = vec![Vec::new(); count];
        let mut is_left = vec![false; count];
        let in_use = stands_in && resident.has_levels_in_use();
        for (level, record) in resident.levels.iter().enumerate().filter(|_| in_use) {
            // What stands for something that has moved no ray takes.
            is_left[first + level] = record.error == f64::MAX;
            let mut own: Vec<u32> = record.children().map(|child| child.brick).collect();
            own.sort_unstable();
            own.dedup();
            own.retain(|_| !is_left[first + level]);
            own.iter().for_each(|&child| parents[child as usize].push((first + level) as u32));
            children[first + level] = own;
        }
        let above = if in_use { resident.level_parents() } else { Vec::new() };
        let parent = |leaf: usize| above.get(leaf).copied().unwrap_or(NONE);
        let leaves: Vec<(u32, u32)> =
            resident.leaves.iter().enumerate().map(|(index, leaf)| (leaf.brick, parent(index))).collect();
        // Children are bricks or levels before their parent.
        let mut order: Vec<u32> = (0..leaves.len() as u32).collect();
        order.sort_unstable_by_key(|&leaf| Reverse(leaves[leaf as usize].0));
        let is_root = |&brick: &u32| in_use && parents[brick as usize].is_empty() && !is_left[brick as usize];
        let roots = (0..count as u32).filter(is_root).collect();
        let used = [vec![false; count], vec![false; count]];
        let is_open = vec![false; count];
        Self { children, parents, is_open, leaves, order, roots, asked: BTreeMap::new(), used, is_first: true }
    }

    /// Starts a frame: what was used in the one before is still kept.
    pub fn begin_frame(&mut self) {
        let [now, before] = &mut self.used;
        std::mem::swap(now, before);
        now.fill(false);
        self.is_first = true;
    }

    /// Loads what rays asked for as far as the allowance goes, opens and closes levels, and marks what stands in from
    /// now on. Returns whether rays may find something else now.
    fn refine(
        &mut self,
        executor: &mut dyn Executor,
        cache: &mut Cache,
        stats: &mut Counters,
    ) -> Result<bool, ExecutorError> {
        let wanted = self.wanted(cache);
        let asked = std::mem::take(&mut self.asked);
        let kept: Vec<Item> = self.kept(cache).into_iter().flat_map(both).collect();
        let mut has_changed = cache.load_within(executor, &wanted, &kept, stats)?;
        for level in 0..self.children.len() {
            let own = &self.children[level];
            self.is_open[level] |= !own.is_empty() && own.iter().all(|&child| is_ready(cache, child));
        }
        for &brick in asked.keys().filter(|&&brick| !is_ready(cache, brick)) {
            has_changed |= self.close_above(brick, cache);
        }
        executor.mark_leaves(&self.marks(cache));
        Ok(has_changed)
    }

    /// Closes the nearest levels above a brick that can stand in for it. Returns whether any was open.
    fn close_above(&mut self, brick: u32, cache: &Cache) -> bool {
        let mut above = self.parents[brick as usize].clone();
        let mut has_closed = false;
        while let Some(level) = above.pop() {
            if is_ready(cache, level) {
                has_closed |= std::mem::replace(&mut self.is_open[level as usize], false);
            } else {
                above.extend(&self.parents[level as usize]);
            }
        }
        has_closed
    }

    /// What to load, the most urgent first, and what of that is resident already: bricks that nothing stands in for,
    /// roots, and the children of each level that rays asked for, which are of use together.
    fn wanted(&self, cache: &Cache) -> Vec<Vec<Item>> {
        let mut by_rays: Vec<(u64, u32)> = self.asked.iter().map(|(&brick, &rays)| (rays, brick)).collect();
        by_rays.sort_unstable_by_key(|&(rays, brick)| (Reverse(rays), brick));
        let missing = by_rays.iter().map(|&(_, brick)| brick).filter(|&brick| !is_ready(cache, brick));
        let mut bytes = 0;
        let most = cache.residency.budget_bytes() / ROOTS;
        let roots = self.roots.iter().copied().take_while(|&brick| {
            bytes += both(brick).map(|item| cache.residency.bytes(item)).iter().sum::<u64>();
            bytes <= most
        });
        let children = by_rays.iter().map(|&(_, brick)| self.children[brick as usize].clone());
        let alone: Vec<u32> = missing.chain(roots).collect();
        let mut is_listed = vec![false; self.children.len()];
        let mut items = |group: Vec<u32>| {
            let is_new = |&brick: &u32| !std::mem::replace(&mut is_listed[brick as usize], true);
            group.into_iter().filter(is_new).flat_map(both).collect::<Vec<Item>>()
        };
        alone.into_iter().map(|brick| vec![brick]).chain(children).map(&mut items).collect()
    }

    /// The bricks that stay: roots that are ready, what was used, and what stands above it.
    fn kept(&self, cache: &Cache) -> Vec<u32> {
        let [now, before] = &self.used;
        let mut is_kept: Vec<bool> = now.iter().zip(before).map(|(now, before)| *now || *before).collect();
        self.roots.iter().for_each(|&root| is_kept[root as usize] |= is_ready(cache, root));
        // Parents come behind their children.
        for level in 0..self.children.len() {
            is_kept[level] |= self.children[level].iter().any(|&child| is_kept[child as usize]);
        }
        (0..is_kept.len() as u32).filter(|&brick| is_kept[brick as usize]).collect()
    }

    /// Which leaves are marked: closed levels that are ready, and all below them.
    fn marks(&self, cache: &Cache) -> Arc<[bool]> {
        let stands_in =
            |level: usize| !self.is_open[level] && !self.children[level].is_empty() && is_ready(cache, level as u32);
        let stands_in: Vec<bool> = (0..self.children.len()).map(stands_in).collect();
        let mut marks = vec![false; self.leaves.len()];
        for &leaf in &self.order {
            let (brick, parent) = self.leaves[leaf as usize];
            marks[leaf as usize] = stands_in[brick as usize] || parent != NONE && marks[parent as usize];
        }
        marks.into()
    }

    fn note(&mut self, used: &[u32], demand: &[Demand], cache: &mut Cache) {
        for &brick in used {
            self.used[0][brick as usize] = true;
            both(brick).into_iter().for_each(|item| cache.touch(item));
        }
        for asked in demand {
            *self.asked.entry(asked.brick).or_default() += u64::from(asked.rays);
        }
    }
}

/// Traces the rays of a pass, after the steps in `first` have made them, over what is ready, and says what each is left
/// with ([`super::Report::states`]). Before the first camera rays of a frame the cut is refined, and again while they
/// ask for something and the allowance lasts until they are traced once more, or where nothing stands in for something.
/// What other rays ask for comes in the next frame.
///
/// # Errors
/// A brick that cannot be read; the device's.
pub fn trace(t: &mut Tracer, cut: &mut Cut, first: &[Step]) -> Result<Vec<u32>, ExecutorError> {
    t.stats.schedule.push("cut");
    let steps = [first, &[Step::CountRays, Step::IntersectReady]].concat();
    let is_first = t.pass == Pass::Primary && std::mem::take(&mut cut.is_first);
    if is_first {
        cut.refine(t.executor, t.cache, t.stats)?;
    }
    loop {
        let start = Instant::now();
        let mut report = t.executor.run(t.pass, &steps, &t.cache.states)?;
        let mut asks = t.executor.run(t.pass, &[Step::QueryStandIns], &t.cache.states)?;
        t.stats.bricks_entered.extend(report.used.iter().copied());
        cut.note(&report.used, &asks.demand, t.cache);
        let has_left = t.cache.allowance.as_ref().is_some_and(|allowance| allowance.outlasts(start.elapsed()));
        let has_holes = cut.asked.keys().any(|&brick| !is_ready(t.cache, brick));
        let goes_on = is_first && (has_left || has_holes) && !cut.asked.is_empty();
        if !goes_on || !cut.refine(t.executor, t.cache, t.stats)? {
            let states = std::mem::take(&mut asks.states);
            t.stats.add(report);
            t.stats.add(asks);
            return Ok(states);
        }
        // The same rays once more: only the last time counts.
        report.counters = Counters { round_trips: report.counters.round_trips, ..Counters::default() };
        t.stats.add(report);
        t.stats.round_trips += asks.counters.round_trips;
    }
}

/// Geometry and attributes of a brick.
fn both(brick: u32) -> [Item; 2] {
    [Item::geometry(brick), Item::attributes(brick)]
}

/// Whether geometry and attributes of a brick are resident.
fn is_ready(cache: &Cache, brick: u32) -> bool {
    let brick = brick as usize;
    cache.states.geometry(brick).is_some() && cache.states.attributes(brick).is_some()
}
