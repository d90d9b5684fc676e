//! Scenes from a server on this machine: the same answers as from the file, whatever goes wrong, or one clear error.

mod entries;
mod server;

use super::disk::DiskCache;
use super::fetch::Limits;
use super::names;
use super::source;
use crate::math::random::Rng;
use crate::output::npy::{Hit, Ray};
use crate::query::Queries;
use crate::settings::CacheSize;
use bricks::{Payload, SceneFile};
use brickwalk_convert::build::{BuildSettings, build};
use brickwalk_convert::progress::Progress;
use brickwalk_scenes::{SoupKind, soup};
use server::{Fault, Manner, Server};
use std::path::Path;
use std::sync::atomic::Ordering;
use std::sync::{Arc, LazyLock};
use std::time::{Duration, Instant};

/// A scene file: some 6 MB in bricks of 100 KB, or few KB in tiny ones.
fn file_of(triangles: u32, brick_triangles: u32) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.bricks");
    let settings = BuildSettings { brick_triangles, ..BuildSettings::default() };
    build(soup(SoupKind::Uniform, triangles, 3), &settings, &path, &Progress::hidden()).unwrap();
    std::fs::read(path).unwrap()
}

static LARGE: LazyLock<Vec<u8>> = LazyLock::new(|| file_of(100_000, 2048));
static SMALL: LazyLock<Vec<u8>> = LazyLock::new(|| file_of(6000, 64));

/// Short times, so that tests are short.
fn limits() -> Limits {
    Limits {
        connect: Duration::from_secs(2),
        silence: Duration::from_millis(400),
        first_pause: Duration::from_millis(5),
        longest_pause: Duration::from_millis(50),
        ..Limits::default()
    }
}

fn open(server: &Server, disk: Option<&DiskCache>) -> anyhow::Result<Arc<SceneFile>> {
    let place = names::place(&names::name_with(Path::new(&server.url), disk.cloned()));
    source::open(&place, &limits()).map(Arc::new)
}

fn traffic(server: &Server) -> super::Traffic {
    names::traffic(Path::new(&server.url)).unwrap()
}

fn local(file: &[u8]) -> Arc<SceneFile> {
    Arc::new(SceneFile::from_bytes("local", file.to_vec()).unwrap())
}

fn rays() -> Vec<Ray> {
    let mut rng = Rng(5);
    let mut unit = || f64::from(rng.signed());
    let ray = |_| Ray {
        origin: [unit() * 12.0, unit() * 12.0, unit() * 12.0],
        direction: [unit(), unit(), unit()],
        t_min: 0.0,
        t_max: f64::INFINITY,
    };
    (0..4000).map(ray).collect()
}

/// The closest hits of rays, through a cache that is too small for the scene.
fn cast(scene: &Arc<SceneFile>) -> anyhow::Result<Vec<Hit>> {
    let queries = Queries::new(scene.clone(), CacheSize::Percent(60.0), 2)?;
    queries.cast(&rays(), &mut |_| Ok(()))
}

/// Hits as what can be compared.
fn bits(hits: &[Hit]) -> Vec<(u64, u32, u32)> {
    hits.iter().map(|hit| (hit.t.to_bits(), hit.triangle, hit.u.to_bits())).collect()
}

#[test]
fn answers_are_those_of_the_file_in_few_requests() {
    let server = Server::new(LARGE.clone(), Manner::default());
    let scene = open(&server, None).unwrap();
    // The header, and the resident part.
    assert_eq!(server.counts.requests.load(Ordering::Relaxed), 2);
    let opened = traffic(&server);
    let remote = cast(&scene).unwrap();
    let expected = cast(&local(&LARGE)).unwrap();
    assert_eq!(bits(&remote), bits(&expected));
    assert!(expected.iter().filter(|hit| hit.t.is_finite()).count() > 1000);
    // The control: of another scene they are others.
    assert_ne!(bits(&cast(&local(&SMALL)).unwrap()), bits(&expected));
    let all = traffic(&server);
    let (fetched, needed) = (all.bytes_fetched - opened.bytes_fetched, all.bytes_needed - opened.bytes_needed);
    println!("{all:?}: fetched / needed {:.4}", fetched as f64 / needed as f64);
    assert!(fetched as f64 <= 1.05 * needed as f64 && needed > 1 << 20);
    assert_eq!(all.requests, server.counts.requests.load(Ordering::Relaxed));
    assert_eq!((all.retries, all.bytes_fetched), (0, server.counts.bytes.load(Ordering::Relaxed)));
    // Every byte, in a few requests: payloads lie side by side.
    let report = scene.verify(&mut |_, _| ()).unwrap();
    assert!(report.is_ok(), "{:?}", report.problems);
    let requests = traffic(&server).requests - all.requests;
    assert!(report.payloads > 100 && requests <= 8, "{requests} requests");
}

