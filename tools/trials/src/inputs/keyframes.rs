//! Camera paths and motions.

use super::{Files, Format, Verdict};
use crate::kind::Fault;
use crate::mutate::Harm;
use crate::random::Random;
use brickwalk::scene::CameraPath;
use brickwalk::scene::motion::Motion;
use serde_json::{Value, json};
use std::path::Path;

/// Keys of both.
const NAMES: &[&str] = &[
    "fov_y_degrees",
    "up",
    "keyframes",
    "time",
    "position",
    "target",
    "instances",
    "node",
    "instance",
    "pivot",
    "translation",
    "rotation",
    "scale",
];

/// The text of a file, or what refuses it.
fn text(files: &Files) -> Result<&str, Verdict> {
    // The reader of files says so too.
    let wrong = || Verdict::Refused(format!("{}: not UTF-8", files.name()));
    std::str::from_utf8(files.bytes()).map_err(|_| wrong())
}

fn numbers<const N: usize>(random: &mut Random) -> Value {
    json!([0; N].map(|_: i32| (random.below(2001) as f64 - 1000.0) / 100.0).to_vec())
}

/// Camera paths.
pub struct Paths;

impl Format for Paths {
    const NAME: &'static str = "inputs/paths";
    const ABOUT: &'static str = "Camera paths: what is read has cameras at every time";

    fn make(&self, random: &mut Random, harm: Harm) -> Files {
        let keyframes: Vec<Value> = (0..random.within(1, 6))
            .map(|at| json!({"time": at, "position": numbers::<3>(random), "target": [at, 20, 0]}))
            .collect();
        let mut root = json!({"fov_y_degrees": 50.5, "up": [0, 1, 0.125], "keyframes": keyframes});
        harm.json(random, &mut root, NAMES, 90);
        let mut bytes = root.to_string().into_bytes();
        harm.bytes(random, &mut bytes, 15);
        Files::one("a.json", bytes)
    }

    fn read(&self, random: &mut Random, files: &Files, _: &Path) -> Result<Verdict, Fault> {
        let text = match text(files) {
            Ok(text) => text,
            Err(verdict) => return Ok(verdict),
        };
        let path = match CameraPath::parse(text, Path::new(files.name())) {
            Ok(path) => path,
            Err(error) => return Ok(Verdict::Refused(error.to_string())),
        };
        let keys = path.keyframes();
        if keys.is_empty() || !keys.is_sorted_by(|a, b| a.time < b.time) {
            return Err(Fault::new("a path's keyframes are not in order", text));
        }
        for key in keys {
            if path.at(key.time).check().is_err() {
                return Err(Fault::new("a path's keyframe is no camera", text));
            }
        }
        let frames = random.within(1, 9) as u32;
        for frame in 0..frames {
            let camera = path.frame(frame, frames);
            if camera.position.is_nan() || camera.target.is_nan() {
                return Err(Fault::new("a path leads nowhere", text));
            }
        }
        Ok(Verdict::Read)
    }
}

/// Motions.
pub struct Motions;

impl Format for Motions {
    const NAME: &'static str = "inputs/motions";
    const ABOUT: &'static str = "Motions: what is read has a pose at every time";

    fn make(&self, random: &mut Random, harm: Harm) -> Files {
        let keyframe = |at: usize, random: &mut Random| {
            let translation = numbers::<3>(random);
            json!({"time": at, "translation": translation, "rotation": [0, 0.6, 0, 0.8], "scale": 1 + at})
        };
        let mover = |random: &mut Random| {
            let keyframes: Vec<Value> = (0..random.within(1, 5)).map(|at| keyframe(at, random)).collect();
            match random.chance(50) {
                true => json!({"node": "door*", "pivot": [1, 2, 3], "keyframes": keyframes}),
                false => json!({"instance": 0, "keyframes": keyframes}),
            }
        };
        let movers: Vec<Value> = (0..random.within(1, 3)).map(|_| mover(random)).collect();
        let mut root = json!({"instances": movers});
        harm.json(random, &mut root, NAMES, 90);
        let mut bytes = root.to_string().into_bytes();
        harm.bytes(random, &mut bytes, 15);
        Files::one("a.json", bytes)
    }

    fn read(&self, random: &mut Random, files: &Files, _: &Path) -> Result<Verdict, Fault> {
        let text = match text(files) {
            Ok(text) => text,
            Err(verdict) => return Ok(verdict),
        };
        let motion = match Motion::parse(text, Path::new(files.name())) {
            Ok(motion) => motion,
            Err(error) => return Ok(Verdict::Refused(error.to_string())),
        };
        for mover in motion.movers() {
            for _ in 0..4 {
                let time = random.pick([-1.0, 0.0, 0.5, 1.0, 1e300, f64::MIN_POSITIVE]) * random.share();
                let pose = mover.at(time);
                if pose.translation.is_nan() || pose.rotation.is_nan() || pose.scale.is_nan() {
                    return Err(Fault::new("a motion leads nowhere", format!("at {time}: {pose:?} of {text}")));
                }
            }
        }
        Ok(Verdict::Read)
    }
}
