//! `brickwalk bench lod`: what levels of detail are worth and what they cost, beside exact pictures: errors, bytes and
//! times by the tolerance, what changes from frame to frame, and how bytes resident grow with the scene.
//!
//! Ways that are compared take turns in one process. Each finished measurement is a line of `rows.jsonl`, from which
//! alone tables, plots, verdicts and pages are made.

pub mod args;
mod bounds;
mod measures;
mod output;
mod places;
mod plan;
mod scale;
mod verdicts;
mod view;

use super::args::wanted;
use super::runner::Runner;
use super::scenes::View as Path;
use super::store::{Header, Row, Rows, Values, median};
use crate::lab::console::Console;
use crate::metrics::{Image, PIXELS_PER_DEGREE, flicker, flip_ldr, pixel_errors};
use crate::output::atomic;
use crate::scene::Camera;
use crate::session::Settings as WalkSettings;
use anyhow::{Context, Result};
use args::LodBenchArgs;
use bounds::Bounds;
use measures::Seen;
use places::Subject;
use plan::{EXACT, Job, Kind, Party, SAMPLES, Stage, Way};
use scale::Settings;
use serde_json::json;
use std::path::PathBuf;
use view::{Cost, View};

/// Raised when a value changes its meaning.
const FORMAT: u32 = 1;

/// Frames of which popping is measured, and of how many that its path would have: steps of 2 % of it.
const POPPING_FRAMES: [u32; 2] = [12, 51];

/// Where scenes are, and with what they are opened.
struct Bench<'a> {
    args: &'a LodBenchArgs,
    settings: &'a Settings,
    subjects: &'a [Subject],
    folder: PathBuf,
    console: Console<'a>,
}

/// Runs the command.
///
/// # Errors
/// The folder holds other measurements or cannot be written; a scene cannot be made or read; the device's.
pub fn run(args: &LodBenchArgs, console: Console) -> Result<()> {
    let (settings, console) = (args.settings(), console.within(args.minutes));
    let variable = || std::env::var_os("BRICKWALK_SCENES").filter(|folder| !folder.is_empty()).map(PathBuf::from);
    let inputs = args.inputs.clone().or_else(variable);
    let (subjects, left_out) = places::subjects(&settings, inputs.as_deref());
    let stages = wanted(Stage::ALL, &args.stages);
    let mut jobs = plan::jobs(&settings, &subjects);
    jobs.retain(|job| stages.contains(&job.stage) && args.wants(&job.name()));
    atomic::create_folder(&args.output)?;
    for line in &left_out {
        console.show(&format!("{line}\n"))?;
    }
    let own = json!({
        "triangles": settings.triangles,
        "large": settings.large,
        "size": settings.size.to_string(),
        "frames": settings.frames,
        "repetitions": settings.repeat,
        "samples": settings.samples,
        "schedule": settings.schedule.name(),
    });
    let mut rows = Rows::open(args.output.join("rows.jsonl"), Header::new(FORMAT, &args.adapter, own)?, false)?;
    let mut runner = Runner::new(console);
    let folder = args.scenes.clone().unwrap_or_else(|| args.output.join("scenes"));
    let bench = Bench { args, settings: &settings, subjects: &subjects, folder, console };
    let mut views: Vec<View> = Vec::new();
    runner.measure(&mut rows, &jobs, Job::keys, |job| {
        // Those of other scenes make room.
        views.retain(|view| view.is_of(job.scene, job.cache, &bench.base(job)));
        let found = match job.kind {
            Kind::Pictures => pictures(bench.view(&mut views, job, &job.parties[0])?, job, &settings)?,
            Kind::Popping => popping(bench.view(&mut views, job, &job.parties[0])?, job, &settings)?,
            Kind::Walks => walks(&bench, &mut views, job)?,
            Kind::Resident => resident(&bench, job)?,
        };
        Ok(found.into_iter().map(|(key, values)| Row { key, values }).collect())
    })?;
    let planned = jobs.iter().map(|job| job.keys().len()).sum();
    let text = output::write(args, &settings, &plan::jobs(&settings, &subjects), &left_out, &rows, planned)?;
    runner.end(&args.output, &text)
}

