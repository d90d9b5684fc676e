//! Camera paths: keyframes in a JSON file, a non-uniform Catmull–Rom spline between them.
//!
//! The spline is the one of Barry and Goldman (SIGGRAPH 1988) with the keyframes' times as knots, in Hermite form: the
//! tangent at an inner keyframe is that of the parabola through it and its two neighbours, at the first and the last
//! one-sided. Quadratic motion is therefore reproduced exactly between inner keyframes, and two keyframes make a line
//! at constant speed.

use super::camera::{Camera, CameraError, check_fov_y_degrees};
use super::keyframes::{self, KeyframesError};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// What messages call it.
const KIND: &str = "camera path";

/// A camera path. Valid by construction: at least one keyframe, times strictly ascending, every keyframe a camera.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CameraPath {
    /// Vertical field of view, degrees.
    fov_y_degrees: f64,
    /// Up vector, world space.
    up: [f64; 3],
    /// Keyframes by time.
    keyframes: Vec<Keyframe>,
}

/// A point of a path.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Keyframe {
    /// Time, seconds.
    pub time: f64,
    /// Position of the camera, world units.
    pub position: [f64; 3],
    /// What the camera looks at, world units.
    pub target: [f64; 3],
}

/// The file as serde sees it; keyframes stay values so that an error can name the one it is in.
#[derive(Deserialize)]
struct Raw {
    #[serde(default = "default_fov")]
    fov_y_degrees: f64,
    #[serde(default = "default_up")]
    up: [f64; 3],
    keyframes: Vec<serde_json::Value>,
}

fn default_fov() -> f64 {
    60.0
}

fn default_up() -> [f64; 3] {
    [0.0, 1.0, 0.0]
}

impl CameraPath {
    /// Reads a path file.
    ///
    /// # Errors
    /// The file cannot be read, is not JSON of the documented form, or breaks a rule of [`Self::new`].
    pub fn read(file: &Path) -> Result<Self, KeyframesError> {
        Self::parse(&keyframes::read(file, KIND)?, file)
    }

