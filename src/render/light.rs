//! Sun, sky and the rectangular light.

use glam::DVec3;

/// A parallelogram that shines evenly to one side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RectangleLight {
    /// A corner, world units.
    pub corner: DVec3,
    /// The edges that start there, world units. It shines to the side of `edges[0]` x `edges[1]`.
    pub edges: [DVec3; 2],
    /// Its radiance, linear.
    pub radiance: [f32; 3],
}

/// A sun disc and a sky of one colour over a ground of another, and perhaps a rectangular light, which is not seen itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Unit vector toward the sun, world space.
    pub sun_direction: DVec3,
    /// Full angle of the sun's disc in degrees; 0 makes shadows hard.
    pub sun_angle_degrees: f64,
    /// What a white surface that faces the sun reflects of it, linear.
    pub sun_color: [f32; 3],
    /// Radiance of the sky, linear.
    pub sky_color: [f32; 3],
    /// Radiance of the ground, linear.
    pub ground_color: [f32; 3],
    /// The rectangular light.
    pub rectangle: Option<RectangleLight>,
}

impl Light {
    /// A clear afternoon: direction as given, intensities relative to it.
    pub fn new(sun_direction: DVec3, sun_angle_degrees: f64, sun_intensity: f32, sky_intensity: f32) -> Self {
        let scaled = |c: [f32; 3], by: f32| c.map(|x| x * by);
        Self {
            sun_direction: sun_direction.normalize_or(DVec3::Y),
            sun_angle_degrees,
            sun_color: scaled([0.60, 0.56, 0.48], sun_intensity),
            sky_color: scaled([1.15, 1.55, 2.20], sky_intensity),
            ground_color: scaled([0.75, 0.69, 0.60], sky_intensity),
            rectangle: None,
        }
    }
}
