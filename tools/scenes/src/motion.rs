//! How things of a generated scene move, as `walk --motion` reads it.

use crate::path::{LONG_FRAMES, write_beside};
use crate::{Error, Scene};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// A node that moves from where the scene has it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Mover {
    /// Its name.
    pub node: String,
    /// Ascending in time, which is that of camera paths.
    pub keyframes: Vec<Pose>,
}

/// Where a node is at a time, against its place in the scene.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Pose {
    /// Time.
    pub time: f64,
    /// By which it is moved, metres.
    pub translation: [f64; 3],
    /// By which it is turned about its middle: a unit quaternion x, y, z, w.
    pub rotation: [f64; 4],
}

#[derive(Serialize)]
struct Motion {
    instances: Vec<Mover>,
}

/// Writes how things of a scene move beside it, as long as its longest path: for `base` = `dir/S.bricks` the file
/// `dir/S.motion.json`. Returns its name; `None` where nothing moves.
///
/// The file appears complete or not at all.
///
/// # Errors
///
/// [`Error::Write`] when the file cannot be written.
pub fn write_motion(scene: &Scene, base: &Path) -> Result<Option<PathBuf>, Error> {
    let instances = scene.movers(LONG_FRAMES);
    if instances.is_empty() {
        return Ok(None);
    }
    write_beside(&Motion { instances }, base, "motion").map(Some)
}
