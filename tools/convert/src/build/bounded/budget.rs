//! Divides the memory of a conversion.
//!
//! Of `--memory` the *reserve* and the *tables* are set aside; the phases follow each other, and each divides the rest:
//!
//! | phase | what it holds |
//! | --- | --- |
//! | collecting | per thread a part of the source and the items of a run of triangles; then items of objects that fit |
//! | partition | the items of a node that fits with their order; or per thread a block of items and its two sides |
//! | distribution | per thread a part of the source and triangles not yet appended; the bricks of a window of slots |
//! | encoding | two chunks of triangles, one being read; per thread a brick, its occupancy, two batches of payloads |
//! | levels | per thread the children of a level and what it is made in, two batches of payloads |
//!
//! A source that lies in memory is not counted, nor is a single image while its texture is made.

use super::external::PackedItem;
use crate::build::cut::partition::{CANONICAL_TRIANGLES, Item};
use crate::build::disk::journal::{WordReader, Words};
use crate::build::disk::shard::BLOCK_RECORDS;
use crate::build::error::BuildError;
use crate::build::input::objects::Plan;
use crate::build::settings::BuildSettings;
use crate::build::triangles::triangle::{Detailed, Plain};
use crate::source::{PART_TRIANGLES, Source};
use bricks::{LEVEL_CHILDREN, Material};

/// The program, its stacks, and what the allocator does not give back.
const RESERVE: u64 = 32 << 20;

/// A brick in the tables: its record and occupancy, its leaf, its nodes of both top-level trees and what builds them.
const TABLE_BRICK_BYTES: u64 = 3 << 9;

/// A triangle of a part at most: its indices and three vertices with all attributes but details.
const PART_TRIANGLE_BYTES: u64 = 3 * (4 + 24 + 12 + 8 + 16);

/// What details add to that: second coordinates and tangents.
const PART_DETAIL_BYTES: u64 = 3 * (8 + 16);

/// A triangle of a part while its tangents are made.
const TANGENT_WORK_BYTES: u64 = 512;

/// An item in memory, with its place in the order as it is cut and as it is joined.
const ITEM_BYTES: u64 = size_of::<Item>() as u64 + 8 + 8;

/// A block of items with its two sides, packed and not.
const BLOCK_BYTES: u64 = (BLOCK_RECORDS * 2 * (size_of::<Item>() + size_of::<PackedItem>())) as u64;

/// A triangle of a brick in work: its vertices, hash tables, the trees over it.
const WORK_BYTES: u64 = 1280;

/// A triangle of the children of a level in work: its payloads, vertices, clusters, colours and distances.
const LEVEL_WORK_BYTES: u64 = 768;

/// What details add to that, and to a triangle of encoded payloads.
const DETAIL_WORK_BYTES: u64 = 256;
const DETAIL_PAYLOAD_BYTES: u64 = 48;

/// What the place of a triangle of a chunk in the order of bricks takes.
const PLACE_BYTES: u64 = 16;

/// A triangle of encoded payloads but for proxies.
const PAYLOAD_BYTES: u64 = 80;

/// Occupancy of a brick in work: cells, levels, and what packs them.
const OCCUPANCY_WORK_BYTES: u64 = 4 * MAP_BYTES;

/// An occupancy map that packing does not shorten.
const MAP_BYTES: u64 = bricks::OCCUPANCY_BYTES as u64;

/// Triangles of a chunk beyond which larger ones are no faster.
const MOST_CHUNK: u64 = 1 << 21;

/// Slots of a window beyond which larger ones are no faster; a conversion that is continued repeats at most one window.
const MOST_WINDOW: u64 = 1 << 24;

/// Items of a node that is cut in memory, and triangles of a chunk, where many processes share the work.
const MOST_SHARED_ITEMS: u64 = 1 << 22;
const MOST_SHARED_CHUNK: u64 = 1 << 19;

/// Triangles a thread encodes before they are written, where there is room.
const MOST_BATCH: u64 = 1 << 18;

/// Triangles a thread collects before it appends them to their chunks, where there is room.
const MOST_PENDING: u64 = 1 << 16;

/// How a conversion uses its memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Budget {
    /// Threads that there is room for.
    pub threads: usize,
    /// Items that are cut in memory.
    pub items: u64,
    /// Slots whose triangles are distributed in one pass.
    pub window: u64,
    /// Triangles a thread collects before it appends them to their chunks.
    pub pending: usize,
    /// Triangles of a chunk.
    pub chunk: u64,
    /// Triangles a thread encodes before they are written.
    pub batch: usize,
}

/// What dividing needs to know.
struct Needs {
    brick: u64,
    part: u64,
    run: u64,
    tables: u64,
    /// A brick in work.
    work: u64,
    /// A level in work; 0 without levels.
    level: u64,
    /// A triangle of encoded payloads.
    payload: u64,
    /// A triangle as it lies on the disk.
    stored: u64,
}

