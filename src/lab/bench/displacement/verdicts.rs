//! What the measurements say of the paper's claims.

use super::args::Settings;
use super::mapping::Mapping;
use super::paper;
use super::plan::{Job, Look, Stage, Way, jobs};
use crate::lab::bench::results::{Column, table};
use crate::lab::bench::store::Rows;
use crate::settings::sizes::human_count;
use brickwalk_report::{Table, Value};

/// A claim, and what was found.
pub struct Verdict {
    /// The claim, with what it is about.
    pub claim: String,
    /// What was measured.
    pub found: Value,
    /// What was wanted.
    pub target: &'static str,
    /// Whether that is so; `None`: nothing was wanted.
    pub is_met: Option<bool>,
}

impl Verdict {
    fn new(claim: String, found: Value, target: &'static str, is_met: bool) -> Self {
        Self { claim, found, target, is_met: Some(is_met) }
    }

    fn result(&self) -> &'static str {
        match self.is_met {
            Some(true) => "OK",
            Some(false) => "missed",
            None => "–",
        }
    }

    /// As a sentence.
    pub fn sentence(&self) -> String {
        let Self { claim, found, target, is_met } = self;
        match is_met {
            Some(_) => format!("{claim}: {} (target {target}): {}", found.show(), self.result()),
            None => format!("{claim}: {}", found.show()),
        }
    }
}

/// The table of all.
pub fn as_table(all: &[Verdict]) -> Table {
    let columns: [Column<&Verdict>; 4] = [
        ("claim", |verdict| verdict.claim.clone().into()),
        ("measured", |verdict| verdict.found.clone()),
        ("target", |verdict| verdict.target.into()),
        ("result", |verdict| verdict.result().into()),
    ];
    table("verdict", "", all, &columns)
}

/// What was measured, by stages.
struct Measured<'a> {
    jobs: Vec<Job>,
    rows: &'a Rows,
}

impl Measured<'_> {
    fn has(&self, job: &Job, way: Way) -> bool {
        self.rows.has(&job.key(way))
    }

    /// The jobs of a stage of which a way was measured.
    fn of(&self, stage: Stage, way: Way) -> impl Iterator<Item = &Job> {
        self.jobs.iter().filter(move |job| job.stage == stage && self.has(job, way))
    }

    fn value(&self, job: &Job, way: Way, name: &str) -> Option<f64> {
        self.rows.value(&job.key(way), name)
    }
}

/// All that can be said; `is_bunny`: of the paper's model.
pub fn verdicts(settings: &Settings, rows: &Rows, is_bunny: bool) -> Vec<Verdict> {
    let all = Measured { jobs: jobs(settings), rows };
    let mut found = Vec::new();
    found.extend(over_positions(&all, settings));
    found.extend(over_directions(&all, settings));
    found.extend(is_bunny.then(|| beside_paper(&all)).flatten());
    found.extend(over_bits(&all));
    found.extend(over_mappings(&all));
    found.extend(over_triangles(&all));
    found
}

const PAPER: Way = Way::Asked(Look::Paper);

/// The RMS of the paper's mode, by rings and directions.
fn rms(all: &Measured, rings: u32, directions: u32) -> Option<f64> {
    let job =
        all.of(Stage::Figure6, PAPER).find(|job| (job.shape.rings, job.shape.directions) == (rings, directions))?;
    all.value(job, PAPER, "rms")
}

/// The least of some values, and the greatest.
fn range(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values.fold(None, |range, x| Some(range.map_or((x, x), |(least, most): (f64, f64)| (least.min(x), most.max(x)))))
}

fn over_positions(all: &Measured, settings: &Settings) -> Option<Verdict> {
    let [few, .., many] = settings.rings[..] else { return None };
    let fall = |&n: &u32| Some(rms(all, few, n)? / rms(all, many, n)?);
    let (least, _) = range(settings.directions.iter().filter_map(fall))?;
    let [few, many] =
        [few, many].map(|rings| crate::secondary::displacement::Shape { rings, directions: 2 }.positions());
    let claim = format!("RMS falls from {few} to {many} positions, at least");
    // The target is that of the paper's ends.
    if (few, many) == (290, 4226) {
        Some(Verdict::new(claim, Value::Of(least, '×'), "3× or more", least >= 3.0))
    } else {
        Some(Verdict { claim, found: Value::Of(least, '×'), target: "", is_met: None })
    }
}

