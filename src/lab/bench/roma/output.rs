//! The tables and plots of the bench.

use super::args::Settings;
use super::plan::{FIELD, Job, Stage, USUAL, Way, jobs};
use super::{LEAKS, leak_key, leak_name, leaks, seams};
use crate::lab::bench::results::Results;
use crate::lab::bench::rows::Rows;
use crate::settings::sizes::human_count;
use anyhow::Result;
use brickwalk_report::{Graph, GraphShape, Section, Table, Unit, Value};
use std::path::Path;

const TITLE: &str = "The experiments of ROMA";
const READING: &str = "Times are medians over turns of one frame, in which all ways take turns in one process. Errors are those of linear \
                       radiance: bias and RMSE relative to the exact picture's mean, FLIP at 67 pixels per degree. The noise of the \
                       exact picture is that of another one of as many samples. Paper: Zeng et al. 2023, 1920 x 1080, one ray a pixel.";

/// What the paper's table 2 has, ms: generation and tracing, by resolution and number of directions.
const PAPER: [(u32, u32, f64, f64); 6] = [
    (32, 4, 0.14, 0.16),
    (32, 8, 0.18, 0.16),
    (64, 4, 0.20, 0.16),
    (64, 8, 0.31, 0.16),
    (128, 4, 0.30, 0.16),
    (128, 8, 0.69, 0.16),
];

/// What it has there of distance fields, by resolution.
const PAPER_FIELD: [(u32, f64, f64); 3] = [(32, 0.31, 0.55), (64, 0.55, 0.84), (128, 3.31, 1.30)];

/// What it has of soft shadows, 128 cells and K = 8: how much faster than with a distance field maps are made and rays
/// traced.
const PAPER_SHADOWS: [f64; 2] = [3.6, 1.7];

/// Writes the results; returns what to print.
///
/// # Errors
/// The folder cannot be written.
pub fn write(folder: &Path, settings: &Settings, rows: &Rows, planned: usize) -> Result<String> {
    let all = jobs(settings, true);
    let section = |stage| {
        let of_stage: Vec<&Job> = all.iter().filter(|job| job.stage == stage).collect();
        let table = match stage {
            Stage::Speed => speed(&of_stage, rows),
            Stage::Seams => seams_table(&of_stage, rows),
            Stage::Leaks => leaks_table(rows),
            _ => errors(stage, &of_stage, rows),
        };
        (!table.rows.is_empty()).then(|| Section {
            title: title(stage).into(),
            tables: vec![table],
            plots: plots(stage, &all, rows),
            ..Section::default()
        })
    };
    let facts = vec![
        ("Triangles of generated scenes", human_count(settings.triangles)),
        ("Resolution", settings.size.to_string()),
        ("Occlusion rays", format!("one a pixel and sample, {} long", settings.ao_length)),
        ("Turns", settings.repeat.to_string()),
        ("Samples of converged pictures", settings.samples.to_string()),
    ];
    let sections = Stage::ALL.into_iter().filter_map(section).collect();
    Results { name: "roma", title: TITLE, reading: READING, facts, sections, rows, planned }.write(folder)
}

fn title(stage: Stage) -> &'static str {
    match stage {
        Stage::Speed => "Times, table 2",
        Stage::Ao => "Ambient occlusion by scenes, figure 5",
        Stage::Resolution => "Resolutions and numbers of directions, figure 9",
        Stage::Radius => "Lengths of rays: where it fails",
        Stage::Shadows => "Soft shadows, figures 7 and 8",
        Stage::Diffuse => "One-bounce diffuse light, figure 6",
        Stage::OutOfCore => "Out of core",
        Stage::Handover => "Maps and bricks together",
        Stage::Seams => "Seams between maps",
        Stage::Leaks => "Single sheets that leak",
    }
}

/// `a` over `b`, where both are above zero.
fn ratio(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    a.zip(b).filter(|(a, b)| *a > 0.0 && *b > 0.0).map(|(a, b)| a / b)
}

/// How much longer than `way` the distance field of as many cells takes: generation, tracing, both.
fn over_field(way: &Way, value: &dyn Fn(&Way, &str) -> Option<f64>) -> [Option<f64>; 3] {
    let Some(field) = way.field() else { return [None; 3] };
    let of = |way: &Way| [value(way, "ms_generation"), value(way, "ms_trace")];
    let [field, own] = [of(&field), of(way)];
    let total = |of: [Option<f64>; 2]| of[0].zip(of[1]).map(|(a, b)| a + b);
    [ratio(field[0], own[0]), ratio(field[1], own[1]), ratio(total(field), total(own))]
}

