//! The processor's kernels against other programs: the same triangles and the same rays, dumped, in turns.
//! `tools/peer.sh` builds Embree's side (`benches/peer/embree.cpp`) and runs this. PEERS names programs that speak
//! `benches/peer/protocol.h`, as PATH names folders; the crate obvhs is always measured.
//!
//! Camera rays of the first view of the near path; from every hit a ray 4 m long that any hit ends (AO), and one that
//! looks for the closest (diffuse), their directions distributed by the cosine and random by pixel. Everything is
//! resident. Rates are medians of the turns: rays by processor time of one thread, and rays by the clock where all
//! threads trace. Ours walks from the root (`plain`) and with tiles' lists (`chc`).
//!
//! Words are sizes of generated cities. `--plot FILE` draws the rates over them.

#[path = "../common/mod.rs"]
mod common;
mod judge;
mod obvhs_trees;
mod ours;
mod plot;
mod program;
mod table;

use brickwalk::kernels::layout::Ray;
use judge::{Case, Corners};
use obvhs_trees::Trees;
use ours::{Ours, Scene, squares};
use program::Program;
use std::path::PathBuf;
use table::{Row, Timed};

/// Metres.
const OCCLUSION_LENGTH: f64 = 4.0;
/// Metres from a hit to where rays from it begin: none meets its own surface, which others are not told to leave out.
const START: f64 = 1e-3;
const SETS: [&str; 3] = ["primary", "AO", "diffuse"];
const TURNS: usize = 7;
/// Most rays of a set on whose hit a peer may differ: those through edges, where it rounds.
const MOST_APART: f64 = 1e-3;
/// Hits are the same whose distances differ by this share at most.
const NEAR: f32 = 1e-3;

/// What rays of a set took once, and found.
pub struct Measured {
    /// Seconds of all threads.
    processor: f64,
    /// Seconds by the clock.
    wall: f64,
    /// By ray in the order of [`squares`]: infinite without a hit; of rays that any hit ends 0 with one.
    distances: Vec<f32>,
}

/// A column of the tables.
pub struct Column {
    title: String,
    modes: Vec<String>,
}

/// Who traces.
pub trait Peer {
    /// Its columns, in the order in which its modes count.
    fn columns(&self) -> &[Column];
    /// Traces a set in a mode; modes count through all columns.
    fn measure(&mut self, mode: usize, set: usize, threads: usize) -> Measured;
}

/// Seconds that all threads of this process have run for, those that have ended included.
pub fn processor_seconds() -> f64 {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: `time` is a timespec that may be written.
    let status = unsafe { libc::clock_gettime(libc::CLOCK_PROCESS_CPUTIME_ID, &mut time) };
    assert_eq!(status, 0, "the processor's time is known");
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

/// A city of so many triangles, made once.
fn city(triangles: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("peer-{triangles}.bricks"));
    if !path.exists() {
        common::city(triangles, &path);
    }
    path
}

/// The rays of a city in the order of [`squares`], and its triangles.
struct Input {
    rays: [Vec<Ray>; 3],
    triangles: Vec<Corners>,
}

/// The rays on whose hit two do not agree: whether there is one, or where.
fn apart(a: &[f32], b: &[f32]) -> Vec<usize> {
    let differ = |a: f32, b: f32| a.is_finite() != b.is_finite() || (a - b).abs() > NEAR * a.max(b);
    (0..a.len()).filter(|&ray| differ(a[ray], b[ray])).collect()
}

/// All peers in turns, with one thread and with all.
fn measure(peers: &mut [Box<dyn Peer>], input: &Input, set: usize, traced: usize, threads: usize) -> Vec<Timed> {
    let rays = &input.rays[set];
    let mut columns: Vec<(usize, usize, Timed)> = Vec::new();
    for (peer, of) in peers.iter().enumerate() {
        let mut first_mode = 0;
        for column in of.columns() {
            columns.push((peer, first_mode, Timed::new(column)));
            first_mode += column.modes.len();
        }
    }
    // Those of the first measurement, which is ours.
    let mut distances = Vec::new();
    for _ in 0..TURNS {
        for (peer, first_mode, timed) in &mut columns {
            for (k, mode) in timed.modes.iter_mut().enumerate() {
                let alone = peers[*peer].measure(*first_mode + k, set, 1);
                let together = peers[*peer].measure(*first_mode + k, set, threads);
                mode.processor.push(alone.processor);
                mode.wall.push(together.wall);
                if distances.is_empty() {
                    distances.clone_from(&alone.distances);
                }
                for found in [&alone, &together] {
                    let apart = apart(&distances, &found.distances);
                    let share = apart.len() as f64 / traced as f64;
                    let (title, set) = (&timed.title, SETS[set]);
                    assert!(share <= MOST_APART, "{title}, {set}: {share} of the rays have other hits than ours");
                    if apart.len() > timed.apart.len() {
                        let case = |ray: usize| Case { ray: rays[ray], found: [distances[ray], found.distances[ray]] };
                        timed.apart = apart.into_iter().map(case).collect();
                    }
                }
            }
        }
    }
    columns.iter_mut().for_each(|(_, _, timed)| timed.right = judge::right(&timed.apart, &input.triangles, set == 1));
    columns.into_iter().map(|(_, _, timed)| timed).collect()
}

fn main() {
    let programs: Vec<PathBuf> =
        std::env::var_os("PEERS").map_or_else(Vec::new, |all| std::env::split_paths(&all).collect());
    if programs.is_empty() {
        println!("peer: skipped, for PEERS names no program; run tools/peer.sh");
        return;
    }
    let mut words = std::env::args().skip(1).filter(|word| word != "--bench");
    let (mut cities, mut picture) = (Vec::new(), None);
    while let Some(word) = words.next() {
        match &*word {
            "--plot" => picture = Some(PathBuf::from(words.next().expect("--plot FILE.svg"))),
            _ => cities.push(word),
        }
    }
    if cities.is_empty() {
        cities = vec!["1M".into(), "5M".into()];
    }
    let threads = std::thread::available_parallelism().map_or(1, |count| count.get());
    println!("{}", brickwalk::cpu::device_info().driver_info);
    let mut rows: Vec<Row> = Vec::new();
    for city_of in cities {
        let path = city(&city_of);
        let dump = path.with_extension("dump");
        let scene = Scene::new(&path, false);
        let triangles = scene.dump(&dump).expect("a dump");
        let traced = |rays: &Vec<Ray>| rays.iter().filter(|ray| ray.t_min <= ray.t_max).count();
        let traced = scene.sets.each_ref().map(traced);
        let rays = scene.sets.each_ref().map(|rays| squares().into_iter().map(|pixel| rays[pixel]).collect());
        drop(scene);
        let input = Input { triangles: ours::triangles(&dump, &rays), rays };
        let mut peers: Vec<Box<dyn Peer>> = vec![Box::new(Ours::new(&path, true)), Box::new(Ours::new(&path, false))];
        for program in &programs {
            peers.push(Box::new(Program::new(program, &dump, input.rays[0].len())));
        }
        peers.push(Box::new(Trees::new(&input.triangles, input.rays.clone())));
        std::fs::remove_file(&dump).expect("its own file");
        for (set, name) in SETS.into_iter().enumerate() {
            eprintln!("{city_of}, {name} ...");
            let columns = measure(&mut peers, &input, set, traced[set], threads);
            rows.push(Row { city: city_of.clone(), triangles, set, traced: traced[set], columns });
        }
    }
    table::print(&rows, threads);
    if let Some(picture) = picture {
        plot::draw(&picture, &rows).expect("a plot");
    }
}
