//! The residency state machine: random schedules against the naive model, edges, invariants.

use super::model::{Broken, Model, bytes};
use crate::math::random::Rng;
use crate::stream::residency::Placement;
use crate::stream::{Item, Kind, NoRoom, Policy, Residency, ResidencyError, Sizes, Slot};

/// Sizes, budget and page of a random small cache; the budget is often the least one.
fn random_cache(random: &mut Rng) -> (Sizes, u64, u64) {
    let bricks = 1 + random.below(24);
    let most = 1 + random.below(12);
    let brick = |random: &mut Rng| (16 * (1 + random.below(most)), 16 * random.below(most + 1));
    let bricks = (0..bricks).map(|_| brick(random)).collect();
    // Every other scene has textures, some more tiles than bricks.
    let tiles = random.below(2) * random.below(40);
    let tiles = (0..tiles).map(|_| 16 * (1 + random.below(2))).collect();
    let sizes = Sizes { bricks, tiles };
    let least = Residency::least_budget(&sizes);
    let budget = least + if random.below(3) == 0 { 0 } else { 16 * random.below(4 * most * 2) };
    let largest = sizes.largest();
    let page = if random.below(2) == 0 { budget } else { largest + 16 * random.below(2 * most) };
    (sizes, budget, page.max(16))
}

/// Runs one schedule on cache and model; says where they first differ, or where an invariant breaks.
fn run_schedule(seed: u64, policy: Policy, broken: Broken, steps: usize) -> Result<(), String> {
    let mut random = Rng(seed);
    let (sizes, budget, page) = random_cache(&mut random);
    let mut cache = Residency::new(&sizes, budget, page, policy).map_err(|error| error.to_string())?;
    let mut model = Model::new(&sizes, budget, page, policy, broken);
    let address = |slot: Slot| slot.page as u64 * page + slot.offset as u64;
    let mut head = (0, 0);
    for step in 0..steps {
        let at = |what: &str| format!("seed {seed}, {policy}, step {step}: {what}");
        let items = sizes.rows() as u64;
        // Every other schedule goes round through everything, with a step aside now and then.
        let index =
            if seed.is_multiple_of(2) && random.below(8) > 0 { step as u64 % items } else { random.below(items) }
                as usize;
        let item = Item::from_index(index).unwrap();
        let empty = bytes(&sizes, item) == 0;
        match random.below(20) {
            0 => cache.begin_pass(),
            1 | 2 => {
                cache.unpin_all();
                model.unpin_all();
            }
            3..=5 if !empty => {
                cache.touch(item);
                model.touch(item);
            }
            6 | 7 if !empty => {
                if cache.pin(item) != model.pin(item) {
                    return Err(at("pinned differently"));
                }
            }
            8 if !empty => {
                cache.withdraw(item);
                model.withdraw(item);
            }
            9 => {
                let now = (cache.head(), model.head());
                let before = std::mem::replace(&mut head, now);
                cache.rewind(before.0);
                model.rewind(before.1);
            }
            _ if empty => {
                let placed = cache.insert(item).map_err(|error| at(&error.to_string()))?;
                if !placed.evicted.is_empty() {
                    return Err(at("an empty item evicted something"));
                }
            }
            _ => {
                let before: Vec<_> = cache.resident().collect();
                let pinned: Vec<Item> = before.iter().map(|one| one.0).filter(|&one| cache.is_pinned(one)).collect();
                let got = cache.insert(item);
                if got.is_err() && cache.resident().collect::<Vec<_>>() != before {
                    return Err(at("a refusal changed something"));
                }
                if got.is_err() && pinned.is_empty() {
                    return Err(at("refused with nothing pinned"));
                }
                if let Some(lost) = pinned.iter().find(|&&one| cache.slot(one).is_none()) {
                    return Err(at(&format!("{lost} was pinned and is gone")));
                }
                let got = got.ok().map(|placed| (address(placed.slot), placed.evicted));
                let expected = model.insert(item);
                if got != expected {
                    return Err(at(&format!("{item}: {got:?}, the model says {expected:?}")));
                }
            }
        }
        cache.validate().map_err(|what| at(&what))?;
        for index in 0..sizes.rows() {
            let item = Item::from_index(index).unwrap();
            if bytes(&sizes, item) > 0 && cache.slot(item).map(address) != model.address(item) {
                return Err(at(&format!("{item} lies elsewhere")));
            }
        }
    }
    Ok(())
}

