//! Which items are on the device and where: a pure, deterministic state machine without threads, clocks or a device.

use super::item::{Item, Kind, Slot};
use super::lru::Lru;
use super::ring::Ring;
use super::sizes::Sizes;
use super::space::Space;
use crate::settings::Policy;
use bricks::planted::{self, Defect};

/// Alignment in bytes of sizes, offsets and the budget.
const ALIGN: u64 = 16;

/// [`Residency::place`]: not resident.
const NOWHERE: u64 = u64::MAX;

/// The cache cannot be made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ResidencyError {
    /// The budget does not hold the two largest bricks, or the tiles of a texture lookup.
    #[error(
        "a cache of {given} bytes is too small: {what} need {needed} bytes; give it at least that, or convert the \
         scene with smaller bricks"
    )]
    CacheTooSmall {
        /// What needs so much: "the two largest bricks" or "the tiles of a texture lookup".
        what: &'static str,
        /// Least budget in bytes.
        needed: u64,
        /// The budget in bytes, rounded down to 16.
        given: u64,
    },
    /// A page does not hold the largest item.
    #[error(
        "{item} has {needed} bytes, more than a page of the cache ({given} bytes, at most one storage binding); \
         convert the scene with smaller bricks"
    )]
    PageTooSmall {
        /// The largest item.
        item: Item,
        /// Its bytes.
        needed: u64,
        /// Bytes of a page, rounded down to 16.
        given: u64,
    },
    /// The budget makes more pages, or the scene has more bricks or tiles, than 32 bits count.
    #[error("{count} {what} are more than the cache can count")]
    TooMany {
        /// How many.
        count: u64,
        /// What: "pages", or "bricks or tiles".
        what: &'static str,
    },
    /// An item's size is not a multiple of 16.
    #[error("{item} has {bytes} bytes, which is not a multiple of 16")]
    Unaligned {
        /// The item.
        item: Item,
        /// Its bytes.
        bytes: u64,
    },
}

/// Pinned items leave no place for an item. Nothing was changed.
///
/// Finish what is pinned, [`Residency::unpin_all`], insert again: with nothing pinned every item finds a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no place for {item} ({bytes} bytes) beside what is pinned")]
pub struct NoRoom {
    /// The item.
    pub item: Item,
    /// Its bytes.
    pub bytes: u64,
}

/// Where an item was placed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Placed {
    /// Its place.
    pub slot: Slot,
    /// What is no longer resident because of it, in the order of addresses; never pinned. Usually none to three.
    pub evicted: Vec<Item>,
}

/// What happened to the items of one kind since the cache was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct KindCounters {
    /// Items inserted.
    pub loaded: u64,
    /// Of those, items that had been inserted before within the same pass ([`Residency::begin_pass`]).
    pub reloaded: u64,
    /// Items evicted.
    pub evicted: u64,
    /// Bytes of the items inserted.
    pub loaded_bytes: u64,
    /// Bytes of the items evicted.
    pub evicted_bytes: u64,
}

impl KindCounters {
    fn zip(&self, other: &Self, f: impl Fn(u64, u64) -> u64) -> Self {
        Self {
            loaded: f(self.loaded, other.loaded),
            reloaded: f(self.reloaded, other.reloaded),
            evicted: f(self.evicted, other.evicted),
            loaded_bytes: f(self.loaded_bytes, other.loaded_bytes),
            evicted_bytes: f(self.evicted_bytes, other.evicted_bytes),
        }
    }
}

/// What happened since the cache was made, by kind: resident = loaded − evicted, in items and in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters(pub(super) [KindCounters; Kind::ALL.len()]);

impl Counters {
    /// Of one kind.
    pub fn kind(&self, kind: Kind) -> &KindCounters {
        &self.0[kind as usize]
    }

    /// Of all kinds together.
    pub fn total(&self) -> KindCounters {
        self.0.iter().fold(KindCounters::default(), |sum, own| sum.zip(own, |a, b| a + b))
    }

    /// What happened between `earlier` and `self`, both read from one cache in this order.
    pub fn since(&self, earlier: &Self) -> Self {
        Self(Kind::ALL.map(|kind| self.kind(kind).zip(earlier.kind(kind), u64::saturating_sub)))
    }
}

/// Where the next write goes, per policy.
#[derive(Clone, Debug)]
pub(super) enum Placement {
    RoundRobin(Ring),
    Lru(Lru),
}