/// What the paper's table 2 has of a way, ms: generation and tracing.
fn paper_of(way: &Way) -> Option<(f64, f64)> {
    match way {
        Way::Roma { k, size, is_unsnapped: false } => {
            PAPER.iter().find(|paper| (paper.0, paper.1) == (*size, *k)).map(|paper| (paper.2, paper.3))
        }
        Way::Field { size } => PAPER_FIELD.iter().find(|paper| paper.0 == *size).map(|paper| (paper.1, paper.2)),
        _ => None,
    }
}

fn speed(jobs: &[&Job], rows: &Rows) -> Table {
    let columns = [
        "scene",
        "way",
        "generation, ms",
        "tracing, ms",
        "ns a ray",
        "exact ÷ tracing",
        "df ÷ generation",
        "df ÷ tracing",
        "df ÷ both",
        "generation, paper",
        "tracing, paper",
        "df ÷ generation, paper",
        "df ÷ tracing, paper",
        "df ÷ both, paper",
    ];
    let of_paper = |way: &Way, name: &str| {
        let (generation, tracing) = paper_of(way)?;
        Some(if name == "ms_generation" { generation } else { tracing })
    };
    let mut lines = Vec::new();
    for job in jobs {
        let value = |way: &Way, name: &str| rows.value(&job.key(way), name);
        for way in job.ways.iter().filter(|way| rows.has(&job.key(way))) {
            let per_ray = |way: &Way| ratio(value(way, "ms_trace").map(|ms| 1e6 * ms), value(way, "rays"));
            let mut line = vec![
                Value::Text(job.scene.name().into()),
                Value::Text(way.to_string()),
                Value::number(value(way, "ms_generation").filter(|_| *way != Way::Exact)),
                Value::number(value(way, "ms_trace")),
                Value::number(per_ray(way)),
                Value::ratio(ratio(per_ray(&Way::Exact), per_ray(way))),
            ];
            line.extend(over_field(way, &value).map(Value::ratio));
            line.extend(["ms_generation", "ms_trace"].map(|name| Value::number(of_paper(way, name))));
            line.extend(over_field(way, &of_paper).map(Value::ratio));
            lines.push(line);
        }
    }
    let caption = "Making the maps or the distance field of a frame (generation) and answering its rays (tracing), device time; of exact rays \
                   the wall time of the pass. df ÷: how much longer the distance field of as many cells takes.";
    Table { name: "speed".into(), caption: caption.into(), columns: columns.map(String::from).to_vec(), rows: lines }
}

