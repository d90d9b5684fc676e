//! The way around the pond.

use glam::DVec2;

/// Radius of the way around the pond, metres.
const WAY: f64 = 24.0;
/// Nothing but low grass is nearer to the way, metres.
pub const CLEAR: f64 = 1.6;

/// The way, `s` metres from its start.
pub fn way(s: f64) -> DVec2 {
    DVec2::from_angle(0.9 - s / WAY) * WAY
}

/// Distance from the way.
pub fn way_distance(p: DVec2) -> f64 {
    (p.length() - WAY).abs()
}
