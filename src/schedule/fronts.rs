//! The schedule `chc` with `--fronts on`: Algorithm 1 of CHC+RT with temporal visible and invisible fronts.
//!
//! *Changed*: the pairs of one round of queries are evaluated in one dispatch; newly visible pairs are intersected
//! before the next round instead of after every 16; visible pairs whose brick is missing wait, and at the end of the
//! traversal are queried, loaded nearest first and intersected as without fronts. Invisible pairs are queried in every
//! frame and a pair is only ever left out by a query against present hits, so the final hits are exact.

use super::multi_query::batches;
use super::pair_tree::{Front, PairTree, Square};
use super::{ExecutorError, PairQuery, Pass, Step, Tracer};
use bricks::Resident;
use std::collections::BTreeMap;

/// Visible pairs are queried again every so many frames (CHC+RT §5.1, n).
const REQUERY_FRAMES: u32 = 3;

/// Most bytes of all fronts together. Those not used for longest are given up first; they grow anew from the root.
pub const FRONT_BYTES: usize = 256 << 20;

/// The fronts of all passes, kept from frame to frame: one a direction, one for all shadow rays of a set of hits.
#[derive(Clone, Debug, Default)]
pub struct Fronts {
    /// By [`Pass::visibility_state`], with the number of the pass that used them last.
    trees: BTreeMap<Pass, (PairTree, u64)>,
    passes: u64,
}

/// What stays the same over a pass.
pub struct FrontPass<'a> {
    /// The scene.
    pub resident: &'a Resident,
    /// Rays per row, rows, edge of a tile.
    pub extent: (u32, u32, u32),
    /// Frame, for lazy queries.
    pub frame: u32,
}

impl Fronts {
    /// Traces the rays that the steps in `first` make.
    ///
    /// # Errors
    /// What the executor says.
    pub fn trace(&mut self, t: &mut Tracer, setup: &FrontPass, first: &[Step]) -> Result<(), ExecutorError> {
        let (width, height, tile) = setup.extent;
        let top = &setup.resident.top2;
        let state = t.pass.visibility_state();
        self.passes += 1;
        self.bound(FRONT_BYTES);
        let (tree, used) = self.trees.entry(state).or_insert_with(|| (PairTree::new(width, height, tile), 0));
        *used = self.passes;
        if !tree.fits(width, height, tile) {
            *tree = PairTree::new(width, height, tile);
        }
        let on = &t.tracing.optimisations;
        let resident_before = t.cache.resident_geometry();
        let ahead = on.resident_first && !t.cache.states.all_geometry_resident();
        let mut found = Found { t, setup, steps: Vec::new(), waiting: Vec::new(), used: Vec::new() };

        // Phase 1: what was visible. Rays are counted by the step that bounds the tiles.
        let leaves = tree.leaves();
        let (visible, invisible): (Vec<u32>, Vec<u32>) =
            leaves.into_iter().partition(|&i| matches!(tree.pair(i).front, Front::Visible { .. }));
        found.steps.extend(first);
        found.steps.push(Step::CountRays);
        found.intersect(tree, &visible)?;

        // Phases 2 and 3: query the invisible front; split what became visible until a front is reached again.
        let mut queue = if top.is_empty() { Vec::new() } else { invisible };
        let mut is_front = true;
        loop {
            let seen = found.query(tree, &mut queue, is_front)?;
            is_front = false;
            let (mut next, mut terminal) = (Vec::new(), Vec::new());
            for (&index, _) in queue.iter().zip(&seen).filter(|(_, rays)| **rays > 0) {
                if tree.is_terminal(index, top) {
                    // Spread over the frames to come, so that not all fall due at once.
                    let later = 1 + index % REQUERY_FRAMES;
                    let requery = if on.lazy_requery { setup.frame + later } else { setup.frame };
                    tree.set_front(index, Front::Visible { requery });
                    terminal.push(index);
                } else {
                    next.extend(tree.split(index, top, setup.frame));
                }
            }
            found.t.stats.queries_interval_culled += seen.iter().filter(|&&rays| rays == 0).count() as u64;
            if next.is_empty() && terminal.is_empty() {
                break;
            }
            found.intersect(tree, &terminal)?;
            queue = next;
        }
        found.used.sort_unstable();
        found.used.dedup();
        found.t.cache.touch_geometry(&found.used, ahead, found.t.stats);

        // What is visible and missing: ask again, load, intersect.
        let waiting = std::mem::take(&mut found.waiting);
        if !waiting.is_empty() {
            found.load(tree, &waiting)?;
        }
        self.finish(t, setup)?;
        t.measure_needed(&resident_before)
    }

