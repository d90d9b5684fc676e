//! Which targets the measurements meet.

use super::places::{CITY, CITY_LARGE, PLANT, PLANTS_16, TERRAIN};
use super::plan::{EXACT, Job, Kind, Party, Stage, USUAL, Way};
use crate::lab::bench::results::{Column, ratio, table};
use crate::lab::bench::scenes::View;
use crate::lab::bench::store::Rows;
use brickwalk_report::{Table, Value};

/// Bytes of a megabyte, as targets have them.
pub const MB: f64 = 1e6;

/// A target, and what was found.
pub struct Verdict {
    /// What is measured.
    pub what: String,
    /// What was found.
    pub found: Value,
    /// What was wanted.
    pub target: String,
    /// Whether that is so.
    pub is_met: bool,
}

impl Verdict {
    fn result(&self) -> &'static str {
        if self.is_met { "OK" } else { "missed" }
    }

    /// As a sentence.
    pub fn sentence(&self) -> String {
        let Self { what, found, target, .. } = self;
        format!("{what}: {} (target {target}): {}", found.show(), self.result())
    }
}

/// The table of all.
pub fn as_table(all: &[Verdict]) -> Table {
    let columns: [Column<&Verdict>; 4] = [
        ("what", |verdict| verdict.what.clone().into()),
        ("measured", |verdict| verdict.found.clone()),
        ("target", |verdict| verdict.target.clone().into()),
        ("result", |verdict| verdict.result().into()),
    ];
    table("verdict", "", all, &columns)
}

/// What was measured.
struct Measured<'a> {
    jobs: &'a [Job],
    rows: &'a Rows,
}

impl Measured<'_> {
    /// A value of a picture of a scene with so many samples a pixel.
    fn picture(&self, scene: &str, way: Way, samples: u32, name: &str) -> Option<f64> {
        let job = |job: &&Job| (job.stage, job.kind, job.scene) == (Stage::Quality, Kind::Pictures, scene);
        let job = self.jobs.iter().find(job)?;
        let party = job.parties.iter().find(|party| party.way == way)?;
        self.rows.value(&job.key(party, samples), name)
    }

    /// A value of a walk of a job.
    fn walk(
        &self,
        (stage, scene, cache): (Stage, &str, u32),
        is_own: impl Fn(&Party) -> bool,
        name: &str,
    ) -> Option<f64> {
        let job = |job: &&Job| (job.stage, job.kind, job.scene, job.cache) == (stage, Kind::Walks, scene, cache);
        let job = self.jobs.iter().find(job)?;
        self.rows.value(&job.key(job.parties.iter().find(|party| is_own(party))?, 1), name)
    }

    /// A value of a walk far away.
    fn far(&self, job: (Stage, &str, u32), way: Way, name: &str) -> Option<f64> {
        self.walk(job, |party| party.scene == job.1 && party.view == View::Far && party.way == way, name)
    }
}

/// A value that is to be `most` at most.
fn at_most(what: String, found: Option<f64>, most: f64, unit: &str) -> Option<Verdict> {
    let value = found?;
    let found = match unit {
        "×" => Value::Of(value, '×'),
        "%" => Value::Of(value, '%'),
        _ => Value::Number(value),
    };
    let unit = if ["×", ""].contains(&unit) { unit.to_string() } else { format!(" {unit}") };
    Some(Verdict { what, found, target: format!("{most}{unit} or less"), is_met: value <= most })
}

/// All that can be said.
pub fn verdicts(jobs: &[Job], rows: &Rows) -> Vec<Verdict> {
    let all = Measured { jobs, rows };
    let mut found = Vec::new();
    found.extend(city(&all));
    found.extend(terrain_and_plants(&all));
    found.extend(diffuse(&all));
    found.extend(see_through(&all));
    found.extend(working_sets(&all));
    found
}

/// The large city, or the other one where that is not measured.
fn largest(all: &Measured) -> &'static str {
    let has_large = all.picture(CITY_LARGE, USUAL, 1, "rmse").is_some()
        || all.far((Stage::Walks, CITY_LARGE, 100), USUAL, "ms").is_some();
    if has_large { CITY_LARGE } else { CITY }
}

