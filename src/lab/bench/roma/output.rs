//! The tables and plots of the bench.

use super::args::Settings;
use super::plan::{FIELD, Job, Stage, USUAL, Way, jobs};
use super::{LEAKS, leak_key, leak_name, leaks, seams};
use crate::lab::bench::results::{Column, Results, percent, plot, ratio, table};
use crate::lab::bench::store::Rows;
use crate::settings::sizes::human_count;
use anyhow::Result;
use brickwalk_report::{Graph, Section, Table, Unit, Value};
use std::path::Path;

const TITLE: &str = "The experiments of ROMA";
const READING: &str = "Times are medians over turns of one frame; all ways take turns in one process. Errors are in \
                       linear radiance: bias and RMSE relative to the exact picture's mean, FLIP at 67 pixels per \
                       degree. The noise of the exact picture is its difference from another one with as many samples. \
                       Paper: Zeng et al. 2023, 1920 x 1080, one ray per pixel.";

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
    let section = |&stage: &Stage| {
        let jobs: Vec<&Job> = all.iter().filter(|job| job.stage == stage).collect();
        let lines = || jobs.iter().flat_map(|job| job.ways.iter().map(|way| Measurement { job, way: *way, rows }));
        let lines = || lines().filter(|line| rows.has(&line.job.key(&line.way)));
        let table = match stage {
            Stage::Speed => table(stage.name(), SPEED, lines(), &speed()),
            Stage::Seams => seams_table(lines().filter(|line| line.way != Way::Exact)),
            Stage::Leaks => leaks_table(rows),
            _ => table(stage.name(), ERRORS, lines(), &errors(stage)),
        };
        (!table.rows.is_empty()).then(|| Section {
            title: title(stage).into(),
            tables: vec![table],
            plots: plots(stage, &jobs, rows),
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
    let sections = Stage::ALL.iter().filter_map(section).collect();
    Results::of_rows(("roma", TITLE, READING), rows, planned, facts, sections).write(folder)
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

/// What was measured of a way of a job.
#[derive(Clone, Copy)]
struct Measurement<'a> {
    job: &'a Job,
    way: Way,
    rows: &'a Rows,
}

impl Measurement<'_> {
    /// Of another way.
    fn of(&self, way: Way) -> Self {
        Self { way, ..*self }
    }

    fn value(&self, name: &str) -> Option<f64> {
        self.rows.value(&self.job.key(&self.way), name)
    }

    /// A value that exact rays have none of.
    fn own(&self, name: &str) -> Value {
        Value::number(self.value(name).filter(|_| self.way != Way::Exact))
    }

    /// Nanoseconds of a ray. Of rays that maps and bricks are asked about both count.
    fn per_ray(&self) -> Option<f64> {
        let rays = self.of(if self.way.is_traced() { Way::Exact } else { self.way }).value("rays");
        ratio(self.value("ms_trace").map(|ms| 1e6 * ms), rays)
    }

    fn exact_over(&self) -> Option<f64> {
        ratio(self.of(Way::Exact).per_ray(), self.per_ray())
    }

    /// A value over that of the distance field that is beside it.
    fn over_field(&self, name: &str) -> Value {
        let field = self.way.field().map(|field| if self.job.stage == Stage::Ao { FIELD } else { field });
        Value::ratio(field.and_then(|field| ratio(self.value(name), self.of(field).value(name))))
    }

    /// How much longer than it the distance field of as many cells takes.
    fn field_over(&self, part: Part) -> Value {
        field_over(self.way, part, |way| {
            let own = self.of(way);
            Some([own.value("ms_generation")?, own.value("ms_trace")?])
        })
    }
}

/// A part of the times of generation and tracing.
type Part = fn([f64; 2]) -> f64;

const GENERATION: Part = |[generation, _]| generation;
const TRACING: Part = |[_, tracing]| tracing;
const BOTH: Part = |[generation, tracing]| generation + tracing;

/// How much longer than `way` the distance field of as many cells takes; `times` are those of generation and tracing.
fn field_over(way: Way, part: Part, times: impl Fn(Way) -> Option<[f64; 2]>) -> Value {
    Value::ratio(way.field().and_then(|field| ratio(times(field).map(part), times(way).map(part))))
}

/// What the paper's table 2 has of a way, ms: generation and tracing.
fn paper(way: Way) -> Option<[f64; 2]> {
    match way {
        Way::Roma { k, size, is_unsnapped: false } => {
            PAPER.iter().find(|paper| (paper.0, paper.1) == (size, k)).map(|paper| [paper.2, paper.3])
        }
        Way::Field { size } => PAPER_FIELD.iter().find(|paper| paper.0 == size).map(|paper| [paper.1, paper.2]),
        _ => None,
    }
}

const SPEED: &str = "Device time to make the maps or the distance field of a frame (generation) and to answer its rays \
                     (tracing); of exact rays, wall time of the pass. exact ÷ and df ÷ are speed-ups: above 1 ROMA is \
                     faster. df is a distance field with as many cells. Whole: wall time of the pass, with all that it \
                     needs; the first way of a size makes base maps anew, the second of that size finds them.";

fn speed<'a>() -> [Column<Measurement<'a>>; 16] {
    [
        ("scene", |line| line.job.scene.name().into()),
        ("way", |line| line.way.to_string().into()),
        ("generation, ms", |line| line.own("ms_generation")),
        ("generation, paper", |line| Value::number(paper(line.way).map(|ms| ms[0]))),
        ("tracing, ms", |line| Value::number(line.value("ms_trace"))),
        ("tracing, paper", |line| Value::number(paper(line.way).map(|ms| ms[1]))),
        ("df ÷ generation", |line| line.field_over(GENERATION)),
        ("df ÷ generation, paper", |line| field_over(line.way, GENERATION, paper)),
        ("df ÷ tracing", |line| line.field_over(TRACING)),
        ("df ÷ tracing, paper", |line| field_over(line.way, TRACING, paper)),
        ("df ÷ both", |line| line.field_over(BOTH)),
        ("df ÷ both, paper", |line| field_over(line.way, BOTH, paper)),
        ("ns a ray", |line| Value::number(line.per_ray())),
        ("exact ÷ tracing", |line| Value::ratio(line.exact_over())),
        ("whole, ms", |line| Value::number(line.value("ms"))),
        ("exact ÷ whole", |line| Value::ratio(ratio(line.of(Way::Exact).value("ms"), line.value("ms")))),
    ]
}

