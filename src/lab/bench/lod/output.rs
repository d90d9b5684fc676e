//! The tables and plots of the bench.

use super::args::LodBenchArgs;
use super::plan::{EXACT, Job, Kind, Party, SAMPLES, Stage, Way};
use super::scale::Settings;
use super::verdicts::{MB, Verdict, as_table, verdicts};
use crate::lab::bench::results::{Column, Results, log_plot, percent, plot, ratio, table};
use crate::lab::bench::scenes::View;
use crate::lab::bench::store::Rows;
use crate::settings::sizes::human_count;
use anyhow::Result;
use brickwalk_report::{Graph, Section, Unit, Value};

const TITLE: &str = "What levels of detail save, and how they err";
const READING: &str = "tau: the tolerance, pixels; exact: without levels. Scenes are seen along their far paths unless \
                       said. Errors are against exact pictures of many samples, of which the first camera rays are \
                       those of the pictures; rays of light differ. RMSE is in sRGB, 0 to 1; relMSE is \
                       of linear radiance; FLIP is at 67 pixels per degree. MB are 1,000,000 bytes. Times \
                       are medians of frames of one sample, all ways in turns in one process.";
const PICTURES: &str = "The first frame. Silhouettes: RMSE over pixels within one of an edge of the exact picture. \
                        Sees through: rays through centres that exactly hit something and with levels nothing, or what \
                        lies behind the plane of the exact hit by more than the level's bound and a pixel; holes: \
                        those of them away from silhouettes; hits nothing: those that nothing stops; next \
                        pixel's: the share that exact rays of the next pixel \
                        would see through, bounds left out. Triangles and nodes: tested and visited, of all rays.";
const WALKS: &str = "Cold: loaded by the first frame, with an empty cache. Steady: loaded by a later frame. All: a \
                     frame's mean of both. The cache holds a share of all bricks without levels, with levels as many \
                     bytes. At 100 % times are of frames for which nothing is loaded; else of the later frames of \
                     walks that begin with an empty cache.";
const POPPING: &str = "Twelve frames, each 2 % of the path after the one before, all by the same rays. Change: mean \
                       absolute difference from the frame before, sRGB, thousandths. Of the error: by what the \
                       difference from the exact frame changes; of noise: the same of exact frames by other rays of \
                       light.";
const RESIDENT: &str = "What is resident after the first frame, which began with an empty cache that holds all. \
                        Triangles count every instance.";

/// Writes the results; returns what to print.
///
/// # Errors
/// The folder cannot be written.
pub fn write(
    args: &LodBenchArgs,
    settings: &Settings,
    jobs: &[Job],
    left_out: &[String],
    rows: &Rows,
    planned: usize,
) -> Result<String> {
    let found = verdicts(jobs, rows);
    let mut sections = vec![Section { title: "Verdict".into(), tables: vec![as_table(&found)], ..Section::default() }];
    for stage in [Stage::Quality, Stage::Diffuse] {
        sections.push(pictures(stage, jobs, rows));
    }
    for stage in [Stage::Walks, Stage::Diffuse] {
        sections.push(walks(stage, jobs, rows));
    }
    sections.push(popping(jobs, rows));
    sections.push(resident(jobs, rows));
    sections.retain(|section| section.tables.iter().any(|table| !table.rows.is_empty()));
    let mut facts = vec![
        ("Triangles of the city, the terrain and the plant", human_count(settings.triangles)),
        ("Resolution", settings.size.to_string()),
        ("Samples of the pictures that others are compared with", settings.samples.to_string()),
        ("Frames of a walk", settings.frames.to_string()),
        ("Turns", settings.repeat.to_string()),
        ("Schedule", settings.schedule.to_string()),
    ];
    facts.extend(settings.large.map(|triangles| ("Triangles of the large city", human_count(triangles))));
    facts.extend(left_out.iter().map(|line| ("Not measured", line.clone())));
    let mut results = Results::of_rows(("lod", TITLE, READING), rows, planned, facts, sections);
    results.verdicts.extend(settings.unmet().into_iter().map(|rule| (format!("Not as targets have it: {rule}"), true)));
    results.verdicts.extend(found.iter().map(|own: &Verdict| (own.sentence(), !own.is_met)));
    results.write(&args.output)
}

/// What was measured of a party of a job.
#[derive(Clone, Copy)]
struct Line<'a> {
    job: &'a Job,
    party: &'a Party,
    samples: u32,
    rows: &'a Rows,
}

impl<'a> Line<'a> {
    fn key(&self) -> String {
        self.job.key(self.party, self.samples)
    }

    fn value(&self, name: &str) -> Option<f64> {
        self.rows.value(&self.key(), name)
    }

    fn number(&self, name: &str) -> Value {
        Value::number(self.value(name))
    }

    fn mb(&self, name: &str) -> Value {
        Value::number(self.value(name).map(|bytes| bytes / MB))
    }