impl Budget {
    /// Divides `memory` bytes; `None`: everything fits in memory at once.
    ///
    /// # Errors
    /// The least that a conversion takes is more.
    pub fn divide(
        memory: u64,
        threads: usize,
        source: &dyn Source,
        plan: &Plan,
        settings: &BuildSettings,
    ) -> Result<Option<Self>, BuildError> {
        let (needs, all) = Needs::of(threads, source, plan, settings);
        if all <= memory { Ok(None) } else { needs.fit(memory, threads, all).map(Some) }
    }

    /// Divides the `memory` bytes of each of many processes that share the work. Pieces are small enough for all of
    /// them to have some.
    ///
    /// # Errors
    /// The least that a conversion takes is more.
    pub fn share(
        memory: u64,
        threads: usize,
        source: &dyn Source,
        plan: &Plan,
        settings: &BuildSettings,
    ) -> Result<Self, BuildError> {
        let (needs, _) = Needs::of(threads, source, plan, settings);
        let budget = needs.fit(memory, threads, u64::MAX)?;
        Ok(Self {
            items: budget.items.min(MOST_SHARED_ITEMS.max(needs.least_items())),
            chunk: budget.chunk.min(MOST_SHARED_CHUNK.max(needs.brick)),
            ..budget
        })
    }

    /// For the journal.
    pub fn put(&self, words: &mut Words) {
        let Self { threads, items, window, pending, chunk, batch } = *self;
        words.put(threads as u64).put(items).put(window).put(pending as u64).put(chunk).put(batch as u64);
    }

    /// From the journal.
    pub fn take(words: &mut WordReader) -> Option<Self> {
        let (threads, items, window) = (words.take()? as usize, words.take()?, words.take()?);
        let (pending, chunk, batch) = (words.take()? as usize, words.take()?, words.take()? as usize);
        Some(Self { threads, items, window, pending, chunk, batch })
    }
}

impl Needs {
    /// Of a conversion, and the bytes that all of it takes at once.
    fn of(threads: usize, source: &dyn Source, plan: &Plan, settings: &BuildSettings) -> (Self, u64) {
        let slots: u64 = plan.objects.iter().map(|object| u64::from(object.slots)).sum();
        let parts = plan.objects.iter().flat_map(|object| &object.parts);
        let has_details = source.outline().materials.iter().any(Material::needs_details);
        let detail = |bytes: u64| if has_details { bytes } else { 0 };
        let (largest, part_bytes, making) = match source.is_in_memory() {
            true => (PART_TRIANGLES, 0, 0),
            false => {
                let largest = parts.map(|part| part.triangles).max().unwrap_or(0);
                (largest, PART_TRIANGLE_BYTES + detail(PART_DETAIL_BYTES), detail(TANGENT_WORK_BYTES))
            }
        };
        let brick = u64::from(settings.brick_triangles);
        let (occupancy, map) = if settings.proxies { (OCCUPANCY_WORK_BYTES, MAP_BYTES) } else { (0, 0) };
        let needs = Self {
            brick,
            part: u64::from(largest) * (part_bytes + making),
            run: u64::from(largest.min(PART_TRIANGLES)),
            tables: if settings.lod { 4 } else { 2 } * slots.div_ceil(brick) * TABLE_BRICK_BYTES,
            work: brick * (WORK_BYTES + detail(DETAIL_WORK_BYTES)) + occupancy,
            level: if settings.lod { brick * LEVEL_WORK_BYTES * LEVEL_CHILDREN as u64 } else { 0 },
            payload: PAYLOAD_BYTES + detail(DETAIL_PAYLOAD_BYTES) + map.div_ceil(brick),
            stored: if has_details { size_of::<Detailed>() } else { size_of::<Plain>() } as u64,
        };
        let all = needs.all_in_memory(threads as u64, slots, part_bytes);
        (needs, all)
    }

    /// Divides `memory` bytes by as many threads as there is room for; `all` would suffice anyway.
    fn fit(&self, memory: u64, threads: usize, all: u64) -> Result<Budget, BuildError> {
        let least = |threads: u64| RESERVE + self.tables + self.largest_phase(threads);
        let fitting = (1..=threads as u64).rev().find(|&threads| least(threads) <= memory);
        let Some(threads) = fitting else {
            let megabytes = least(1).min(all).div_ceil(1 << 20);
            let found = format!("{} MiB", memory >> 20);
            return Err(BuildError::Setting { setting: "--memory", found, expected: format!("{megabytes}M or more") });
        };
        Ok(self.divide(memory - RESERVE - self.tables, threads))
    }

