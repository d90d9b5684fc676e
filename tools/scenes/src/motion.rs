//! How things of a generated scene move, as `walk --motion` reads it.

use serde::Serialize;

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