    fn thousandths(&self, name: &str) -> Value {
        Value::number(self.value(name).map(|value| 1e3 * value))
    }

    /// Millions.
    fn millions(&self, name: &str) -> Value {
        Value::number(self.value(name).map(|count| 1e-6 * count))
    }

    /// The same of exact rays.
    fn exact(&self) -> Option<Self> {
        let is_exact = |party: &&Party| {
            let own = self.party;
            party.way == EXACT && (party.scene, party.view, party.cache) == (own.scene, own.view, own.cache)
        };
        Some(Self { party: self.job.parties.iter().find(is_exact)?, ..*self })
    }

    /// A value over that of exact rays.
    fn over_exact(&self, name: &str) -> Value {
        Value::ratio(ratio(self.value(name), self.exact().and_then(|exact| exact.value(name))))
    }
}

/// All that was measured of a kind in a stage.
fn lines<'a>(stage: Stage, kind: Kind, jobs: &'a [Job], rows: &'a Rows) -> Vec<Line<'a>> {
    let samples = if kind == Kind::Pictures { &SAMPLES[..] } else { &SAMPLES[..1] };
    let of_party = |job, party| samples.iter().map(move |&samples| Line { job, party, samples, rows });
    let own = jobs.iter().filter(|job| job.stage == stage && job.kind == kind);
    let all = own.flat_map(|job| job.parties.iter().flat_map(move |party| of_party(job, party)));
    all.filter(|line| rows.has(&line.key())).collect()
}

fn pictures(stage: Stage, jobs: &[Job], rows: &Rows) -> Section {
    let columns: [Column<Line>; 16] = [
        ("scene", |line| line.party.scene.into()),
        ("way", |line| line.party.way.to_string().into()),
        ("samples", |line| f64::from(line.samples).into()),
        ("RMSE", |line| line.number("rmse")),
        ("÷ exact", |line| line.over_exact("rmse")),
        ("FLIP", |line| line.number("flip")),
        ("relMSE", |line| line.number("rel_mse")),
        ("luminance, % off", |line| percent(line.value("luminance").map(|ratio| ratio - 1.0))),
        ("RMSE, silhouettes", |line| line.number("rmse_silhouettes")),
        ("sees through, %", |line| percent(line.value("see_through"))),
        ("holes, %", |line| percent(line.value("holes"))),
        ("hits nothing, %", |line| percent(line.value("missed"))),
        ("next pixel's, %", |line| percent(line.value("next_pixel"))),
        ("bricks, primary", |line| line.number("bricks")),
        ("triangles, M", |line| line.millions("triangles")),
        ("nodes, M", |line| line.millions("nodes")),
    ];
    let (title, name) = match stage {
        Stage::Diffuse => ("Errors with one bounce of diffuse light", "pictures-diffuse"),
        _ => ("Errors, lit by the sun", "pictures"),
    };
    let lines = lines(stage, Kind::Pictures, jobs, rows);
    let plots = vec![
        over_pixels("FLIP of 16 samples over the tolerance", &lines, |line| {
            line.value("flip").filter(|_| line.samples == 16).map(|flip| 100.0 * flip)
        }),
        over_pixels("RMSE of 1 sample over the tolerance", &lines, |line| {
            line.value("rmse").filter(|_| line.samples == 1).map(|rmse| 100.0 * rmse)
        }),
    ];
    Section { title: title.into(), tables: vec![table(name, PICTURES, lines, &columns)], plots, ..Section::default() }
}

/// A value in hundredths over the tolerance, a line for each scene. At 0 is what exact pictures have.
fn over_pixels(title: &str, lines: &[Line], value: impl Fn(&Line) -> Option<f64>) -> Graph {
    let mut of_scenes: Vec<brickwalk_report::Line> = Vec::new();
    for line in lines.iter().filter(|line| line.party.way == Way::of(line.party.way.pixels)) {
        let Some(y) = value(line) else { continue };
        push(&mut of_scenes, line.party.scene.into(), (line.party.way.pixels, y));
    }
    plot(title.into(), "Hundredths, a line for each scene. At 0: exact.", "pixels", Unit::Percent, of_scenes)
}

fn push(lines: &mut Vec<brickwalk_report::Line>, name: String, point: (f64, f64)) {
    match lines.iter_mut().find(|(own, _)| *own == name) {
        Some((_, points)) => points.push(point),
        None => lines.push((name, vec![point])),
    }
}

