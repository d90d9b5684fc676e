//! The tables and plots of the bench.

use super::args::{DisplacementBenchArgs, Settings};
use super::mapping::Mapping;
use super::paper::{self, Paper};
use super::plan::{Job, Look, Stage, Way, jobs};
use super::verdicts::{Verdict, as_table, verdicts};
use crate::lab::bench::results::{Column, Results, log_plot, percent, ratio, table};
use crate::lab::bench::store::Rows;
use anyhow::Result;
use brickwalk_report::{Graph, Section, Table, Unit, Value};

const TITLE: &str = "The experiments of displacement fields";
const READING: &str = "A model over a corner of three walls with 33 x 33 vertices each. RMS and bias are differences of \
                       grey levels, 0 to 255, of light that distance attenuates, from exact rays of the same \
                       directions; a bias above 0 is brighter. Times are medians over turns, all threads at work. \
                       paper: the stored ray in the asked direction from the nearest position. aimed: the one that \
                       meets the asked ray in the middle of its chord. interpolated: aimed, between positions and \
                       between directions. Paper: Gaitatzes et al. 2008.";

/// Writes the results; returns what to print.
///
/// # Errors
/// The folder cannot be written.
pub fn write(args: &DisplacementBenchArgs, settings: &Settings, rows: &Rows, planned: usize) -> Result<String> {
    let all = jobs(settings);
    let own = &rows.header.settings;
    let model = own["model"].as_str().unwrap_or_default();
    let found = verdicts(settings, rows, model.contains("bunny"));
    let mut sections = vec![Section { title: "Verdict".into(), tables: vec![as_table(&found)], ..Section::default() }];
    sections.extend(Stage::ALL.iter().map(|&stage| section(stage, &all, rows)));
    sections.retain(|section| section.tables.iter().any(|table| !table.rows.is_empty()));
    let facts = vec![
        ("Model", format!("{model}, {} triangles", own["triangles"])),
        ("Rays", format!("{} of each of 3267 vertices", args.rays)),
        ("Turns", args.repeat.to_string()),
    ];
    let mut results = Results::of_rows(("displacement", TITLE, READING), rows, planned, facts, sections);
    results.verdicts.extend(found.iter().map(|own: &Verdict| (own.sentence(), own.is_met == Some(false))));
    results.write(&args.output)
}

fn section(stage: Stage, all: &[Job], rows: &Rows) -> Section {
    let jobs: Vec<&Job> = all.iter().filter(|job| job.stage == stage).collect();
    let lines = jobs.iter().flat_map(|job| job.ways.iter().map(|&way| Line { job, way, rows }));
    let lines = lines.filter(|line| rows.has(&line.job.key(line.way)));
    let (title, caption, columns): (_, _, Vec<Column<Line>>) = match stage {
        Stage::Figure6 => ("Positions and directions, figure 6", FIGURE6, figure6()),
        Stage::Figure4 => ("Bits of a sample, figures 4 and 7", FIGURE4, figure4()),
        Stage::Figure5 => ("Directions on a square, figure 5", FIGURE5, figure5()),
        Stage::Figure8 => ("Triangles of the object, figure 8", FIGURE8, figure8()),
    };
    let mut tables = vec![table(stage.name(), caption, lines, &columns)];
    if stage == Stage::Figure8 && !tables[0].rows.is_empty() {
        tables.push(of_paper());
    }
    let plots = match stage {
        Stage::Figure6 => Look::ALL.iter().map(|&look| over_positions(look, &jobs, rows)).collect(),
        Stage::Figure8 => vec![over_triangles(&jobs, rows)],
        Stage::Figure4 | Stage::Figure5 => Vec::new(),
    };
    Section { title: title.into(), tables, plots, ..Section::default() }
}

/// What was measured of a way of a job.
#[derive(Clone, Copy)]
struct Line<'a> {
    job: &'a Job,
    way: Way,
    rows: &'a Rows,
}