fn city(all: &Measured) -> Vec<Verdict> {
    let scene = largest(all);
    let walks = (Stage::Walks, scene, 100);
    let far = |name| all.far(walks, USUAL, name);
    let near = all.walk(walks, |party| party.view == View::Near && party.way == EXACT, "ms");
    let picture = |way, samples, name| all.picture(scene, way, samples, name);
    let off = picture(USUAL, 16, "luminance").map(|ratio| 100.0 * (ratio - 1.0).abs());
    let what = |text: &str| format!("{scene}, far, tau 1: {text}");
    let verdicts = [
        at_most(what("time of a frame over that of the near path, exact"), ratio(far("ms"), near), 3.0, "×"),
        at_most(what("loaded by the first frame, MB"), far("bytes_first").map(|bytes| bytes / MB), 60.0, "MB"),
        at_most(what("loaded by a later frame, MB"), far("bytes_later").map(|bytes| bytes / MB), 5.0, "MB"),
        at_most(
            what("RMSE of 1 sample over exact's"),
            ratio(picture(USUAL, 1, "rmse"), picture(EXACT, 1, "rmse")),
            0.85,
            "×",
        ),
        at_most(what("FLIP of 16 samples"), picture(USUAL, 16, "flip"), 0.035, ""),
        at_most(what("luminance is off by"), off, 1.0, "%"),
    ];
    verdicts.into_iter().flatten().collect()
}

fn terrain_and_plants(all: &Measured) -> Vec<Verdict> {
    let what = |scene: &str, text: &str| format!("{scene}, far, {text}");
    let terrain = (Stage::Walks, TERRAIN, 100);
    let plants = (Stage::Walks, PLANTS_16, 32);
    let over = |job, way, name| ratio(all.far(job, way, name), all.far(job, EXACT, name));
    let one = all.walk(plants, |party| party.scene == PLANT, "ms");
    let verdicts = [
        at_most(what(TERRAIN, "tau 1: FLIP of 16 samples"), all.picture(TERRAIN, USUAL, 16, "flip"), 0.01, ""),
        at_most(
            what(TERRAIN, "tau 1: loaded by the first frame over exact's"),
            over(terrain, USUAL, "bytes_first"),
            0.125,
            "×",
        ),
        at_most(
            what(PLANTS_16, "tau 1, cache 32 %: bytes a frame over exact's"),
            over(plants, USUAL, "bytes"),
            0.5,
            "×",
        ),
        at_most(
            what(PLANTS_16, "tau 4, cache 32 %: bytes a frame over exact's"),
            over(plants, Way::of(4.0), "bytes"),
            // A sixth, as it is shown.
            0.167,
            "×",
        ),
        at_most(
            what(PLANTS_16, "tau 1, cache 32 %: time of a frame over that of one plant, exact, in core"),
            ratio(all.far(plants, USUAL, "ms"), one),
            2.0,
            "×",
        ),
    ];
    verdicts.into_iter().flatten().collect()
}

fn diffuse(all: &Measured) -> Option<Verdict> {
    let of = |scene| {
        let job = (Stage::Diffuse, scene, 15);
        Some((scene, ratio(all.far(job, USUAL, "bytes"), all.far(job, EXACT, "bytes"))?))
    };
    let (scene, found) = of(CITY_LARGE).or_else(|| of(CITY))?;
    let what = format!("{scene}, far, tau 1, diffuse rays, cache 15 %: bytes a frame over exact's");
    at_most(what, Some(found), 0.1, "×")
}

/// The share of rays that see through what exact rays hit, in each scene.
fn see_through(all: &Measured) -> Vec<Verdict> {
    let jobs = all.jobs.iter().filter(|job| (job.stage, job.kind) == (Stage::Quality, Kind::Pictures));
    let of = |job: &Job| {
        let found = all.picture(job.scene, USUAL, 1, "see_through").map(|share| 100.0 * share);
        at_most(format!("{}, far, tau 1: rays that see through", job.scene), found, 0.3, "%")
    };
    jobs.filter_map(of).collect()
}

