//! The tables of the bench.

use super::args::{DvfBenchArgs, Stage};
use super::plots::short;
use super::{key, plots};
use crate::lab::bench::results::{Column, Results, percent, table};
use crate::lab::bench::store::Rows;
use crate::settings::sizes::human_count;
use anyhow::Result;
use brickwalk_report::{Graph, Section, Table, Value};

const TITLE: &str = "The experiments of discrete visibility fields";
const READING: &str = "Fewer rays: rays to the environment without a field ÷ those traced with it. Both trace the same \
                       rays, so errors are those of the field alone; in the paper's mode rays differ, too. Faster: \
                       time of these rays without a field ÷ time with it, medians over turns; above 1 is faster. \
                       Errors are in linear radiance, FLIP at 67 pixels per degree. Paper: Günay and Akyüz 2025, \
                       Sponza, 128 rays per pixel, an RTX 4060.";
const MAKING: &str = "Making ÷ exact: time to make the field ÷ time of the rays of a picture without one. Making and \
                      picture ÷ exact: a picture with a field made for it ÷ one without. Pays after: making ÷ what a \
                      picture saves; none where it saves nothing. Shares of making: areas and sums are the paper's \
                      compute shaders 1 to 3, points and rays shader 4, labels shader 5. The paper's tables 3 and 4 \
                      are not compared with rays: they imply 2e12 rays per second.";
const FLICKERING: &str = "Change of pictures with a field from frame to frame, over pixels whose rays all have the \
                          same answers in both frames. Noise: difference of two exact pictures with other rays. A \
                          pixel jumps if it changes by more than 99 of 100 pixels differ by noise. Anew: the field is \
                          made in every frame, as in the paper; otherwise it is that of the first frame and knows what \
                          has moved. Renewed: cells are made anew, with --dvf-renew rays per frame. Rays of fields: \
                          those spent on making cells anew, in all frames. FLIP is against exact pictures with the \
                          same rays, the mean of all frames.";

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

/// A scene, its points, the columns of [`making`] that it is beside.
type PaperMaking = (&'static str, Option<u32>, [Option<f64>; 5]);

/// What the paper's tables 2 to 4 have of a scene: making over a picture by brute force (9 and 44 a second), a picture
/// with its field over that, and the shares of making of compute shaders 1 to 3, 4 and 5. Sponza with 80K and 400K
/// points and shares of 10M, the Cornell box with 100K, whose frames have no time there.
const PAPER_MAKING: [PaperMaking; 3] = [
    ("sponza", Some(80_000), [Some(0.035), Some(0.155), Some(0.330), Some(0.180), Some(0.490)]),
    ("sponza", Some(400_000), [Some(0.035), Some(0.161), Some(0.330), Some(0.180), Some(0.490)]),
    ("cornell", None, [Some(0.041), None, Some(0.017), Some(0.977), Some(0.006)]),
];

/// Writes the results; returns what to print.
///
/// # Errors
/// The folder cannot be written.
pub fn write(args: &DvfBenchArgs, scenes: &[&str], rows: &Rows, planned: usize) -> Result<String> {
    let lines = |stage: Stage| {
        let line = move |scene, options: String| Line { scene, stage, key: key(scene, stage, &options), options, rows };
        let of_scene = move |&scene| args.names(stage).into_iter().map(move |options| line(scene, options));
        scenes.iter().flat_map(of_scene).filter(|line| rows.has(&line.key))
    };
    let mut sections = Vec::new();
    for &stage in Stage::ALL {
        let columns = if stage == Stage::Flicker { flicker() } else { columns(stage) };
        let caption = if stage == Stage::Flicker { FLICKERING } else { READING };
        let own = table(stage.name(), caption, lines(stage), &columns);
        sections.push((stage.title(), own, plots::of(stage, args, scenes, rows)));
        if stage == Stage::Points {
            sections.push((MAKING_TITLE, table("making", MAKING, lines(stage), &making()), Vec::new()));
        }
    }
    sections.retain(|(_, table, _)| !table.rows.is_empty());
    let section = |(title, table, plots): (&str, Table, Vec<Graph>)| Section {
        title: title.into(),
        tables: vec![table],
        plots,
        ..Section::default()
    };
    let facts = vec![
        ("Resolution", args.size.to_string()),
        ("Rays a pixel", args.samples.to_string()),
        ("Most points", human_count(args.points.into())),
        ("Turns", args.repeat.to_string()),
    ];
    let sections = sections.into_iter().map(section).collect();
    Results::of_rows(("dvf", TITLE, READING), rows, planned, facts, sections).write(&args.output)
}

/// What was measured of a scene with some options.
struct Line<'a> {
    scene: &'a str,
    stage: Stage,
    options: String,
    key: String,
    rows: &'a Rows,
}