impl Line<'_> {
    fn value(&self, name: &str) -> Option<f64> {
        self.rows.value(&self.job.key(self.way), name)
    }

    fn number(&self, name: &str) -> Value {
        Value::number(self.value(name))
    }

    /// The value over that of another way.
    fn over(&self, name: &str, way: Way) -> Value {
        Value::ratio(ratio(self.value(name), Line { way, ..*self }.value(name)))
    }

    /// What the paper's figure 6 has of the samples.
    fn paper(&self) -> Option<Paper> {
        paper::figure6(self.job.shape.positions(), self.job.shape.directions)
    }

    /// Millions a second of `count` in so many of `seconds`' milliseconds.
    fn millions(&self, count: &str, time: &str, seconds: f64) -> Value {
        Value::number(ratio(self.value(count), self.value(time)).map(|rate| 1e-6 * rate / seconds))
    }

    fn mib(&self) -> Value {
        Value::number(self.value("bytes").map(|bytes| bytes / f64::from(1 << 20)))
    }
}

/// The columns that most tables begin with.
fn first<'a>() -> Vec<Column<Line<'a>>> {
    vec![
        ("positions", |line| f64::from(line.job.shape.positions()).into()),
        ("directions", |line| format!("{}²", line.job.shape.directions).into()),
    ]
}

const FIGURE6: &str = "Samples of 8 bits. Making them is tracing one ray each. A query is all rays of the corner. The \
                       paper's times are those of its machine (two Xeons, 2008).";

fn figure6<'a>() -> Vec<Column<Line<'a>>> {
    let all: [Column<Line>; 13] = [
        ("way", |line| line.way.to_string().into()),
        ("RMS, levels", |line| line.number("rms")),
        ("RMS, paper", |line| Value::number(line.paper().map(|paper| paper.rms))),
        ("RMS ÷ paper's", |line| Value::ratio(ratio(line.value("rms"), line.paper().map(|paper| paper.rms)))),
        ("bias, levels", |line| line.number("bias")),
        ("samples, MiB", |line| line.mib()),
        ("making, s", |line| line.number("bake_s")),
        ("making, s, paper", |line| Value::number(line.paper().map(|paper| paper.bake_s))),
        ("making, Mray/s", |line| line.millions("samples", "bake_s", 1.0)),
        ("query, ms", |line| line.number("query_ms")),
        ("query, ms, paper", |line| Value::number(line.paper().map(|paper| paper.query_ms))),
        ("query, Mray/s", |line| line.millions("rays", "query_ms", 1e-3)),
        ("query, ns a ray", |line| Value::number(ratio(line.value("query_ms"), line.value("rays")).map(|ms| 1e6 * ms))),
    ];
    [&first(), &all[..]].concat()
}

const FIGURE4: &str = "32 bits are f32. 1 bit says whether a ray meets something; where is the mean of all rays of the \
                       field that do (the paper: of those along the normal of a position).";

fn figure4<'a>() -> Vec<Column<Line<'a>>> {
    /// The same way to look with 32 bits.
    fn exact(line: &Line) -> Way {
        Way::Held(32, line.way.look())
    }
    let all: [Column<Line>; 8] = [
        ("bits", |line| line.way.bits().to_string().into()),
        ("way", |line| line.way.look().name().into()),
        ("RMS, levels", |line| line.number("rms")),
        ("RMS ÷ 32 bits'", |line| line.over("rms", exact(line))),
        ("RMS, paper", |line| {
            let is_one = line.way == Way::Held(1, Look::Paper) && line.job.shape.positions() == 4226;
            let eight = line.paper().filter(|_| line.way == Way::Held(8, Look::Paper)).map(|paper| paper.rms);
            Value::number(if is_one { Some(paper::ONE_BIT) } else { eight })
        }),
        ("bias, levels", |line| line.number("bias")),
        ("samples, MiB", |line| line.mib()),
        ("query, ms", |line| line.number("query_ms")),
    ];
    [&first(), &all[..]].concat()
}

const FIGURE5: &str = "8 bits, with directions on their square by the concentric map, by both angles evenly (uniform), \
                       and over the disc, where what lies outside is not used (rejection). Positions are the same for \
                       all. The paper shows pictures alone: its uniform directions are of 1122 positions, the \
                       concentric ones of 1090.";

fn figure5<'a>() -> Vec<Column<Line<'a>>> {
    /// The same way to look at directions of the concentric map.
    fn concentric(line: &Line) -> Way {
        Way::Mapped(Mapping::Concentric, line.way.look())
    }
    let all: [Column<Line>; 6] = [
        ("map", |line| if let Way::Mapped(map, _) = line.way { map.name().into() } else { Value::Missing }),
        ("way", |line| line.way.look().name().into()),
        ("RMS, levels", |line| line.number("rms")),
        ("RMS ÷ concentric", |line| line.over("rms", concentric(line))),
        ("bias, levels", |line| line.number("bias")),
        ("samples used, %", |line| percent(line.value("used"))),
    ];
    [&first(), &all[..]].concat()
}

