//! Bricks of 4K to 256K triangles: what a frame asks, loads and takes. Prints a table a scene and, with `--record DIR`,
//! writes them there. The default of `--brick-triangles` comes from this table.
//!
//! Scenes: a generated city and the interior of generated pipes on their near paths, and Sponza where
//! `BRICKWALK_SCENES` is set. Options (after `--`): `--triangles COUNT` (2M) of the generated scenes, `--size WxH`
//! (480x270), `--frames N` (10), `--repeat N` (3), `--bricks LIST` (4K,…,256K), `--record DIR`. The walks of all sizes
//! are interleaved; the first 2 frames of each are left out of its times. A cache holds two bricks at least: sizes of
//! which a fifth of the scene holds no two are walked in core only.

mod common;

use brickwalk::output::atomic;
use brickwalk::session::opened::open_scene;
use brickwalk::stream::PayloadSource;
use clap::Parser;
use common::{brickwalk, bytes_moved, device_ms, median, number, records, summary, walk};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Frames that start a walk and are not timed.
const WARM_UP: usize = 2;

/// Options of this bench; `--bench` is what cargo passes.
#[derive(Parser)]
struct Options {
    #[arg(long, default_value = "2M")]
    triangles: String,
    #[arg(long, default_value = "480x270")]
    size: String,
    #[arg(long, default_value_t = 10)]
    frames: usize,
    #[arg(long, default_value_t = 3)]
    repeat: usize,
    #[arg(long, value_delimiter = ',', default_value = "4K,8K,16K,32K,64K,128K,256K")]
    bricks: Vec<String>,
    #[arg(long)]
    record: Option<PathBuf>,
    #[arg(long, hide = true)]
    bench: bool,
}

/// A scene with bricks of one size.
struct Cut {
    triangles: String,
    file: PathBuf,
    /// Whether a fifth of the scene holds the two largest bricks.
    is_walked_out_of_core: bool,
    /// Device time of primary rays and their queries, ms a frame, of every repetition: out of core, in core by `chc`
    /// and by `plain`.
    ms: [Vec<f64>; 3],
}

fn main() {
    let options = Options::parse();
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("brick-sizes-{}", options.triangles));
    atomic::create_folder(&folder).expect("a folder");
    let mut text = String::new();
    for kind in ["city", "pipes"] {
        let make = |file: &Path, bricks: &str| {
            let words = format!("--triangles {} --brick-triangles {bricks}", options.triangles);
            brickwalk(&format!("scene {kind}"), &[Path::new("-o"), file], &words);
        };
        measure(&options, &folder, kind, make, |file| file.with_extension("near.json"), &mut text);
    }
    match std::env::var_os("BRICKWALK_SCENES") {
        None => eprintln!("Sponza was left out: BRICKWALK_SCENES is not set to the folder of scenes"),
        Some(scenes) => {
            let source = Path::new(&scenes).join("sponza/Sponza.gltf");
            let make = |file: &Path, bricks: &str| {
                brickwalk("convert", &[&source, Path::new("-o"), file], &format!("--brick-triangles {bricks}"));
            };
            let path = |_: &Path| Path::new(env!("CARGO_MANIFEST_DIR")).join("paths/sponza.json");
            measure(&options, &folder, "sponza", make, path, &mut text);
        }
    }
    print!("{text}");
    if let Some(record) = &options.record {
        atomic::create_folder(record).expect("the folder of results");
        atomic::write(&record.join(format!("brick-sizes-{}.md", options.size)), text.as_bytes()).expect("the results");
    }
}