/// Names and values of measurements.
type Found = Vec<(String, Values)>;

fn named<const N: usize>(values: [(&str, f64); N]) -> Values {
    values.map(|(name, value)| (name.to_string(), value)).into()
}

impl<'a> Bench<'a> {
    /// What a job traces; where nothing is timed nodes and triangles are counted.
    fn base(&self, job: &Job) -> WalkSettings {
        WalkSettings { count: job.kind == Kind::Pictures || job.kind == Kind::Popping, ..job.base() }
    }

    /// The view of a party, opened if it is not.
    fn view<'v>(&self, views: &'v mut Vec<View<'a>>, job: &Job, party: &Party) -> Result<&'v mut View<'a>> {
        let base = self.base(job);
        let found = views.iter().position(|view| view.is_of(party.scene, party.cache, &base));
        let at = match found {
            Some(at) => at,
            None => {
                let subject = self.subjects.iter().find(|subject| subject.name == party.scene);
                let subject = subject.with_context(|| format!("there is no scene {}", party.scene))?;
                let place = places::place(subject, &self.folder, self.console)?;
                let named = (party.scene, place);
                views.push(View::new(named, party.cache, base, self.settings, &self.args.adapter, self.console));
                views.len() - 1
            }
        };
        views.get_mut(at).context("the view is open")
    }
}

/// What camera rays see exactly, and what of it is a silhouette.
struct Exact {
    camera: Camera,
    angle: f64,
    reference: Image,
    reference_srgb: Image,
    seen: Seen,
    silhouettes: Vec<bool>,
    hit: Vec<Option<(u32, u32)>>,
}

/// Errors of all ways against exact pictures of the first frame of the far path.
fn pictures(view: &mut View, job: &Job, settings: &Settings) -> Result<Found> {
    let camera = view.path(Path::Far)?.frame(0, 1);
    let angle = view.angle(&camera);
    let first = view.frame(EXACT, (1, 0), (0, &camera), true)?;
    let (seen, hit) = (view.seen(&first, &camera), view.hit()?);
    let silhouettes = seen.silhouettes(angle);
    // By other rays than those of the pictures.
    let reference = view.frame(EXACT, (settings.samples, 1), (0, &camera), false)?;
    let reference = view.image(reference);
    let reference_srgb = measures::srgb(&reference);
    let exact = Exact { camera, angle, reference, reference_srgb, seen, silhouettes, hit };
    let mut found = Found::new();
    for party in &job.parties {
        for samples in SAMPLES {
            found.push((job.key(party, samples), errors(view, party.way, samples, &exact)?));
        }
    }
    Ok(found)
}

/// Errors of a picture; of one sample a pixel also what is seen through, and the work.
fn errors(view: &mut View, way: Way, samples: u32, exact: &Exact) -> Result<Values> {
    let output = view.frame(way, (samples, 0), (0, &exact.camera), samples == 1)?;
    let (depth, records) = (output.pixels.depth.clone(), output.records.clone());
    let image = view.image(output);
    let shown = measures::srgb(&image);
    let linear = pixel_errors(&image, &exact.reference)?;
    let mut values = named([
        ("rmse", pixel_errors(&shown, &exact.reference_srgb)?.rmse),
        ("rel_mse", linear.rel_mse),
        ("flip", flip_ldr(&image, &exact.reference, PIXELS_PER_DEGREE)?.mean()),
    ]);
    let luminance = measures::luminance_ratio(&image, &exact.reference);
    values.extend(luminance.map(|ratio| ("luminance".into(), ratio)));
    let edges = measures::rmse_of(&shown, &exact.reference_srgb, &exact.silhouettes);
    values.extend(edges.map(|rmse| ("rmse_silhouettes".into(), rmse)));
    if samples == 1 {
        let cost = Cost::of(&records);
        let sum = |count: fn(&crate::counters::Record) -> u64| records.iter().map(count).sum::<u64>() as f64;
        let through = seen_through(view, way, &depth, exact)?;
        let missed: Vec<bool> = depth.iter().map(|depth| depth.is_infinite()).collect();
        if !way.is_levelled() {
            // What a pixel's shift of all rays alone would do.
            let next = exact.seen.seen_through(&exact.seen.shifted(), exact.angle, |_| 0.0);
            values.insert("next_pixel".into(), exact.seen.share(&next, |_| true));
        }
        values.extend(named([
            ("silhouettes", exact.seen.share(&exact.silhouettes, |_| true)),
            ("see_through", exact.seen.share(&through, |_| true)),
            ("holes", exact.seen.share(&through, |i| !exact.silhouettes[i])),
            ("missed", exact.seen.share(&missed, |_| true)),
            ("rays", sum(|record| record.rays_traced)),
            ("nodes", sum(|record| record.nodes_visited)),
            ("triangles", sum(|record| record.triangles_tested)),
            ("bricks", cost.bricks),
            ("pairs", cost.pairs),
        ]));
    }
    Ok(values)
}

