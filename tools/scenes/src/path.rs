//! Camera paths through generated scenes.

use crate::city::Outcome;
use crate::layout::Layout;
use crate::{Error, Kind, Settings};
use brickwalk_convert::progress::Progress;
use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_PI_2;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Height of the eye above the street, metres.
const EYE: f64 = 1.7;
/// Metres from frame to frame of a walk.
const STEP: f64 = 0.5;
/// Radius of the walk's turns, metres; they stay within the crossings.
const TURN: f64 = 3.5;
/// How far ahead the walker looks, metres along the way.
const AHEAD: f64 = 9.0;
/// Frames of the walk written for headless runs, whose default is as many.
pub const NEAR_FRAMES: u32 = 30;
/// Frames of the long walk.
pub const LONG_FRAMES: u32 = 300;

/// A camera path, as it is stored in JSON. World units, right-handed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CameraPath {
    /// Vertical field of view in degrees.
    pub fov_y_degrees: f64,
    /// Up.
    pub up: [f64; 3],
    /// Keyframes, ascending in time.
    pub keyframes: Vec<Keyframe>,
}

/// A camera at a time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Keyframe {
    /// Time; only differences and order matter.
    pub time: f64,
    /// Position of the camera.
    pub position: [f64; 3],
    /// The point looked at.
    pub target: [f64; 3],
}

/// A way of straight lines and quarter circles.
struct Way {
    /// Start, direction at the start, length and turn to the left (+1), right (−1) or none (0) of each piece.
    pieces: Vec<(DVec2, DVec2, f64, f64)>,
}

impl Way {
    /// Along `points`, with rounded corners.
    fn new(points: &[DVec2]) -> Self {
        let mut pieces = Vec::new();
        let mut from = points[0];
        for k in 1..points.len() {
            let d = (points[k] - from).normalize();
            match points.get(k + 1) {
                Some(next) => {
                    let end = points[k] - d * TURN;
                    pieces.push((from, d, (end - from).length(), 0.0));
                    let e = (*next - points[k]).normalize();
                    pieces.push((end, d, TURN * FRAC_PI_2, d.perp_dot(e).signum()));
                    from = points[k] + e * TURN;
                }
                None => pieces.push((from, d, (points[k] - from).length(), 0.0)),
            }
        }
        Self { pieces }
    }

    /// The point `s` metres from the start.
    fn at(&self, mut s: f64) -> DVec2 {
        let last = self.pieces.len() - 1;
        for (k, &(p, d, length, turn)) in self.pieces.iter().enumerate() {
            if s <= length || k == last {
                if turn == 0.0 {
                    return p + d * s;
                }
                let side = d.perp() * turn;
                let (sin, cos) = (s / TURN).sin_cos();
                return p + d * (TURN * sin) + side * (TURN * (1.0 - cos));
            }
            s -= length;
        }
        self.pieces[last].0
    }
}

/// A walk of `frames` frames of half a metre through the centre of the city of `seed`: to the crossing at the origin, then
/// around the first block. It is the beginning of every longer one and the same for every size of the city.
pub fn near_path(seed: u64, frames: u32) -> CameraPath {
    let layout = Layout::new(seed);
    let (x1, z1) = (layout.x(1), layout.z(1));
    let way = Way::new(&[
        DVec2::new(-9.0, 0.0),
        DVec2::ZERO,
        DVec2::new(0.0, z1),
        DVec2::new(x1, z1),
        DVec2::new(x1, 0.0),
        DVec2::new(-60.0, 0.0),
    ]);
    let keyframes = (0..frames.max(1)).map(|k| {
        let s = f64::from(k) * STEP;
        let (p, t) = (way.at(s), way.at(s + AHEAD));
        Keyframe { time: f64::from(k), position: [p.x, EYE, p.y], target: [t.x, EYE + 0.8, t.y] }
    });
    CameraPath { fov_y_degrees: 65.0, up: [0.0, 1.0, 0.0], keyframes: keyframes.collect() }
}

