//! What kernels keep of tiles: the bounds of their rays, their lists of leaves, and how many of their rays see each
//! leaf.

use super::bound::{Bound, Demand};
use super::layout::{Entry, PARAM_CULLED, Pair, TileBounds, TileList};
use super::report::too_many_pairs;
use crate::schedule::ExecutorError;
use std::sync::atomic::{AtomicU32, Ordering};

/// Most entries of all lists together: 1.25 GiB.
const MOST_ENTRIES: u64 = 1 << 26;

/// Tiles, their lists, and queries of pairs: group 3 of the kernels that work on tiles.
#[derive(Default)]
pub struct TileLists {
    /// Bounds of the tiles' rays.
    pub bounds: Vec<TileBounds>,
    /// Where the tiles' entries lie in `list`, one after the other. Which tiles have work `chosen` says, and
    /// `from_root` of each.
    pub lists: Vec<TileList>,
    /// Whether each tile had a selection when tiles were last chosen.
    pub chosen: Vec<bool>,
    /// Leaves per tile, near first; tables of those whose rays walk from the root.
    pub list: Vec<Entry>,
    /// Positions in `list`, per tile.
    pub selection: Vec<u32>,
    /// The least distance of the entries that are selected, per tile.
    pub nearest: Vec<f32>,
    /// What is asked of every position of `list`.
    pub pair_demand: Vec<Demand>,
    /// Queries of pairs.
    pub pairs: Vec<Pair>,
    /// Their nodes.
    pub pair_nodes: Vec<u32>,
    /// Rays that see each of their nodes.
    pub pair_rays: Vec<u32>,
    /// Rays that see each leaf from each tile.
    pub pair_counts: PairCounts,
}

impl TileLists {
    /// For so many tiles.
    pub fn new(tiles: usize) -> Self {
        let (bounds, lists) = (vec![TileBounds::default(); tiles], vec![TileList::default(); tiles]);
        Self { bounds, lists, chosen: vec![false; tiles], nearest: vec![0.0; tiles], ..Self::default() }
    }

    /// For so many tiles from now on.
    pub fn resize(&mut self, tiles: usize) {
        if self.lists.len() != tiles {
            self.bounds.resize(tiles, TileBounds::default());
            self.lists.resize(tiles, TileList::default());
            self.chosen.resize(tiles, false);
            self.nearest.resize(tiles, 0.0);
        }
    }

    /// Makes room for so many entries.
    ///
    /// # Errors
    /// They are too many.
    pub fn make_room(&mut self, entries: u64) -> Result<(), ExecutorError> {
        if entries > MOST_ENTRIES {
            let text = format!("cannot hold tile lists of {entries} entries; use a larger --tile");
            return Err(ExecutorError::Device(text));
        }
        let entries = entries as usize;
        if entries > self.list.len() {
            self.list.resize(entries, Entry::default());
            self.selection.resize(entries, 0);
            self.pair_demand.resize_with(entries, Demand::default);
        }
        Ok(())
    }

    /// Sets the lists of all tiles, for which there is room.
    pub fn set(&mut self, lists: &[Vec<u32>]) {
        let mut first = 0;
        self.lists.clear();
        for nodes in lists {
            let count = nodes.len() as u32;
            self.lists.push(TileList { first, count, ..TileList::default() });
            first += count;
        }
        for (entry, &node) in self.list.iter_mut().zip(lists.iter().flatten()) {
            *entry = Entry { node, near: 0.0 };
        }
        self.pair_demand.iter_mut().for_each(|demand| *demand = Demand::default());
    }
}

/// Most pairs that are counted: 1 GiB.
const MOST_PAIRS: u64 = 1 << 28;

/// How many rays of each tile see each leaf, by tile, then leaf: what a threshold culls pairs of a tile and a leaf by.
#[derive(Default)]
pub struct PairCounts {
    counts: Vec<AtomicU32>,
    leaves: usize,
}

impl PairCounts {
    /// Begins to count, from zero, for so many tiles and leaves.
    ///
    /// # Errors
    /// The pairs are too many.
    pub fn start(&mut self, tiles: u32, leaves: usize) -> Result<(), ExecutorError> {
        let pairs = u64::from(tiles) * leaves as u64;
        if pairs > MOST_PAIRS {
            return Err(too_many_pairs(tiles, leaves));
        }
        self.counts.clear();
        self.counts.resize_with(pairs as usize, AtomicU32::default);
        self.leaves = leaves;
        Ok(())
    }

    /// Adds a ray of the tile that sees the leaf. Returns how many did before it.
    pub fn add(&self, tile: usize, leaf: u32) -> u32 {
        self.of(tile, leaf).fetch_add(1, Ordering::Relaxed)
    }

    /// Whether pairs are culled, and too few rays of the tile see the leaf.
    #[inline(always)]
    pub fn is_culled(&self, bound: &Bound, tile: usize, leaf: u32) -> bool {
        bound.has(PARAM_CULLED) && self.of(tile, leaf).load(Ordering::Relaxed) <= bound.params.threshold
    }

    fn of(&self, tile: usize, leaf: u32) -> &AtomicU32 {
        &self.counts[tile * self.leaves + leaf as usize]
    }
}