const FIGURE8: &str = "A bumpy sphere, cut ever finer. All objects and ways take turns in one run, on the same rays, \
                       all bricks resident. Fields are asked on the processor. Tracing is the whole of it: rays handed to the \
                       executor, traversal, hits read back. ÷ aimed are speed-ups: above 1 the field is faster.";

fn figure8<'a>() -> Vec<Column<Line<'a>>> {
    /// A time over that of fields, aimed.
    fn over_aimed(line: &Line, name: &str) -> Value {
        Value::ratio(ratio(line.value(name), line.value("ns_aimed")))
    }
    let all: [Column<Line>; 11] = [
        ("triangles", |line| line.number("triangles")),
        ("bricks", |line| line.value("bricks").map_or(Value::Missing, |n| format!("{n}").into())),
        ("rays through the sphere, %", |line| percent(line.value("inside"))),
        ("field, paper, ns a ray", |line| line.number("ns_paper")),
        ("field, aimed, ns a ray", |line| line.number("ns_aimed")),
        ("exact, closest hit, ns a ray", |line| line.number("ns_closest")),
        ("exact, any hit, ns a ray", |line| line.number("ns_any")),
        ("closest ÷ aimed", |line| over_aimed(line, "ns_closest")),
        ("any ÷ aimed", |line| over_aimed(line, "ns_any")),
        ("RMS, aimed, levels", |line| line.number("rms_aimed")),
        ("making, s", |line| line.number("bake_s")),
    ];
    [&first(), &all[..]].concat()
}

/// What the paper's figure 8 has.
fn of_paper() -> Table {
    type Model = (&'static str, f64, f64, f64, f64);
    let columns: [Column<&Model>; 5] = [
        ("model", |model| model.0.into()),
        ("triangles", |model| model.1.into()),
        ("field, ns a ray", |model| (1e9 * model.4 / model.2).into()),
        ("casting, ns a ray", |model| (1e9 * model.3 / model.2).into()),
        ("casting ÷ field", |model| Value::Of(model.3 / model.4, '×')),
    ];
    let caption = "The paper's figure 8, 4226 x 32², on a Pentium 4, beside a casting of rays of its own.";
    table("figure8-paper", caption, &paper::FIGURE8, &columns)
}

/// RMS over positions, a line for each number of directions.
fn over_positions(look: Look, jobs: &[&Job], rows: &Rows) -> Graph {
    let mut directions: Vec<u32> = jobs.iter().map(|job| job.shape.directions).collect();
    directions.sort_unstable();
    directions.dedup();
    let line = |n: u32| {
        let of = jobs.iter().filter(|job| job.shape.directions == n);
        let point = |job: &&Job| {
            let rms = rows.value(&job.key(Way::Asked(look)), "rms")?;
            Some((f64::from(job.shape.positions()), rms))
        };
        (format!("{n}² directions"), of.filter_map(point).collect())
    };
    let title = format!("RMS over positions, {look}, grey levels");
    let reading = "Lower is better. Where lines lie on each other more directions gain nothing.";
    log_plot(title, reading, "positions", Unit::Count, directions.into_iter().map(line).collect())
}

/// Times of a ray over triangles.
fn over_triangles(jobs: &[&Job], rows: &Rows) -> Graph {
    let lines = [
        ("ns_paper", "field, paper"),
        ("ns_aimed", "field, aimed"),
        ("ns_closest", "exact, closest hit"),
        ("ns_any", "exact, any hit"),
    ];
    let line = |(name, what): (&str, &str)| {
        let point = |key: String| Some((rows.value(&key, "triangles")?, rows.value(&key, name)?));
        let keys = jobs.iter().flat_map(|job| job.ways.iter().map(|&way| job.key(way)));
        (what.to_string(), keys.filter_map(point).collect())
    };
    let title = "Nanoseconds of a ray over triangles of the object".into();
    let reading = "Where a line of tracing lies above one of fields, fields are faster.";
    log_plot(title, reading, "triangles", Unit::Count, lines.map(line).to_vec())
}