/// A third of a circle around the city, above its roofs, all of it in view.
fn far_path(city: &Outcome) -> CameraPath {
    const KEYS: u32 = 13;
    let start = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    let [low, high] = city.bounds.iter().fold(start, |a, b| [a[0].min(b[0]), a[1].max(b[1])]);
    let middle = 0.5 * (low + high);
    let target = DVec3::new(middle.x, (0.02 * (high.x - low.x)).min(0.3 * high.y), middle.z);
    let fov_y_degrees: f64 = 50.0;
    let rise: f64 = 33.0f64.to_radians();
    // Away from the target.
    let directions: Vec<DVec3> = (0..KEYS)
        .map(|k| {
            let angle = 0.5 + f64::from(k) / f64::from(KEYS - 1) * std::f64::consts::TAU / 3.0;
            DVec3::new(angle.cos() * rise.cos(), rise.sin(), angle.sin() * rise.cos())
        })
        .collect();
    // Every corner of every block's bounds stays within a picture of 4:3 or wider, in every keyframe.
    let slope = (0.5 * fov_y_degrees).to_radians().tan();
    let corners =
        city.bounds.iter().flat_map(|b| (0..8).map(|k| DVec3::new(b[k & 1].x, b[k >> 1 & 1].y, b[k >> 2].z) - target));
    let corners: Vec<DVec3> = corners.collect();
    let needed = directions.iter().flat_map(|d| {
        let right = DVec3::Y.cross(*d).normalize();
        let up = d.cross(right);
        corners.iter().map(move |c| (0.75 * c.dot(right).abs()).max(c.dot(up).abs()) / slope + c.dot(*d))
    });
    let distance = 1.03 * needed.fold(0.0, f64::max);
    let keyframes = directions.iter().enumerate().map(|(k, d)| Keyframe {
        time: k as f64,
        position: (target + *d * distance).to_array(),
        target: target.to_array(),
    });
    CameraPath { fov_y_degrees, up: [0.0, 1.0, 0.0], keyframes: keyframes.collect() }
}

/// The path above the roofs of the scene that `settings` generate, with the whole city in view.
///
/// Builds the scene once more without keeping it, to learn how far it reaches.
///
/// # Errors
///
/// As [`crate::generate`].
pub fn path_above(settings: &Settings, progress: &Progress) -> Result<CameraPath, Error> {
    Ok(far_path(&crate::city::outline(settings, progress)?))
}

/// Writes the paths of a scene beside it: for `base` = `dir/S.bricks` or `dir/S` the files `dir/S.near.json` (a walk for 30
/// frames), `dir/S.near-300.json` (the same walk, longer, for 300 frames) and `dir/S.far.json`. Returns their names.
///
/// Each file appears complete or not at all.
///
/// # Errors
///
/// As [`crate::generate`], and when a file cannot be written.
pub fn write_paths(kind: Kind, settings: &Settings, base: &Path) -> Result<Vec<PathBuf>, Error> {
    let Kind::City = kind;
    let far = path_above(settings, &Progress::hidden())?;
    let near = near_path(settings.seed, NEAR_FRAMES);
    let long = near_path(settings.seed, LONG_FRAMES);
    let stem =
        if base.extension().is_some_and(|e| e == "bricks") { base.with_extension("") } else { base.to_path_buf() };
    let mut written = Vec::new();
    for (suffix, path) in [("near", near), ("near-300", long), ("far", far)] {
        let mut name = stem.clone().into_os_string();
        name.push(format!(".{suffix}.json"));
        let file = PathBuf::from(name);
        write_json(&path, &file).map_err(|source| Error::Write { path: file.clone(), source })?;
        written.push(file);
    }
    Ok(written)
}

/// Writes through a temporary file in the same folder.
fn write_json(path: &CameraPath, file: &Path) -> std::io::Result<()> {
    let folder = match file.parent() {
        Some(p) if !p.as_os_str().is_empty() => p,
        _ => Path::new("."),
    };
    let mut temporary = tempfile::Builder::new().prefix(".path").suffix(".tmp").tempfile_in(folder)?;
    serde_json::to_writer_pretty(&mut temporary, path)?;
    temporary.write_all(b"\n")?;
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        temporary.as_file().set_permissions(std::fs::Permissions::from_mode(0o644))?;
    }
    temporary.as_file().sync_all()?;
    temporary.persist(file).map_err(|e| e.error)?;
    Ok(())
}
