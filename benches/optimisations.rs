//! What each optimisation saves or costs in time, queries and bytes moved: walks along the near path of a generated
//! city with one switched off (or on, where it is off by itself) against walks with all as they are. Prints tables and,
//! with `--record DIR`, writes them there.
//!
//! Options (after `--`): `--triangles COUNT` (500K), `--brick-triangles COUNT` (4K), `--size WxH` (320x180), `--frames
//! N` (12), `--effects LIST` (shadow,ao; one ray of ao and diffuse a pixel), `--repeat N` (5), `--tile PIXELS` (32),
//! `--cache P%` (20%), `--record DIR`. Walks are interleaved; of every frame the least time of all repetitions counts,
//! so that what else the machine does shows least, and the first 5 frames are left out. Counters are those of one walk,
//! all frames.

mod common;

use brickwalk::output::atomic;
use clap::Parser;
use common::{bytes_moved, number, records, summary};
use serde_json::Value;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Options of this bench; `--bench` is what cargo passes.
#[derive(Parser)]
struct Options {
    #[arg(long, default_value = "500K")]
    triangles: String,
    #[arg(long, default_value = "4K")]
    brick_triangles: String,
    #[arg(long, default_value = "320x180")]
    size: String,
    #[arg(long, default_value_t = 12)]
    frames: usize,
    #[arg(long, default_value = "shadow,ao")]
    effects: String,
    #[arg(long, default_value_t = 5)]
    repeat: usize,
    #[arg(long, default_value_t = 32)]
    tile: u32,
    #[arg(long, default_value = "20%")]
    cache: String,
    #[arg(long)]
    record: Option<PathBuf>,
    #[arg(long, hide = true)]
    bench: bool,
}

/// A schedule and what is compared with it: options of walks.
const GROUPS: &[(&str, &[&str])] = &[
    (
        "--schedule chc",
        &[
            "--without nearest-first",
            "--without requery",
            "--without requery,nearest-first",
            "--without resident-first",
            "--without front-to-back",
            "--without by-tile",
        ],
    ),
    (
        "--schedule demand",
        &[
            "--without nearest-first",
            "--without requery",
            "--without requery,nearest-first",
            "--without resident-first",
        ],
    ),
    (
        "--schedule chc --fronts on",
        &[
            "--without multi-queries",
            "--without tighter-bounds",
            "--without lazy-requery",
            "--without pull-up",
            "--without front-to-back",
        ],
    ),
];

/// Effects, and the passes that belong to each.
const EFFECTS: &[(&str, &[&str])] =
    &[("primary", &["primary"]), ("shadow", &["shadow"]), ("ao", &["ao"]), ("diffuse", &["diffuse", "diffuse-shadow"])];

/// Frames whose times do not count.
const FIRST_FRAMES: usize = 5;

/// A variant, and what was measured of it.
struct Variant {
    words: String,
    /// Of one walk: rows of each effect.
    rows: Vec<Vec<Value>>,
    /// Milliseconds of each effect by frame, the least of all repetitions.
    ms: Vec<Vec<f64>>,
}

fn main() {
    let options = Options::parse();
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR"))
        .join(format!("optimisations-{}-{}", options.triangles, options.brick_triangles));
    atomic::create_folder(&folder).expect("a folder");
    let scene = folder.join("city.bricks");
    if !scene.exists() {
        let words = format!("--triangles {} --brick-triangles {}", options.triangles, options.brick_triangles);
        common::brickwalk("scene city", &[Path::new("-o"), &scene], &words);
    }
    let output = folder.join("walk");
    let mut groups: Vec<Vec<Variant>> = Vec::new();
    for (schedule, switches) in GROUPS {
        let words = std::iter::once(schedule.to_string()).chain(switches.iter().map(|s| format!("{schedule} {s}")));
        let fresh =
            |words| Variant { words, rows: Vec::new(), ms: vec![vec![f64::INFINITY; options.frames]; EFFECTS.len()] };
        groups.push(words.map(fresh).collect());
    }
    for _ in 0..options.repeat {
        groups.iter_mut().flatten().for_each(|variant| measure(&options, &scene, &output, variant));
    }
    let text = report(&options, &summary(&output), &groups);
    print!("{text}");
    if let Some(record) = &options.record {
        atomic::create_folder(record).expect("the folder of results");
        let file = record.join(format!("optimisations-{}-{}.md", options.triangles, options.size));
        atomic::write(&file, text.as_bytes()).expect("the results");
    }
}