#[test]
fn a_round_waits_for_the_link_and_one_latency() {
    let (latency, bandwidth) = (Duration::from_millis(50), 20e6);
    let manner = Manner { latency, bandwidth, ..Manner::default() };
    let server = Server::new(LARGE.clone(), manner.clone());
    let scene = open(&server, None).unwrap();
    let before = traffic(&server);
    let start = Instant::now();
    cast(&scene).unwrap();
    let (took, all) = (start.elapsed().as_secs_f64(), traffic(&server));
    let rounds = (all.round_trips - before.round_trips) as f64;
    let least = (all.bytes_fetched - before.bytes_fetched) as f64 / bandwidth + rounds * latency.as_secs_f64();
    let waited = all.seconds_waiting - before.seconds_waiting;
    println!("{rounds} rounds, {waited:.3} s of at least {least:.3} s: {:.3}; {took:.3} s in all", waited / least);
    assert!(waited <= 1.3 * least, "{waited} {least}");
    // The control: one payload after the other waits for as many latencies.
    let scene = open(&server, None).unwrap();
    let (before, start) = (traffic(&server), Instant::now());
    for brick in 0..20 {
        let mut out = vec![0; scene.loaded_bytes(Payload::Geometry(brick)) as usize];
        scene.copy(Payload::Geometry(brick), &mut out).unwrap();
    }
    let alone = traffic(&server);
    assert_eq!(alone.round_trips - before.round_trips, 20);
    let least = (alone.bytes_fetched - before.bytes_fetched) as f64 / bandwidth + latency.as_secs_f64();
    assert!(start.elapsed().as_secs_f64() > 2.0 * least);
}

#[test]
fn faults_are_survived() {
    let expected = bits(&cast(&local(&SMALL)).unwrap());
    for way in [Fault::Busy, Fault::Silence, Fault::Cut, Fault::Flip] {
        // Silence takes its time.
        for has_etag in [true, false].into_iter().take(if way == Fault::Silence { 1 } else { 2 }) {
            let (ways, faults): (&[Fault], f64) = match way {
                Fault::Busy => (&[Fault::Busy], 0.2),
                Fault::Silence => (&[Fault::Silence], 0.05),
                Fault::Cut => (&[Fault::Cut], 0.1),
                Fault::Flip => (&[Fault::Flip], 0.1),
            };
            let server = Server::new(SMALL.clone(), Manner { faults, ways, has_etag, ..Manner::default() });
            let scene = open(&server, None).unwrap();
            assert_eq!(bits(&cast(&scene).unwrap()), expected, "{way:?}");
            // So that some happen.
            let mut bytes = Vec::new();
            for brick in 0..24 {
                bytes.resize(scene.loaded_bytes(Payload::Geometry(brick)) as usize, 0);
                scene.copy(Payload::Geometry(brick), &mut bytes).unwrap();
            }
            let faults = server.counts.faults.load(Ordering::Relaxed);
            let retries = traffic(&server).retries;
            assert!(faults > 0 && retries > 0, "{way:?}: {faults} faults, {retries} retries");
        }
    }
    let server = Server::new(SMALL.clone(), Manner { faults: 0.05, ..Manner::default() });
    for _ in 0..5 {
        assert_eq!(bits(&cast(&open(&server, None).unwrap()).unwrap()), expected);
    }
    println!("{:?}", traffic(&server));
}

/// The error of a server that always answers so, after the scene was opened or on opening; and how long it took.
fn error_of(manner: Manner) -> (String, Duration) {
    let server = Server::new(SMALL.clone(), manner);
    let start = Instant::now();
    let error = open(&server, None).and_then(|scene| cast(&scene).map(|_| ())).unwrap_err();
    (format!("{error:#}"), start.elapsed())
}