fn errors(stage: Stage, jobs: &[&Job], rows: &Rows) -> Table {
    let mut columns = vec![
        "scene",
        "view",
        "way",
        "FLIP",
        "bias, %",
        "RMSE, %",
        "FLIP, one sample",
        "FLIP ÷ df",
        "FLIP ÷ df, one sample",
        "ns a ray",
        "exact ÷ this",
        "bricks loaded",
        "capped, %",
        "lamps' maps, ms",
    ];
    let has_times = stage == Stage::Shadows;
    let has_lamps = stage == Stage::Diffuse;
    let has_lengths = [Stage::Ao, Stage::Radius].contains(&stage);
    if has_lengths {
        columns.insert(2, "cells");
        columns.insert(4, "MiB a level");
    }
    columns.truncate(columns.len() - usize::from(!has_lamps));
    let is_whole = stage == Stage::Handover;
    if is_whole {
        columns.extend(["whole, ms", "whole ÷ exact"]);
    }
    if has_times {
        columns.extend([
            "generation, ms",
            "df ÷ generation",
            "df ÷ tracing",
            "df ÷ generation, paper",
            "df ÷ tracing, paper",
        ]);
    }
    let mut lines = Vec::new();
    for job in jobs {
        let value = |way: &Way, name: &str| rows.value(&job.key(way), name);
        let field = |way: &Way| way.field().map(|field| if stage == Stage::Ao { FIELD } else { field });
        // Of rays that maps and bricks are asked about both count.
        let rays = |way: &Way| value(if way.is_traced() { &Way::Exact } else { way }, "rays");
        let per_ray = |way: &Way| ratio(value(way, "ms_trace").map(|ms| 1e6 * ms), rays(way));
        for way in job.ways.iter().filter(|way| rows.has(&job.key(way))) {
            let percent = |name: &str| Value::number(value(way, name).map(|x| 100.0 * x));
            let beside =
                |name: &str| Value::ratio(field(way).and_then(|field| ratio(value(way, name), value(&field, name))));
            let mut line = vec![
                Value::Text(job.scene.name().into()),
                Value::Text(job.variant.clone()),
                Value::Text(if *way == Way::Exact { "exact (noise)".into() } else { way.to_string() }),
                Value::number(value(way, "flip_converged")),
                percent("bias_converged"),
                percent("rmse_converged"),
                Value::number(value(way, "flip_single")),
                beside("flip_converged"),
                beside("flip_single"),
                Value::number(per_ray(way)),
                Value::ratio(ratio(per_ray(&Way::Exact), per_ray(way)).filter(|_| *way != Way::Exact)),
                Value::number(value(way, "bricks_loaded")),
                Value::number(ratio(value(way, "rays_capped"), value(way, "rays")).map(|x| 100.0 * x)),
            ];
            if has_lengths {
                line.insert(2, Value::number(value(way, "cells")));
                line.insert(4, Value::number(way.mib()));
            }
            if has_lamps {
                line.push(Value::number(value(way, "ms_lamps").filter(|_| *way != Way::Exact)));
            }
            if is_whole {
                line.push(Value::number(value(way, "ms")));
                line.push(Value::ratio(ratio(value(way, "ms"), value(&Way::Exact, "ms"))));
            }
            if has_times {
                let [generation, tracing, _] = over_field(way, &value);
                line.push(Value::number(value(way, "ms_generation").filter(|_| *way != Way::Exact)));
                line.extend([generation, tracing].map(Value::ratio));
                let is_paper = matches!(way, Way::Roma { k: 8, is_unsnapped: true, .. });
                line.extend(PAPER_SHADOWS.map(|ratio| Value::ratio(Some(ratio).filter(|_| is_paper))));
            }
            lines.push(line);
        }
    }
    let caption = "How far pictures are from exact ones: converged, and with one sample a pixel. Times are those of tracing, without the \
                   making of maps; bricks are those that the pass loaded. FLIP ÷ df: over that of the distance field of as many cells, which \
                   takes as much memory with K = 4; in the paper it is below 1 in every scene of ambient occlusion. Of figure 5 errors are \
                   means over six frames along the path, and the field has 128 cells beside all maps. Cells: length of rays, in cells that bricks have; of fewer than three maps \
                   know nothing, and `--secondary auto` traces them. Whole: all of the effect, the making of maps as well.";
    Table {
        name: stage.name().into(),
        caption: caption.into(),
        columns: columns.into_iter().map(String::from).collect(),
        rows: lines,
    }
}

fn plots(stage: Stage, all: &[Job], rows: &Rows) -> Vec<Graph> {
    if stage == Stage::Handover {
        return all.iter().filter(|job| job.stage == stage).filter_map(|job| error_over_time(job, rows)).collect();
    }
    if stage == Stage::Seams {
        return all.iter().filter(|job| job.stage == stage).filter_map(|job| error_over_distance(job, rows)).collect();
    }
    if stage != Stage::Radius {
        return Vec::new();
    }
    let line = |way: &Way| {
        let mut points: Vec<(f64, f64)> = all
            .iter()
            .filter(|job| job.stage == stage)
            .filter_map(|job| Some((job.length, rows.value(&job.key(way), "flip_converged")?)))
            .map(|(length, flip)| (length, 100.0 * flip))
            .collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        (if *way == Way::Exact { "noise of the exact picture".into() } else { way.to_string() }, points)
    };
    vec![Graph {
        title: "FLIP over the length of occlusion rays, world units".into(),
        reading: "Hundredths of FLIP. Rays shorter than a few cells are not answered by cells.".into(),
        shape: GraphShape::Lines {
            across: "length",
            unit: Unit::Percent,
            lines: vec![line(&USUAL), line(&FIELD), line(&Way::Exact)],
        },
    }]
}

/// Errors by the distance from a seam.
fn seams_table(jobs: &[&Job], rows: &Rows) -> Table {
    let columns = ["scene", "way", "cells from the seam, outward", "pixels", "bias, %", "error, %"];
    let mut lines = Vec::new();
    for job in jobs {
        for way in job.ways.iter().filter(|way| **way != Way::Exact && rows.has(&job.key(way))) {
            for bin in seams::bins() {
                let value = |name: &str| rows.value(&job.key(way), &format!("{name} at {bin}"));
                lines.push(vec![
                    Value::Text(job.scene.name().into()),
                    Value::Text(way.to_string()),
                    Value::number(Some(bin.into())),
                    Value::number(value("pixels")),
                    Value::number(value("bias").map(|x| 100.0 * x)),
                    Value::number(value("error").map(|x| 100.0 * x)),
                ]);
            }
        }
    }
    let caption = "Occlusion of what is near a side of the cube of a map, beyond which cells are twice as large; cells are 128ths of that cube's side, \
                   distances the middles of bins two cells wide. Differences from the exact picture and their magnitudes, relative to its mean there, of six frames \
                   along the path together.";
    Table { name: "seams".into(), caption: caption.into(), columns: columns.map(String::from).to_vec(), rows: lines }
}