/// The pixels that are seen through in a frame with such depths.
fn seen_through(view: &mut View, way: Way, depth: &[f32], exact: &Exact) -> Result<Vec<bool>> {
    let Exact { camera, angle, seen, hit, .. } = exact;
    if !way.is_levelled() {
        return Ok(seen.seen_through(depth, *angle, |_| 0.0));
    }
    let scene = view.side(way)?.scene.clone();
    let mut bounds = Bounds::new(scene.resident(), camera.position, *angle, way);
    let of = |i: usize| hit.get(i).copied().flatten().map_or(0.0, |(instance, brick)| bounds.of(instance, brick));
    Ok(seen.seen_through(depth, *angle, of))
}

/// What changes from frame to frame of a slow path by the same rays, beyond what changes exactly.
fn popping(view: &mut View, job: &Job, settings: &Settings) -> Result<Found> {
    let path = view.path(Path::Far)?;
    let [frames, of] = POPPING_FRAMES;
    let mut before: Vec<Image> = Vec::new();
    let mut sums = vec![[0.0f64; 4]; job.parties.len()];
    for frame in 0..frames {
        let camera = path.frame(frame, of);
        let mut now = Vec::new();
        // Beside them exact pictures by other rays of light.
        let exact = [(EXACT, 0), (EXACT, 1)];
        let exact_pictures = exact.len();
        for (way, seed) in exact.into_iter().chain(job.parties.iter().map(|party| (party.way, 0))) {
            let output = view.frame(way, (settings.popping_samples, seed), (0, &camera), false)?;
            now.push(measures::srgb(&view.image(output)));
        }
        if frame > 0 {
            let exact = measures::change(&now[0], &before[0]);
            let all = vec![true; now[0].rgb.len()];
            let error = |k: usize| flicker([&before[k], &before[0]], [&now[k], &now[0]], &all, 0.0);
            let noise = error(1)?.mean;
            for (k, sums) in (exact_pictures..).zip(sums.iter_mut()) {
                let own = measures::change(&now[k], &before[k]);
                for (sum, value) in sums.iter_mut().zip([exact, own, error(k)?.mean, noise]) {
                    *sum += value / f64::from(frames - 1);
                }
            }
        }
        before = now;
    }
    let values = |[exact, own, error, noise]: [f64; 4]| {
        named([
            ("change_exact", exact),
            ("change", own),
            ("beyond", own - exact),
            ("change_of_error", error),
            ("change_of_noise", noise),
        ])
    };
    Ok(job.parties.iter().zip(sums).map(|(party, sums)| (job.key(party, 1), values(sums))).collect())
}