fn measure(options: &Options, scene: &Path, output: &Path, variant: &mut Variant) {
    let Options { frames, size, tile, cache, effects, .. } = options;
    let words = format!(
        "--frames {frames} --size {size} --tile {tile} --cache {cache} --effects {effects} --ao-rays 1 \
         --diffuse-rays 1 {}",
        variant.words
    );
    common::walk(scene, &scene.with_extension("near.json"), output, &words);
    variant.rows = EFFECTS.iter().map(|(_, passes)| passes.iter().flat_map(|p| records(output, p)).collect()).collect();
    for (ms, rows) in variant.ms.iter_mut().zip(&variant.rows) {
        for (frame, least) in ms.iter_mut().enumerate() {
            let of_frame = rows.iter().filter(|r| number(r, "frame") == frame as f64);
            *least = least.min(of_frame.map(|r| number(r, "ms")).sum());
        }
    }
}

fn report(options: &Options, head: &Value, groups: &[Vec<Variant>]) -> String {
    let mut text = String::new();
    let _ = writeln!(
        text,
        "# Optimisations, city of {} triangles, {}, {} frames of the near path\n\nAdapter {} ({}), commit {}, {} \
         bricks of {:.1} MB, cache {}, tile {} px, effects {}, one ray each. {} interleaved repetitions.\n",
        options.triangles,
        options.size,
        options.frames,
        head["adapter"]["name"],
        head["adapter"]["driver_info"],
        head["commit"],
        head["scene"]["bricks"],
        head["scene"]["brick_bytes"].as_f64().unwrap_or(0.0) * 1e-6,
        options.cache,
        options.tile,
        options.effects,
        options.repeat
    );
    let names: Vec<&str> = groups[0][0].shown().map(|i| EFFECTS[i].0).collect();
    let _ = writeln!(text, "## Time: ms a frame with all as they are, and its multiples with one switched\n");
    let _ = writeln!(text, "| options | {} | all |\n|{}", names.join(" | "), " --- |".repeat(names.len() + 2));
    for group in groups {
        let times: Vec<Vec<f64>> = group.iter().map(Variant::times).collect();
        for (variant, ms) in group.iter().zip(&times) {
            let of_base = |(ms, base): (&f64, &f64)| format!("{:.2}", ms / base);
            let cells: Vec<String> = match std::ptr::eq(variant, &group[0]) {
                true => ms.iter().map(|ms| format!("{ms:.1} ms")).collect(),
                false => ms.iter().zip(&times[0]).map(of_base).collect(),
            };
            let _ = writeln!(text, "| `{}` | {} |", variant.words, cells.join(" | "));
        }
    }
    let _ = writeln!(text, "\n## Queries, bytes of geometry moved, round trips: all frames\n");
    let _ = writeln!(
        text,
        "| options | queries | MB, first frame, primary | MB, first frame, all | MB, later frames | \
         pairs intersected | round trips |\n| --- | --- | --- | --- | --- | --- | --- |"
    );
    for variant in groups.iter().flatten() {
        let all = || variant.rows.iter().flatten();
        let sum = |field: &str| all().map(|r| number(r, field)).sum::<f64>();
        let first = |r: &&Value| number(r, "frame") == 0.0;
        let mb = |rows: f64| format!("{:.2}", rows * 1e-6);
        let _ = writeln!(
            text,
            "| `{}` | {} | {} | {} | {} | {} | {} |",
            variant.words,
            sum("queries"),
            mb(variant.rows[0].iter().filter(first).map(bytes_moved).sum()),
            mb(all().filter(first).map(bytes_moved).sum()),
            mb(all().filter(|r| !first(r)).map(bytes_moved).sum()),
            sum("pairs_intersected"),
            sum("round_trips")
        );
    }
    text
}

impl Variant {
    /// The effects that were traced.
    fn shown(&self) -> impl Iterator<Item = usize> {
        (0..EFFECTS.len()).filter(|&effect| !self.rows[effect].is_empty())
    }

    /// Milliseconds a frame of each effect, and of all.
    fn times(&self) -> Vec<f64> {
        let late = |ms: &[f64]| ms.iter().skip(FIRST_FRAMES).sum::<f64>() / (ms.len() - FIRST_FRAMES) as f64;
        let mut times: Vec<f64> = self.shown().map(|effect| late(&self.ms[effect])).collect();
        times.push(times.iter().sum());
        times
    }
}