impl Line<'_> {
    fn value(&self, name: &str) -> Option<f64> {
        self.rows.value(&self.key, name)
    }

    fn number(&self, name: &str) -> Value {
        Value::number(self.value(name))
    }

    /// What making the field takes over the time of rays without one; with the time of rays with it if `and_picture`.
    fn making(&self, and_picture: bool) -> Value {
        let value = |name: &str| self.value(name).unwrap_or(0.0);
        let own = value("seconds") + if and_picture { 1e-3 * value("ms") } else { 0.0 };
        Value::Of(own / (1e-3 * value("exact_ms")).max(f64::MIN_POSITIVE), '×')
    }

    /// Pictures after which the field has saved what making it took; none where it saves nothing.
    fn pays_after(&self) -> Option<f64> {
        let saved = 1e-3 * (self.value("exact_ms")? - self.value("ms")?);
        (saved > 0.0).then_some(self.value("seconds")? / saved)
    }

    /// A share of the time of making, per cent.
    fn share(&self, name: &str) -> Value {
        let [own, making] = [name, "seconds"].map(|name| self.value(name).unwrap_or(0.0));
        Value::Number(100.0 * own / making.max(f64::MIN_POSITIVE))
    }

    /// What the paper has of making: its columns in [`PAPER_MAKING`].
    fn paper_making(&self, column: usize) -> Option<f64> {
        let is_of = |points: &Option<u32>| points.is_none_or(|n| self.options.contains(&format!("--dvf-points {n} ")));
        let found = PAPER_MAKING.iter().find(|(name, points, _)| self.scene.contains(name) && is_of(points));
        found.and_then(|(.., values)| values[column])
    }

    /// What the paper has of a measurement of Sponza: RMSE and FLIP.
    fn paper(&self) -> Option<(f64, f64)> {
        let first = if self.stage == Stage::Points { "--dvf-points" } else { "--dvf-cells" };
        let options: Vec<&str> = self.options.split_whitespace().collect();
        let has =
            |words: &str| words.starts_with(first) && words.split_whitespace().all(|word| options.contains(&word));
        let found = PAPER.iter().find(|(words, ..)| self.scene.contains("sponza") && has(words));
        found.map(|paper| (paper.1, paper.2))
    }
}

/// The columns that all tables begin with.
fn first<'a>() -> Vec<Column<Line<'a>>> {
    vec![
        ("scene", |line| line.scene.into()),
        ("options", |line| short(&line.options).into()),
        ("points", |line| line.number("points")),
    ]
}

fn columns<'a>(stage: Stage) -> Vec<Column<Line<'a>>> {
    let mut all: Vec<Column<Line>> = vec![
        ("cells", |line| line.number("longest")),
        ("fewer rays", |line| Value::ratio(line.value("fewer"))),
        ("faster", |line| Value::ratio(line.value("faster"))),
        ("FLIP", |line| line.number("flip")),
        ("FLIP, paper", |line| Value::number(line.paper().map(|paper| paper.1))),
        ("RMSE", |line| line.number("rmse")),
        ("RMSE, paper", |line| Value::number(line.paper().map(|paper| paper.0))),
        ("bias", |line| line.number("bias")),
        ("pixels that differ, %", |line| percent(line.value("pixels_that_differ"))),
        ("field, s", |line| line.number("seconds")),
    ];
    all.retain(|(head, _)| [Stage::Points, Stage::Grid].contains(&stage) || !head.ends_with("paper"));
    let own: &[Column<Line>] = match stage {
        Stage::Modes => &[
            ("FLIP of other rays alone", |line| line.number("noise_flip")),
            ("RMSE of other rays alone", |line| line.number("noise_rmse")),
        ],
        Stage::Memory => &[
            ("bricks loaded", |line| line.number("bricks_loaded")),
            ("needed", |line| line.number("bricks_needed")),
            ("loaded ÷ needed", |line| {
                let bricks = line.value("bricks_loaded").zip(line.value("bricks_needed"));
                Value::ratio(bricks.map(|(loaded, needed)| loaded / needed.max(1.0)))
            }),
            ("read", |line| line.number("bricks_read")),
            ("pixels other than in core", |line| line.number("differ_from_in_core")),
        ],
        _ => &[],
    };
    [&first(), &all[..], own].concat()
}

/// What making the fields of the points takes.
fn making<'a>() -> Vec<Column<Line<'a>>> {
    let all: [Column<Line>; 11] = [
        ("making ÷ exact", |line| line.making(false)),
        ("making ÷ exact, paper", |line| Value::ratio(line.paper_making(0))),
        ("making and picture ÷ exact", |line| line.making(true)),
        ("making and picture ÷ exact, paper", |line| Value::ratio(line.paper_making(1))),
        ("pays after, pictures", |line| Value::number(line.pays_after())),
        ("areas and sums, %", |line| line.share("seconds_areas")),
        ("areas and sums, %, paper", |line| percent(line.paper_making(2))),
        ("points and rays, %", |line| line.share("seconds_rays")),
        ("points and rays, %, paper", |line| percent(line.paper_making(3))),
        ("labels, %", |line| line.share("seconds_labels")),
        ("labels, %, paper", |line| percent(line.paper_making(4))),
    ];
    [&first(), &all[..]].concat()
}

/// How pictures of what moves flicker.
fn flicker<'a>() -> Vec<Column<Line<'a>>> {
    let all: [Column<Line>; 9] = [
        ("cells", |line| line.number("longest")),
        ("fewer rays", |line| Value::ratio(line.value("fewer"))),
        ("rays traced", |line| line.number("traced")),
        ("rays of fields", |line| line.number("of_fields")),
        ("fewer with these", |line| Value::ratio(line.value("fewer_with_fields"))),
        ("FLIP", |line| line.number("flip")),
        ("mean change ÷ mean noise", |line| line.number("mean_to_noise")),
        ("greatest change ÷ noise", |line| line.number("greatest_to_noise")),
        ("pixels that jump in the worst frame, %", |line| percent(line.value("jumps"))),
    ];
    [&first(), &all[..]].concat()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::bench::published::{heads, published};

    #[test]
    fn pages_leave_out_no_column() {
        let of = |stage: &Stage| if *stage == Stage::Flicker { flicker() } else { columns(*stage) };
        let mut all: Vec<_> = Stage::ALL.iter().map(|stage| (stage.name(), heads(&of(stage)))).collect();
        all.push(("making", heads(&making())));
        let found = published("dvf", &all);
        assert!(["points", "making"].iter().all(|name| found.contains(*name)), "{found:?}");
    }
}
