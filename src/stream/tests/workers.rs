//! The workers: order, corrupt payloads, panics, host cache, shutdown.

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::math::random::Rng;
use crate::stream::{Destination, HostCache, Item, Kind, PayloadSource, SourceError, StreamError, Workers};

/// What the mock does with an item.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    Corrupt,
    Panic,
    PanicWithBomb,
}

/// Payloads made from the item's number; faults on request.
#[derive(Default)]
struct Mock {
    bricks: u32,
    tiles: u32,
    faults: HashMap<Item, Fault>,
    copies: AtomicU64,
}

/// Panics when dropped.
struct Bomb;

impl Drop for Bomb {
    fn drop(&mut self) {
        panic!("the payload of a panic was dropped");
    }
}

fn payload(item: Item) -> Vec<u8> {
    let bytes = match item.kind {
        Kind::Geometry => 16 * (1 + item.number as usize % 7),
        Kind::Attributes => 16 * (item.number as usize % 3),
        Kind::Tile => 64,
    };
    (0..bytes).map(|byte| (byte + item.index() * 31) as u8).collect()
}

impl PayloadSource for Mock {
    fn brick_count(&self) -> u32 {
        self.bricks
    }

    fn tile_count(&self) -> u32 {
        self.tiles
    }

    fn bytes(&self, item: Item) -> u64 {
        payload(item).len() as u64
    }

    fn copy(&self, item: Item, out: &mut [u8]) -> Result<(), SourceError> {
        self.copies.fetch_add(1, Ordering::Relaxed);
        out.copy_from_slice(&payload(item));
        match self.faults.get(&item) {
            None => Ok(()),
            Some(Fault::Corrupt) => {
                out.fill(0xAA);
                Err(format!("{item} is damaged: found checksum 1, expected 2").into())
            }
            Some(Fault::Panic) => panic!("mock panic at {item}"),
            Some(Fault::PanicWithBomb) => std::panic::panic_any(Bomb),
        }
    }
}

/// Collects what it is filled with, like a buffer of fixed length.
#[derive(Debug, Default, PartialEq)]
struct Sink {
    bytes: Option<Vec<u8>>,
    panics: bool,
}

impl Destination for Sink {
    fn fill(&mut self, bytes: &[u8]) {
        assert!(!self.panics, "the destination is too short");
        assert!(self.bytes.is_none(), "filled twice");
        self.bytes = Some(bytes.to_vec());
    }
}

fn start(mock: Mock, host_bytes: u64, threads: usize) -> (Workers, Arc<Mock>) {
    let mock = Arc::new(mock);
    (Workers::new(mock.clone(), HostCache::new(host_bytes), threads).unwrap(), mock)
}

fn requests(items: impl IntoIterator<Item = Item>) -> Vec<(Item, Sink)> {
    items.into_iter().map(|item| (item, Sink::default())).collect()
}

fn all_items(bricks: u32) -> impl Iterator<Item = Item> {
    (0..bricks).flat_map(|brick| [Item::geometry(brick), Item::attributes(brick)])
}

#[test]
fn every_destination_gets_its_payload_in_the_order_of_requests() {
    for threads in [0, 1, 3] {
        let (workers, mock) = start(Mock { bricks: 200, ..Mock::default() }, 0, threads);
        let loaded = workers.load(requests(all_items(200))).unwrap();
        assert!(loaded.iter().map(|one| one.0).eq(all_items(200)));
        assert!(loaded.iter().all(|(item, sink)| sink.bytes.as_deref() == Some(&payload(*item)[..])));
        // Control: the payloads tell items apart.
        assert_ne!(payload(Item::geometry(3)), payload(Item::geometry(10)));
        let stats = workers.stats();
        assert_eq!((stats.read, stats.cached, stats.failed), (400, 0, 0));
        assert_eq!(stats.read_bytes, mock.sizes().sum());
        assert!(workers.load(requests([])).unwrap().is_empty());
    }
}