/// How bytes resident grow from a scene to the next larger one.
fn working_sets(all: &Measured) -> Vec<Verdict> {
    let mut found = Vec::new();
    for job in all.jobs.iter().filter(|job| job.kind == Kind::Resident) {
        let bytes = |party: &Party| all.rows.value(&job.key(party, 1), "bytes_resident");
        for pair in job.parties.windows(2) {
            let what = format!("{} over {}, far, tau 1: bytes resident", pair[1].scene, pair[0].scene);
            found.extend(at_most(what, ratio(bytes(&pair[1]), bytes(&pair[0])), 1.5, "×"));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::bench::lod::args::LodBenchArgs;
    use crate::lab::bench::lod::{places, plan};
    use crate::lab::bench::store::{Header, Row, Values};
    use serde_json::json;

    /// Verdicts of made-up measurements, of which `of` gives the values by party and samples.
    fn of(values: impl Fn(&Job, &Party) -> Vec<(&'static str, f64)>) -> Vec<Verdict> {
        let folder = tempfile::tempdir().unwrap();
        let header = Header { format: 1, settings: json!({}), adapter: json!({}), commit: String::new() };
        let mut rows = Rows::open(folder.path().join("rows.jsonl"), header, false).unwrap();
        let settings = LodBenchArgs { large: true, ..LodBenchArgs::default() }.settings();
        let jobs = plan::jobs(&settings, &places::subjects(&settings, None).0);
        for job in &jobs {
            for party in &job.parties {
                for samples in plan::SAMPLES {
                    let values: Values =
                        values(job, party).into_iter().map(|(name, x)| (name.to_string(), x)).collect();
                    rows.push(Row { key: job.key(party, samples), values }).unwrap();
                }
            }
        }
        verdicts(&jobs, &rows)
    }

    #[test]
    fn verdicts_follow_from_the_numbers() {
        let levelled = |job: &Job, party: &Party| {
            let by = if party.way.is_levelled() { 1.0 / (20.0 * party.way.pixels) } else { 1.0 };
            // One more hundredth for every tenfold scene.
            let resident = if job.kind == Kind::Resident { 5e7 } else { 4e9 * by };
            vec![
                ("ms", 10.0 + 40.0 * by),
                ("bytes", 1e9 * by),
                ("bytes_first", 9e8 * by),
                ("bytes_later", 6e7 * by),
                ("bytes_resident", resident),
                ("rmse", 0.05 + 0.02 * by),
                ("flip", 0.009),
                ("luminance", 0.995),
                ("see_through", 0.002),
            ]
        };
        let all = of(levelled);
        assert_eq!(all.len(), 6 + 5 + 1 + 5 + 3);
        let missed: Vec<String> = all.iter().filter(|own| !own.is_met).map(Verdict::sentence).collect();
        assert!(missed.is_empty(), "{missed:?}");
        let first = all[1].sentence();
        assert_eq!(first, "city-large, far, tau 1: loaded by the first frame, MB: 45.0 (target 60 MB or less): OK");
        // Control: levels that gain nothing, show worse and let through, and sets that grow with the scene.
        let useless = |job: &Job, party: &Party| {
            let large = if job.kind == Kind::Resident { job.parties.iter().position(|own| own == party) } else { None };
            vec![
                ("ms", if party.view == View::Near || party.scene == PLANT { 1.0 } else { 9.0 }),
                ("bytes", 1e9),
                ("bytes_first", 1e9),
                ("bytes_later", 1e8),
                ("bytes_resident", 2f64.powi(large.unwrap_or(0) as i32)),
                ("rmse", 0.05),
                ("flip", 0.05),
                ("luminance", 1.02),
                ("see_through", 0.01),
            ]
        };
        let all = of(useless);
        assert!(all.len() == 20 && all.iter().all(|own| !own.is_met), "{:?}", all[0].sentence());
        // Without measurements nothing is said.
        assert!(of(|_, _| Vec::new()).is_empty());
    }
}
