//! The targets of the foundation on the near path of a generated city: bytes moved against bytes needed (cold and
//! steady), round trips, memory, and `chc` ÷ `plain` in core, near and far. Prints a table and, with `--record DIR`,
//! writes it there.
//!
//! Options (after `--`): `--triangles COUNT` (3M), `--size WxH` (640x360), `--frames N` (16), `--repeat N` (5), `--tile
//! PIXELS` (64), `--record DIR`. Walks that are compared are interleaved; the first 5 frames of a timed walk are left
//! out.

mod common;

use brickwalk::output::atomic;
use clap::Parser;
use common::{bytes_moved, device_ms, median, number, records, summary};
use std::fmt::Write;
use std::path::{Path, PathBuf};

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
        let words = format!("--triangles {}", options.triangles);
        common::brickwalk("scene city", &[Path::new("-o"), &scene], &words);
    }
    let mut text = String::new();
    let head = summary(&walk(&options, &scene, "near", "--cache 20% --measure-needed --schedule chc", "cold"));
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

/// Walks along a path of the scene in a process of its own and returns the walk's folder.
fn walk(options: &Options, scene: &Path, path: &str, more: &str, name: &str) -> PathBuf {
    let output = scene.with_file_name(name);
    let words = format!("--frames {} --size {} --tile {} {more}", options.frames, options.size, options.tile);
    common::walk(scene, &scene.with_extension(format!("{path}.json")), &output, &words);
    output
}

fn out_of_core(folder: &Path, text: &mut String) {
    let _ = writeln!(text, "## Out of core, near path, cache 20 %\n");
    let _ = writeln!(
        text,
        "| pass | cold: loaded / needed | steady: loaded / needed and missing | round trips - batches, most |"
    );
    let _ = writeln!(text, "| --- | --- | --- | --- |");
    for pass in ["primary", "shadow"] {
        let rows = records(folder, pass);
        let cold = bytes_moved(&rows[0]) / number(&rows[0], "bytes_needed_missing").max(1.0);
        let loaded: f64 = rows[1..].iter().map(bytes_moved).sum();
        let missing: f64 = rows[1..].iter().map(|r| number(r, "bytes_needed_missing")).sum();
        let trips = rows.iter().map(|r| number(r, "round_trips") - number(r, "load_batches")).fold(0.0, f64::max);
        let _ = writeln!(
            text,
            "| {pass} | {:.2} / {:.2} MB = {cold:.3} | {:.2} / {:.2} MB = {:.3} | {trips} |",
            bytes_moved(&rows[0]) * 1e-6,
            number(&rows[0], "bytes_needed_missing") * 1e-6,
            loaded * 1e-6,
            missing * 1e-6,
            loaded / missing.max(1.0)
        );
    }
    let memory = &summary(folder)["memory"];
    let cache = number(&records(folder, "primary")[0], "cache_bytes");
    let _ = writeln!(
        text,
        "\nPeak memory {:.0} MB of the process (mapped file pages {:.0} MB apart), of which the cache {:.0} MB, the \
         host cache at most 1024 MiB.\n",
        number(memory, "peak_bytes") * 1e-6,
        number(memory, "mapped_bytes") * 1e-6,
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
                times[side].push(frames.clone().map(device_ms).sum::<f64>() / frames.count() as f64);
            }
        }
        let [plain, chc] = times.map(median);
        let _ = writeln!(text, "| {path} | {plain:.2} | {chc:.2} | {:.3} |", chc / plain);
    }
}