    /// Bytes with all geometry in memory.
    fn all_in_memory(&self, threads: u64, slots: u64, part_bytes: u64) -> u64 {
        let work =
            self.work.min(slots * WORK_BYTES + OCCUPANCY_WORK_BYTES).max(self.level.min(slots * LEVEL_WORK_BYTES));
        let working = threads * (work + 2 * MOST_BATCH.min(slots) * self.payload);
        RESERVE + self.tables + slots * (part_bytes + ITEM_BYTES) + working
    }

    /// Least items that are cut in memory: a node of more is neither a brick nor a canonical chunk.
    fn least_items(&self) -> u64 {
        self.brick.max(CANONICAL_TRIANGLES as u64)
    }

    fn collecting(&self) -> u64 {
        self.part + self.run * (size_of::<Item>() + size_of::<PackedItem>()) as u64
    }

    fn distributing(&self, pending: u64) -> u64 {
        // A buffer that grows may be twice as large as what is in it.
        self.part + 2 * pending * self.stored
    }

    fn encoding(&self, batch: u64) -> u64 {
        self.work + 2 * (batch + self.brick) * self.payload
    }

    /// A level needs no more than a brick of the payloads that are made.
    fn levels(&self, batch: u64) -> u64 {
        if self.level > 0 { self.level + self.work + 2 * (batch + self.brick) * self.payload } else { 0 }
    }

    /// Bytes of the phase that takes the most, each at its least.
    fn largest_phase(&self, threads: u64) -> u64 {
        let items = threads * self.collecting().max(BLOCK_BYTES) + self.least_items() * ITEM_BYTES;
        let distribution = threads * self.distributing(MOST_PENDING / 8) + self.run * 4;
        // The last brick of a chunk may exceed it.
        let encoding =
            threads * self.encoding(self.brick.min(MOST_BATCH)) + 4 * self.brick * (self.stored + PLACE_BYTES);
        items.max(distribution).max(encoding).max(threads * self.levels(self.brick.min(MOST_BATCH)))
    }

    /// Divides what is left beside the tables.
    fn divide(&self, rest: u64, threads: u64) -> Budget {
        let items = rest - threads * self.collecting().max(BLOCK_BYTES);
        let per_thread = rest / (8 * threads);
        let pending = (per_thread / (2 * self.stored)).clamp(MOST_PENDING / 8, MOST_PENDING);
        let window = rest - threads * self.distributing(pending).min(rest / threads);
        let batch = (per_thread / (2 * self.payload)).clamp(self.brick.min(MOST_BATCH), MOST_BATCH);
        let chunk = rest.saturating_sub(threads * self.encoding(batch)) / (2 * (self.stored + PLACE_BYTES));
        Budget {
            threads: threads as usize,
            items: (items / ITEM_BYTES).max(self.least_items()),
            window: (window / 4).clamp(self.run.max(1), MOST_WINDOW),
            pending: pending as usize,
            chunk: chunk.saturating_sub(self.brick).clamp(self.brick, MOST_CHUNK),
            batch: batch as usize,
        }
    }
}

/// A quarter of the memory of the machine or of the control group that the process runs in.
pub(crate) fn default_memory() -> u64 {
    let mut system = sysinfo::System::new();
    system.refresh_memory();
    share(&system)
}

/// A quarter of the memory of a system; of 4 GiB where it does not tell, as without `/proc`.
fn share(system: &sysinfo::System) -> u64 {
    let machine = system.total_memory();
    if machine == 0 {
        return 1 << 30;
    }
    let group = system.cgroup_limits().map(|limits| limits.total_memory).filter(|&limit| limit > 0);
    group.map_or(machine, |group| group.min(machine)) / 4
}

/// Keeps memory that is freed for what follows, where many of the same things are made and dropped: taking it from the
/// system anew costs more than clearing it.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
pub(crate) fn keep() {
    /// What is free at the end of a heap from which on it goes back.
    const KEPT_BYTES: i32 = 64 << 20;
    // SAFETY: as in `give_back`.
    unsafe {
        libc::mallopt(libc::M_TRIM_THRESHOLD, KEPT_BYTES);
    }
}

/// Other allocators keep what they want.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub(crate) fn keep() {}

/// Gives memory that was freed back to the system: the next phase divides it anew.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
pub(super) fn give_back() {
    /// Allocations from this size on go back when they are freed.
    const AT_ONCE_BYTES: i32 = 1 << 20;
    // SAFETY: both functions may be called at any time from any thread; they change where memory comes from and goes
    // to, not what is in it.
    unsafe {
        libc::mallopt(libc::M_MMAP_THRESHOLD, AT_ONCE_BYTES);
        libc::malloc_trim(0);
    }
}

/// Other allocators give back by themselves.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub(super) fn give_back() {}

#[cfg(test)]
mod tests {
    #[test]
    fn memory_that_is_not_told_is_assumed() {
        assert_eq!(super::share(&sysinfo::System::new()), 1 << 30);
        assert!(super::default_memory() > 1 << 24);
    }
}
