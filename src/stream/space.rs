//! The address space of the cache: pages laid end to end, and the extents that are occupied.
//!
//! Addresses are u64 bytes over all pages, so that budgets beyond 4 GiB need no special case; only [`Slot`] splits them
//! into page and offset. There is no list of free gaps: gaps are what lies between extents, so the two cannot disagree.

use std::collections::BTreeMap;

use super::item::{Item, Slot};

/// Occupied bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Extent {
    /// First byte.
    pub start: u64,
    /// One past the last byte.
    pub end: u64,
    /// What lies there.
    pub item: Item,
}

/// Pages of equal size, the last one possibly shorter, with what occupies them.
#[derive(Clone, Debug)]
pub(super) struct Space {
    page_bytes: u64,
    total: u64,
    /// Start → (end, item).
    occupied: BTreeMap<u64, (u64, Item)>,
}

impl Space {
    /// `total` bytes in pages of `page_bytes` > 0, both multiples of 16.
    pub fn new(page_bytes: u64, total: u64) -> Self {
        Self { page_bytes, total, occupied: BTreeMap::new() }
    }

    /// Bytes of all pages.
    pub fn total(&self) -> u64 {
        self.total
    }

    /// Lengths of the pages in bytes.
    pub fn page_sizes(&self) -> impl ExactSizeIterator<Item = u64> + '_ {
        let pages = self.total.div_ceil(self.page_bytes) as usize;
        (0..pages).map(|page| (self.total - page as u64 * self.page_bytes).min(self.page_bytes))
    }

    /// First byte of the page that holds `address`.
    fn page_start(&self, address: u64) -> u64 {
        address - address % self.page_bytes
    }

    /// One past the last byte of the page that holds `address` < total.
    pub fn page_end(&self, address: u64) -> u64 {
        (self.page_start(address) + self.page_bytes).min(self.total)
    }

    /// `address` as page and offset. Offsets fit because pages are smaller than 4 GiB.
    pub fn slot(&self, address: u64) -> Slot {
        Slot { page: (address / self.page_bytes) as u32, offset: (address % self.page_bytes) as u32 }
    }

    /// Everything occupied, ascending.
    pub fn extents(&self) -> impl DoubleEndedIterator<Item = Extent> + '_ {
        self.occupied.iter().map(|(&start, &(end, item))| Extent { start, end, item })
    }

    /// Extents that share a byte with `start..end`, ascending.
    pub fn overlapping(&self, start: u64, end: u64) -> impl DoubleEndedIterator<Item = Extent> + '_ {
        // Extents do not overlap each other, so at most one that begins before `start` reaches into the range.
        let first = match self.occupied.range(..start).next_back() {
            Some((&before, &(before_end, _))) if before_end > start => before,
            _ => start,
        };
        self.occupied.range(first..end).map(|(&start, &(end, item))| Extent { start, end, item })
    }

    /// Occupies `start..start + bytes` by `item`; the range must be free and inside one page.
    pub fn occupy(&mut self, start: u64, bytes: u64, item: Item) {
        debug_assert!(self.overlapping(start, start + bytes).next().is_none());
        self.occupied.insert(start, (start + bytes, item));
    }

    /// Frees the extent that begins at `start`.
    pub fn free(&mut self, start: u64) {
        self.occupied.remove(&start);
    }

    /// The longest range around `extent`, within its page, made of `extent`, free bytes and extents that
    /// `counts_as_free`.
    pub fn run_around(&self, start: u64, end: u64, counts_as_free: impl Fn(Item) -> bool) -> (u64, u64) {
        let (page_start, page_end) = (self.page_start(start), self.page_end(start));
        let mut from = page_start;
        for (&_, &(before_end, item)) in self.occupied.range(page_start..start).rev() {
            if !counts_as_free(item) {
                from = before_end;
                break;
            }
        }
        let mut to = page_end;
        for (&after, &(_, item)) in self.occupied.range(end..page_end) {
            if !counts_as_free(item) {
                to = after;
                break;
            }
        }
        (from, to)
    }

    /// The lowest address with `bytes` > 0 free, not straddling a page; else the largest free range within one page.
    pub fn first_fit(&self, bytes: u64) -> Result<u64, u64> {
        let mut largest = 0;
        let mut cursor = 0;
        let ends = self.occupied.iter().map(|(&start, &(end, _))| (start, end));
        for (gap_end, next) in ends.chain([(self.total, self.total)]) {
            // A gap between two extents may reach over page borders: look at its part in each page.
            while cursor < gap_end {
                let part_end = self.page_end(cursor).min(gap_end);
                if part_end - cursor >= bytes {
                    return Ok(cursor);
                }
                largest = largest.max(part_end - cursor);
                cursor = part_end;
            }
            cursor = next;
        }
        Err(largest)
    }
}