/// Makes a scene with bricks of all sizes, walks through each and writes the table.
fn measure(
    options: &Options,
    folder: &Path,
    kind: &str,
    make: impl Fn(&Path, &str),
    path: impl Fn(&Path) -> PathBuf,
    text: &mut String,
) {
    let cuts = options.bricks.iter().map(|bricks| {
        let file = folder.join(format!("{kind}-{bricks}.bricks"));
        if !file.exists() {
            make(&file, bricks);
        }
        let mut bytes: Vec<u64> = open_scene(&file)
            .expect("the scene")
            .sizes()
            .bricks
            .iter()
            .map(|(geometry, attributes)| geometry + attributes)
            .collect();
        bytes.sort_unstable_by(|a, b| b.cmp(a));
        let is_walked_out_of_core = 5 * bytes.iter().take(2).sum::<u64>() <= bytes.iter().sum();
        Cut { triangles: bricks.clone(), file, is_walked_out_of_core, ms: Default::default() }
    });
    let mut cuts: Vec<Cut> = cuts.collect();
    let common = format!("--frames {} --size {} --effects primary", options.frames, options.size);
    let output = |cut: &Cut, name: &str| folder.join(format!("{kind}-{}-{name}", cut.triangles));
    for cut in &cuts {
        let cache = if cut.is_walked_out_of_core { "20%" } else { "100%" };
        let words = format!("{common} --cache {cache} --schedule chc --measure-needed");
        walk(&cut.file, &path(&cut.file), &output(cut, "needed"), &words);
    }
    let ways = [
        ("out", "--cache 20% --schedule chc"),
        ("chc", "--cache 100% --schedule chc"),
        ("plain", "--cache 100% --schedule plain"),
    ];
    for _ in 0..options.repeat {
        for cut in &mut cuts {
            let first = usize::from(!cut.is_walked_out_of_core);
            for (way, (name, words)) in ways.into_iter().enumerate().skip(first) {
                let folder = output(cut, name);
                walk(&cut.file, &path(&cut.file), &folder, &format!("{common} {words}"));
                let rows = records(&folder, "primary");
                let frames = &rows[WARM_UP.min(rows.len() - 1)..];
                cut.ms[way].push(frames.iter().map(device_ms).sum::<f64>() / frames.len() as f64);
            }
        }
    }

    let head = summary(&output(&cuts[0], "needed"));
    let _ = writeln!(text, "# Brick sizes: {kind}, {} triangles\n", head["scene"]["triangles"]);
    let _ = writeln!(
        text,
        "Adapter {}, commit {}, {}, {} frames, primary rays, cache 20 %. Loads and queries are of the whole walk; \
         \"needed\" is what rays enter before their hits. Where two bricks do not fit into the cache they are those of \
         a walk in core. Times are ms a frame on the device, the median of {} walks (least to most).\n",
        head["adapter"]["name"], head["commit"], options.size, options.frames, options.repeat
    );
    let _ = writeln!(
        text,
        "| most triangles | bricks | queries | round trips, most a frame | payloads | MB loaded first | \
         MB loaded after | MB needed first | ms out of core | ms in core, chc | ms in core, plain |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |"
    );
    for cut in cuts {
        let folder = output(&cut, "needed");
        let rows = records(&folder, "primary");
        let sum = |field: &str| rows.iter().map(|row| number(row, field)).sum::<f64>();
        let trips = rows.iter().map(|row| number(row, "round_trips")).fold(0.0, f64::max);
        let [out, chc, plain] = cut.ms.clone().map(|values| {
            if values.is_empty() {
                return "two bricks do not fit".to_owned();
            }
            let least = values.iter().copied().fold(f64::INFINITY, f64::min);
            let most = values.iter().copied().fold(0.0, f64::max);
            format!("{:.0} ({least:.0} to {most:.0})", median(values))
        });
        let _ = writeln!(
            text,
            "| {} | {} | {} | {trips} | {} | {:.2} | {:.2} | {:.2} | {out} | {chc} | {plain} |",
            cut.triangles,
            summary(&folder)["scene"]["bricks"],
            sum("queries"),
            sum("bricks_loaded"),
            bytes_moved(&rows[0]) * 1e-6,
            rows[1..].iter().map(bytes_moved).sum::<f64>() * 1e-6,
            number(&rows[0], "bytes_needed_missing") * 1e-6,
        );
    }
    let _ = writeln!(text);
}
