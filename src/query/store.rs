//! Payloads of bricks in host memory: each is read and checked by workers, and stays while there is room.

use crate::stream::{HostCache, Item, Shared, Workers};
use anyhow::{Result, anyhow};
use bricks::SceneFile;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Least bytes that payloads in use may take together, whatever the budget; in tests so few that small scenes come in
/// parts.
const LEAST_BATCH: u64 = if cfg!(test) { 64 << 10 } else { 4 << 20 };

/// Payloads of a scene, through a cache.
pub(super) struct Store {
    scene: Arc<SceneFile>,
    workers: Workers,
    /// Bytes of payloads that are in use at a time.
    batch_bytes: u64,
    /// Bytes that the cache keeps.
    kept_bytes: u64,
    /// Bytes of what was made of payloads.
    beside: AtomicU64,
    most: AtomicU64,
}

impl Store {
    /// A store of at most `bytes`, of which a quarter is for what is in use; `threads` read.
    pub(super) fn new(scene: Arc<SceneFile>, bytes: u64, threads: usize) -> Result<Self> {
        let batch_bytes = (bytes / 4).max(LEAST_BATCH);
        let kept_bytes = bytes.saturating_sub(batch_bytes);
        let workers = Workers::new(scene.clone(), HostCache::new(kept_bytes), threads)?;
        Ok(Self { scene, workers, batch_bytes, kept_bytes, beside: AtomicU64::new(0), most: AtomicU64::new(0) })
    }

    fn bytes(&self, item: Item) -> u64 {
        self.scene.loaded_bytes(item.into())
    }

    /// A payload, if the cache has it.
    pub(super) fn at_hand(&self, item: Item) -> Option<Arc<[u8]>> {
        self.workers.host_cache().get(item)
    }

    /// Bytes that the cache keeps together.
    fn room(&self) -> u64 {
        self.kept_bytes.max(self.batch_bytes)
    }

    /// Whether it keeps `bytes` of payloads together.
    pub(super) fn keeps(&self, bytes: u64) -> bool {
        bytes <= self.kept_bytes
    }

    /// How many of `items`, from the first on, are kept together; one at least.
    pub(super) fn together(&self, items: &[Item]) -> usize {
        let mut sum = 0;
        let fits = |item: &&Item| {
            sum += self.bytes(**item);
            sum <= self.room()
        };
        items.iter().take_while(fits).count().max(1).min(items.len())
    }

    /// Bricks by runs whose geometry the cache keeps together, in the order of the file.
    pub(super) fn runs(&self) -> Vec<Range<u32>> {
        let count = self.scene.resident().exact_bricks() as u32;
        let room = self.room();
        let (mut runs, mut first, mut sum) = (Vec::new(), 0, 0);
        for brick in 0..count {
            let bytes = self.bytes(Item::geometry(brick));
            if sum + bytes > room && brick > first {
                runs.push(first..brick);
                (first, sum) = (brick, 0);
            }
            sum += bytes;
        }
        if first < count {
            runs.push(first..count);
        }
        runs
    }

    /// Calls `visit` with the place of each of `items` and its payload: as many at a time as may be in use, which are
    /// there together.
    ///
    /// # Errors
    /// A damaged payload, by its name; what `visit` says.
    pub(super) fn for_each(
        &self,
        items: &[Item],
        mut visit: impl FnMut(usize, &[Arc<[u8]>]) -> Result<()>,
    ) -> Result<()> {
        let mut first = 0;
        while first < items.len() {
            let (mut end, mut sum) = (first, 0);
            while end < items.len() && (end == first || sum + self.bytes(items[end]) <= self.batch_bytes) {
                sum += self.bytes(items[end]);
                end += 1;
            }
            let requests = items[first..end].iter().map(|&item| (item, Shared::default())).collect();
            let loaded = self.workers.load(requests)?;
            let held = loaded.into_iter().map(|(item, held)| held.0.ok_or_else(|| anyhow!("{item}: no payload")));
            let held = held.collect::<Result<Vec<_>>>()?;
            self.note_held(sum);
            visit(first, &held)?;
            first = end;
        }
        Ok(())
    }

    /// Notes that `bytes` of payloads are in use, beside what is kept.
    fn note_held(&self, bytes: u64) {
        let kept = self.workers.host_cache().stats().used_bytes + self.beside.load(Ordering::Relaxed);
        self.most.fetch_max(bytes + kept, Ordering::Relaxed);
    }

    /// Notes that something of so many bytes was made of payloads, and stays.
    pub(super) fn note_beside(&self, bytes: u64) {
        self.beside.fetch_add(bytes, Ordering::Relaxed);
        self.note_held(0);
    }

    /// Payloads and bytes read from the file so far, and most bytes that were held.
    pub(super) fn read(&self) -> (u64, u64, u64) {
        let stats = self.workers.stats();
        (stats.read, stats.read_bytes, self.most.load(Ordering::Relaxed))
    }
}