#[test]
fn a_corrupt_payload_is_named_and_the_others_complete() {
    let faults = HashMap::from([
        (Item::geometry(5), Fault::Corrupt),
        (Item::attributes(7), Fault::Panic),
        (Item::geometry(8), Fault::PanicWithBomb),
    ]);
    let (workers, _) = start(Mock { bricks: 12, faults: faults.clone(), ..Mock::default() }, 1 << 20, 2);
    for _ in 0..3 {
        for one in workers.load_each(requests(all_items(12))) {
            let sink = one.destination;
            match (&one.result, faults.get(&one.item)) {
                (Ok(()), None) => assert_eq!(sink.bytes.as_deref(), Some(&payload(one.item)[..])),
                (Err(error), Some(_)) => {
                    assert_eq!(sink.bytes, None, "unverified bytes reached a destination");
                    assert!(error.to_string().starts_with(&one.item.to_string()), "{error}");
                }
                other => panic!("{}: {other:?}", one.item),
            }
            assert_eq!(workers.host_cache().contains(one.item), !faults.contains_key(&one.item));
        }
    }
    assert_eq!(workers.stats().failed, 9);
    let error = workers.load(requests([Item::geometry(8), Item::geometry(5)])).unwrap_err();
    assert!(matches!(error, StreamError::Panicked { item, .. } if item == Item::geometry(8)), "{error}");
    let error = workers.load(requests([Item::geometry(1), Item::geometry(5)])).unwrap_err();
    assert_eq!(error.to_string(), "brick 5 geometry is damaged: found checksum 1, expected 2");
    let error = workers.load(requests([Item::attributes(7)])).unwrap_err();
    assert!(error.to_string().contains("mock panic at brick 7 attributes"), "{error}");
    // The threads live on, and no room in the host cache stays reserved.
    let held: u64 =
        all_items(12).filter(|item| !faults.contains_key(item)).map(|item| payload(item).len() as u64).sum();
    assert_eq!(workers.host_cache().stats().used_bytes, held);
}

#[test]
fn a_panicking_destination_is_an_error() {
    let (workers, _) = start(Mock { bricks: 4, ..Mock::default() }, 1 << 20, 1);
    let panics = Sink { panics: true, ..Sink::default() };
    let loaded = workers.load_each(vec![(Item::geometry(1), panics), (Item::geometry(2), Sink::default())]);
    assert!(matches!(loaded[0].result, Err(StreamError::Panicked { .. })));
    assert!(loaded[1].result.is_ok());
}

#[test]
fn a_brick_beyond_the_last_is_an_error() {
    let (workers, mock) = start(Mock { bricks: 4, ..Mock::default() }, 1 << 20, 1);
    let loaded = workers.load_each(requests([Item::geometry(4), Item::geometry(3)]));
    assert!(matches!(loaded[0].result, Err(StreamError::NoSuchItem { bricks: 4, .. })));
    assert!(loaded[1].result.is_ok());
    assert_eq!(mock.copies.load(Ordering::Relaxed), 1);
}

#[test]
fn the_host_cache_answers_the_second_time() {
    let (workers, mock) = start(Mock { bricks: 50, ..Mock::default() }, 1 << 20, 2);
    for round in 0..3 {
        let loaded = workers.load(requests(all_items(50))).unwrap();
        assert!(loaded.iter().all(|(item, sink)| sink.bytes.as_deref() == Some(&payload(*item)[..])), "{round}");
    }
    let stats = workers.stats();
    assert_eq!((stats.read, stats.cached), (100, 200));
    assert_eq!(stats.cached_bytes, 2 * stats.read_bytes);
    let filled = all_items(50).filter(|&item| !payload(item).is_empty()).count() as u64;
    assert_eq!(mock.copies.load(Ordering::Relaxed), filled);
    // Control: without it everything is read each time.
    let (workers, _) = start(Mock { bricks: 50, ..Mock::default() }, 0, 2);
    (0..3).for_each(|_| drop(workers.load(requests(all_items(50))).unwrap()));
    assert_eq!((workers.stats().read, workers.stats().cached), (300, 0));
}

/// The statistics after a seeded sequence of batches through a host cache far too small for them.
fn stats_of_a_walk(threads: usize, seed: u64) -> impl PartialEq + std::fmt::Debug {
    let (workers, _) = start(Mock { bricks: 60, tiles: 40, ..Mock::default() }, 1200, threads);
    let mut random = Rng(seed);
    for _ in 0..60 {
        let count = random.below(30);
        let items: Vec<Item> = (0..count).map(|_| Item::from_index(random.below(120) as usize).unwrap()).collect();
        let loaded = workers.load(requests(items)).unwrap();
        assert!(loaded.iter().all(|(item, sink)| sink.bytes.as_deref() == Some(&payload(*item)[..])));
        assert!(workers.host_cache().stats().used_bytes <= 1200);
    }
    (workers.stats(), workers.host_cache().stats())
}

#[test]
fn counters_do_not_depend_on_threads() {
    let once = stats_of_a_walk(1, 7);
    for threads in [1, 2, 4, 4] {
        assert_eq!(stats_of_a_walk(threads, 7), once);
    }
    // Control: they depend on the requests.
    assert_ne!(stats_of_a_walk(1, 8), once);
}

#[test]
fn threads_end_with_the_pool() {
    let (workers, mock) = start(Mock { bricks: 20, ..Mock::default() }, 1 << 20, 3);
    workers.load(requests(all_items(20))).unwrap();
    assert!(Arc::strong_count(&mock) > 1, "control: the pool holds its source");
    drop(workers);
    assert_eq!(Arc::strong_count(&mock), 1, "a thread outlived the pool");
}