#[test]
fn random_schedules_match_the_naive_model() {
    for &policy in Policy::ALL {
        for seed in 0..150 {
            run_schedule(seed, policy, Broken::Not, 400).unwrap();
        }
    }
}

#[test]
fn a_broken_model_is_noticed() {
    let controls = [
        (Policy::SecondChance, Broken::IgnoresPins),
        (Policy::SecondChance, Broken::IgnoresPages),
        (Policy::SecondChance, Broken::HeadStays),
        (Policy::SecondChance, Broken::ForgetsUses),
        (Policy::SecondChance, Broken::KeepsMarks),
        (Policy::SecondChance, Broken::NeverStays),
        (Policy::RoundRobin, Broken::IgnoresPins),
        (Policy::RoundRobin, Broken::IgnoresPages),
        (Policy::RoundRobin, Broken::HeadStays),
        (Policy::RoundRobin, Broken::NeverRewinds),
        (Policy::Lru, Broken::IgnoresPins),
        (Policy::Lru, Broken::IgnoresPages),
        (Policy::Lru, Broken::ForgetsUses),
    ];
    for (policy, broken) in controls {
        let noticed = (0..40).filter(|&seed| run_schedule(seed, policy, broken, 400).is_err()).count();
        assert!(noticed > 0, "{policy}: a model with {broken:?} passed every schedule");
    }
}

/// A cache with five items resident, one of them pinned.
fn filled(policy: Policy) -> Residency {
    let mut cache = Residency::new(&[(32, 16), (64, 16), (32, 0), (48, 48)], 320, 160, policy).unwrap();
    for item in [Item::geometry(0), Item::attributes(0), Item::geometry(1), Item::geometry(2), Item::attributes(3)] {
        cache.insert(item).unwrap();
    }
    assert!(cache.pin(Item::geometry(1)));
    cache.validate().unwrap();
    cache
}

#[test]
fn validate_notices_each_broken_invariant() {
    type Damage = fn(&mut Residency);
    let damages: [(&str, Damage); 9] = [
        ("overlap", |cache| {
            cache.space.free(32);
            cache.place[Item::attributes(0).index()] = 16;
            // Behind the back of the check that `occupy` makes in debug builds.
            cache.space.free(0);
            cache.space.occupy(16, 16, Item::attributes(0));
            cache.space.occupy(0, 16, Item::geometry(0));
        }),
        ("used bytes", |cache| cache.used_bytes += 16),
        ("lost place", |cache| cache.place[Item::geometry(0).index()] = u64::MAX),
        ("other place", |cache| cache.place[Item::geometry(0).index()] = 64),
        ("counters", |cache| cache.counters.0[0].loaded += 1),
        ("counted bytes", |cache| cache.counters.0[1].evicted_bytes += 16),
        ("pin without a flag", |cache| cache.is_pinned[Item::geometry(1).index()] = false),
        ("pin of what is not resident", |cache| {
            cache.is_pinned[Item::geometry(3).index()] = true;
            cache.pinned.push(Item::geometry(3));
        }),
        ("straddle", |cache| {
            let (start, item) = (cache.place[Item::geometry(0).index()], Item::geometry(0));
            cache.space.free(start);
            cache.space.occupy(144, 32, item);
            cache.place[item.index()] = 144;
        }),
    ];
    for &policy in Policy::ALL {
        for (name, damage) in damages {
            let mut cache = filled(policy);
            // The straddling item needs free bytes at the border of the pages.
            if name == "straddle" {
                let late: Vec<Item> =
                    cache.resident().filter(|one| one.1.page == 1 || one.1.offset >= 112).map(|one| one.0).collect();
                for item in late {
                    assert!(cache.withdraw(item));
                }
            }
            damage(&mut cache);
            assert!(cache.validate().is_err(), "{policy}: {name} was not noticed");
        }
    }
    let mut cache = filled(Policy::Lru);
    let Placement::Lru(lru) = &mut cache.placement else { unreachable!() };
    lru.recency.pop(&Item::geometry(0));
    assert!(cache.validate().is_err(), "a missing use was not noticed");
    let mut cache = filled(Policy::Lru);
    let Placement::Lru(lru) = &mut cache.placement else { unreachable!() };
    lru.gap_bound = 0;
    assert!(cache.validate().is_err(), "a wrong bound was not noticed");
}

