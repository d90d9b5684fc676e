//! The targets of the foundation on the near path of a generated city: bytes moved against bytes needed (cold and steady),
//! round trips, memory, and `chc` ÷ `plain` in core, near and far. Prints a table and, with `--record DIR`, writes it there.
//!
//! Options (after `--`): `--triangles COUNT` (3M), `--size WxH` (640x360), `--frames N` (16), `--repeat N` (5), `--tile PIXELS`
//! (64), `--record DIR`. Walks that are compared are interleaved; the first 5 frames of a timed walk are left out.

use brickwalk::app::args::{Cli, Command};
use brickwalk::app::output::atomic;
use clap::Parser;
use serde_json::Value;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command as Process;

/// Options of this bench; `--bench` is what cargo passes.
#[derive(Parser)]
struct Options {
    #[arg(long, default_value = "3M")]
    triangles: String,
    #[arg(long, default_value = "640x360")]
    size: String,
    #[arg(long, default_value_t = 16)]
    frames: usize,
    #[arg(long, default_value_t = 5)]
    repeat: usize,
    #[arg(long, default_value_t = 64)]
    tile: u32,
    #[arg(long)]
    record: Option<PathBuf>,
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() {
    let options = Options::parse();
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("city-{}", options.triangles));
    atomic::create_folder(&folder).expect("a folder");
    let scene = folder.join("city.bricks");
    if !scene.exists() {
        let words =
            ["brickwalk", "scene", "city", "--triangles", &options.triangles, "-o"].map(std::ffi::OsString::from);
        let Cli { command, .. } = Cli::parse_from(words.into_iter().chain([scene.clone().into()]));
        assert!(matches!(command, Command::Scene(_)));
        brickwalk::app::run(&command).expect("a city");
    }
    let mut text = String::new();
    let head = summary(&walk(&options, &scene, "near", "--cache 20% --measure-needed", "cold"));
    let _ = writeln!(text, "# City of {} triangles, {}, {} frames\n", options.triangles, options.size, options.frames);
    let _ = writeln!(
        text,
        "Adapter {} ({}), upload by {}, commit {}, {} bricks of {:.1} MB, tile {} px, 1 ray a pixel and pass.\n",
        head["adapter"]["name"],
        head["adapter"]["driver_info"],
        head["adapter"]["upload"],
        head["commit"],
        head["scene"]["bricks"],
        head["scene"]["brick_bytes"].as_f64().unwrap_or(0.0) * 1e-6,
        options.tile
    );
    out_of_core(&folder.join("cold"), &mut text);
    in_core(&options, &scene, &mut text);
    print!("{text}");
    if let Some(record) = &options.record {
        atomic::create_folder(record).expect("the folder of results");
        let name = head["adapter"]["name"].as_str().unwrap_or("adapter").replace(|c: char| !c.is_alphanumeric(), "-");
        let file = record.join(format!("out-of-core-{}-{}-{name}.md", options.triangles, options.size));
        atomic::write(&file, text.as_bytes()).expect("the results");
    }
}

/// Runs a walk in a process of its own and returns its folder.
fn walk(options: &Options, scene: &Path, path: &str, more: &str, name: &str) -> PathBuf {
    let output = scene.with_file_name(name);
    let status = Process::new(env!("CARGO_BIN_EXE_brickwalk"))
        .arg("walk")
        .arg(scene)
        .arg("-o")
        .arg(&output)
        .arg("--path")
        .arg(scene.with_extension(format!("{path}.json")))
        .args(["--frames", &options.frames.to_string(), "--size", &options.size, "--tile", &options.tile.to_string()])
        .args(more.split_whitespace())
        .status();
    assert!(status.expect("the command starts").success(), "{more}");
    output
}

fn summary(folder: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(folder.join("summary.json")).expect("a summary")).expect("JSON")
}

fn records(folder: &Path, pass: &str) -> Vec<Value> {
    let text = std::fs::read_to_string(folder.join("records.jsonl")).expect("records");
    text.lines().map(|l| serde_json::from_str::<Value>(l).expect("a record")).filter(|r| r["pass"] == pass).collect()
}

fn out_of_core(folder: &Path, text: &mut String) {
    let _ = writeln!(text, "## Out of core, near path, cache 20 %\n");
    let _ = writeln!(
        text,
        "| pass | cold: loaded / needed | steady: loaded / needed and missing | round trips - batches, most |"
    );
    let _ = writeln!(text, "| --- | --- | --- | --- |");
    let n = |r: &Value, field: &str| r[field].as_f64().unwrap_or(0.0);
    let moved = |r: &Value| n(r, "bytes_bvh") + n(r, "bytes_geometry");
    for pass in ["primary", "shadow"] {
        let rows = records(folder, pass);
        let cold = moved(&rows[0]) / n(&rows[0], "bytes_needed_missing").max(1.0);
        let loaded: f64 = rows[1..].iter().map(moved).sum();
        let missing: f64 = rows[1..].iter().map(|r| n(r, "bytes_needed_missing")).sum();
        let trips = rows.iter().map(|r| n(r, "round_trips") - n(r, "load_batches")).fold(0.0, f64::max);
        let _ = writeln!(
            text,
            "| {pass} | {:.2} / {:.2} MB = {cold:.3} | {:.2} / {:.2} MB = {:.3} | {trips} |",
            moved(&rows[0]) * 1e-6,
            n(&rows[0], "bytes_needed_missing") * 1e-6,
            loaded * 1e-6,
            missing * 1e-6,
            loaded / missing.max(1.0)
        );
    }
    let memory = &summary(folder)["memory"];
    let cache = n(&records(folder, "primary")[0], "cache_bytes");
    let _ = writeln!(
        text,
        "\nPeak memory {:.0} MB of the process (mapped file pages {:.0} MB apart), of which the cache {:.0} MB, the host cache \
         at most 1024 MiB.\n",
        n(memory, "peak_bytes") * 1e-6,
        n(memory, "mapped_bytes") * 1e-6,
        cache * 1e-6
    );
}

fn in_core(options: &Options, scene: &Path, text: &mut String) {
    let _ = writeln!(text, "## In core: primary rays, ms a frame (device time of the traversal and of all queries)\n");
    let _ = writeln!(text, "| path | plain | chc | chc / plain |\n| --- | --- | --- | --- |");
    for path in ["near", "far"] {
        let mut times = [Vec::new(), Vec::new()];
        for _ in 0..options.repeat {
            for (side, schedule) in ["plain", "chc"].into_iter().enumerate() {
                let more = format!("--cache 100% --effects primary --schedule {schedule}");
                let rows = records(&walk(options, scene, path, &more, "timed"), "primary");
                let frames = rows.iter().skip(5.min(rows.len() - 1));
                let ms = |r: &Value| {
                    ["ms_phase1", "ms_phase2", "ms_phase3"].iter().filter_map(|f| r[*f].as_f64()).sum::<f64>()
                };
                times[side].push(frames.clone().map(ms).sum::<f64>() / frames.count() as f64);
            }
        }
        let [plain, chc] = times.map(median);
        let _ = writeln!(text, "| {path} | {plain:.2} | {chc:.2} | {:.3} |", chc / plain);
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
