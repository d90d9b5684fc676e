//! Least recently used: the order of use, and where the next write goes.

use super::item::Item;
use super::space::Space;

/// End of the list.
const END: u32 = u32::MAX;

/// Items in the order of their last use: a doubly linked list through two tables, so that a use costs no allocation.
#[derive(Clone, Debug)]
pub(super) struct Recency {
    /// Per item: the one used just before it. One more row, the last, closes the circle: its `after` is the oldest.
    before: Vec<u32>,
    /// Per item: the one used just after it.
    after: Vec<u32>,
}

impl Recency {
    /// An empty list over `items` items.
    pub fn new(items: usize) -> Self {
        let mut list = Self { before: vec![END; items + 1], after: vec![END; items + 1] };
        list.before[items] = items as u32;
        list.after[items] = items as u32;
        list
    }

    /// The row that closes the circle.
    fn anchor(&self) -> usize {
        self.before.len() - 1
    }

    /// Whether `item` is in the list.
    pub fn contains(&self, item: Item) -> bool {
        self.after[item.index()] != END
    }

    /// Makes `item` the most recently used, adding it if it is not in the list.
    pub fn touch(&mut self, item: Item) {
        self.remove(item);
        let (row, anchor) = (item.index(), self.anchor());
        let newest = self.before[anchor] as usize;
        self.after[newest] = row as u32;
        self.before[row] = newest as u32;
        self.after[row] = anchor as u32;
        self.before[anchor] = row as u32;
    }

    /// Takes `item` out of the list, if it is in it.
    pub fn remove(&mut self, item: Item) {
        if !self.contains(item) {
            return;
        }
        let row = item.index();
        let (before, after) = (self.before[row], self.after[row]);
        self.after[before as usize] = after;
        self.before[after as usize] = before;
        self.before[row] = END;
        self.after[row] = END;
    }

    /// The items, least recently used first.
    pub fn oldest_first(&self) -> impl Iterator<Item = Item> + '_ {
        let anchor = self.anchor();
        let mut row = self.after[anchor] as usize;
        std::iter::from_fn(move || {
            let item = if row == anchor { None } else { Item::from_index(row) };
            row = self.after[row] as usize;
            item
        })
    }
}

/// LRU placement.
///
/// First fit where there is room. Else items are given up, least recently used first, until those given up and the free
/// bytes between them make a large enough range; of the items given up only those in that range are overwritten, so the
/// most recently used victim is as old as it can be and nothing is evicted in vain.
#[derive(Clone, Debug)]
pub(super) struct Lru {
    /// Order of use of everything resident.
    pub recency: Recency,
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
        Self { recency: Recency::new(items), gap_bound, given_up: vec![0; items], search: 0 }
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
        for item in self.recency.oldest_first() {
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
        self.recency.remove(item);
        let (from, to) = space.run_around(start, end, |_| false);
        self.gap_bound = self.gap_bound.max(to - from);
    }
}
