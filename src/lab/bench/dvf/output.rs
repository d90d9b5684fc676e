//! The tables of the bench.

use super::args::{DvfBenchArgs, Stage};
use super::{key, plots};
use crate::lab::bench::results::Results;
use crate::lab::bench::rows::Rows;
use crate::settings::sizes::human_count;
use anyhow::Result;
use brickwalk_report::{Section, Table, Value};

const TITLE: &str = "The experiments of discrete visibility fields";
const READING: &str = "Fewer rays: rays to the environment without a field over those that are traced with it; all of them are the same rays, so \
                       errors are those of the field alone (in the mode of the paper: of other rays, too). Faster: the time of these rays without a field over \
                       that with it, medians of turns. Errors are those of linear radiance; FLIP at 67 pixels per degree. Paper: Günay and Akyüz 2025, Sponza, \
                       128 rays a pixel, an RTX 4060.";
const MAKING: &str = "Times in ratios: what making the field takes over the time of the rays of a picture without one; a picture with a field made for \
                      it over one without. Shares of making: areas and their sums are the paper's compute shaders 1 to 3, points and rays its 4, labels its 5, whose \
                      tables 3 and 4 are left out as ratios to rays: they say 2e12 rays a second.";
const FLICKERING: &str = "Of pixels all rays of which have the same answers in both frames, what pictures by a field change by from frame to frame. \
                          Noise: the difference of two pictures by brute force, by other rays. A pixel jumps where it changes by more than 99 of 100 pixels differ by noise. Anew: the \
                          field is made anew in every frame, as in the paper; else it is that of the first frame, and knows what has moved; renewed: of it, cells are \
                          made anew within --dvf-renew rays a frame. Rays of fields: those by which all or some cells were made anew, in all frames; fewer with \
                          these: counted with the rays that are traced. FLIP is that against brute force by the same rays, the mean of all frames.";

/// What the paper has of Sponza: options, then RMSE and FLIP. Figure 13 has 80K and 400K points of 77 cells, figure 14
/// 10M points.
const PAPER: [(&str, f64, f64); 11] = [
    ("--dvf-points 80000 rounding hash", 0.330940, 0.499832),
    ("--dvf-points 80000 ceiling hash", 0.113394, 0.090513),
    ("--dvf-points 80000 ceiling hammersley", 0.109425, 0.145041),
    ("--dvf-points 400000 rounding hash", 0.209978, 0.215490),
    ("--dvf-points 400000 ceiling hash", 0.013245, 0.022700),
    ("--dvf-points 400000 ceiling hammersley", 0.028231, 0.054061),
    ("--dvf-cells 155", 0.006531, 0.008956),
    ("--dvf-cells 77", 0.002604, 0.001792),
    ("--dvf-cells 40", 0.001072, 0.000357),
    ("--dvf-cells 21", 0.000423, 0.000082),
    ("--dvf-cells 12", 0.000120, 0.000010),
];

const MAKING_TITLE: &str = "Making fields, tables 2 to 4";

