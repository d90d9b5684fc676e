//! Verified payloads in host memory, least recently used out first.
//!
//! The budget is exact to the byte in what is really held: room is reserved before a copy is allocated, and what a
//! worker still copies into or reads from is not evicted. A batch larger than the budget keeps its first items, so what
//! is cached depends on the order of requests alone, never on which thread finished first.

use super::item::Item;
use crate::stream::sync::{Arc, Mutex, MutexGuard};
use bricks::planted::{self, Defect};
use std::sync::PoisonError;

/// What happened in a [`HostCache`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HostCacheStats {
    /// Look-ups that found the payload.
    pub hits: u64,
    /// Look-ups that did not.
    pub misses: u64,
    /// Payloads put in.
    pub inserted: u64,
    /// Payloads put out for others.
    pub evicted: u64,
    /// Payloads held now.
    pub entries: u64,
    /// Bytes held or reserved now; never above the budget.
    pub used_bytes: u64,
}

/// A payload, or the room reserved for one.
#[derive(Debug)]
struct Entry {
    bytes: u64,
    /// Verified bytes; `None` until a worker has filled it.
    payload: Option<Arc<[u8]>>,
}

impl Entry {
    /// Whether dropping it frees its memory at once.
    fn evictable(&self) -> bool {
        // Clones are made under the cache's lock alone, so a count of one cannot rise while it is held.
        self.payload.as_ref().is_some_and(|payload| Arc::strong_count(payload) == 1)
    }
}

#[derive(Debug)]
struct Inner {
    entries: lru::LruCache<Item, Entry>,
    stats: HostCacheStats,
}

/// The cache; shared by the workers.
#[derive(Debug)]
pub struct HostCache {
    budget_bytes: u64,
    inner: Mutex<Inner>,
}

impl HostCache {
    /// A cache of `budget_bytes`; 0 turns it off.
    pub fn new(budget_bytes: u64) -> Arc<Self> {
        let inner = Inner { entries: lru::LruCache::unbounded(), stats: HostCacheStats::default() };
        Arc::new(Self { budget_bytes, inner: Mutex::new(inner) })
    }

    /// Most bytes that it holds.
    pub fn budget_bytes(&self) -> u64 {
        self.budget_bytes
    }

    /// Every change below is complete before anything can panic, so a poisoned lock guards a sound state.
    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What happened so far.
    pub fn stats(&self) -> HostCacheStats {
        self.lock().stats
    }

    /// Whether `item` is held; neither counts nor is a use.
    pub fn contains(&self, item: Item) -> bool {
        self.budget_bytes > 0 && self.lock().entries.peek(&item).is_some_and(|entry| entry.payload.is_some())
    }

    /// The payload of `item`, which becomes the most recently used. It is not evicted while the handle lives.
    pub fn get(&self, item: Item) -> Option<Arc<[u8]>> {
        if self.budget_bytes == 0 {
            return None;
        }
        let mut inner = self.lock();
        let Inner { entries, stats } = &mut *inner;
        let found = entries.get(&item).and_then(|entry| entry.payload.clone());
        match found {
            Some(_) => stats.hits += 1,
            None => stats.misses += 1,
        }
        found
    }

    /// Reserves room for `item`, evicting the least recently used payloads that nobody is using.
    ///
    /// `None` when it is held or reserved already, is larger than the budget, or does not fit beside what is in use:
    /// then nothing is evicted and the payload is simply not cached.
    pub fn reserve(self: &Arc<Self>, item: Item, bytes: u64) -> Option<Reservation> {
        if bytes > self.budget_bytes || self.budget_bytes == 0 {
            return None;
        }
        let mut victims = Vec::new();
        {
            let mut inner = self.lock();
            if inner.entries.contains(&item) {
                return None;
            }
            let mut used = inner.stats.used_bytes;
            let mut oldest_first = inner.entries.iter().rev();
            while used > self.budget_bytes - bytes {
                let (&old, entry) = oldest_first.next()?;
                if entry.evictable() {
                    used -= entry.bytes;
                    victims.push((old, None));
                }
            }
            for (old, entry) in &mut victims {
                *entry = inner.entries.pop(old);
            }
            inner.stats.entries -= victims.len() as u64;
            inner.stats.evicted += victims.len() as u64;
            inner.stats.used_bytes = used + bytes;
            inner.entries.put(item, Entry { bytes, payload: None });
        }
        // Freed outside the lock, yet before the reservation can be filled.
        drop(victims);
        Some(Reservation { cache: self.clone(), item, bytes, filled: false })
    }
}

/// Room in a [`HostCache`]. Dropped unfilled, it gives the room back.
#[derive(Debug)]
pub struct Reservation {
    cache: Arc<HostCache>,
    item: Item,
    bytes: u64,
    filled: bool,
}

impl Reservation {
    /// Puts a copy of `payload`, which must be verified and of the reserved length, into the cache. Of another length,
    /// it is not put in.
    pub fn fill(self, payload: &[u8]) {
        if payload.len() as u64 == self.bytes {
            self.share(Arc::from(payload));
        }
    }

    /// Puts `payload` itself into the cache, as [`Self::fill`] does a copy.
    pub fn share(mut self, payload: Arc<[u8]>) {
        if payload.len() as u64 != self.bytes {
            return;
        }
        let mut inner = self.cache.lock();
        let Inner { entries, stats } = &mut *inner;
        if let Some(entry) = entries.peek_mut(&self.item) {
            entry.payload = Some(payload);
            stats.entries += 1;
            stats.inserted += 1;
            self.filled = true;
        }
    }
}

impl Drop for Reservation {
    fn drop(&mut self) {
        if !self.filled {
            let mut inner = self.cache.lock();
            inner.entries.pop(&self.item);
            if !planted::is(Defect::HeldBytes) {
                inner.stats.used_bytes -= self.bytes;
            }
        }
    }
}