#[test]
fn the_least_cache_holds_the_two_largest_bricks() {
    let sizes = [(160, 32), (320, 64), (16, 16), (320, 16)];
    for &policy in Policy::ALL {
        let needed = 320 + 64 + 320 + 16;
        assert_eq!(
            Residency::new(&sizes, needed - 1, 1 << 20, policy).unwrap_err(),
            ResidencyError::CacheTooSmall { what: "the two largest bricks", needed, given: needed - 16 }
        );
        let mut cache = Residency::new(&sizes, needed, 1 << 20, policy).unwrap();
        for brick in [1, 3] {
            for item in [Item::geometry(brick), Item::attributes(brick)] {
                assert_eq!(cache.insert(item).unwrap().evicted, []);
                assert!(cache.pin(item));
            }
        }
        assert_eq!(cache.used_bytes(), needed);
        assert_eq!(cache.insert(Item::geometry(2)), Err(NoRoom { item: Item::geometry(2), bytes: 16 }));
        cache.unpin_all();
        // Every item goes in alone, over and over, whatever lies there.
        for round in 0..50 {
            let item = Item::from_index(round * 3 % 8).unwrap();
            cache.insert(item).unwrap();
            assert!(cache.slot(item).is_some());
            cache.validate().unwrap();
        }
    }
}

/// The tiles of a lookup find room beside each other, wherever those of them lie that are resident already.
#[test]
fn the_least_cache_holds_the_tiles_of_any_lookup() {
    let sizes = Sizes { bricks: vec![(48, 16), (32, 0)], tiles: vec![64; 30] };
    let least = Residency::least_budget(&sizes);
    assert_eq!(least, 2 * 8 * 64);
    for &policy in Policy::ALL {
        let what = "the tiles of a texture lookup";
        let refused = Residency::new(&sizes, least - 16, 1 << 20, policy).unwrap_err();
        assert_eq!(refused, ResidencyError::CacheTooSmall { what, needed: least, given: least - 16 });
        let mut cache = Residency::new(&sizes, least, 1 << 20, policy).unwrap();
        let mut random = Rng(5);
        let (mut had, mut full) = (0, 0);
        for _ in 0..500 {
            // Something else, of another size, moves what comes next.
            cache.unpin_all();
            cache.insert(Item::geometry(random.below(2) as u32)).unwrap();
            let wanted: Vec<Item> = (0..8).map(|_| Item::tile(random.below(30) as u32)).collect();
            for &item in &wanted {
                had += u32::from(cache.slot(item).is_some());
                cache.insert(item).unwrap();
                assert!(cache.pin(item));
            }
            assert!(wanted.iter().all(|&item| cache.slot(item).is_some()));
            // Control: a few more do not find room.
            full +=
                u32::from((0..30).any(|tile| cache.insert(Item::tile(tile)).is_err() || !cache.pin(Item::tile(tile))));
            cache.validate().unwrap();
        }
        assert!(had > 100 && full == 500, "{policy}: {had}, {full}");
        let tiles = *cache.counters().kind(Kind::Tile);
        assert_eq!(tiles.loaded_bytes, 64 * tiles.loaded);
        assert!(cache.counters().total().loaded > tiles.loaded);
    }
}

#[test]
fn one_brick_and_no_brick() {
    let mut cache = Residency::new(&[(96, 16)], 112, 1 << 20, Policy::RoundRobin).unwrap();
    cache.insert(Item::geometry(0)).unwrap();
    cache.insert(Item::attributes(0)).unwrap();
    assert_eq!(cache.used_bytes(), 112);
    assert!(Residency::new(&[(96, 16)], 111, 1 << 20, Policy::Lru).unwrap_err().to_string().contains("112 bytes"));
    for &policy in Policy::ALL {
        let cache = Residency::new(&[], 0, 1 << 20, policy).unwrap();
        assert_eq!((cache.page_sizes().len(), cache.budget_bytes()), (0, 0));
        cache.validate().unwrap();
    }
}

