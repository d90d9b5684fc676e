//! Verified payloads in host memory, least recently used out first.
//!
//! The budget is exact to the byte in what is really held: room is reserved before a copy is allocated, and what a
//! worker still copies into or reads from is not evicted. A batch larger than the budget keeps its first items, so what
//! is cached depends on the order of requests alone, never on which thread finished first.
//!
//! What is brought in ahead of need is on sufferance: it takes the room of nothing that was used in the present round
//! or the one before ([`HostCache::begin_round`]), and the statistics say what came of it.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::item::Item;

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
    /// Of the payloads put in, those brought ahead of need; one that its first load overtook is not among them.
    pub prefetched: u64,
    /// Bytes of those.
    pub prefetched_bytes: u64,
    /// Payloads brought ahead of need that a look-up found later; each counts once.
    pub prefetched_used: u64,
    /// Bytes of those.
    pub prefetched_used_bytes: u64,
    /// Bytes of payloads brought ahead of need that were put out before a look-up found them.
    pub prefetched_wasted_bytes: u64,
}

/// A payload, or the room reserved for one.
#[derive(Debug)]
struct Entry {
    bytes: u64,
    /// Verified bytes; `None` until a worker has filled it.
    payload: Option<Arc<[u8]>>,
    /// Brought ahead of need and not looked up yet.
    ahead: bool,
    /// The round of its last use. In the order of use these ascend.
    round: u64,
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
    round: u64,
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
        let inner = Inner { entries: lru::LruCache::unbounded(), round: 0, stats: HostCacheStats::default() };
        Arc::new(Self { budget_bytes, inner: Mutex::new(inner) })
    }

    /// Every change below is complete before anything can panic, so a poisoned lock guards a sound state.
    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The budget in bytes.
    pub fn budget_bytes(&self) -> u64 {
        self.budget_bytes
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
        let Inner { entries, round, stats } = &mut *inner;
        let found = entries.get_mut(&item).and_then(|entry| {
            entry.round = *round;
            // A load that finds its payload still on the way reads it itself: that was not ahead of need.
            let ahead = std::mem::take(&mut entry.ahead);
            let payload = entry.payload.clone()?;
            if ahead {
                stats.prefetched_used += 1;
                stats.prefetched_used_bytes += entry.bytes;
            }
            Some(payload)
        });
        match found {
            Some(_) => stats.hits += 1,
            None => stats.misses += 1,
        }
        found
    }

    /// Begins a round, such as a frame: see [`Self::reserve_ahead`].
    pub fn begin_round(&self) {
        self.lock().round += 1;
    }

    /// Reserves room for `item`, evicting the least recently used payloads that nobody is using.
    ///
    /// `None` when it is held or reserved already, is larger than the budget, or does not fit beside what is in use:
    /// then nothing is evicted and the payload is simply not cached.
    pub fn reserve(self: &Arc<Self>, item: Item, bytes: u64) -> Option<Reservation> {
        self.reserve_where(item, bytes, false)
    }

    /// As [`Self::reserve`], for an item that nobody asked for yet: nothing is evicted for it that was used, or brought
    /// ahead, in the present round or the one before.
    pub fn reserve_ahead(self: &Arc<Self>, item: Item, bytes: u64) -> Option<Reservation> {
        self.reserve_where(item, bytes, true)
    }

    fn reserve_where(self: &Arc<Self>, item: Item, bytes: u64, ahead: bool) -> Option<Reservation> {
        if bytes > self.budget_bytes || self.budget_bytes == 0 {
            return None;
        }
        let mut victims = Vec::new();
        {
            let mut inner = self.lock();
            if inner.entries.contains(&item) {
                return None;
            }
            let round = inner.round;
            let mut used = inner.stats.used_bytes;
            let mut oldest_first = inner.entries.iter().rev();
            while used > self.budget_bytes - bytes {
                let (&old, entry) = oldest_first.next()?;
                if ahead && entry.round + 1 >= round {
                    return None;
                }
                if entry.evictable() {
                    used -= entry.bytes;
                    victims.push((old, None));
                }
            }
            for (old, entry) in &mut victims {
                *entry = inner.entries.pop(old);
            }
            let in_vain = victims.iter().filter_map(|(_, entry)| entry.as_ref()).filter(|entry| entry.ahead);
            inner.stats.prefetched_wasted_bytes += in_vain.map(|entry| entry.bytes).sum::<u64>();
            inner.stats.entries -= victims.len() as u64;
            inner.stats.evicted += victims.len() as u64;
            inner.stats.used_bytes = used + bytes;
            inner.entries.put(item, Entry { bytes, payload: None, ahead, round });
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
        let Inner { entries, stats, .. } = &mut *inner;
        if let Some(entry) = entries.peek_mut(&self.item) {
            entry.payload = Some(payload);
            stats.entries += 1;
            stats.inserted += 1;
            if entry.ahead {
                stats.prefetched += 1;
                stats.prefetched_bytes += self.bytes;
            }
            self.filled = true;
        }
    }
}

impl Drop for Reservation {
    fn drop(&mut self) {
        if !self.filled {
            let mut inner = self.cache.lock();
            inner.entries.pop(&self.item);
            inner.stats.used_bytes -= self.bytes;
        }
    }
}
