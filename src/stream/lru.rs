//! Least recently used: the order of use, and where the next write goes.

use super::item::Item;
use super::space::Space;
use lru::LruCache;

/// LRU placement.
///
/// First fit where there is room. Else items are given up, least recently used first, until those given up and the free
/// bytes between them make a large enough range; of the items given up only those in that range are overwritten, so the
/// most recently used victim is as old as it can be and nothing is evicted in vain.
#[derive(Clone, Debug)]
pub(super) struct Lru {
    /// Everything resident, in the order of use.
    pub recency: LruCache<Item, ()>,
    /// No free range within a page is longer than this.
    pub gap_bound: u64,
    /// Per item: the search that gave it up last.
    given_up: Vec<u32>,
    search: u32,
}

impl Lru {
    /// For an empty `space` and `items` items.
    pub fn new(items: usize, space: &Space) -> Self {
        let gap_bound = space.page_sizes().next().unwrap_or(0);
        Self { recency: LruCache::unbounded(), gap_bound, given_up: vec![0; items], search: 0 }
    }

    /// Notes a use of `item`, which is resident.
    pub fn touch(&mut self, item: Item) {
        self.recency.put(item, ());
    }

    /// Everything resident, least recently used first.
    pub fn oldest_first(&self) -> impl Iterator<Item = Item> + '_ {
        self.recency.iter().rev().map(|(&item, ())| item)
    }

    /// Where `bytes` > 0 can be written without touching a pinned item. `address` tells where a resident item lies.
    pub fn place(
        &mut self,
        space: &Space,
        bytes: u64,
        pinned: impl Fn(Item) -> bool,
        extent: impl Fn(Item) -> (u64, u64),
    ) -> Option<u64> {
        if bytes <= self.gap_bound {
            match space.first_fit(bytes) {
                Ok(start) => return Some(start),
                Err(largest) => self.gap_bound = largest,
            }
        }
        if self.search == u32::MAX {
            self.given_up.fill(0);
            self.search = 0;
        }
        self.search += 1;
        for (&item, ()) in self.recency.iter().rev() {
            if pinned(item) {
                continue;
            }
            self.given_up[item.index()] = self.search;
            let (start, end) = extent(item);
            // Before this item no range was large enough, so each walk passes less than `bytes` on either side.
            let (from, to) = space.run_around(start, end, |near| self.given_up[near.index()] == self.search);
            if to - from >= bytes {
                return Some(from);
            }
        }
        None
    }

    /// Notes that `item`, which lay at `start..end`, was freed in `space`.
    pub fn freed(&mut self, space: &Space, item: Item, start: u64, end: u64) {
        self.recency.pop(&item);
        let (from, to) = space.run_around(start, end, |_| false);
        self.gap_bound = self.gap_bound.max(to - from);
    }
}