#[test]
fn pages_sum_to_the_budget_and_hold_the_largest_item() {
    let sizes = [(160, 32), (64, 16)];
    let cache = Residency::new(&sizes, 1000, 400, Policy::RoundRobin).unwrap();
    assert_eq!(cache.page_sizes().collect::<Vec<_>>(), [400, 400, 192]);
    assert_eq!(
        Residency::new(&sizes, 1000, 159, Policy::RoundRobin).unwrap_err(),
        ResidencyError::PageTooSmall { item: Item::geometry(0), needed: 160, given: 144 }
    );
    assert_eq!(
        Residency::new(&[(24, 0)], 1000, 400, Policy::Lru).unwrap_err(),
        ResidencyError::Unaligned { item: Item::geometry(0), bytes: 24 }
    );
    assert!(matches!(
        Residency::new(&[], u64::MAX, 16, Policy::Lru),
        Err(ResidencyError::TooMany { what: "pages", .. })
    ));
}

#[test]
fn sizes_beyond_32_bits() {
    let item = 3 << 30;
    let sizes = [(item, 16); 6];
    // Sums beyond 64 bits saturate into a clear error.
    assert_eq!(
        Residency::new(&[(u64::MAX - 15, u64::MAX - 15); 2], 1 << 40, 1 << 30, Policy::Lru).unwrap_err(),
        ResidencyError::CacheTooSmall { what: "the two largest bricks", needed: u64::MAX, given: 1 << 40 }
    );
    for &policy in Policy::ALL {
        let mut cache = Residency::new(&sizes, 5 * item, u64::MAX, policy).unwrap();
        assert_eq!(cache.page_sizes().next(), Some(u32::MAX as u64 - 15));
        let slots: Vec<Slot> = (0..3).map(|brick| cache.insert(Item::geometry(brick)).unwrap().slot).collect();
        assert_eq!(slots, [0, 1, 2].map(|page| Slot { page, offset: 0 }));
        assert_eq!(cache.insert(Item::attributes(0)).unwrap().slot.page, if policy == Policy::Lru { 0 } else { 2 });
        assert_eq!(cache.counters().total().loaded_bytes, 3 * item + 16);
        cache.validate().unwrap();
    }
}

#[test]
fn a_wrap_in_mid_batch_skips_what_is_pinned() {
    // Eight bricks of 32 bytes fill the ring; the batch begins at its end and wraps.
    let mut cache = Residency::new(&[(32, 0); 20], 256, 256, Policy::RoundRobin).unwrap();
    for brick in 0..7 {
        cache.insert(Item::geometry(brick)).unwrap();
    }
    assert!(cache.pin(Item::geometry(0)));
    assert!(cache.pin(Item::geometry(2)));
    let mut batch = Vec::new();
    for brick in 10..16 {
        let placed = cache.insert(Item::geometry(brick)).unwrap();
        assert!(cache.pin(Item::geometry(brick)));
        batch.push((placed.slot.offset / 32, placed.evicted));
    }
    let g = |brick| vec![Item::geometry(brick)];
    assert_eq!(batch, [(7, vec![]), (1, g(1)), (3, g(3)), (4, g(4)), (5, g(5)), (6, g(6))]);
    assert!(cache.insert(Item::geometry(17)).is_err());
    assert!([0, 2, 10, 11, 12, 13, 14, 15].iter().all(|&brick| cache.slot(Item::geometry(brick)).is_some()));
    cache.unpin_all();
    // The head stands behind the last write: cell 7, whose brick was written first of the batch.
    assert_eq!(cache.insert(Item::geometry(17)).unwrap().evicted, g(10));
    cache.validate().unwrap();
}

#[test]
fn pinned_fragments_can_leave_no_place() {
    for &policy in Policy::ALL {
        let mut cache = Residency::new(&[(64, 0), (64, 0), (32, 0), (32, 0), (32, 0)], 128, 128, policy).unwrap();
        for brick in [2, 3, 4] {
            cache.insert(Item::geometry(brick)).unwrap();
        }
        // 32 free and 32 to evict, yet not side by side.
        assert!(cache.pin(Item::geometry(2)) && cache.pin(Item::geometry(4)));
        assert!(!cache.pin(Item::geometry(0)));
        assert!(cache.insert(Item::geometry(0)).is_err());
        assert!(cache.slot(Item::geometry(3)).is_some(), "{policy}: a refusal evicted");
        cache.unpin_all();
        assert!(cache.insert(Item::geometry(0)).is_ok());
        cache.validate().unwrap();
    }
}

