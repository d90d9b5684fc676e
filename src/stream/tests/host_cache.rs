//! The host cache: budget exact to the byte, order of eviction, use and reservation.

use std::sync::Arc;

use crate::math::random::Rng;
use crate::stream::{HostCache, Item};

fn put(cache: &Arc<HostCache>, brick: u32, bytes: usize) -> bool {
    match cache.reserve(Item::geometry(brick), bytes as u64) {
        Some(reservation) => {
            reservation.fill(&vec![brick as u8; bytes]);
            true
        }
        None => false,
    }
}

#[test]
fn the_budget_is_exact_to_the_byte() {
    let cache = HostCache::new(100);
    assert!(put(&cache, 0, 60) && put(&cache, 1, 40));
    assert_eq!((cache.stats().entries, cache.stats().used_bytes), (2, 100));
    // One byte more evicts the oldest, and only that.
    assert!(put(&cache, 2, 1));
    assert_eq!((cache.stats().entries, cache.stats().used_bytes, cache.stats().evicted), (2, 41, 1));
    assert!(!cache.contains(Item::geometry(0)) && cache.contains(Item::geometry(1)));
    // The whole budget fits, one byte more does not and evicts nothing.
    assert!(!put(&cache, 3, 101));
    assert_eq!(cache.stats().entries, 2);
    assert!(put(&cache, 4, 100));
    assert_eq!((cache.stats().entries, cache.stats().used_bytes), (1, 100));
    assert_eq!(cache.get(Item::geometry(4)).as_deref(), Some(&[4u8; 100][..]));
}

#[test]
fn a_budget_of_zero_is_off() {
    let cache = HostCache::new(0);
    assert!(!put(&cache, 0, 0) && !put(&cache, 0, 16));
    assert!(cache.get(Item::geometry(0)).is_none());
    assert_eq!(cache.stats(), Default::default());
}

#[test]
fn a_look_up_is_a_use_and_a_peek_is_none() {
    for (used, survivor) in [(true, 0), (false, 1)] {
        let cache = HostCache::new(32);
        assert!(put(&cache, 0, 16) && put(&cache, 1, 16));
        assert!(cache.contains(Item::geometry(0)));
        if used {
            assert!(cache.get(Item::geometry(0)).is_some());
        }
        assert!(put(&cache, 2, 16));
        assert!(cache.contains(Item::geometry(survivor)) && !cache.contains(Item::geometry(1 - survivor)));
    }
}

#[test]
fn what_is_in_use_or_reserved_is_not_evicted() {
    let cache = HostCache::new(48);
    assert!(put(&cache, 0, 16) && put(&cache, 1, 16));
    let held = cache.get(Item::geometry(0)).unwrap();
    let reserved = cache.reserve(Item::geometry(2), 16).unwrap();
    // Only brick 1 can go: 32 bytes do not fit, and nothing is evicted for the attempt.
    assert!(!put(&cache, 3, 32));
    assert_eq!((cache.stats().entries, cache.stats().used_bytes), (2, 48));
    assert!(put(&cache, 3, 16));
    assert!(!cache.contains(Item::geometry(1)));
    // Twice the same is not reserved twice.
    assert!(cache.reserve(Item::geometry(2), 16).is_none());
    assert!(cache.get(Item::geometry(2)).is_none(), "reserved is not held");
    drop(held);
    drop(reserved);
    assert_eq!(cache.stats().used_bytes, 32);
    assert!(put(&cache, 4, 32));
    assert!(!cache.contains(Item::geometry(0)));
}

#[test]
fn an_unfilled_or_misfilled_reservation_gives_its_room_back() {
    let cache = HostCache::new(64);
    drop(cache.reserve(Item::geometry(0), 64).unwrap());
    cache.reserve(Item::geometry(0), 64).unwrap().fill(&[0; 63]);
    assert_eq!((cache.stats().used_bytes, cache.stats().entries, cache.stats().inserted), (0, 0, 0));
    assert!(put(&cache, 1, 64));
}

#[test]
fn random_use_matches_a_naive_list() {
    for seed in 0..40 {
        let mut random = Rng(seed);
        let budget = 1 + random.below(400);
        let cache = HostCache::new(budget);
        let sizes: Vec<usize> = (0..30).map(|_| 1 + random.below(90) as usize).collect();
        // Oldest first.
        let mut naive: Vec<u32> = Vec::new();
        for step in 0..2000 {
            let brick = random.below(30) as u32;
            let held = cache.get(Item::geometry(brick));
            assert_eq!(held.is_some(), naive.contains(&brick), "seed {seed}, step {step}");
            if let Some(held) = held {
                assert_eq!(*held, *vec![brick as u8; sizes[brick as usize]]);
                naive.retain(|&other| other != brick);
                naive.push(brick);
            } else if put(&cache, brick, sizes[brick as usize]) {
                naive.push(brick);
                while naive.iter().map(|&brick| sizes[brick as usize] as u64).sum::<u64>() > budget {
                    naive.remove(0);
                }
            } else {
                assert!(sizes[brick as usize] as u64 > budget, "seed {seed}, step {step}: refused for no reason");
            }
            let used: usize = naive.iter().map(|&brick| sizes[brick as usize]).sum();
            assert_eq!(cache.stats().used_bytes, used as u64, "seed {seed}, step {step}");
            assert_eq!(cache.stats().entries, naive.len() as u64);
        }
        let stats = cache.stats();
        assert_eq!(stats.entries, stats.inserted - stats.evicted);
    }
}
