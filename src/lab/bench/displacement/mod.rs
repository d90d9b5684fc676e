//! `brickwalk bench displacement`: the experiments of Gaitatzes et al. 2008 with a model over a corner: how far light
//! by fields is from that by exact rays, and how long a ray takes by them and by tracing it.
//!
//! Samples that several ways share are made once. Each finished measurement is a line of `rows.jsonl`, from which alone
//! tables, plots, verdicts and pages are made.

pub mod args;
pub mod corner;
mod mapping;
mod model;
mod output;
mod paper;
mod plan;
mod samples;
mod verdicts;

use super::args::wanted;
use super::runner::Runner;
use super::store::{Header, Row, Rows, Values, median};
use crate::kernels::vector::Vec3;
use crate::lab::console::Console;
use crate::output::atomic;
use crate::secondary::displacement::Chord;
use crate::secondary::displacement::shape::{frame, position_of};
use anyhow::Result;
use args::DisplacementBenchArgs;
use corner::{by_field, inside, levels, rms};
use glam::DVec3;
use mapping::Mapping;
use model::Model;
use plan::{Job, Look, Stage, Way};
use samples::Samples;
use serde_json::json;
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

/// Raised when a value changes its meaning.
const FORMAT: u32 = 1;

/// Runs the command.
///
/// # Errors
/// The folder holds other measurements or cannot be written; the model cannot be read; the device's.
pub fn run(args: &DisplacementBenchArgs, console: Console) -> Result<()> {
    let (settings, console) = (args.settings(), console.within(args.minutes));
    atomic::create_folder(&args.output)?;
    let models = args.output.join("models");
    let (name, file) = model::place(args.model.as_deref(), args.triangles, &models, console)?;
    let (scene, subject) = model::open(&file)?;
    let ball = subject.ball(&scene)?;
    let own = json!({
        "model": name,
        "triangles": scene.resident().manifest.triangle_ids,
        "center": ball.center.to_array(),
        "radius": ball.radius,
        "rays": args.rays,
        "repetitions": args.repeat,
    });
    let mut rows = Rows::open(args.output.join("rows.jsonl"), Header::new(FORMAT, &args.adapter, own)?, false)?;
    let mut runner = Runner::new(console);
    let stages = wanted(Stage::ALL, &args.stages);
    let mut jobs = plan::jobs(&settings);
    jobs.retain(|job| stages.contains(&job.stage));
    let mut open: Option<Model> = None;
    let keys = |job: &Job| job.ways.iter().map(|&way| job.key(way)).collect();
    runner.measure(&mut rows, &jobs, keys, |job| {
        if job.stage == Stage::Figure8 {
            open = None;
            return timed(job, args, &models, console);
        }
        let model = match open.take() {
            Some(model) => model,
            None => Model::open(&file, &args.adapter, args.rays)?,
        };
        let model = open.insert(model);
        if job.stage == Stage::Figure5 { mapped(job, args, model, console) } else { held(job, args, model, console) }
    })?;
    let planned = jobs.iter().map(|job| job.ways.len()).sum();
    let text = output::write(args, &settings, &rows, planned)?;
    runner.end(&args.output, &text)
}

/// Errors of grey levels by distances.
fn errors(model: &Model, args: &DisplacementBenchArgs, found: &[f32]) -> Values {
    let (rms, bias) = rms(&levels(found, args.rays), &levels(&model.exact, args.rays));
    Values::from([("rms".into(), rms), ("bias".into(), bias)])
}

/// A way to ask samples that are held, as it is measured.
struct Held<'a> {
    way: Way,
    look: Look,
    samples: &'a Samples,
    /// By the last turn.
    distances: Vec<f32>,
    /// Milliseconds of every turn but the first.
    ms: Vec<f64>,
}

