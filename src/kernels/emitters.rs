//! Emitters: lamps that have a place, or shine from infinity, and as kernels see them.

use super::frame::Frame;
use super::layout;
use glam::DVec3;
use std::f64::consts::PI;

/// What an emitter is and where, in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// Shines evenly to the side of the cross product of its edges.
    Parallelogram {
        /// A corner.
        corner: DVec3,
        /// The edges that start there.
        edges: [DVec3; 2],
    },
    /// Half of that; a surface of the scene itself.
    Triangle {
        /// A corner.
        corner: DVec3,
        /// The edges that start there.
        edges: [DVec3; 2],
    },
    /// Shines from a point to all sides.
    Point {
        /// Where.
        position: DVec3,
        /// The distance at which it ends (KHR_lights_punctual); 0: nowhere.
        range: f64,
    },
    /// Shines from a point into a cone.
    Spot {
        /// Where.
        position: DVec3,
        /// Unit vector along the axis.
        direction: DVec3,
        /// As of a point.
        range: f64,
        /// Angles from the axis where the light begins to fall off, and where it ends, radians.
        cone: [f64; 2],
    },
    /// Shines from infinity.
    Distant {
        /// Unit vector along the light.
        direction: DVec3,
    },
}

/// A light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Emitter {
    /// What and where.
    pub shape: Shape,
    /// Whether an area shines to both sides.
    pub two_sided: bool,
    /// Linear radiance of areas, W/(m² sr); radiant intensity of points and spots, W/sr; irradiance of distant lights,
    /// W/m².
    pub radiance: [f32; 3],
}

impl Emitter {
    /// What it sends out, up to a factor that all have; distant lights by what meets a scene of this radius.
    pub fn power(&self, radius: f64) -> f64 {
        let [r, g, b] = self.radiance.map(f64::from);
        let luminance = 0.2126 * r + 0.7152 * g + 0.0722 * b;
        let sides = if self.two_sided { 2.0 } else { 1.0 };
        luminance
            * match self.shape {
                Shape::Parallelogram { edges: [u, v], .. } => PI * sides * u.cross(v).length(),
                Shape::Triangle { edges: [u, v], .. } => 0.5 * PI * sides * u.cross(v).length(),
                Shape::Point { .. } => 4.0 * PI,
                Shape::Spot { cone: [inner, outer], .. } => 2.0 * PI * (1.0 - 0.5 * (inner.cos() + outer.cos())),
                Shape::Distant { .. } => PI * radius * radius,
            }
    }

    /// As kernels see it in `frame`, but for how it is drawn.
    pub fn placed(&self, frame: &Frame) -> layout::Emitter {
        let length = |d: DVec3| (d / frame.unit).as_vec3().to_array();
        let sided = if self.two_sided { layout::EMITTER_TWO_SIDED } else { 0 };
        let of_point = layout::Emitter {
            // Intensity is by the square of the world's unit, distances are by that of the device's.
            radiance: self.radiance.map(|c| (f64::from(c) / (frame.unit * frame.unit)) as f32),
            ..Default::default()
        };
        let inverse = |range: f64| if range > 0.0 { (frame.unit / range) as f32 } else { 0.0 };
        match self.shape {
            Shape::Parallelogram { corner, edges } | Shape::Triangle { corner, edges } => layout::Emitter {
                kind: sided
                    | match self.shape {
                        Shape::Triangle { .. } => layout::EMITTER_TRIANGLE,
                        _ => layout::EMITTER_PARALLELOGRAM,
                    },
                corner: frame.point(corner),
                u: length(edges[0]),
                v: length(edges[1]),
                radiance: self.radiance,
                ..Default::default()
            },
            Shape::Point { position, range } => layout::Emitter {
                kind: layout::EMITTER_POINT,
                corner: frame.point(position),
                v: [0.0, 0.0, inverse(range)],
                ..of_point
            },
            Shape::Spot { position, direction, range, cone: [inner, outer] } => {
                // KHR_lights_punctual, "Inner and outer cone angles".
                let scale = 1.0 / (inner.cos() - outer.cos()).max(1e-3);
                layout::Emitter {
                    kind: layout::EMITTER_SPOT,
                    corner: frame.point(position),
                    u: direction.as_vec3().to_array(),
                    v: [scale as f32, (-outer.cos() * scale) as f32, inverse(range)],
                    ..of_point
                }
            }
            Shape::Distant { direction } => layout::Emitter {
                kind: layout::EMITTER_DISTANT,
                u: direction.as_vec3().to_array(),
                radiance: self.radiance,
                ..Default::default()
            },
        }
    }
}