/// The device cache: a budget in bytes, cut into pages, with items in slots.
///
/// Pages are `page_bytes` long, the last one shorter, and together exactly the budget rounded down to 16. An item never
/// straddles a page. Items of zero bytes are always resident, take no room and are not counted.
#[derive(Clone, Debug)]
pub struct Residency {
    pub(super) space: Space,
    pub(super) placement: Placement,
    /// Per item: its bytes.
    bytes: Vec<u64>,
    /// Per item: its address, or [`NOWHERE`].
    pub(super) place: Vec<u64>,
    /// Per item: whether it is pinned. Only resident items are.
    pub(super) is_pinned: Vec<bool>,
    /// The pinned items, unordered.
    pub(super) pinned: Vec<Item>,
    /// Per item: the pass that inserted it last, and how often that pass did.
    inserted: Vec<(u32, u32)>,
    pass: u32,
    /// Per item: the filling that used it last.
    used_in: Vec<u64>,
    filling: u64,
    /// The filling that the pass began with.
    first_filling: u64,
    pub(super) used_bytes: u64,
    pub(super) counters: Counters,
}

impl Residency {
    /// An empty cache for bricks and tiles of `sizes` (multiples of 16).
    ///
    /// # Errors
    /// [`ResidencyError::CacheTooSmall`] below [`Self::least_budget`]; [`ResidencyError::PageTooSmall`] when the first
    /// page (`page_bytes`, or the budget if that is less) does not hold the largest item.
    pub fn new(
        sizes: impl Into<Sizes>,
        budget_bytes: u64,
        page_bytes: u64,
        policy: Policy,
    ) -> Result<Self, ResidencyError> {
        let sizes: Sizes = sizes.into();
        // Item tables are indexed by u32, with one row to spare.
        if sizes.rows() as u64 >= u32::MAX as u64 {
            let count = sizes.rows() as u64 / Kind::ALL.len() as u64;
            return Err(ResidencyError::TooMany { count, what: "bricks or tiles" });
        }
        let mut bytes = vec![0; sizes.rows()];
        sizes.items().for_each(|(item, size)| bytes[item.index()] = size);
        let items = || sizes.items();
        if let Some((item, bytes)) = items().find(|(_, bytes)| bytes % ALIGN != 0) {
            return Err(ResidencyError::Unaligned { item, bytes });
        }
        let budget = round_down(budget_bytes);
        let needed = Self::least_budget(&sizes);
        if needed > budget {
            let bricks = sizes.two_largest_bricks() == needed;
            let what = if bricks { "the two largest bricks" } else { "the tiles of a texture lookup" };
            return Err(ResidencyError::CacheTooSmall { what, needed, given: budget });
        }
        // Offsets are u32. A page of nothing would make no progress.
        let page_bytes = round_down(page_bytes.min(u32::MAX as u64)).max(ALIGN);
        if let Some((item, needed)) = items().find(|&(_, bytes)| bytes > page_bytes) {
            let (item, needed) = items().fold((item, needed), |most, next| if next.1 > most.1 { next } else { most });
            return Err(ResidencyError::PageTooSmall { item, needed, given: page_bytes });
        }
        let pages = budget.div_ceil(page_bytes);
        if pages > u32::MAX as u64 {
            return Err(ResidencyError::TooMany { count: pages, what: "pages" });
        }
        let space = Space::new(page_bytes, budget);
        let count = bytes.len();
        let placement = match policy {
            Policy::SecondChance => Placement::RoundRobin(Ring::with_chances(count)),
            Policy::RoundRobin => Placement::RoundRobin(Ring::plain()),
            Policy::Lru => Placement::Lru(Lru::new(count, &space)),
        };
        Ok(Self {
            space,
            placement,
            bytes,
            place: vec![NOWHERE; count],
            is_pinned: vec![false; count],
            pinned: Vec::new(),
            inserted: vec![(0, 0); count],
            pass: 0,
            used_in: vec![0; count],
            filling: 1,
            first_filling: 1,
            used_bytes: 0,
            counters: Counters::default(),
        })
    }

    /// The least budget in bytes: the two largest bricks, geometry and attributes, or, if that is more, what the tiles
    /// of a texture lookup take ([`Sizes::tiles_of_a_lookup`]). Saturates.
    pub fn least_budget(sizes: impl Into<Sizes>) -> u64 {
        let sizes: Sizes = sizes.into();
        sizes.two_largest_bricks().max(sizes.tiles_of_a_lookup())
    }