#[test]
fn lru_evicts_the_oldest_and_nothing_in_vain() {
    let mut cache = Residency::new(&[(32, 0); 8], 128, 128, Policy::Lru).unwrap();
    for brick in 0..4 {
        cache.insert(Item::geometry(brick)).unwrap();
    }
    cache.touch(Item::geometry(0));
    assert_eq!(cache.insert(Item::geometry(4)).unwrap().evicted, [Item::geometry(1)]);
    // An insertion of what is resident is a use.
    assert_eq!(cache.insert(Item::geometry(2)).unwrap().evicted, []);
    assert_eq!(cache.insert(Item::geometry(5)).unwrap().evicted, [Item::geometry(3)]);

    // Oldest first: 0, 2, 1, 3. A range of 64 needs neighbours: 0 and 1, so 2 stays though it is older than 1.
    let mut cache = Residency::new(&[(32, 0), (32, 0), (32, 0), (32, 0), (64, 0)], 128, 128, Policy::Lru).unwrap();
    for brick in 0..4 {
        cache.insert(Item::geometry(brick)).unwrap();
    }
    cache.touch(Item::geometry(1));
    cache.touch(Item::geometry(3));
    let placed = cache.insert(Item::geometry(4)).unwrap();
    assert_eq!(placed.evicted, [Item::geometry(0), Item::geometry(1)]);
    assert!(cache.slot(Item::geometry(2)).is_some());
}

#[test]
fn counters_tell_loaded_reloaded_and_evicted_apart() {
    let mut cache = Residency::new(&[(64, 32), (64, 32)], 192, 192, Policy::RoundRobin).unwrap();
    cache.begin_pass();
    for _ in 0..2 {
        for brick in 0..2 {
            cache.insert(Item::geometry(brick)).unwrap();
            cache.insert(Item::attributes(brick)).unwrap();
        }
    }
    // All fit: the second round hits.
    assert_eq!((cache.counters().total().loaded, cache.counters().total().reloaded), (4, 0));
    assert!(cache.withdraw(Item::geometry(1)));
    assert!(!cache.withdraw(Item::geometry(1)));
    assert_eq!((cache.counters().kind(Kind::Geometry).loaded, cache.counters().kind(Kind::Geometry).evicted), (1, 0));
    assert_eq!(cache.counters().kind(Kind::Geometry).loaded_bytes, 64);
    // A retry after a withdrawal is no reload, and one after an eviction is.
    let before = cache.counters();
    assert_eq!(cache.insert(Item::geometry(1)).unwrap().evicted, [Item::geometry(0)]);
    assert_eq!(cache.counters().since(&before).kind(Kind::Geometry).reloaded, 0);
    cache.insert(Item::geometry(0)).unwrap();
    let since = cache.counters().since(&before);
    assert_eq!((since.kind(Kind::Geometry).loaded, since.kind(Kind::Geometry).reloaded), (2, 1));
    assert_eq!((since.kind(Kind::Geometry).evicted, since.kind(Kind::Geometry).evicted_bytes), (1, 64));
    // In the next pass it is none.
    cache.begin_pass();
    let before = cache.counters();
    cache.withdraw(Item::geometry(0));
    cache.insert(Item::geometry(0)).unwrap();
    assert_eq!(cache.counters().since(&before).kind(Kind::Geometry).reloaded, 0);
    cache.validate().unwrap();
}

#[test]
fn what_holds_all_still_does_after_a_batch_that_did_not_arrive() {
    let mut lost = 0;
    for seed in 0..100 {
        let mut random = Rng(seed);
        let (sizes, _, page) = random_cache(&mut random);
        let budget = Residency::budget_for_all(&sizes, page);
        let items: Vec<Item> = sizes.items().map(|(item, _)| item).collect();
        let first = random.below(items.len() as u64) as usize;
        let end = first + 1 + random.below((items.len() - first) as u64) as usize;
        // All but a batch, which does not arrive; then all.
        let evicted = |policy: Policy, rewinds: bool| {
            let mut cache = Residency::new(&sizes, budget, page, policy).unwrap();
            for &item in &items[..first] {
                cache.insert(item).unwrap();
            }
            let head = cache.head();
            for &item in &items[first..end] {
                cache.insert(item).unwrap();
            }
            for &item in &items[first..end] {
                cache.withdraw(item);
            }
            if rewinds {
                cache.rewind(head);
            }
            for &item in items[end..].iter().chain(&items) {
                cache.insert(item).unwrap();
            }
            cache.validate().unwrap();
            cache.counters().total().evicted
        };
        for &policy in Policy::ALL {
            assert_eq!(evicted(policy, true), 0, "seed {seed}, {policy}");
        }
        lost += u64::from(evicted(Policy::RoundRobin, false) > 0);
    }
    assert!(lost > 10, "without a rewind something must be lost now and then");
}