/// The magnitude of errors over the distance from a seam; `None` where nothing is measured.
fn error_over_distance(job: &Job, rows: &Rows) -> Option<Graph> {
    let line = |way: &Way| {
        let point = |bin: i32| {
            let error = rows.value(&job.key(way), &format!("error at {bin}"))?;
            Some((f64::from(bin + seams::REACH), 100.0 * error))
        };
        (way.to_string(), seams::bins().filter_map(point).collect::<Vec<_>>())
    };
    let lines: Vec<_> = job.ways.iter().filter(|way| **way != Way::Exact).map(line).collect();
    lines.iter().any(|(_, points)| !points.is_empty()).then(|| Graph {
        title: format!("Error over the distance from a seam, {}", job.scene.name()),
        reading: format!("Mean magnitude of differences from the exact picture, per cent, over cells from {} inside of a map to as many outside; its side is at {}.", seams::REACH, seams::REACH),
        shape: GraphShape::Lines { across: "cells", unit: Unit::Percent, lines },
    })
}

/// Shares of columns that pass through a plane, beside those measured before (spec §2).
fn leaks_table(rows: &Rows) -> Table {
    // Of one and four look-ups.
    const BEFORE: [[[Option<f64>; 3]; 3]; 2] = [
        [[Some(11.5), None, Some(2.7)], [Some(35.0), None, Some(6.3)], [None; 3]],
        [[Some(0.0), None, None], [Some(8.4), Some(1.1), None], [None; 3]],
    ];
    let widths = ["the base map", "its diagonal", "the diagonal of twice as many cells"];
    let columns = ["base map", "turned map as wide as", "look-ups a texel", "leaks, %", "leaks before, %"];
    let mut lines = Vec::new();
    for ((name, _), before) in LEAKS.iter().zip(BEFORE) {
        for (wide, width) in widths.iter().enumerate() {
            for (k, samples) in leaks::SAMPLES.into_iter().enumerate() {
                if let Some(value) = rows.value(&leak_key(name), &leak_name(wide, samples)) {
                    lines.push(vec![
                        Value::Text((*name).into()),
                        Value::Text((*width).into()),
                        Value::number(Some(samples.into())),
                        Value::number(Some(value)),
                        Value::number(before[wide][k]),
                    ]);
                }
            }
        }
    }
    let caption = "Columns of turned maps that cross a random plane without a set bit: of the paper's base maps, rasterised from three sides, and of conservative \
                   ones. Rays of ao have the last width with two look-ups, all others with four.";
    Table { name: "leaks".into(), caption: caption.into(), columns: columns.map(String::from).to_vec(), rows: lines }
}

/// FLIP of converged pictures over the time of the effect, by the ways of a job; `None` where nothing is measured.
fn error_over_time(job: &Job, rows: &Rows) -> Option<Graph> {
    let point = |way: &Way| {
        let value = |name: &str| rows.value(&job.key(way), name);
        Some((value("ms")?, 100.0 * value("flip_converged")?))
    };
    let line = |name: &str, of: fn(&Way) -> bool| {
        let mut points: Vec<(f64, f64)> = job.ways.iter().filter(|way| of(way)).filter_map(point).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        (name.to_string(), points)
    };
    let lines = vec![
        line("maps alone", |way| matches!(way, Way::Roma { .. })),
        line("auto: maps corrected by one ray in 2 to 8", |way| matches!(way, Way::Corrected { .. })),
        line("auto: those in doubt traced", |way| *way == Way::Sifted),
        line("auto: 2 to 10 % wrong", |way| matches!(way, Way::Bounded { .. })),
        line("exact (noise)", |way| *way == Way::Exact),
    ];
    lines.iter().any(|(_, points)| !points.is_empty()).then(|| Graph {
        title: format!("Error over time, {}", job.variant),
        reading: "Hundredths of FLIP against milliseconds of ao in a frame, the making of maps as well.".into(),
        shape: GraphShape::Lines { across: "ms", unit: Unit::Percent, lines },
    })
}