    /// Parses the text of a path file; `file` names it in errors. `fov_y_degrees` (60) and `up` ([0, 1, 0]) may be
    /// absent.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn parse(text: &str, file: &Path) -> Result<Self, KeyframesError> {
        let raw: Raw = keyframes::parse(text, file, KIND)?;
        let keyframes = raw
            .keyframes
            .into_iter()
            .enumerate()
            .map(|(keyframe, value)| {
                serde_json::from_value(value).map_err(|error| {
                    let needs = "it needs time, position [x, y, z] and target [x, y, z]";
                    KeyframesError::new(file, format!("keyframe {keyframe}: {error}; {needs}"))
                })
            })
            .collect::<Result<Vec<Keyframe>, _>>()?;
        Self::new(raw.fov_y_degrees, raw.up, keyframes, file)
    }

    /// A path of these keyframes; `name` names it in errors.
    ///
    /// # Errors
    /// No keyframe, a non-finite value, times that do not ascend strictly, a position equal to its target, a zero up
    /// vector, a field of view out of range.
    pub fn new(
        fov_y_degrees: f64,
        up: [f64; 3],
        keyframes: Vec<Keyframe>,
        name: &Path,
    ) -> Result<Self, KeyframesError> {
        let whole = |what: String| KeyframesError::new(name, what);
        check_fov_y_degrees(fov_y_degrees).map_err(|e| whole(e.to_string()))?;
        if keyframes.is_empty() {
            return Err(whole("it has no keyframes; add at least one".into()));
        }
        let path = Self { fov_y_degrees, up, keyframes };
        for (keyframe, k) in path.keyframes.iter().enumerate() {
            let refuse = |what: String| whole(format!("keyframe {keyframe}: {what}"));
            if !k.time.is_finite() {
                return Err(refuse("time is not finite".into()));
            }
            let before = keyframe.checked_sub(1).map(|i| path.keyframes[i].time);
            keyframes::check_after(before, k.time).map_err(refuse)?;
            path.camera_of(k.position.into(), k.target.into()).check().map_err(|e| match e {
                CameraError::NoUp | CameraError::NotFinite("up") => whole(e.to_string()),
                e => refuse(e.to_string()),
            })?;
        }
        if !(path.keyframes[path.keyframes.len() - 1].time - path.keyframes[0].time).is_finite() {
            return Err(whole("its times are too far apart for a number".into()));
        }
        Ok(path)
    }

    /// A path of keyframes that are known to be cameras, 10 s long, +Y up.
    pub(super) fn of_views(fov_y_degrees: f64, views: impl ExactSizeIterator<Item = [DVec3; 2]>) -> Self {
        let step = 10.0 / (views.len().max(2) - 1) as f64;
        let key = |(k, [position, target]): (usize, [DVec3; 2])| Keyframe {
            time: k as f64 * step,
            position: position.to_array(),
            target: target.to_array(),
        };
        Self { fov_y_degrees, up: default_up(), keyframes: views.enumerate().map(key).collect() }
    }

    /// The keyframes, at least one, times strictly ascending.
    pub fn keyframes(&self) -> &[Keyframe] {
        &self.keyframes
    }

    /// Vertical field of view, degrees.
    pub fn fov_y_degrees(&self) -> f64 {
        self.fov_y_degrees
    }

    /// The same path with another vertical field of view, degrees.
    ///
    /// # Errors
    /// The field of view is out of range.
    pub fn with_fov_y_degrees(mut self, degrees: f64) -> Result<Self, CameraError> {
        check_fov_y_degrees(degrees)?;
        self.fov_y_degrees = degrees;
        Ok(self)
    }

    /// The camera of frame `k` of `frames`: time k/(frames − 1) of the range, the first keyframe when `frames` is 1;
    /// frames at and beyond the last stand at the last keyframe.
    pub fn frame(&self, k: u32, frames: u32) -> Camera {
        self.at(self.time(k, frames))
    }

    /// The time of frame `k` of `frames`, as of [`Self::frame`].
    pub fn time(&self, k: u32, frames: u32) -> f64 {
        let (first, last) = (self.keyframes[0].time, self.keyframes[self.keyframes.len() - 1].time);
        if frames <= 1 || k == 0 {
            first
        } else if k >= frames - 1 {
            last
        } else {
            first + (last - first) * (f64::from(k) / f64::from(frames - 1))
        }
    }

    /// The time from one frame of `frames` to the next.
    pub fn frame_time(&self, frames: u32) -> f64 {
        let range = self.keyframes[self.keyframes.len() - 1].time - self.keyframes[0].time;
        range / f64::from(frames.saturating_sub(1).max(1))
    }

    /// The camera at a time, clamped to the range of the keyframes.
    pub fn at(&self, time: f64) -> Camera {
        let keys = &self.keyframes;
        // The segment [i, i + 1] that holds the time: the number of inner keyframes not after it.
        let i = keys.partition_point(|k| k.time <= time).saturating_sub(1);
        if i + 1 >= keys.len() || time <= keys[0].time {
            let k = &keys[i];
            return self.camera_of(k.position.into(), k.target.into());
        }
        let along = |value: fn(&Keyframe) -> DVec3| spline(keys, i, time, |k| k.time, value);
        self.camera_of(along(|k| k.position.into()), along(|k| k.target.into()))
    }

    fn camera_of(&self, position: DVec3, target: DVec3) -> Camera {
        Camera { position, target, up: self.up.into(), fov_y: self.fov_y_degrees.to_radians() }
    }
}

/// `value` of the keyframes at `time` within segment `[i, i + 1]`, on the spline of this module; on a line where that
/// leaves the range of numbers. It is finite if values and the range of times are.
pub(super) fn spline<K>(
    keys: &[K],
    i: usize,
    time: f64,
    time_of: impl Fn(&K) -> f64,
    value: impl Fn(&K) -> DVec3,
) -> DVec3 {
    let (a, b) = (&keys[i], &keys[i + 1]);
    let span = time_of(b) - time_of(a);
    let s = (time - time_of(a)) / span;
    // Velocity at a keyframe.
    let tangent = |i: usize| {
        let slope = |a: usize, b: usize| {
            let (a, b) = (&keys[a], &keys[b]);
            (value(b) - value(a)) / (time_of(b) - time_of(a))
        };
        let last = keys.len() - 1;
        match i {
            0 => slope(0, 1),
            i if i == last => slope(last - 1, last),
            i => slope(i - 1, i) - slope(i - 1, i + 1) + slope(i, i + 1),
        }
    };
    let (m_a, m_b) = (tangent(i) * span, tangent(i + 1) * span);
    let (s2, s3) = (s * s, s * s * s);
    let curve = value(a) * (2.0 * s3 - 3.0 * s2 + 1.0)
        + m_a * (s3 - 2.0 * s2 + s)
        + value(b) * (3.0 * s2 - 2.0 * s3)
        + m_b * (s3 - s2);
    // Velocities and distances of finite keyframes may be beyond all numbers; the way between two of them is not.
    if curve.is_finite() { curve } else { value(a) * (1.0 - s) + value(b) * s }
}

#[cfg(test)]
#[path = "path_tests.rs"]
mod tests;