fn over_directions(all: &Measured, settings: &Settings) -> Option<Verdict> {
    let [few, .., many] = settings.directions[..] else { return None };
    let fall = |&m: &u32| Some(100.0 * (1.0 - rms(all, m, many)? / rms(all, m, few)?));
    let (_, most) = range(settings.rings.iter().filter_map(fall))?;
    let claim = format!("RMS falls from {few}² to {many}² directions, at most");
    Some(Verdict::new(claim, Value::Of(most, '%'), "below 25 %", most < 25.0))
}

fn beside_paper(all: &Measured) -> Option<Verdict> {
    let ratio = |job: &Job| {
        let paper = paper::figure6(job.shape.positions(), job.shape.directions)?;
        Some(all.value(job, PAPER, "rms")? / paper.rms)
    };
    let (_, most) = range(all.of(Stage::Figure6, PAPER).filter_map(ratio))?;
    Some(Verdict::new("RMS over the paper's, at most".into(), Value::Of(most, '×'), "1.5× or less", most <= 1.5))
}

fn over_bits(all: &Measured) -> Vec<Verdict> {
    let held = |job: &Job, bits: u32, name: &str| all.value(job, Way::Held(bits, Look::Paper), name);
    let jobs = || all.of(Stage::Figure4, Way::Held(8, Look::Paper));
    let mut found = Vec::new();
    let change = |job: &Job| Some(100.0 * (held(job, 8, "rms")? / held(job, 32, "rms")? - 1.0).abs());
    if let Some((_, most)) = range(jobs().filter_map(change)) {
        let claim = "RMS of 8 bits differs from that of 32 bits, at most".into();
        found.push(Verdict::new(claim, Value::Of(most, '%'), "within 5 %", most <= 5.0));
    }
    let brighter = |job: &Job| Some(held(job, 1, "bias")? - held(job, 8, "bias")?);
    if let Some((least, _)) = range(jobs().filter_map(brighter)) {
        let claim = "1 bit is brighter than 8 bits, grey levels, at least".into();
        found.push(Verdict::new(claim, Value::Number(least), "above 0", least > 0.0));
    }
    found
}

fn over_mappings(all: &Measured) -> Vec<Verdict> {
    [Look::Paper, Look::Aimed].into_iter().filter_map(|look| over_mappings_by(look, all)).collect()
}

/// Of most directions.
fn over_mappings_by(look: Look, all: &Measured) -> Option<Verdict> {
    let of = |mapping| Way::Mapped(mapping, look);
    let job = all.of(Stage::Figure5, of(Mapping::Concentric)).last()?;
    let rms = |mapping| all.value(job, of(mapping), "rms");
    let ratio = rms(Mapping::Uniform)? / rms(Mapping::Concentric)?;
    let n = job.shape.directions;
    let claim = format!("RMS of uniform directions ({look}, {n}²) over that of concentric ones");
    let found = Value::Of(ratio, '×');
    // The paper says so of its own way.
    Some(match look {
        Look::Paper => Verdict::new(claim, found, "above 1×", ratio > 1.0),
        _ => Verdict { claim, found, target: "", is_met: None },
    })
}