const ERRORS: &str = "Errors against exact pictures: converged, and with one sample per pixel. Times are those of \
                      tracing, without making maps; bricks are those that the pass loaded. FLIP ÷ df: over that of a \
                      distance field with as many cells, which takes as much memory with K = 4; in the paper it is \
                      below 1 for ambient occlusion in every scene. Figure 5: errors are means over six frames along \
                      the path, and the field has 128 cells. Cells: length of rays, in cells of bricks; maps know \
                      nothing of rays shorter than three, and `--secondary sift` traces them. Whole: all of the \
                      effect, with making maps.";

fn errors<'a>(stage: Stage) -> Vec<Column<Measurement<'a>>> {
    /// What the paper has of soft shadows.
    fn of_paper(line: &Measurement, which: usize) -> Value {
        let is_paper = matches!(line.way, Way::Roma { k: 8, is_unsnapped: true, .. });
        Value::ratio(is_paper.then(|| PAPER_SHADOWS[which]))
    }
    let has_lengths = [Stage::Ao, Stage::Radius].contains(&stage);
    let mut columns: Vec<Column<Measurement>> =
        vec![("scene", |line| line.job.scene.name().into()), ("view", |line| line.job.variant.clone().into())];
    if has_lengths {
        columns.push(("cells", |line| Value::number(line.value("cells"))));
    }
    columns.push(("way", |line| exact_as(line.way, "exact (noise)").into()));
    if has_lengths {
        columns.push(("MiB a level", |line| Value::number(line.way.mib())));
    }
    columns.extend::<[Column<Measurement>; 10]>([
        ("FLIP", |line| Value::number(line.value("flip_converged"))),
        ("bias, %", |line| percent(line.value("bias_converged"))),
        ("RMSE, %", |line| percent(line.value("rmse_converged"))),
        ("FLIP, one sample", |line| Value::number(line.value("flip_single"))),
        ("FLIP ÷ df", |line| line.over_field("flip_converged")),
        ("FLIP ÷ df, one sample", |line| line.over_field("flip_single")),
        ("ns a ray", |line| Value::number(line.per_ray())),
        ("exact ÷ this", |line| Value::ratio(line.exact_over().filter(|_| line.way != Way::Exact))),
        ("bricks loaded", |line| Value::number(line.value("bricks_loaded"))),
        ("capped, %", |line| percent(ratio(line.value("rays_capped"), line.value("rays")))),
    ]);
    let more: &[Column<Measurement>] = match stage {
        Stage::Diffuse => &[("lamps' maps, ms", |line| line.own("ms_lamps"))],
        Stage::Handover => &[
            ("whole, ms", |line| Value::number(line.value("ms"))),
            ("whole ÷ exact", |line| Value::ratio(ratio(line.value("ms"), line.of(Way::Exact).value("ms")))),
        ],
        Stage::Shadows => &[
            ("generation, ms", |line| line.own("ms_generation")),
            ("df ÷ generation", |line| line.field_over(GENERATION)),
            ("df ÷ generation, paper", |line| of_paper(line, 0)),
            ("df ÷ tracing", |line| line.field_over(TRACING)),
            ("df ÷ tracing, paper", |line| of_paper(line, 1)),
        ],
        _ => &[],
    };
    columns.extend(more);
    columns
}