/// A scene, its points, the columns of [`making`].
type PaperMaking = (&'static str, Option<u32>, [Option<f64>; 5]);

/// What the paper's tables 2 to 4 have of a scene: making over a picture by brute force (9 and 44 a second), a picture
/// with its field over that, and the shares of making of compute shaders 1 to 3, 4 and 5. Sponza with 80K and 400K
/// points and shares of 10M, the Cornell box with 100K, whose frames have no time there.
const PAPER_MAKING: [PaperMaking; 3] = [
    ("sponza", Some(80_000), [Some(0.035), Some(0.155), Some(0.330), Some(0.180), Some(0.490)]),
    ("sponza", Some(400_000), [Some(0.035), Some(0.161), Some(0.330), Some(0.180), Some(0.490)]),
    ("cornell", None, [Some(0.041), None, Some(0.017), Some(0.977), Some(0.006)]),
];

/// What the paper has of a measurement of Sponza: RMSE and FLIP.
fn paper(stage: Stage, scene: &str, options: &str) -> [Option<f64>; 2] {
    let first = match stage {
        Stage::Points => "--dvf-points",
        Stage::Grid => "--dvf-cells",
        _ => return [None; 2],
    };
    let options: Vec<&str> = options.split_whitespace().collect();
    let has = |words: &str| words.starts_with(first) && words.split_whitespace().all(|word| options.contains(&word));
    let found = PAPER.iter().find(|(words, ..)| scene.contains("sponza") && has(words));
    [found.map(|paper| paper.1), found.map(|paper| paper.2)]
}

/// Writes the results; returns what to print.
///
/// # Errors
/// The folder cannot be written.
pub fn write(args: &DvfBenchArgs, scenes: &[&str], rows: &Rows, planned: usize) -> Result<String> {
    let section = |stage: Stage| {
        let table = match stage {
            Stage::Flicker => flickering(args, scenes, rows),
            _ => table(args, scenes, stage, rows),
        };
        let plots = plots::of(stage, args, scenes, rows);
        let own = Section { title: stage.title().into(), tables: vec![table], plots, ..Section::default() };
        let tables = (stage == Stage::Points).then(|| vec![making(args, scenes, rows)]);
        let making = tables.map(|tables| Section { title: MAKING_TITLE.into(), tables, ..Section::default() });
        [Some(own), making].into_iter().flatten()
    };
    let sections: Vec<Section> = Stage::ALL.iter().copied().flat_map(section).collect();
    let sections = sections.into_iter().filter(|section| !section.tables[0].rows.is_empty()).collect();
    let facts = vec![
        ("Resolution", args.size.to_string()),
        ("Rays a pixel", args.samples.to_string()),
        ("Most points", human_count(args.points.into())),
        ("Turns", args.repeat.to_string()),
    ];
    Results { name: "dvf", title: TITLE, reading: READING, facts, sections, rows, planned }.write(&args.output)
}

/// What a measurement is called in its row: its options without those that all have.
pub fn short(options: &str) -> String {
    options.replace("--dvf-", "")
}

fn table(args: &DvfBenchArgs, scenes: &[&str], stage: Stage, rows: &Rows) -> Table {
    let mut columns = vec![
        "scene",
        "options",
        "points",
        "cells",
        "fewer rays",
        "faster",
        "FLIP",
        "RMSE",
        "bias",
        "pixels that differ, %",
        "field, s",
    ];
    match stage {
        Stage::Points | Stage::Grid => columns.extend(["RMSE, paper", "FLIP, paper"]),
        Stage::Modes => columns.extend(["FLIP of other rays alone", "RMSE of other rays alone"]),
        Stage::Memory => {
            columns.extend(["bricks loaded", "needed", "loaded ÷ needed", "read", "pixels other than in core"])
        }
        _ => {}
    }
    let mut lines = Vec::new();
    for scene in scenes {
        for options in args.names(stage) {
            let key = key(scene, stage, &options);
            if !rows.has(&key) {
                continue;
            }
            let value = |name: &str| rows.value(&key, name);
            let mut line = vec![
                Value::Text(scene.to_string()),
                Value::Text(short(&options)),
                Value::number(value("points")),
                Value::number(value("longest")),
                Value::ratio(value("fewer")),
                Value::ratio(value("faster")),
                Value::number(value("flip")),
                Value::number(value("rmse")),
                Value::number(value("bias")),
                Value::number(value("pixels_that_differ").map(|share| 100.0 * share)),
                Value::number(value("seconds")),
            ];
            match stage {
                Stage::Points | Stage::Grid => line.extend(paper(stage, scene, &options).map(Value::number)),
                Stage::Modes => line.extend(["noise_flip", "noise_rmse"].map(|name| Value::number(value(name)))),
                Stage::Memory => line.extend([
                    Value::number(value("bricks_loaded")),
                    Value::number(value("bricks_needed")),
                    Value::ratio(value("bricks_loaded").zip(value("bricks_needed")).map(|(a, b)| a / b.max(1.0))),
                    Value::number(value("bricks_read")),
                    Value::number(value("differ_from_in_core")),
                ]),
                _ => {}
            }
            lines.push(line);
        }
    }
    let columns = columns.into_iter().map(String::from).collect();
    Table { name: stage.name().into(), caption: READING.into(), columns, rows: lines }
}

/// What making the fields of the points takes.
fn making(args: &DvfBenchArgs, scenes: &[&str], rows: &Rows) -> Table {
    let columns = [
        "scene",
        "options",
        "points",
        "making ÷ exact",
        "making and picture ÷ exact",
        "areas and sums, %",
        "points and rays, %",
        "labels, %",
        "making ÷ exact, paper",
        "making and picture ÷ exact, paper",
        "areas and sums, %, paper",
        "points and rays, %, paper",
        "labels, %, paper",
    ];
    let mut lines = Vec::new();
    for scene in scenes {
        for options in args.names(Stage::Points) {
            let key = key(scene, Stage::Points, &options);
            if !rows.has(&key) {
                continue;
            }
            let value = |name: &str| rows.value(&key, name).unwrap_or(0.0);
            let (making, exact) = (value("seconds"), (1e-3 * value("exact_ms")).max(f64::MIN_POSITIVE));
            let share = |name: &str| 100.0 * value(name) / making.max(f64::MIN_POSITIVE);
            let own = [
                making / exact,
                (making + 1e-3 * value("ms")) / exact,
                share("seconds_areas"),
                share("seconds_rays"),
                share("seconds_labels"),
            ];
            let is_of = |points: &Option<u32>| points.is_none_or(|n| options.contains(&format!("--dvf-points {n} ")));
            let found = PAPER_MAKING.iter().find(|(name, points, _)| scene.contains(name) && is_of(points));
            let [making, both, shares @ ..] = found.map_or([None; 5], |(.., values)| *values);
            let hundredths = shares.map(|share| share.map(|share| 100.0 * share));
            let mut line = vec![
                Value::Text(scene.to_string()),
                Value::Text(short(&options)),
                Value::number(rows.value(&key, "points")),
            ];
            line.extend([Value::ratio(Some(own[0])), Value::ratio(Some(own[1]))]);
            line.extend(own[2..].iter().map(|&share| Value::number(Some(share))));
            line.extend([Value::ratio(making), Value::ratio(both)]);
            line.extend(hundredths.map(Value::number));
            lines.push(line);
        }
    }
    let columns = columns.map(String::from).to_vec();
    Table { name: "making".into(), caption: MAKING.into(), columns, rows: lines }
}

/// How pictures of what moves flicker.
fn flickering(args: &DvfBenchArgs, scenes: &[&str], rows: &Rows) -> Table {
    let columns = [
        "scene",
        "options",
        "points",
        "cells",
        "fewer rays",
        "rays traced",
        "rays of fields",
        "fewer with these",
        "FLIP",
        "mean change ÷ mean noise",
        "greatest change ÷ noise",
        "pixels that jump in the worst frame, %",
    ];
    let mut lines = Vec::new();
    for scene in scenes {
        for options in args.names(Stage::Flicker) {
            let key = key(scene, Stage::Flicker, &options);
            if !rows.has(&key) {
                continue;
            }
            let value = |name: &str| rows.value(&key, name);
            lines.push(vec![
                Value::Text(scene.to_string()),
                Value::Text(short(&options)),
                Value::number(value("points")),
                Value::number(value("longest")),
                Value::ratio(value("fewer")),
                Value::number(value("traced")),
                Value::number(value("of_fields")),
                Value::ratio(value("fewer_with_fields")),
                Value::number(value("flip")),
                Value::number(value("mean_to_noise")),
                Value::number(value("greatest_to_noise")),
                Value::number(value("jumps").map(|share| 100.0 * share)),
            ]);
        }
    }
    let columns = columns.map(String::from).to_vec();
    Table { name: Stage::Flicker.name().into(), caption: FLICKERING.into(), columns, rows: lines }
}