/// Errors and times by samples of so many bits as the ways of the job have.
fn held(job: &Job, args: &DisplacementBenchArgs, model: &mut Model, console: Console) -> Result<Vec<Row>> {
    let mut samples: BTreeMap<u32, Samples> = BTreeMap::new();
    for way in &job.ways {
        samples.entry(way.bits()).or_insert_with(|| Samples::new(job.shape, way.bits()));
    }
    let seconds = model.bake(job.shape, None, console, &mut |first, shares| {
        samples.values_mut().for_each(|samples| samples.take(first, shares));
    })?;
    let of = |&way: &Way| {
        let samples = samples.get(&way.bits())?;
        Some(Held { way, look: way.look(), samples, distances: Vec::new(), ms: Vec::new() })
    };
    let mut all: Vec<Held> = job.ways.iter().filter_map(of).collect();
    for turn in 0..=args.repeat {
        for own in &mut all {
            console.go_on()?;
            let start = Instant::now();
            own.distances = by_samples(own.samples, own.look, model);
            // What the first turn brings into the caches is not counted.
            if turn > 0 {
                own.ms.push(1e3 * start.elapsed().as_secs_f64());
            }
        }
    }
    let row = |own: Held| {
        let mut values = errors(model, args, &own.distances);
        let beside = [
            ("bake_s", seconds),
            ("samples", job.shape.samples() as f64),
            ("bytes", own.samples.bytes() as f64),
            ("rays", model.rays.len() as f64),
        ];
        values.extend(beside.map(|(name, x)| (name.into(), x)));
        values.extend(median(own.ms).map(|ms| ("query_ms".into(), ms)));
        Row { key: job.key(own.way), values }
    };
    Ok(all.into_iter().map(row).collect())
}

/// Distances of the corner's rays by samples.
fn by_samples(samples: &Samples, look: Look, model: &Model) -> Vec<f32> {
    let field = samples.view();
    by_field(|chord| field.share(chord, look.bits()), &model.rays, &model.exact)
}

/// Errors by ways to map directions to a square.
fn mapped(job: &Job, args: &DisplacementBenchArgs, model: &mut Model, console: Console) -> Result<Vec<Row>> {
    let shape = job.shape;
    let place = |number: u32| {
        let at = shape.position(number);
        (at, frame(at))
    };
    let places: Vec<(DVec3, [DVec3; 3])> = (0..shape.positions()).map(place).collect();
    let mut rows = Vec::new();
    for &mapping in Mapping::ALL {
        let mut samples = Samples::new(shape, 8);
        let take = &mut |first, shares: &[f32]| samples.take(first, shares);
        let seconds = model.bake(shape, Some(&move |number| mapping.direction(shape, number)), console, take)?;
        let used = (0..shape.squares()).filter(|&number| mapping.is_used(shape, number)).count();
        for look in [Look::Paper, Look::Aimed] {
            let share = |chord: &Chord| {
                let position = position_of(shape.rings, chord.entry());
                let (at, frame) = &places[position as usize];
                let way = if look == Look::Aimed { wide(chord.middle) - at } else { wide(chord.direction) };
                samples.of(position, mapping.number(shape, in_frame(frame, way)))
            };
            let mut values = errors(model, args, &by_field(share, &model.rays, &model.exact));
            values.insert("used".into(), used as f64 / f64::from(shape.squares()));
            values.insert("bake_s".into(), seconds);
            rows.push(Row { key: job.key(Way::Mapped(mapping, look)), values });
        }
    }
    Ok(rows)
}

fn wide(v: Vec3) -> DVec3 {
    DVec3::from_array(v.map(f64::from))
}

/// A direction in a frame, its z not below 0.
fn in_frame([x, y, z]: &[DVec3; 3], way: DVec3) -> DVec3 {
    DVec3::new(x.dot(way), y.dot(way), z.dot(way).max(0.0))
}

/// What answers the rays of figure 8: names of their times.
const QUERIES: [&str; 4] = ["ns_paper", "ns_aimed", "ns_closest", "ns_any"];

/// An object of figure 8.
struct Object {
    way: Way,
    model: Model,
    samples: Samples,
    values: Values,
    /// Nanoseconds of a ray in every turn but the first, by [`QUERIES`].
    ns: [Vec<f64>; 4],
}