#[test]
fn what_cannot_be_survived_is_named() {
    let always = |ways: &'static [Fault]| Manner { faults: 1.0, ways, ..Manner::default() };
    for (manner, part) in [
        (Manner { has_ranges: false, ..Manner::default() }, "does not answer range requests"),
        (Manner { replaced_after: 2, ..Manner::default() }, "was replaced after it was opened"),
        (Manner { replaced_after: 2, has_etag: false, ..Manner::default() }, "was replaced after it was opened"),
        (always(&[Fault::Busy]), "503"),
        (always(&[Fault::Cut]), "cut off"),
        (always(&[Fault::Flip]), "is damaged: found checksum"),
    ] {
        let (error, took) = error_of(manner);
        assert!(error.contains(part) && error.contains("a.bricks"), "{part}: {error}");
        assert!(!error.contains('\n') && took < Duration::from_secs(20), "{took:?}: {error}");
    }
    let nobody = Path::new("http://127.0.0.1:9/a.bricks?sig=5ec2e7");
    let error = source::open(&names::place(nobody), &limits()).unwrap_err();
    let error = format!("{error:#} {error:?}");
    assert!(error.contains("there is no connection") && !error.contains("5ec2e7"), "{error}");
}

#[test]
fn the_disk_cache_saves_all_but_the_head() {
    let folder = tempfile::tempdir().unwrap();
    let disk = DiskCache { folder: folder.path().join("cache"), bytes: 64 << 20 };
    let server = Server::new(SMALL.clone(), Manner::default());
    let first = cast(&open(&server, Some(&disk)).unwrap()).unwrap();
    let requests = || server.counts.requests.load(Ordering::Relaxed);
    let cold = requests();
    let hits = traffic(&server).disk_cache_hits;
    assert_eq!(bits(&cast(&open(&server, Some(&disk)).unwrap()).unwrap()), bits(&first));
    assert_eq!(requests(), cold + 1);
    assert!(traffic(&server).disk_cache_hits > hits && cold > 2);
    // What was flipped or cut off is fetched again.
    let mut entries: Vec<_> = std::fs::read_dir(&disk.folder)
        .unwrap()
        .flatten()
        .filter_map(|folder| std::fs::read_dir(folder.path()).ok())
        .flat_map(|folder| folder.flatten().map(|entry| entry.path()))
        .collect();
    entries.sort();
    for (number, entry) in entries.iter().enumerate() {
        let mut bytes = std::fs::read(entry).unwrap();
        match number % 3 {
            0 => bytes.truncate(bytes.len() - 1),
            1 => *bytes.last_mut().unwrap() ^= 1,
            _ => continue,
        }
        std::fs::write(entry, bytes).unwrap();
    }
    assert!(entries.len() > 20, "{}", entries.len());
    assert_eq!(bits(&cast(&open(&server, Some(&disk)).unwrap()).unwrap()), bits(&first));
    assert!(requests() > cold + 2);
    let again = requests();
    cast(&open(&server, Some(&disk)).unwrap()).unwrap();
    assert_eq!(requests(), again + 1);
    // The control: without it everything is fetched.
    let other = Server::new(SMALL.clone(), Manner::default());
    cast(&open(&other, None).unwrap()).unwrap();
    let one = other.counts.requests.load(Ordering::Relaxed);
    cast(&open(&other, None).unwrap()).unwrap();
    assert_eq!(other.counts.requests.load(Ordering::Relaxed), 2 * one);
}

#[test]
fn wrong_bytes_do_not_stay_in_the_disk_cache() {
    let folder = tempfile::tempdir().unwrap();
    let disk = DiskCache { folder: folder.path().into(), bytes: 64 << 20 };
    let expected = bits(&cast(&local(&SMALL)).unwrap());
    let ways = &[Fault::Flip];
    let server = Server::new(SMALL.clone(), Manner { faults: 0.1, ways, ..Manner::default() });
    for _ in 0..3 {
        assert_eq!(bits(&cast(&open(&server, Some(&disk)).unwrap()).unwrap()), expected);
    }
    assert!(server.counts.faults.load(Ordering::Relaxed) > 0);
}