#[test]
fn the_budget_for_all_holds_all() {
    for seed in 0..300 {
        let mut random = Rng(seed);
        let (sizes, _, page) = random_cache(&mut random);
        let budget = Residency::budget_for_all(&sizes, page);
        for &policy in Policy::ALL {
            let mut cache = Residency::new(&sizes, budget, page, policy).unwrap();
            for _ in 0..sizes.rows() * 2 {
                let item = Item::from_index(random.below(sizes.rows() as u64) as usize).unwrap();
                if cache.slot(item).is_none() {
                    assert_eq!(cache.insert(item).unwrap().evicted, [], "seed {seed}, {policy}");
                }
            }
        }
    }
    // Control: the plain sum does not when pages leave ends over.
    let mut cache = Residency::new(&[(48, 0); 4], 192, 80, Policy::RoundRobin).unwrap();
    assert!((0..4).any(|brick| !cache.insert(Item::geometry(brick)).unwrap().evicted.is_empty()));
}

#[test]
fn items_round_trip_as_text() {
    for item in [Item::geometry(0), Item::attributes(17), Item::geometry(u32::MAX)] {
        assert_eq!(Item::try_from(item.code()), Ok(item));
        assert_eq!(Item::from_index(item.index()), Some(item));
    }
    for wrong in ["", "g", "17", "x17", "g+1", "g-1", "g4294967296", "a 1", "é1"] {
        assert!(Item::try_from(wrong.to_owned()).is_err(), "{wrong:?}");
    }
    assert_eq!(Item::attributes(17).to_string(), "brick 17 attributes");
}

#[test]
fn fillings_are_counted_within_a_pass() {
    for &policy in Policy::ALL {
        // Room for four; a pass that uses ten.
        let mut cache = Residency::new(&[(32, 0); 10], 128, 128, policy).unwrap();
        cache.begin_pass();
        assert_eq!(cache.fillings(), 1);
        (0..10).for_each(|brick| drop(cache.insert(Item::geometry(brick)).unwrap()));
        assert_eq!(cache.fillings(), 3, "{policy}: four, four, two");
        // What earlier passes left is no part of this one's fillings.
        cache.begin_pass();
        (0..2).for_each(|brick| drop(cache.insert(Item::geometry(brick)).unwrap()));
        assert_eq!(cache.fillings(), 1, "{policy}");
        // A use counts like a load: three used, then two loaded into room for one.
        cache.begin_pass();
        let used: Vec<Item> = cache.resident().map(|one| one.0).collect();
        used.iter().for_each(|&item| cache.touch(item));
        let missing = (0..10).map(Item::geometry).find(|&item| cache.slot(item).is_none()).unwrap();
        cache.insert(missing).unwrap();
        assert_eq!(cache.fillings(), 2, "{policy}");
        // Never more bytes used in a pass than so many caches hold, whatever comes.
        for seed in 0..50 {
            let mut random = Rng(seed);
            let (sizes, budget, page) = random_cache(&mut random);
            let mut cache = Residency::new(&sizes, budget, page, policy).unwrap();
            for _ in 0..4 {
                cache.begin_pass();
                let mut used = std::collections::BTreeSet::new();
                for _ in 0..40 {
                    let item = Item::from_index(random.below(sizes.rows() as u64) as usize).unwrap();
                    cache.insert(item).unwrap();
                    used.insert(item);
                }
                let bytes: u64 = used.iter().map(|&item| bytes(&sizes, item)).sum();
                assert!(bytes <= cache.fillings() * cache.budget_bytes(), "seed {seed}, {policy}");
                // Each filling but the last has evicted something.
                assert!(cache.fillings() <= 1 + cache.counters().total().evicted, "seed {seed}, {policy}");
            }
        }
    }
}
