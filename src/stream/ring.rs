//! Round robin: where the next write goes.

use super::item::Item;
use super::space::Space;

/// The paper's cache (CHC+RT, "Out of core"): write at the next position, wrap, evict what is overlapped.
///
/// Changed: pages are not straddled, and pinned items are skipped over instead of overwritten.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Ring {
    /// Where the next write begins; up to and including the total.
    head: u64,
}

impl Ring {
    /// Where `bytes` > 0 can be written at or after the head, within one cycle, without touching a pinned item.
    ///
    /// It is the first such address: a range that cannot begin one byte earlier begins at the head, at a page or behind a
    /// pinned item, and those are what is tried, in order.
    pub fn place(&self, space: &Space, bytes: u64, pinned: impl Fn(Item) -> bool) -> Option<u64> {
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
            match space.overlapping(start, start + bytes).rev().find(|extent| pinned(extent.item)) {
                Some(extent) => start = extent.end,
                None => return Some(start),
            }
        }
    }

    /// Moves the head behind what was written.
    pub fn advance_to(&mut self, end: u64) {
        self.head = end;
    }

    /// Where the next write begins.
    pub fn head(&self) -> u64 {
        self.head
    }
}