/// The name of a way; of exact rays `name`.
fn exact_as(way: Way, name: &str) -> String {
    if way == Way::Exact { name.into() } else { way.to_string() }
}

const SEAMS: &str = "Occlusion near a side of the cube of a map, beyond which cells are twice as large. Cells are \
                     128ths of that side; distances are the middles of bins two cells wide. Differences from the exact \
                     picture and their magnitudes, relative to its mean there, over six frames along the path.";

/// Errors by the distance from a seam.
fn seams_table<'a>(lines: impl Iterator<Item = Measurement<'a>>) -> Table {
    type InBin<'a> = (Measurement<'a>, i32);
    fn value((line, bin): &InBin, name: &str) -> Option<f64> {
        line.value(&format!("{name} at {bin}"))
    }
    let columns: [Column<InBin>; 6] = [
        ("scene", |(line, _)| line.job.scene.name().into()),
        ("way", |(line, _)| line.way.to_string().into()),
        ("cells from the seam, outward", |(_, bin)| Value::Number((*bin).into())),
        ("pixels", |at| Value::number(value(at, "pixels"))),
        ("bias, %", |at| percent(value(at, "bias"))),
        ("error, %", |at| percent(value(at, "error"))),
    ];
    let bins = lines.flat_map(|line| seams::bins().map(move |bin| (line, bin)));
    table("seams", SEAMS, bins, &columns)
}

const LEAKING: &str = "Columns of turned maps that cross a random plane without a set bit: of the paper's base maps, \
                       rasterised from three sides, and of conservative ones. Rays of ao have the last width with two \
                       look-ups, all others with four.";

/// Shares of columns that pass through a plane, beside those measured before (spec §2).
fn leaks_table(rows: &Rows) -> Table {
    // Of one and four look-ups.
    const BEFORE: [[[Option<f64>; 3]; 3]; 2] = [
        [[Some(11.5), None, Some(2.7)], [Some(35.0), None, Some(6.3)], [None; 3]],
        [[Some(0.0), None, None], [Some(8.4), Some(1.1), None], [None; 3]],
    ];
    const WIDTHS: [&str; 3] = ["the base map", "its diagonal", "the diagonal of twice as many cells"];
    /// Which of [`LEAKS`], of [`WIDTHS`], and of [`leaks::SAMPLES`], and the share.
    type Leak = ([usize; 3], f64);
    let each = |[a, b, c]: [usize; 3]| {
        let share = rows.value(&leak_key(LEAKS[a].0), &leak_name(b, leaks::SAMPLES[c]));
        share.map(|share| ([a, b, c], share))
    };
    let columns: [Column<Leak>; 5] = [
        ("base map", |([a, ..], _)| LEAKS[*a].0.into()),
        ("turned map as wide as", |([_, b, _], _)| WIDTHS[*b].into()),
        ("look-ups a texel", |([.., c], _)| Value::Number(leaks::SAMPLES[*c].into())),
        ("leaks, %", |(_, share)| Value::Number(*share)),
        ("leaks before, %", |([a, b, c], _)| Value::number(BEFORE[*a][*b][*c])),
    ];
    table("leaks", LEAKING, (0..18).map(|i| [i / 9, i / 3 % 3, i % 3]).filter_map(each), &columns)
}