/// Times and bytes of walks that take turns. Where the cache holds all the first walk of each begins without a brick,
/// the second brings in what others' bricks have left no room for, and those after it are timed; else all begin so.
fn walks<'a>(bench: &Bench<'a>, views: &mut Vec<View<'a>>, job: &Job) -> Result<Found> {
    let settings = bench.settings;
    let mut found = vec![Values::new(); job.parties.len()];
    let mut times = vec![Vec::new(); job.parties.len()];
    let mut first_times = vec![Vec::new(); job.parties.len()];
    for turn in 0..settings.repeat + 2 {
        for (k, party) in job.parties.iter().enumerate() {
            let holds_all = party.cache == 100;
            if !holds_all && turn >= settings.repeat {
                continue;
            }
            let view = bench.view(views, job, party)?;
            if turn == 0 || !holds_all {
                view.empty(party.way)?;
            }
            let frames = view.walk(party.way, party.view)?;
            if turn == 0 {
                let resident = view.side(party.way)?.cache.residency.used_bytes();
                found[k] = bytes(&frames, resident as f64);
            }
            match holds_all {
                true if turn < 2 => {}
                true => times[k].extend(frames.iter().map(|frame| frame.ms)),
                false => times[k].extend(frames[1..].iter().map(|frame| frame.ms)),
            }
            if turn == 0 || !holds_all {
                first_times[k].push(frames[0].ms);
            }
        }
    }
    let all = found.iter_mut().zip(times.into_iter().zip(first_times));
    for (values, (times, first)) in all {
        values.extend(median(times).map(|ms| ("ms".into(), ms)));
        values.extend(median(first).map(|ms| ("ms_first".into(), ms)));
    }
    Ok(job.parties.iter().zip(found).map(|(party, values)| (job.key(party, 1), values)).collect())
}

/// Bytes of a walk that begins with an empty cache, and what is resident at its end.
fn bytes(frames: &[Cost], resident: f64) -> Values {
    let mean = |frames: &[Cost], of: fn(&Cost) -> f64| frames.iter().map(of).sum::<f64>() / frames.len().max(1) as f64;
    let later = frames.get(1..).unwrap_or_default();
    named([
        ("bytes_first", mean(&frames[..1], |cost| cost.bytes)),
        ("bytes_later", mean(later, |cost| cost.bytes)),
        ("bytes", mean(frames, |cost| cost.bytes)),
        ("bytes_resident", resident),
        ("bricks", mean(frames, |cost| cost.bricks)),
        ("pairs", mean(frames, |cost| cost.pairs)),
    ])
}

/// What is resident after the first frame of the far path, of scenes of one kind, ascending.
fn resident(bench: &Bench, job: &Job) -> Result<Found> {
    let mut found = Found::new();
    for party in &job.parties {
        let mut views = Vec::new();
        let view = bench.view(&mut views, job, party)?;
        let camera = view.path(Path::Far)?.frame(0, 1);
        let cost = Cost::of(&view.frame(party.way, (1, 0), (0, &camera), false)?.records);
        let renderer = view.side(party.way)?;
        let resident = renderer.scene.resident();
        let exact = resident.exact_bricks();
        let all: u64 = renderer.cache.sizes.bricks.iter().take(exact).map(|(own, attributes)| own + attributes).sum();
        let values = named([
            ("triangles", resident.manifest.triangle_ids as f64),
            ("bytes_resident", renderer.cache.residency.used_bytes() as f64),
            ("bytes_first", cost.bytes),
            ("bytes_of_bricks", all as f64),
            ("bricks", cost.bricks),
        ]);
        found.push((job.key(party, 1), values));
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_of_first_and_later_frames_are_told_apart() {
        let frame = |bytes: f64, bricks: f64| Cost { bytes, bricks, ..Cost::default() };
        let values = bytes(&[frame(90.0, 4.0), frame(6.0, 2.0), frame(0.0, 3.0)], 80.0);
        let of = |name: &str| values[name];
        assert_eq!([of("bytes_first"), of("bytes_later"), of("bytes"), of("bricks")], [90.0, 3.0, 32.0, 3.0]);
        assert_eq!(of("bytes_resident"), 80.0);
        assert_eq!(bytes(&[frame(5.0, 1.0)], 5.0)["bytes_later"], 0.0);
    }
}