    /// A visibility state, a ray (column, row) and a leaf of the top level that are not together in exactly one leaf
    /// pair of the state's fronts; `None` if all fronts partition rays x leaves, as they must. For tests: takes time
    /// and memory in proportion to both.
    pub fn partition_defect(&self, resident: &Resident) -> Option<(Pass, [u32; 3])> {
        let defect = |tree: &PairTree| tree.partition_defect(&resident.top2, resident.leaves.len());
        self.trees.iter().find_map(|(&state, (tree, _))| defect(tree).map(|at| (state, at)))
    }

    /// How many visibility states have fronts.
    pub fn states(&self) -> usize {
        self.trees.len()
    }

    /// Gives up fronts, those not used for longest first, until they take at most `bytes`.
    fn bound(&mut self, bytes: usize) {
        let mut all: usize = self.trees.values().map(|(tree, _)| tree.bytes()).sum();
        while all > bytes {
            let Some(oldest) = self.trees.iter().min_by_key(|(_, (_, used))| *used).map(|(&state, _)| state) else {
                return;
            };
            all -= self.trees.remove(&oldest).map_or(0, |(tree, _)| tree.bytes());
        }
    }

    /// Lazy queries of the visible front against final hits, pull-up, and the statistics of the fronts.
    fn finish(&mut self, t: &mut Tracer, setup: &FrontPass) -> Result<(), ExecutorError> {
        let Some((tree, _)) = self.trees.get_mut(&t.pass.visibility_state()) else { return Ok(()) };
        let on = &t.tracing.optimisations;
        let (mut due, mut deferred) = (Vec::new(), 0);
        for index in tree.leaves() {
            match tree.pair(index).front {
                Front::Visible { requery } if requery <= setup.frame || !on.lazy_requery => due.push(index),
                Front::Visible { .. } => deferred += 1,
                Front::Invisible { .. } | Front::Inner => {}
            }
        }
        t.stats.requeries_deferred += deferred;
        if !due.is_empty() {
            let mut found = Found { t, setup, steps: Vec::new(), waiting: Vec::new(), used: Vec::new() };
            let seen = found.query(tree, &mut due, false)?;
            for (&index, &rays) in due.iter().zip(&seen) {
                let visible = Front::Visible { requery: setup.frame + REQUERY_FRAMES };
                tree.set_front(index, if rays > 0 { visible } else { Front::Invisible { since: setup.frame } });
            }
        }
        if on.pull_up {
            t.stats.pulled_up += tree.pull_up();
        }
        let fronts = tree.leaves();
        let visible = fronts.iter().filter(|&&i| matches!(tree.pair(i).front, Front::Visible { .. })).count();
        t.stats.pairs_visible += visible as u64;
        t.stats.pairs_invisible += (fronts.len() - visible) as u64;
        Ok(())
    }
}

/// Visible pairs on their way to be intersected.
struct Found<'a, 'b> {
    t: &'a mut Tracer<'b>,
    setup: &'a FrontPass<'a>,
    /// Steps of the next submission.
    steps: Vec<Step>,
    /// Pairs whose brick is missing.
    waiting: Vec<u32>,
    /// Bricks that were resident and that rays entered.
    used: Vec<u32>,
}