impl Object {
    /// Opens an object and makes its field.
    fn open(way: Way, job: &Job, args: &DisplacementBenchArgs, models: &Path, console: Console) -> Result<Self> {
        let triangles = if let Way::Timed(triangles) = way { triangles } else { args.triangles };
        let (_, file) = model::made(triangles, models, console)?;
        let mut model = Model::open(&file, &args.adapter, args.rays)?;
        let mut samples = Samples::new(job.shape, 8);
        let seconds = model.bake(job.shape, None, console, &mut |first, shares| samples.take(first, shares))?;
        let mut values = Values::new();
        for look in [Look::Paper, Look::Aimed] {
            let errors = errors(&model, args, &by_samples(&samples, look, &model));
            values.extend(errors.into_iter().map(|(name, x)| (format!("{name}_{look}"), x)));
        }
        let own = [
            ("triangles", model.triangles() as f64),
            ("bricks", model.bricks() as f64),
            ("rays", model.rays.len() as f64),
            ("inside", inside(&model.rays)),
            ("bake_s", seconds),
        ];
        values.extend(own.map(|(name, x)| (name.into(), x)));
        Ok(Self { way, model, samples, values, ns: Default::default() })
    }

    /// Answers all rays; nanoseconds of one.
    fn ask(&mut self, query: &str) -> Result<f64> {
        let start = Instant::now();
        match query {
            "ns_paper" => drop(by_samples(&self.samples, Look::Paper, &self.model)),
            "ns_aimed" => drop(by_samples(&self.samples, Look::Aimed, &self.model)),
            _ => drop(self.model.trace(query == "ns_any")?),
        }
        Ok(1e9 * start.elapsed().as_secs_f64() / self.model.rays.len().max(1) as f64)
    }
}

/// Times of a ray by fields and by tracing it. Objects take turns, too: a drift of the machine meets all alike.
fn timed(job: &Job, args: &DisplacementBenchArgs, models: &Path, console: Console) -> Result<Vec<Row>> {
    let open = |&way: &Way| Object::open(way, job, args, models, console);
    let mut objects = job.ways.iter().map(open).collect::<Result<Vec<Object>>>()?;
    for turn in 0..=args.repeat {
        for object in &mut objects {
            for (k, query) in QUERIES.into_iter().enumerate() {
                console.go_on()?;
                let ns = object.ask(query)?;
                // What the first turn brings into the caches is not counted.
                if turn > 0 {
                    object.ns[k].push(ns);
                }
            }
        }
    }
    let row = |object: Object| {
        let Object { way, mut values, ns, .. } = object;
        values.extend(QUERIES.into_iter().zip(ns).filter_map(|(name, ns)| Some((name.into(), median(ns)?))));
        Row { key: job.key(way), values }
    };
    Ok(objects.into_iter().map(row).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::secondary::displacement::Shape;
    use brickwalk_scenes::Rng;

    /// The bench's own look-up is that of fields, and another mapping's is not.
    #[test]
    fn concentric_look_ups_are_those_of_fields() {
        let shape = Shape { rings: 4, directions: 16 };
        let mut samples = Samples::new(shape, 32);
        let numbers: Vec<f32> = (0..shape.samples()).map(|at| at as f32 / shape.samples() as f32).collect();
        samples.take(0, &numbers);
        let mut rng = Rng::new(11, &[5]);
        let (mut same, mut other) = (0, 0);
        let count = 2000;
        for _ in 0..count {
            let mut any = || DVec3::from_array([(); 3].map(|()| rng.range(-1.0, 1.0)));
            let (origin, aim) = (3.0 * any().normalize(), 0.7 * any().normalize());
            let way = (aim - origin).normalize().as_vec3().to_array();
            let chord = Chord::of(origin.as_vec3().to_array(), way).expect("it hits the sphere");
            let position = position_of(shape.rings, chord.entry());
            let local = in_frame(&frame(shape.position(position)), wide(way));
            let field = samples.view().share(&chord, Look::Paper.bits());
            same += u32::from(samples.of(position, Mapping::Concentric.number(shape, local)) == field);
            other += u32::from(samples.of(position, Mapping::Uniform.number(shape, local)) == field);
        }
        // On an edge between squares f32 and f64 may differ.
        assert!(same >= count - 2 && other < count / 10, "{same} {other}");
    }
}