fn plots(stage: Stage, jobs: &[&Job], rows: &Rows) -> Vec<Graph> {
    match stage {
        Stage::Handover => jobs.iter().map(|job| error_over_time(job, rows)).collect(),
        Stage::Seams => jobs.iter().map(|job| error_over_distance(job, rows)).collect(),
        Stage::Radius => {
            let line = |way: Way| {
                let point = |job: &&Job| Some((job.length, 100.0 * rows.value(&job.key(&way), "flip_converged")?));
                (exact_as(way, "noise of the exact picture"), jobs.iter().filter_map(point).collect())
            };
            let title = "FLIP over the length of occlusion rays, world units".into();
            let reading = "Hundredths of FLIP. Rays shorter than a few cells are not answered by cells.";
            vec![plot(title, reading, "length", Unit::Percent, [USUAL, FIELD, Way::Exact].map(line).to_vec())]
        }
        _ => Vec::new(),
    }
}

/// The magnitude of errors over the distance from a seam.
fn error_over_distance(job: &Job, rows: &Rows) -> Graph {
    let line = |way: &Way| {
        let point = |bin: i32| {
            let error = rows.value(&job.key(way), &format!("error at {bin}"))?;
            Some((f64::from(bin + seams::REACH), 100.0 * error))
        };
        (way.to_string(), seams::bins().filter_map(point).collect())
    };
    let reach = seams::REACH;
    plot(
        format!("Error over the distance from a seam, {}", job.scene),
        &format!(
            "Mean magnitude of differences from the exact picture, per cent, over cells from {reach} inside of a map \
             to as many outside; its side is at {reach}."
        ),
        "cells",
        Unit::Percent,
        job.ways.iter().filter(|way| **way != Way::Exact).map(line).collect(),
    )
}

/// FLIP of converged pictures over the time of the effect, by the ways of a job.
fn error_over_time(job: &Job, rows: &Rows) -> Graph {
    let point = |way: &Way| {
        let value = |name: &str| rows.value(&job.key(way), name);
        Some((value("ms")?, 100.0 * value("flip_converged")?))
    };
    type Line = (&'static str, fn(&Way) -> bool);
    let lines: [Line; 5] = [
        ("maps alone", |way| matches!(way, Way::Roma { .. })),
        ("auto: maps corrected by one ray in 2 to 8", |way| matches!(way, Way::Corrected { .. })),
        ("auto: those in doubt traced", |way| *way == Way::Sifted),
        ("auto: 2 to 10 % wrong", |way| matches!(way, Way::Bounded { .. })),
        ("exact (noise)", |way| *way == Way::Exact),
    ];
    let lines =
        lines.map(|(name, of)| (name.to_string(), job.ways.iter().filter(|way| of(way)).filter_map(point).collect()));
    let reading = "Hundredths of FLIP against milliseconds of ao in a frame, the making of maps as well.";
    plot(format!("Error over time, {}", job.variant), reading, "ms", Unit::Percent, lines.to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::bench::published::{heads, published};

    #[test]
    fn pages_leave_out_no_column() {
        let of = |stage: &Stage| match stage {
            Stage::Speed => Some(heads(&speed())),
            Stage::Seams | Stage::Leaks => None,
            stage => Some(heads(&errors(*stage))),
        };
        let all: Vec<_> = Stage::ALL.iter().filter_map(|stage| Some((stage.name(), of(stage)?))).collect();
        assert!(published("roma", &all).contains("speed"));
    }
}
