//! A naive model of the cache: one cell for every 16 bytes, every search by trying every address.

use crate::stream::{Item, Policy, Sizes};
use std::collections::HashMap;

/// A model that behaves as the documentation of `Residency` says, or is broken in one way.
#[derive(Clone, Debug)]
pub struct Model {
    policy: Policy,
    sizes: Sizes,
    page_cells: usize,
    cells: Vec<Option<Item>>,
    head: usize,
    /// Resident items, least recently used first.
    recency: Vec<Item>,
    pinned: Vec<Item>,
    /// Round robin: what gets a second chance.
    marked: Vec<Item>,
    /// Round robin: bytes written when an item was overwritten last.
    lost: HashMap<Item, u64>,
    written: u64,
    /// Round robin: 16 when writes that bring something back prevail.
    excess: u64,
    brought_back: u64,
    broken: Broken,
}

/// Ways to be wrong, for negative controls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Broken {
    /// Not at all.
    Not,
    /// Overwrites pinned items.
    IgnoresPins,
    /// Lets items straddle pages.
    IgnoresPages,
    /// Writes at the head without moving it.
    HeadStays,
    /// Does not note uses.
    ForgetsUses,
    /// Passes over marked items again and again.
    KeepsMarks,
    /// Moves the head whatever it brings back.
    NeverStays,
    /// Writes on where it is.
    NeverRewinds,
}

/// Bytes of an item.
pub fn bytes(sizes: &Sizes, item: Item) -> u64 {
    sizes.of(item).unwrap_or(0)
}

impl Model {
    pub fn new(sizes: &Sizes, budget: u64, page: u64, policy: Policy, broken: Broken) -> Self {
        Self {
            policy,
            sizes: sizes.clone(),
            page_cells: (page / 16) as usize,
            cells: vec![None; (budget / 16) as usize],
            head: 0,
            recency: Vec::new(),
            pinned: Vec::new(),
            marked: Vec::new(),
            lost: HashMap::new(),
            written: 0,
            excess: 0,
            brought_back: 0,
            broken,
        }
    }

    pub fn address(&self, item: Item) -> Option<u64> {
        self.cells.iter().position(|&cell| cell == Some(item)).map(|cell| cell as u64 * 16)
    }

    pub fn touch(&mut self, item: Item) {
        if self.broken != Broken::ForgetsUses && self.recency.contains(&item) {
            self.recency.retain(|&other| other != item);
            self.recency.push(item);
            self.marked.push(item);
        }
    }

    pub fn pin(&mut self, item: Item) -> bool {
        let resident = self.address(item).is_some();
        if resident && !self.pinned.contains(&item) {
            self.pinned.push(item);
        }
        resident
    }

    pub fn unpin_all(&mut self) {
        self.pinned.clear();
    }

    pub fn withdraw(&mut self, item: Item) {
        self.cells.iter_mut().filter(|cell| **cell == Some(item)).for_each(|cell| *cell = None);
        self.recency.retain(|&other| other != item);
        self.pinned.retain(|&other| other != item);
        self.marked.retain(|&other| other != item);
    }

    /// Where the next write begins, in cells.
    pub fn head(&self) -> usize {
        self.head
    }

    pub fn rewind(&mut self, head: usize) {
        if self.broken != Broken::NeverRewinds {
            self.head = head;
        }
    }

    /// Whether `count` cells from `start` are in one page and all `usable`.
    fn fits(&self, start: usize, count: usize, usable: impl Fn(Option<Item>) -> bool) -> bool {
        let end = start + count;
        end <= self.cells.len()
            && (self.broken == Broken::IgnoresPages || start / self.page_cells == (end - 1) / self.page_cells)
            && self.cells[start..end].iter().all(|&cell| usable(cell))
    }

    /// The first range at or after the head, then from the start, without an item that is `kept`.
    fn first_from_head(&self, count: usize, kept: impl Fn(Item) -> bool) -> Option<usize> {
        let mut starts = (self.head..self.cells.len()).chain(0..self.head);
        starts.find(|&start| self.fits(start, count, |cell| !cell.is_some_and(&kept)))
    }

    /// Round robin with second chances: takes marks for a write of `item` at `start` and says where the head is after
    /// it.
    fn head_after(&mut self, item: Item, start: usize, count: usize) -> usize {
        let all = self.cells.len();
        let marked = |item: Item| self.marked.contains(&item);
        let mut head = start + count;
        let brings_back = self.lost.get(&item).is_some_and(|&lost| self.written - lost < all as u64 * 16);
        self.excess = if brings_back { 16.min(self.excess + 1) } else { self.excess.saturating_sub(1) };
        if brings_back && self.excess == 16 {
            self.brought_back += 1;
            if !self.brought_back.is_multiple_of(8) && self.broken != Broken::NeverStays {
                head = start;
            }
        }
        self.written += count as u64 * 16;
        let spared = self.cells[start..start + count].iter().flatten().all(|&item| !marked(item));
        let passed: Vec<Item> = if !spared {
            self.marked.clone()
        } else if start >= self.head {
            self.cells[self.head..start].iter().flatten().copied().collect()
        } else {
            self.cells[self.head..].iter().chain(&self.cells[..start]).flatten().copied().collect()
        };
        if self.broken != Broken::KeepsMarks {
            self.marked.retain(|item| !passed.contains(item));
        }
        head
    }

    /// Address and evicted items in the order of addresses; `None` without room.
    pub fn insert(&mut self, item: Item) -> Option<(u64, Vec<Item>)> {
        if let Some(address) = self.address(item) {
            self.touch(item);
            return Some((address, Vec::new()));
        }
        let count = (bytes(&self.sizes, item) / 16) as usize;
        let all = self.cells.len();
        let pinned = |item: Item| self.broken != Broken::IgnoresPins && self.pinned.contains(&item);
        let start = match self.policy {
            Policy::RoundRobin => self.first_from_head(count, pinned),
            Policy::SecondChance => self
                .first_from_head(count, |item| pinned(item) || self.marked.contains(&item))
                .or_else(|| self.first_from_head(count, pinned)),
            Policy::Lru => {
                let mut given_up: Vec<Item> = Vec::new();
                let mut candidates = self.recency.iter().copied().filter(|&item| !pinned(item));
                loop {
                    let usable = |cell: Option<Item>| cell.is_none_or(|item| given_up.contains(&item));
                    if let Some(start) = (0..all).find(|&start| self.fits(start, count, usable)) {
                        break Some(start);
                    }
                    match candidates.next() {
                        Some(item) => given_up.push(item),
                        None => break None,
                    }
                }
            }
        }?;
        let head = match self.policy {
            Policy::SecondChance => self.head_after(item, start, count),
            _ => start + count,
        };
        let mut evicted: Vec<Item> = self.cells[start..start + count].iter().filter_map(|&cell| cell).collect();
        evicted.dedup();
        for &old in &evicted {
            self.withdraw(old);
            self.lost.insert(old, self.written);
        }
        self.cells[start..start + count].fill(Some(item));
        if self.broken != Broken::HeadStays {
            self.head = head;
        }
        self.recency.push(item);
        Some((start as u64 * 16, evicted))
    }
}
