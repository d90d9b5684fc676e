//! Round robin: where the next write goes.

use super::item::Item;
use super::space::Space;

/// So many more writes that brought back what was lost within a lap than others, of late, say that a cycle does not
/// fit.
const THRASHING: u32 = 16;
/// While a cycle does not fit, the head moves on after one write in so many that bring something back.
const MOVE_ON: u64 = 8;
/// [`Chances::lost_at`]: never overwritten.
const NEVER: u64 = u64::MAX;

/// The paper's cache (CHC+RT, "Out of core"): write at the next position, wrap, evict what is overlapped.
///
/// Changed: pages are not straddled, pinned items are skipped over instead of overwritten, and with [`Chances`] items
/// that were used are, too.
#[derive(Clone, Debug, Default)]
pub(super) struct Ring {
    /// Where the next write begins; up to and including the total.
    head: u64,
    chances: Option<Chances>,
}

/// What round robin with second chances knows.
///
/// *Second chances* (as in the page replacement "clock"): an item that was used after it was written is marked, and a
/// write passes over what is marked, which loses its mark thereby. Where everything is marked the marks do not count.
///
/// *A cycle that does not fit*: requests that go round through a little more than the cache holds find, by round robin
/// or LRU, nothing of it. It shows in writes that bring back what was overwritten less than a lap (the cache's bytes
/// written) ago. While they prevail, the head stays after most of them, so that the next write replaces this one and
/// the rest of the cache, most of the cycle, is left alone (as bimodal insertion does for LRU: Qureshi et al. 2007,
/// "Adaptive insertion policies for high performance caching").
#[derive(Clone, Debug)]
struct Chances {
    /// Per item: whether it was used since it was written or passed over.
    marked: Vec<bool>,
    /// Per item: [`Self::written`] when it was overwritten last, or [`NEVER`].
    lost_at: Vec<u64>,
    /// Bytes written so far.
    written: u64,
    /// Writes of late that brought something back, less the others; 0 to [`THRASHING`].
    excess: u32,
    /// Writes that brought something back while they prevailed.
    stays: u64,
}

impl Ring {
    /// The paper's.
    pub fn plain() -> Self {
        Self::default()
    }

    /// With second chances, for `items` items.
    pub fn with_chances(items: usize) -> Self {
        let chances =
            Chances { marked: vec![false; items], lost_at: vec![NEVER; items], written: 0, excess: 0, stays: 0 };
        Self { head: 0, chances: Some(chances) }
    }

    /// Whether used items get second chances.
    pub fn has_chances(&self) -> bool {
        self.chances.is_some()
    }

    /// Whether `item` would be passed over.
    pub fn is_marked(&self, item: Item) -> bool {
        self.chances.as_ref().is_some_and(|chances| chances.marked[item.index()])
    }

    /// Notes a use of `item`, which is resident.
    pub fn touch(&mut self, item: Item) {
        if let Some(chances) = &mut self.chances {
            chances.marked[item.index()] = true;
        }
    }

    /// Notes that `item` is no longer resident; `is_overwritten`: because of a write.
    pub fn freed(&mut self, item: Item, is_overwritten: bool) {
        if let Some(chances) = &mut self.chances {
            chances.marked[item.index()] = false;
            if is_overwritten {
                chances.lost_at[item.index()] = chances.written;
            }
        }
    }

    /// Where `bytes` > 0 are to be written, without touching a pinned item: at or after the head, within one cycle, at
    /// the first address without a marked item if there is one, else at the first.
    pub fn place(&self, space: &Space, bytes: u64, pinned: impl Fn(Item) -> bool) -> Option<u64> {
        self.first_without(space, bytes, |item| pinned(item) || self.is_marked(item))
            .or_else(|| self.first_without(space, bytes, pinned))
    }

    /// The first address at or after the head, within one cycle, with `bytes` in one page that hold nothing to be
    /// `kept`.
    ///
    /// A range that cannot begin one byte earlier begins at the head, at a page or behind an item that is kept, and
    /// those are what is tried, in order.
    fn first_without(&self, space: &Space, bytes: u64, kept: impl Fn(Item) -> bool) -> Option<u64> {
        let mut wrapped = false;
        let mut start = self.head;
        loop {
            if start >= space.total() && !wrapped {
                wrapped = true;
                start = 0;
            }
            if start >= space.total() || (wrapped && start >= self.head) {
                return None;
            }
            let page_end = space.page_end(start);
            if bytes > page_end - start {
                start = page_end;
                continue;
            }
            match space.overlapping(start, start + bytes).rev().find(|extent| kept(extent.item)) {
                Some(extent) => start = extent.end,
                None => return Some(start),
            }
        }
    }

    /// Notes that `item` is written at `start`, where [`Self::place`] said, before anything is freed or occupied for
    /// it: moves the head, and takes the marks of what was passed over.
    pub fn write(&mut self, space: &Space, item: Item, start: u64, bytes: u64) {
        let end = start + bytes;
        let head = std::mem::replace(&mut self.head, end);
        let Some(chances) = &mut self.chances else { return };
        if chances.stay(item, space.total()) {
            self.head = start;
        }
        chances.written += bytes;
        let is_free = |item: Item| !chances.marked[item.index()];
        let all = !space.overlapping(start, end).all(|extent| is_free(extent.item));
        let passed = match (all, start >= head) {
            (true, _) => [(0, space.total()), (0, 0)],
            (false, true) => [(head, start), (0, 0)],
            (false, false) => [(head, space.total()), (0, start)],
        };
        for (from, to) in passed.into_iter().filter(|(from, to)| from < to) {
            for extent in space.overlapping(from, to) {
                chances.marked[extent.item.index()] = false;
            }
        }
    }

    /// Where the next write begins.
    pub fn head(&self) -> u64 {
        self.head
    }

    /// Has the next write begin at `head`, as [`Self::head`] gave it.
    pub fn rewind(&mut self, head: u64) {
        self.head = head;
    }
}

impl Chances {
    /// Whether the next write is to replace that of `item`, which is about to be made. Within a batch it does not, as
    /// what is loaded together is pinned.
    fn stay(&mut self, item: Item, lap: u64) -> bool {
        let lost_at = self.lost_at[item.index()];
        if lost_at == NEVER || self.written - lost_at >= lap {
            self.excess = self.excess.saturating_sub(1);
            return false;
        }
        self.excess = (self.excess + 1).min(THRASHING);
        if self.excess < THRASHING {
            return false;
        }
        self.stays += 1;
        !self.stays.is_multiple_of(MOVE_ON)
    }
}
