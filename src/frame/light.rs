//! Sun, sky and the lamps beside them.

use super::environment::{Equirectangular, luminance};
use crate::kernels::Lamps;
use glam::DVec3;
use std::sync::Arc;

/// A sun disc, a sky of one colour over a ground of another, and lamps: perhaps an environment in the sky's place, and
/// emitters.
#[derive(Clone, Debug, PartialEq)]
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
    /// The environment and the emitters.
    pub lamps: Arc<Lamps>,
}

/// Of the sun at an intensity of 1.
const SUN_COLOR: [f32; 3] = [0.60, 0.56, 0.48];
/// Of the sky at an intensity of 1.
const SKY_COLOR: [f32; 3] = [1.15, 1.55, 2.20];

impl Light {
    /// A clear afternoon: direction as given, intensities relative to it.
    pub fn new(sun_direction: DVec3, sun_angle_degrees: f64, sun_intensity: f32, sky_intensity: f32) -> Self {
        let scaled = |c: [f32; 3], by: f32| c.map(|x| x * by);
        Self {
            sun_direction: sun_direction.normalize_or(DVec3::Y),
            sun_angle_degrees,
            sun_color: scaled(SUN_COLOR, sun_intensity),
            sky_color: scaled(SKY_COLOR, sky_intensity),
            ground_color: scaled([0.75, 0.69, 0.60], sky_intensity),
            lamps: Arc::default(),
        }
    }

    /// Luminance of what a white surface reflects of the sun and of the sky of [`Light::new`], at intensities of 1.
    pub fn usual_luminance() -> [f64; 2] {
        [SUN_COLOR, SKY_COLOR].map(|c| luminance(c.map(f64::from)))
    }

    /// The sky over the ground as an image.
    pub fn sky_image(&self) -> Equirectangular {
        let [sky, ground] = [self.sky_color, self.ground_color].map(|c| c.map(f64::from));
        let mix = |a: [f64; 3], b: [f64; 3], t: f64| [0, 1, 2].map(|k| a[k] * (1.0 - t) + b[k] * t);
        let horizon = mix(sky, [luminance(sky); 3], 0.65).map(|c| c * 1.3);
        Equirectangular::of(512, 256, |[_, up, _]| {
            if up < 0.0 { mix(horizon, ground, (-up * 8.0).min(1.0)) } else { mix(horizon, sky, up.sqrt()) }
        })
    }
}
