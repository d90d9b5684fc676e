//! Frames under settings that change no pixel, and the rays behind them.

use super::{MOST_BYTES, refused};
use crate::kind::{Fault, Kind, Limits, Outcome, Trial};
use crate::random::Random;
use crate::scenes;
use anyhow::Result;
use bricks::SceneFile;
use brickwalk::frame::Renderer;
use brickwalk::kernels::frame::Frame;
use brickwalk::kernels::layout::{Hit, NONE, Ray, T_INFINITE};
use brickwalk::reference::{Tally, Truth, TruthRay, judge, judge_any};
use brickwalk::scene::framing::path_from_bounds;
use brickwalk::schedule::{Lamp, Pass};
use std::path::PathBuf;
use std::sync::Arc;

/// A scene of a trial.
fn scene(random: &mut Random, trial: &Trial) -> Result<(Arc<SceneFile>, PathBuf), Fault> {
    let source = scenes::source(random);
    let settings = scenes::settings(random, &source);
    let path = trial.folder.join("scene.bricks");
    scenes::convert(source.scene, &settings, &path)?;
    let file = SceneFile::open(&path).map_err(|error| refused(&error.into()))?;
    Ok((Arc::new(file), path))
}

/// Frames under other schedules.
pub struct Schedules;

impl Kind for Schedules {
    fn name(&self) -> &'static str {
        "differences/schedules"
    }

    fn about(&self) -> &'static str {
        "Frames of a scene under other schedules, caches, tiles, workers and bands: the same bits"
    }

    fn limits(&self) -> Limits {
        Limits { seconds: 60.0, bytes: MOST_BYTES }
    }

    fn trial(&self, trial: &Trial) -> Result<Outcome, Fault> {
        let mut random = Random::new(self.name(), trial.seed);
        let (file, path) = scene(&mut random, trial)?;
        let view = scenes::view(&mut random);
        let rendered = |schedule: &str| {
            let renderer = scenes::open(file.clone(), &path, &format!("{view} {schedule}"));
            let frames = renderer.and_then(|mut renderer| scenes::frames(&mut renderer, 2));
            let frames = frames.map_err(|error| Fault::new("no frames", format!("{view} {schedule}: {error:#}")))?;
            Ok(frames.iter().map(scenes::bits).collect::<Vec<_>>())
        };
        let right = rendered("--schedule plain --cache 100%")?;
        for _ in 0..3 {
            let mut schedule = scenes::schedule(&mut random);
            if random.chance(30) {
                schedule += random.pick([" --bands 2", " --bands 3"]);
            }
            if rendered(&schedule)? != right {
                return Err(Fault::new("other pixels", format!("{view} {schedule}")));
            }
        }
        Ok(Outcome::Passed)
    }
}

/// The rays of frames.
pub struct Exact;

impl Kind for Exact {
    fn name(&self) -> &'static str {
        "differences/hits"
    }

    fn about(&self) -> &'static str {
        "Hits of primary and shadow rays beside those of f64 over all triangles"
    }

    fn limits(&self) -> Limits {
        Limits { seconds: 60.0, bytes: MOST_BYTES }
    }

    fn trial(&self, trial: &Trial) -> Result<Outcome, Fault> {
        let mut random = Random::new(self.name(), trial.seed);
        let (file, path) = scene(&mut random, trial)?;
        let options = format!("--size 48x32 {}", scenes::schedule(&mut random));
        let truth = Truth::load(&file).map_err(|error| refused(&error.into()))?;
        let mut renderer = scenes::open(file.clone(), &path, &options).map_err(|error| refused(&error))?;
        let manifest = &file.resident().manifest;
        let path = path_from_bounds(manifest.min, manifest.max);
        for number in 0..2 {
            let camera = path.frame(number, 2);
            let rendered = renderer.frame(number, &camera).map_err(anyhow::Error::from);
            rendered.map_err(|error| Fault::new("no frames", format!("{options}: {error:#}")))?;
            let frame = Frame::near(file.resident(), camera.position);
            let tally = judged(&mut renderer, &truth, &frame).map_err(|error| refused(&error))?;
            if tally.mismatches > 0 {
                return Err(Fault::new("a wrong hit", format!("{options}: frame {number}: {tally}")));
            }
        }
        Ok(Outcome::Passed)
    }
}

fn truth_ray(frame: &Frame, ray: &Ray) -> TruthRay {
    let t_max = if ray.t_max >= T_INFINITE { f32::INFINITY } else { ray.t_max };
    TruthRay::from_f32(frame.origin.to_array(), frame.unit, ray.origin, ray.direction, ray.t_min, t_max)
}

/// The verdicts on all primary rays of a frame, and on its rays to the sun.
fn judged(renderer: &mut Renderer, truth: &Truth, frame: &Frame) -> Result<Tally> {
    let found = |hit: &Hit| (hit.id != NONE).then_some((hit.id, f64::from(hit.t)));
    let rays = renderer.executor.read_rays(Pass::Primary)?;
    let hits = renderer.executor.read_hits(Pass::Primary)?;
    let mut tally: Tally =
        rays.iter().zip(&hits).map(|(ray, hit)| judge(truth, &truth_ray(frame, ray), found(hit))).collect();
    let rays = renderer.executor.read_rays(Pass::Shadow(Lamp::Sun))?;
    let occluders = renderer.executor.read_hits(Pass::Shadow(Lamp::Sun))?;
    let traced = (rays.iter().zip(&hits).zip(&occluders)).filter(|((ray, _), _)| ray.t_min <= ray.t_max);
    // A shadow ray leaves the hit of its pixel and does not meet that triangle again.
    tally.join(
        traced
            .map(|((ray, from), occluder)| {
                judge_any(truth, &truth_ray(frame, ray).excluding(from.id), occluder.id != NONE)
            })
            .collect(),
    );
    Ok(tally)
}
