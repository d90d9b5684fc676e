//! Camera paths through generated scenes.

use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_PI_2;

/// Height of a walker's eyes above what he walks on, metres.
pub const EYE: f64 = 1.7;
/// Up.
pub const UP: [f64; 3] = [0.0, 1.0, 0.0];
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
pub struct Way {
    /// Start, direction at the start, length and turn to the left (+1), right (−1) or none (0) of each piece.
    pieces: Vec<(DVec2, DVec2, f64, f64)>,
}

impl Way {
    /// Along `points`, with rounded corners.
    pub fn new(points: &[DVec2]) -> Self {
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
    pub fn at(&self, mut s: f64) -> DVec2 {
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

/// A walk of `frames` frames of [`STEP`] metres along `way`, at the height `eye`.
pub fn walk(way: &Way, eye: f64, frames: u32) -> CameraPath {
    let keyframes = (0..frames).map(|k| {
        let s = f64::from(k) * STEP;
        let (p, t) = (way.at(s), way.at(s + AHEAD));
        Keyframe { time: f64::from(k), position: [p.x, eye, p.y], target: [t.x, eye + 0.8, t.y] }
    });
    CameraPath { fov_y_degrees: 65.0, up: UP, keyframes: keyframes.collect() }
}

/// A third of a circle around `target`, as [`arc`].
pub fn around(target: DVec3, bounds: &[[DVec3; 2]], rise: f64, start: f64) -> CameraPath {
    arc(target, bounds, rise, start, std::f64::consts::TAU / 3.0)
}

/// An arc of `span` radians around `target`, `rise` above the horizon, all of `bounds` in view of a picture of 4:3 or
/// wider in every keyframe.
pub fn arc(target: DVec3, bounds: &[[DVec3; 2]], rise: f64, start: f64, span: f64) -> CameraPath {
    const KEYS: u32 = 13;
    let fov_y_degrees: f64 = 50.0;
    // Away from the target.
    let directions: Vec<DVec3> = (0..KEYS)
        .map(|k| {
            let angle = start + f64::from(k) / f64::from(KEYS - 1) * span;
            DVec3::new(angle.cos() * rise.cos(), rise.sin(), angle.sin() * rise.cos())
        })
        .collect();
    let slope = (0.5 * fov_y_degrees).to_radians().tan();
    let corners =
        bounds.iter().flat_map(|b| (0..8).map(|k| DVec3::new(b[k & 1].x, b[k >> 1 & 1].y, b[k >> 2].z) - target));
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
    CameraPath { fov_y_degrees, up: UP, keyframes: keyframes.collect() }
}