fn walks(stage: Stage, jobs: &[Job], rows: &Rows) -> Section {
    let columns: [Column<Line>; 15] = [
        ("beside", |line| line.job.scene.into()),
        ("scene", |line| line.party.scene.into()),
        ("path", |line| line.party.view.name().into()),
        ("cache, %", |line| f64::from(line.party.cache).into()),
        ("way", |line| line.party.way.to_string().into()),
        ("ms a frame", |line| line.number("ms")),
        ("ms ÷ exact", |line| line.over_exact("ms")),
        ("ms, cold", |line| line.number("ms_first")),
        ("MB cold", |line| line.mb("bytes_first")),
        ("MB steady", |line| line.mb("bytes_later")),
        ("MB all", |line| line.mb("bytes")),
        ("all ÷ exact", |line| line.over_exact("bytes")),
        ("MB resident", |line| line.mb("bytes_resident")),
        ("bricks, primary", |line| line.number("bricks")),
        ("pairs", |line| line.number("pairs")),
    ];
    let (title, name) = match stage {
        Stage::Diffuse => ("Times and bytes with one bounce of diffuse light", "walks-diffuse"),
        _ => ("Times and bytes, lit by the sun", "walks"),
    };
    let lines = lines(stage, Kind::Walks, jobs, rows);
    let plots = vec![
        of_walks("MB loaded by the first frame, cache 100 %", &lines, |line| {
            (line.party.cache == 100).then(|| line.value("bytes_first"))?.map(|bytes| bytes / MB)
        }),
        of_walks("Milliseconds of a frame, cache 100 %", &lines, |line| {
            (line.party.cache == 100).then(|| line.value("ms"))?
        }),
        of_walks("MB a frame, cache 15 %", &lines, |line| {
            (line.party.cache == 15).then(|| line.value("bytes"))?.map(|bytes| bytes / MB)
        }),
    ];
    Section { title: title.into(), tables: vec![table(name, WALKS, lines, &columns)], plots, ..Section::default() }
}

/// A value of walks far away over the tolerance, a line for each scene.
fn of_walks(title: &str, lines: &[Line], value: impl Fn(&Line) -> Option<f64>) -> Graph {
    let mut of_scenes: Vec<brickwalk_report::Line> = Vec::new();
    let is_far = |line: &&Line| line.party.view == View::Far && line.party.scene == line.job.scene;
    for line in lines.iter().filter(is_far).filter(|line| line.party.way == Way::of(line.party.way.pixels)) {
        let Some(y) = value(line) else { continue };
        push(&mut of_scenes, line.party.scene.into(), (line.party.way.pixels, y));
    }
    plot(title.into(), "A line for each scene. At 0: exact.", "pixels", Unit::Count, of_scenes)
}

fn popping(jobs: &[Job], rows: &Rows) -> Section {
    let columns: [Column<Line>; 7] = [
        ("scene", |line| line.party.scene.into()),
        ("way", |line| line.party.way.to_string().into()),
        ("change, exact", |line| line.thousandths("change_exact")),
        ("change", |line| line.thousandths("change")),
        ("beyond exact", |line| line.thousandths("beyond")),
        ("of the error", |line| line.thousandths("change_of_error")),
        ("of noise", |line| line.thousandths("change_of_noise")),
    ];
    let lines = lines(Stage::Popping, Kind::Popping, jobs, rows);
    Section {
        title: "What changes from frame to frame".into(),
        tables: vec![table("popping", POPPING, lines, &columns)],
        ..Section::default()
    }
}

fn resident(jobs: &[Job], rows: &Rows) -> Section {
    let columns: [Column<Line>; 6] = [
        ("scenes", |line| line.job.scene.into()),
        ("scene", |line| line.party.scene.into()),
        ("triangles, M", |line| line.millions("triangles")),
        ("MB of bricks", |line| line.mb("bytes_of_bricks")),
        ("MB resident", |line| line.mb("bytes_resident")),
        ("÷ the one before", |line| {
            let at = line.job.parties.iter().position(|party| party == line.party);
            let before = at.and_then(|at| line.job.parties.get(at.checked_sub(1)?));
            let before = before.and_then(|party| Line { party, ..*line }.value("bytes_resident"));
            Value::ratio(ratio(line.value("bytes_resident"), before))
        }),
    ];
    let lines = lines(Stage::WorkingSet, Kind::Resident, jobs, rows);
    let mut of_kinds: Vec<brickwalk_report::Line> = Vec::new();
    for line in &lines {
        for (name, value) in [("resident", "bytes_resident"), ("all bricks", "bytes_of_bricks")] {
            if let Some((x, y)) = line.value("triangles").zip(line.value(value)) {
                push(&mut of_kinds, format!("{}, {name}", line.job.scene), (x, y));
            }
        }
    }
    let reading = "Both axes are logarithmic. A flat line: what is resident does not grow with the scene.";
    let plots =
        vec![log_plot("Bytes resident over triangles, tau 1".into(), reading, "triangles", Unit::Bytes, of_kinds)];
    Section {
        title: "Working sets by the size of scenes".into(),
        tables: vec![table("working-set", RESIDENT, lines, &columns)],
        plots,
        ..Section::default()
    }
}