    /// A budget in bytes at which everything fits at once in pages of `page_bytes`: the sum of all items, plus what can
    /// be left over at the ends of pages. Saturates.
    pub fn budget_for_all(sizes: impl Into<Sizes>, page_bytes: u64) -> u64 {
        let sizes: Sizes = sizes.into();
        let page_bytes = round_down(page_bytes.min(u32::MAX as u64)).max(ALIGN);
        let sum = sizes.sum().max(Self::least_budget(&sizes));
        if sum <= page_bytes {
            return sum;
        }
        let largest = sizes.largest();
        // A page is left for the next one when the next item does not fit: it is filled but for less than that item.
        let filled = page_bytes.saturating_sub(largest.saturating_sub(ALIGN)).max(ALIGN);
        sum.div_ceil(filled).saturating_mul(page_bytes)
    }

    /// Lengths of the pages in bytes; their sum is [`Self::budget_bytes`].
    pub fn page_sizes(&self) -> impl ExactSizeIterator<Item = u64> + '_ {
        self.space.page_sizes()
    }

    /// The budget in bytes, rounded down to 16.
    pub fn budget_bytes(&self) -> u64 {
        self.space.total()
    }

    /// Bytes of all resident items.
    pub fn used_bytes(&self) -> u64 {
        self.used_bytes
    }

    /// The policy.
    pub fn policy(&self) -> Policy {
        match &self.placement {
            Placement::RoundRobin(ring) if ring.has_chances() => Policy::SecondChance,
            Placement::RoundRobin(_) => Policy::RoundRobin,
            Placement::Lru(_) => Policy::Lru,
        }
    }

    /// Bytes of `item`. There must be a brick or tile of its number, here and in every other method.
    pub fn bytes(&self, item: Item) -> u64 {
        self.bytes[item.index()]
    }

    /// What happened so far.
    pub fn counters(&self) -> Counters {
        self.counters
    }

    /// Begins a pass: the scope within which a second insertion of an item counts as reloaded.
    pub fn begin_pass(&mut self) {
        if self.pass == u32::MAX {
            self.inserted.fill((0, 0));
            self.pass = 0;
        }
        self.pass += 1;
        self.filling += 1;
        self.first_filling = self.filling;
    }

    /// How many fillings of the cache the pass has taken so far. A filling ends, and the next begins, when an insertion
    /// evicts what the same filling inserted or touched: 1 where all that a pass uses fits at once. What the fillings
    /// of a pass use has at most as many bytes as so many caches.
    pub fn fillings(&self) -> u64 {
        self.filling - self.first_filling + 1
    }

    /// Where `item` lies, if it is resident. Does not count as a use.
    pub fn slot(&self, item: Item) -> Option<Slot> {
        if self.bytes(item) == 0 {
            return Some(Slot { page: 0, offset: 0 });
        }
        match self.place[item.index()] {
            NOWHERE => None,
            address => Some(self.space.slot(address)),
        }
    }

    /// Everything resident that takes room, in the order of addresses.
    pub fn resident(&self) -> impl Iterator<Item = (Item, Slot)> + '_ {
        self.space.extents().map(|extent| (extent.item, self.space.slot(extent.start)))
    }

    /// Notes a use of `item`, if it is resident: under LRU it becomes the most recently used, with second chances it is
    /// marked.
    pub fn touch(&mut self, item: Item) {
        if self.place[item.index()] == NOWHERE {
            return;
        }
        self.used_in[item.index()] = self.filling;
        match &mut self.placement {
            Placement::RoundRobin(ring) => ring.touch(item),
            Placement::Lru(lru) => lru.touch(item),
        }
    }

    /// Keeps `item` from being evicted until [`Self::unpin_all`]. Returns whether it is resident; else nothing happens.
    pub fn pin(&mut self, item: Item) -> bool {
        if self.bytes(item) == 0 {
            return true;
        }
        if self.place[item.index()] == NOWHERE {
            return false;
        }
        if !self.is_pinned[item.index()] {
            self.is_pinned[item.index()] = true;
            self.pinned.push(item);
        }
        true
    }

    /// Whether `item` is pinned.
    pub fn is_pinned(&self, item: Item) -> bool {
        self.is_pinned[item.index()]
    }

    /// Lets everything be evicted again.
    pub fn unpin_all(&mut self) {
        for item in self.pinned.drain(..) {
            self.is_pinned[item.index()] = false;
        }
    }

    /// Makes `item` resident, evicting what is in the way, and notes a use. It is not pinned by this. An item that is
    /// resident stays where it is.
    ///
    /// With nothing pinned this always succeeds. A batch that wants several items at once pins each as it is placed.
    ///
    /// # Errors
    /// [`NoRoom`] when pinned items leave no place; nothing has changed then.
    pub fn insert(&mut self, item: Item) -> Result<Placed, NoRoom> {
        if let Some(slot) = self.slot(item) {
            self.touch(item);
            return Ok(Placed { slot, evicted: Vec::new() });
        }
        let bytes = self.bytes(item);
        let is_pinned = |item: Item| self.is_pinned[item.index()] && !planted::is(Defect::Pin);
        let start = match &mut self.placement {
            Placement::RoundRobin(ring) => ring.place(&self.space, bytes, is_pinned),
            Placement::Lru(lru) => lru.place(&self.space, bytes, is_pinned, |item| {
                let start = self.place[item.index()];
                (start, start + self.bytes[item.index()])
            }),
        };
        let start = start.ok_or(NoRoom { item, bytes })?;
        let evicted: Vec<Item> = self.space.overlapping(start, start + bytes).map(|extent| extent.item).collect();
        if let Placement::RoundRobin(ring) = &mut self.placement {
            ring.write(&self.space, item, start, bytes);
        }
        self.filling += u64::from(evicted.iter().any(|old| self.used_in[old.index()] == self.filling));
        self.used_in[item.index()] = self.filling;
        for &old in &evicted {
            self.release(old, true);
            let old_bytes = self.bytes(old);
            let counters = &mut self.counters.0[old.kind as usize];
            counters.evicted += 1;
            counters.evicted_bytes += old_bytes;
        }
        self.space.occupy(start, bytes, item);
        self.place[item.index()] = start;
        self.used_bytes += bytes;
        if let Placement::Lru(lru) = &mut self.placement {
            lru.touch(item);
        }
        let (pass, times) = &mut self.inserted[item.index()];
        if *pass != self.pass {
            (*pass, *times) = (self.pass, 0);
        }
        *times += 1;
        let counters = &mut self.counters.0[item.kind as usize];
        counters.loaded += 1;
        counters.loaded_bytes += bytes;
        counters.reloaded += u64::from(*times > 1);
        Ok(Placed { slot: self.space.slot(start), evicted })
    }

    /// Takes back the insertion of `item` in this pass, because its bytes did not arrive: it is not resident, not
    /// pinned, and not counted as loaded. What it evicted stays evicted. Returns whether it was resident.
    pub fn withdraw(&mut self, item: Item) -> bool {
        if self.bytes(item) == 0 || self.place[item.index()] == NOWHERE {
            return false;
        }
        self.release(item, false);
        let bytes = self.bytes(item);
        let (pass, times) = &mut self.inserted[item.index()];
        let counters = &mut self.counters.0[item.kind as usize];
        counters.loaded -= 1;
        counters.loaded_bytes -= bytes;
        if *pass == self.pass && *times > 0 {
            counters.reloaded -= u64::from(*times > 1);
            *times -= 1;
        }
        true
    }

    /// Where round robin writes next, for [`Self::rewind`]; 0 for LRU.
    pub fn head(&self) -> u64 {
        match &self.placement {
            Placement::RoundRobin(ring) => ring.head(),
            Placement::Lru(_) => 0,
        }
    }

    /// Has round robin write next where it would have when [`Self::head`] gave `head`. After a batch has been withdrawn
    /// its room is written first then. A cache that holds everything evicts nothing only as long as it writes without
    /// gaps.
    pub fn rewind(&mut self, head: u64) {
        if let Placement::RoundRobin(ring) = &mut self.placement {
            ring.rewind(head);
        }
    }

    /// Frees the room of a resident item and whatever was noted of it, but for the counters. `is_overwritten`: for
    /// another.
    fn release(&mut self, item: Item, is_overwritten: bool) {
        let (start, bytes) = (self.place[item.index()], self.bytes(item));
        self.space.free(start);
        self.place[item.index()] = NOWHERE;
        self.used_bytes -= bytes;
        if std::mem::take(&mut self.is_pinned[item.index()]) {
            self.pinned.retain(|&pinned| pinned != item);
        }
        match &mut self.placement {
            Placement::RoundRobin(ring) => ring.freed(item, is_overwritten),
            Placement::Lru(lru) => lru.freed(&self.space, item, start, start + bytes),
        }
    }

    /// Checks every invariant; for tests. The error names the first that does not hold.
    pub fn validate(&self) -> Result<(), String> {
        let check = |holds: bool, what: &dyn Fn() -> String| if holds { Ok(()) } else { Err(what()) };
        let mut used = 0;
        let mut last_end = 0;
        let mut residents = 0;
        let mut by_kind = [(0u64, 0u64); Kind::ALL.len()];
        for extent in self.space.extents() {
            let (start, end, item) = (extent.start, extent.end, extent.item);
            check(start >= last_end, &|| format!("{item} at {start} overlaps what ends at {last_end}"))?;
            check(start < end && end <= self.space.total(), &|| format!("{item} at {start}..{end} is out of bounds"))?;
            check(end <= self.space.page_end(start), &|| format!("{item} at {start}..{end} straddles a page"))?;
            check(start % ALIGN == 0, &|| format!("{item} at {start} is not aligned"))?;
            check(end - start == self.bytes(item), &|| format!("{item} at {start}..{end} has the wrong length"))?;
            check(self.place[item.index()] == start, &|| format!("{item} is noted at another place than {start}"))?;
            last_end = end;
            used += end - start;
            residents += 1;
            let kind = &mut by_kind[item.kind as usize];
            *kind = (kind.0 + 1, kind.1 + end - start);
        }
        let placed = self.place.iter().filter(|&&place| place != NOWHERE).count();
        check(placed == residents, &|| format!("{placed} items have a place, {residents} places an item"))?;
        check(used == self.used_bytes, &|| format!("{used} bytes are used, {} are noted", self.used_bytes))?;
        let pages: u64 = self.page_sizes().sum();
        check(pages == self.budget_bytes(), &|| format!("pages of {pages} bytes for {}", self.budget_bytes()))?;
        for kind in Kind::ALL {
            let c = self.counters.kind(kind);
            let found = by_kind[kind as usize];
            let counted = (c.loaded.wrapping_sub(c.evicted), c.loaded_bytes.wrapping_sub(c.evicted_bytes));
            check(found == counted, &|| format!("{kind:?}: {found:?} resident, {counted:?} loaded − evicted"))?;
            check(c.reloaded <= c.loaded, &|| format!("{kind:?}: more reloaded than loaded"))?;
        }
        let flags = self.is_pinned.iter().filter(|&&pinned| pinned).count();
        check(flags == self.pinned.len(), &|| format!("{flags} items pinned, {} listed", self.pinned.len()))?;
        for &item in &self.pinned {
            check(self.is_pinned(item), &|| format!("{item} is listed as pinned and is not"))?;
            check(self.place[item.index()] != NOWHERE, &|| format!("{item} is pinned and not resident"))?;
        }
        match &self.placement {
            Placement::RoundRobin(ring) => {
                let head = ring.head();
                check(head <= self.space.total() && head % ALIGN == 0, &|| format!("the head is at {head}"))?;
                for item in (0..self.place.len()).filter_map(Item::from_index).filter(|&item| ring.is_marked(item)) {
                    check(self.place[item.index()] != NOWHERE, &|| format!("{item} is marked and not resident"))?;
                }
            }
            Placement::Lru(lru) => {
                let mut listed = 0;
                for item in lru.oldest_first().take(residents + 1) {
                    listed += 1;
                    check(self.place[item.index()] != NOWHERE, &|| format!("{item} has a use and is not resident"))?;
                }
                check(listed == residents, &|| format!("{listed} items have a use, {residents} are resident"))?;
                let largest = self.space.first_fit(u64::MAX).err().unwrap_or(u64::MAX);
                let bound = lru.gap_bound;
                check(largest <= bound, &|| format!("{largest} bytes are free in a row, the bound says {bound}"))?;
            }
        }
        Ok(())
    }
}

/// Down to the alignment.
fn round_down(bytes: u64) -> u64 {
    bytes - bytes % ALIGN
}