impl Found<'_, '_> {
    /// Asks how many rays see each of `pairs`, after the steps so far. Pairs of `is_front`, the invisible ones of the
    /// frame before, are asked for by multi-queries where that is on, and are put in the order of these.
    fn query(&mut self, tree: &PairTree, pairs: &mut [u32], is_front: bool) -> Result<Vec<u32>, ExecutorError> {
        let on = &self.t.tracing.optimisations;
        let queries = if is_front && on.multi_queries {
            multi_queries(tree, pairs, self.setup.frame)
        } else {
            pairs.iter().map(|&index| tree.query(index)).collect()
        };
        let nodes: Vec<u32> = pairs.iter().map(|&index| tree.pair(index).node).collect();
        self.t.executor.set_pairs(&queries, &nodes)?;
        self.steps.push(Step::QueryPairs { tighter: on.tighter_bounds });
        let mut report = self.t.run(&std::mem::take(&mut self.steps))?;
        self.used.extend(&report.used);
        let seen = std::mem::take(&mut report.pair_rays);
        let stats = &mut *self.t.stats;
        stats.add(report);
        let mut first = 0;
        for query in &queries {
            let nodes = query.nodes as usize;
            let failed = nodes > 1 && seen[first..first + nodes].iter().any(|&rays| rays > 0);
            stats.multi_queries += u64::from(nodes > 1);
            stats.multi_queries_failed += u64::from(failed);
            first += nodes;
        }
        Ok(seen)
    }

    /// Has the next submission intersect the pairs whose brick is resident, and lets the others wait. Without
    /// [`super::Optimisations::resident_first`] all are intersected now, as they are wanted.
    fn intersect(&mut self, tree: &PairTree, pairs: &[u32]) -> Result<(), ExecutorError> {
        let states = &self.t.cache.states;
        if !self.t.tracing.optimisations.resident_first && !states.all_geometry_resident() {
            return self.load(tree, pairs);
        }
        let mut present = Vec::new();
        for &index in pairs {
            let brick = brick_of(tree, self.setup.resident, index);
            if states.geometry(brick as usize).is_some() {
                present.push(index);
            } else {
                self.waiting.push(index);
            }
        }
        self.set_lists(tree, &present)?;
        self.steps.push(Step::IntersectResident);
        Ok(())
    }

    /// Asks which of the pairs are still wanted, loads and intersects them.
    fn load(&mut self, tree: &PairTree, pairs: &[u32]) -> Result<(), ExecutorError> {
        if pairs.is_empty() {
            return Ok(());
        }
        // Other pairs than before may name the same bricks.
        self.t.cache.states.begin_pass();
        self.set_lists(tree, pairs)?;
        self.steps.push(self.t.tracing.optimisations.query(Step::IntersectBatch));
        let report = self.t.run(&std::mem::take(&mut self.steps))?;
        self.t.load_and_intersect(Step::IntersectBatch, report)
    }

    /// Lists leaves of the pairs by tile.
    fn set_lists(&mut self, tree: &PairTree, pairs: &[u32]) -> Result<(), ExecutorError> {
        let near = self.t.tracing.optimisations.front_to_back;
        let mut lists = vec![Vec::new(); tree.tiles()];
        for &index in pairs {
            let pair = tree.pair(index);
            lists[tree.tile_index(pair.square)].push(pair.node);
        }
        let leaf = |&node: &u32| self.setup.resident.top2[node as usize].left;
        lists.iter_mut().for_each(|list| list.sort_unstable_by_key(leaf));
        self.t.executor.set_lists(&lists)?;
        if near {
            self.steps.push(Step::SortNodesNear);
        }
        Ok(())
    }
}

/// Sorts invisible pairs by tile, the longest invisible first, and makes queries of them, in that order.
fn multi_queries(tree: &PairTree, pairs: &mut [u32], frame: u32) -> Vec<PairQuery> {
    let since = |index: u32| match tree.pair(index).front {
        Front::Invisible { since } => since,
        Front::Visible { .. } | Front::Inner => frame,
    };
    let square = |index: u32| {
        let Square { x, y, log2 } = tree.pair(index).square;
        (log2, y, x)
    };
    pairs.sort_by_key(|&index| (square(index), since(index), index));
    let mut queries = Vec::new();
    for tile in pairs.chunk_by(|&a, &b| square(a) == square(b)) {
        let frames: Vec<u32> = tile.iter().map(|&index| frame.saturating_sub(since(index))).collect();
        let query = tree.query(tile[0]);
        queries.extend(batches(&frames).into_iter().map(|size| PairQuery { nodes: size as u32, ..query }));
    }
    queries
}

fn brick_of(tree: &PairTree, resident: &Resident, index: u32) -> u32 {
    let leaf = resident.top2[tree.pair(index).node as usize].left;
    resident.leaves[leaf as usize].brick
}
