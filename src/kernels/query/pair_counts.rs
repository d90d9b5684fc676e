//! How many rays of each tile see each leaf: what a threshold culls pairs of a tile and a leaf by.

use crate::kernels::bound::Bound;
use crate::kernels::layout::PARAM_CULLED;
use crate::kernels::report::too_many_pairs;
use crate::schedule::ExecutorError;
use std::sync::atomic::{AtomicU32, Ordering};

/// Most pairs that are counted: 1 GiB.
const MOST_PAIRS: u64 = 1 << 28;

/// Counts by tile, then leaf.
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
