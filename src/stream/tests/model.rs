//! A naive model of the cache: one cell for every 16 bytes, every search by trying every address.

use crate::stream::{Item, Policy};

/// A model that behaves as the documentation of `Residency` says, or is broken in one way.
#[derive(Clone, Debug)]
pub struct Model {
    policy: Policy,
    sizes: Vec<(u64, u64)>,
    page_cells: usize,
    cells: Vec<Option<Item>>,
    head: usize,
    /// Resident items, least recently used first.
    recency: Vec<Item>,
    pinned: Vec<Item>,
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
}

/// Bytes of an item.
pub fn bytes(sizes: &[(u64, u64)], item: Item) -> u64 {
    let (geometry, attributes) = sizes[item.brick as usize];
    if item == Item::geometry(item.brick) { geometry } else { attributes }
}

impl Model {
    pub fn new(sizes: &[(u64, u64)], budget: u64, page: u64, policy: Policy, broken: Broken) -> Self {
        Self {
            policy,
            sizes: sizes.to_vec(),
            page_cells: (page / 16) as usize,
            cells: vec![None; (budget / 16) as usize],
            head: 0,
            recency: Vec::new(),
            pinned: Vec::new(),
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
    }

    /// Whether `count` cells from `start` are in one page and all `usable`.
    fn fits(&self, start: usize, count: usize, usable: impl Fn(Option<Item>) -> bool) -> bool {
        let end = start + count;
        end <= self.cells.len()
            && (self.broken == Broken::IgnoresPages || start / self.page_cells == (end - 1) / self.page_cells)
            && self.cells[start..end].iter().all(|&cell| usable(cell))
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
            Policy::RoundRobin => (self.head..all)
                .chain(0..self.head)
                .find(|&start| self.fits(start, count, |cell| !cell.is_some_and(pinned))),
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
        let mut evicted: Vec<Item> = self.cells[start..start + count].iter().filter_map(|&cell| cell).collect();
        evicted.dedup();
        for &old in &evicted {
            self.withdraw(old);
        }
        self.cells[start..start + count].fill(Some(item));
        if self.broken != Broken::HeadStays {
            self.head = start + count;
        }
        self.recency.push(item);
        Some((start as u64 * 16, evicted))
    }
}

/// A small seeded generator (SplitMix64), so that a failing schedule can be run again from its seed.
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// 0 up to and without `bound`.
    pub fn below(&mut self, bound: u64) -> u64 {
        self.next() % bound
    }
}