fn over_triangles<'a>(all: &'a Measured<'a>) -> Vec<Verdict> {
    let mut found = Vec::new();
    let measured = |job: &'a Job| job.ways.iter().map(move |&way| (job, way)).filter(|(job, way)| all.has(job, *way));
    let objects: Vec<(&Job, Way)> =
        all.jobs.iter().filter(|job| job.stage == Stage::Figure8).flat_map(measured).collect();
    let value = |&(job, way): &(&Job, Way), name: &str| all.value(job, way, name);
    let size = |&(_, way): &(&Job, Way)| human_count(if let Way::Timed(triangles) = way { triangles } else { 0 });
    for (name, what) in [("ns_paper", "paper"), ("ns_aimed", "aimed")] {
        let Some((least, most)) = range(objects.iter().filter_map(|object| value(object, name))) else { continue };
        let spread = 100.0 * (most - least) / (most + least);
        let claim = format!("Time of a ray by fields ({what}) over triangles varies by ±");
        found.push(Verdict::new(claim, Value::Of(spread, '%'), "±20 % or less", spread <= 20.0));
    }
    for (name, what) in [("ns_closest", "closest hits"), ("ns_any", "any hit")] {
        let gain = |object: &(&Job, Way)| Some(value(object, name)? / value(object, "ns_aimed")?);
        let Some(last) = objects.last() else { continue };
        // From where on they win all along.
        let loses = |object: &(&Job, Way)| gain(object).is_none_or(|gain| gain <= 1.0);
        let first = objects.iter().rposition(loses).map_or(0, |at| at + 1);
        let text = match objects.get(first) {
            Some(object) if first > 0 => format!("from {} triangles on", size(object)),
            Some(_) => "at every number of triangles".into(),
            None => "at none".into(),
        };
        let claim = format!("Fields (aimed) beat tracing ({what})");
        found.push(Verdict { claim, found: text.into(), target: "", is_met: None });
        let claim = format!("Tracing ({what}) over fields (aimed) at {} triangles", size(last));
        found.push(Verdict { claim, found: Value::ratio(gain(last)), target: "", is_met: None });
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::bench::displacement::args::DisplacementBenchArgs;
    use crate::lab::bench::store::{Header, Row};
    use serde_json::json;

    /// Verdicts of made-up measurements: `rms` of the paper's mode by positions and directions.
    fn of(rms: fn(f64, f64) -> f64, ns_aimed: f64) -> Vec<Verdict> {
        let folder = tempfile::tempdir().unwrap();
        let header = Header { format: 1, settings: json!({}), adapter: json!({}), commit: String::new() };
        let mut rows = Rows::open(folder.path().join("rows.jsonl"), header, false).unwrap();
        let settings = DisplacementBenchArgs::default().settings();
        for job in jobs(&settings) {
            for &way in &job.ways {
                let error = match way {
                    Way::Held(1, _) => 4.0,
                    Way::Mapped(Mapping::Uniform, _) => 3.0,
                    _ => rms(job.shape.positions().into(), job.shape.directions.into()),
                };
                let bias = if matches!(way, Way::Held(1, _)) { 2.0 } else { 0.5 };
                let triangles = if let Way::Timed(triangles) = way { triangles as f64 } else { 1.0 };
                let own = [
                    ("rms", error),
                    ("bias", bias),
                    ("ns_paper", 40.0),
                    ("ns_aimed", ns_aimed),
                    ("ns_closest", 20.0 * triangles.log10()),
                    ("ns_any", 10.0 * triangles.log10()),
                ];
                let values = own.map(|(name, x)| (name.to_string(), x)).into();
                rows.push(Row { key: job.key(way), values }).unwrap();
            }
        }
        verdicts(&settings, &rows, true)
    }

    #[test]
    fn verdicts_follow_from_the_numbers() {
        let fits = of(|positions, directions| 2.8 * (290.0 / positions).sqrt() * (32.0 / directions).powf(0.1), 75.0);
        assert!(fits.iter().all(|verdict| verdict.is_met != Some(false)), "{:?}", sentences(&fits));
        let all = sentences(&fits);
        assert!(
            all.contains(&"Fields (aimed) beat tracing (closest hits): from 10,000 triangles on".into()),
            "{all:?}"
        );
        assert!(all.contains(&"Fields (aimed) beat tracing (any hit): at none".into()), "{all:?}");
        assert!(all[0].starts_with("RMS falls from 290 to 4226 positions, at least: 3.82×"), "{all:?}");
        // Control: errors that fall with directions alone, far from the paper's.
        let others = of(|_, directions| 300.0 / directions, 5.0);
        let missed = others.iter().filter(|verdict| verdict.is_met == Some(false)).count();
        assert_eq!(missed, 4, "{:?}", sentences(&others));
        assert!(sentences(&others).iter().any(|text| text.ends_with("at every number of triangles")));
    }

    fn sentences(all: &[Verdict]) -> Vec<String> {
        all.iter().map(Verdict::sentence).collect()
    }
}
