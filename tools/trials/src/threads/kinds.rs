//! Threads that use what they share, and what has to hold whatever their order.

use super::host_cache::HostCache;
use super::inbox::{Inbox, Turn};
use crate::kind::{Fault, Kind, Limits, Outcome, Trial};
use crate::random::Random;
use crate::stream::sync::{Arc, AtomicBool};
use brickwalk::Settings;
use brickwalk::scene::Camera;
use brickwalk::stream::Item;
use brickwalk::view::studio::{Ask, Overlay, Wish};
use glam::DVec3;
use shuttle::scheduler::{PctScheduler, RandomScheduler, Scheduler};
use shuttle::{Config, Runner, thread};
use std::sync::atomic::Ordering;

/// Orders of threads of a trial.
const ORDERS: usize = 8;

/// Bytes that a trial may take.
const MOST_BYTES: u64 = 64 << 20;

/// Runs `shared` under some orders. A deadlock or a failed assertion panics, which is a finding.
fn orders(random: &mut Random, shared: impl Fn() + Send + Sync + 'static) {
    let seed = random.word();
    let scheduler: Box<dyn Scheduler + Send> = if random.chance(50) {
        Box::new(RandomScheduler::new_from_seed(seed, ORDERS))
    } else {
        // Orders with few changes of threads, of which many defects need one at a place that is rarely met.
        Box::new(PctScheduler::new_from_seed(seed, random.within(1, 4), ORDERS))
    };
    let mut config = Config::new();
    // Trials find panics by themselves.
    config.failure_persistence = shuttle::FailurePersistence::None;
    Runner::new(scheduler, config).run(shared);
}

/// The inbox of a studio.
pub struct Inboxes;

fn wish(x: f64) -> Wish {
    let camera = Camera { position: DVec3::X * x, target: DVec3::ZERO, up: DVec3::Y, fov_y: 1.0 };
    Wish { camera, settings: Settings::default(), overlay: Overlay::None }
}

impl Kind for Inboxes {
    fn name(&self) -> &'static str {
        "threads/inbox"
    }

    fn about(&self) -> &'static str {
        "Wishes and questions of several threads to a studio: none is lost, the last wish is seen, nobody waits in vain"
    }

    fn limits(&self) -> Limits {
        Limits { seconds: 60.0, bytes: MOST_BYTES }
    }

    fn trial(&self, trial: &Trial) -> Result<Outcome, Fault> {
        let mut random = Random::new(self.name(), trial.seed);
        let (wishes, asks, askers) = (random.below(5), random.below(4), random.within(1, 3));
        orders(&mut random, move || {
            let inbox = Arc::new(Inbox::default());
            let wisher = inbox.clone();
            let mut told = vec![thread::spawn(move || (0..wishes).for_each(|x| wisher.wish(wish(x as f64))))];
            told.extend((0..askers).map(|_| {
                let own = inbox.clone();
                thread::spawn(move || (0..asks).for_each(|_| own.ask(Ask::Compare)))
            }));
            let has_looked = Arc::new(AtomicBool::new(false));
            let (hears, looked) = (inbox.clone(), has_looked.clone());
            let studio = thread::spawn(move || {
                let (mut last, mut answered) = (None, 0);
                loop {
                    if answered == asks * askers && last == wishes.checked_sub(1) && !looked.load(Ordering::Relaxed) {
                        // What has been looked at makes no picture give way.
                        assert!(!hears.is_newer(), "a picture gives way to nothing");
                        looked.store(true, Ordering::Relaxed);
                    }
                    match hears.next(None) {
                        Turn::Quit => return (last, answered),
                        Turn::Ask(_) => answered += 1,
                        Turn::Wish(wish) => {
                            let x = wish.camera.position.x as usize;
                            assert!(last.is_none_or(|last| last < x), "an older wish comes after a newer one");
                            last = Some(x);
                        }
                        turn => panic!("{turn:?}"),
                    }
                }
            });
            for thread in told {
                assert!(thread.join().is_ok());
            }
            // Until all has been taken; then the end.
            while !has_looked.load(Ordering::Relaxed) {
                thread::yield_now();
            }
            inbox.quit();
            let ended = studio.join();
            assert!(ended.is_ok_and(|ended| ended == (wishes.checked_sub(1), asks * askers)), "something was lost");
        });
        Ok(Outcome::Passed)
    }
}

/// The cache of a host.
pub struct HostCaches;

impl Kind for HostCaches {
    fn name(&self) -> &'static str {
        "threads/host-cache"
    }

    fn about(&self) -> &'static str {
        "Workers that reserve, fill, give up and read: never more bytes than allowed, the payload that was put in"
    }

    fn limits(&self) -> Limits {
        Limits { seconds: 60.0, bytes: MOST_BYTES }
    }

    fn trial(&self, trial: &Trial) -> Result<Outcome, Fault> {
        let mut random = Random::new(self.name(), trial.seed);
        let budget = random.pick([0u64, 24, 64, 200]);
        let workers = random.within(2, 3);
        let steps: Vec<Vec<(u32, usize)>> =
            (0..workers).map(|_| (0..4).map(|_| (random.below(5) as u32, random.below(4))).collect()).collect();
        orders(&mut random, move || {
            let cache = HostCache::new(budget);
            let threads: Vec<_> = steps
                .iter()
                .cloned()
                .map(|steps| {
                    let cache = cache.clone();
                    thread::spawn(move || steps.into_iter().for_each(|step| work(&cache, step)))
                })
                .collect();
            for thread in threads {
                assert!(thread.join().is_ok());
            }
            let stats = cache.stats();
            let held = (0..5).filter(|&brick| cache.contains(Item::geometry(brick)));
            let bytes: u64 = held.clone().map(length).sum();
            assert_eq!((stats.used_bytes, stats.entries), (bytes, held.count() as u64), "bytes that nobody holds");
            assert_eq!(stats.inserted, stats.entries + stats.evicted);
        });
        Ok(Outcome::Passed)
    }
}

/// Bytes of a brick's payload.
fn length(brick: u32) -> u64 {
    8 + 8 * u64::from(brick)
}

/// What a worker does with a brick.
fn work(cache: &Arc<HostCache>, (brick, way): (u32, usize)) {
    let item = Item::geometry(brick);
    let payload = vec![brick as u8; length(brick) as usize];
    match cache.get(item) {
        Some(found) => assert_eq!(*found, *payload, "another payload"),
        None => {
            if let Some(reservation) = cache.reserve(item, length(brick)) {
                assert!(cache.stats().used_bytes <= cache.budget_bytes(), "more than allowed");
                match way {
                    0 => drop(reservation),
                    1 => reservation.fill(&payload[1..]),
                    2 => reservation.share(payload.into()),
                    _ => reservation.fill(&payload),
                }
            }
        }
    }
}
