//! The environment and the emitters: what lamps beside the sun consist of, and as kernels see them.

use super::frame::Frame;
use super::layout;
use crate::math::alias::AliasTable;
use glam::DVec3;
use std::f64::consts::PI;
use std::sync::Arc;

/// The background of all directions, and how they are drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Environment {
    /// Texels of a row.
    pub width: u32,
    /// Rows, from +Y down. The middle of a row looks along -Z.
    pub height: u32,
    /// Linear radiance; w is the density, over both angles, by which the texel's directions are drawn.
    pub texels: Vec<[f32; 4]>,
    /// [`AliasTable::words`] over the texels.
    pub table: Vec<[u32; 2]>,
    /// Its turn about +Y, radians.
    pub turn: f64,
    /// What a white surface reflects of it, by terms of its normal: `ambient` in `shaders/shade/light.wgsl`.
    pub ambient: [[f32; 3]; 9],
}

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
    fn power(&self, radius: f64) -> f64 {
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
    fn placed(&self, frame: &Frame) -> layout::Emitter {
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

/// All lamps beside the sun.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lamps {
    /// The background, where it is not the sky of [`layout::Params`].
    pub environment: Option<Environment>,
    emitters: Vec<Emitter>,
    /// Of each emitter, by which probability it is drawn.
    probabilities: Vec<f32>,
    table: Vec<[u32; 2]>,
    /// [`Emitter::power`] of all.
    power: f64,
}

impl Lamps {
    /// Of `emitters`, one of which is drawn by its power for every ray, in a scene of this radius in world units. Those
    /// without light are left out.
    pub fn new(environment: Option<Environment>, mut emitters: Vec<Emitter>, radius: f64) -> Self {
        // Powers that overflow draw evenly: what they light is counted as not finite.
        let power = |emitter: &Emitter| emitter.power(radius).min(1e300);
        emitters.retain(|emitter| power(emitter) > 0.0);
        let greatest = emitters.iter().map(power).fold(0.0, f64::max);
        // What an f32 cannot divide by is drawn a little too often instead.
        let powers: Vec<f64> = emitters.iter().map(|e| (power(e) / greatest).max(1e-30)).collect();
        let sum: f64 = powers.iter().sum();
        let table = AliasTable::new(&powers).unwrap_or_default().words();
        let probabilities = powers.iter().map(|p| (p / sum) as f32).collect();
        Self { environment, emitters, probabilities, table, power: sum * greatest }
    }

    /// By which a point of a surface of luminance 1 that shines to one side is drawn, for an area of 1 in world units;
    /// 0 where surfaces are no lamps.
    pub fn density_of_surfaces(&self) -> f64 {
        if self.has_surfaces() { PI / self.power } else { 0.0 }
    }

    /// Whether surfaces of the scene are among the emitters: what hits show of their own light is then brought by rays
    /// to them.
    pub fn has_surfaces(&self) -> bool {
        self.emitters.iter().any(|emitter| matches!(emitter.shape, Shape::Triangle { .. }))
    }

    /// The emitters.
    pub fn emitters(&self) -> &[Emitter] {
        &self.emitters
    }

    /// Of each emitter, by which probability it is drawn: its share of the power of all.
    pub fn probabilities(&self) -> &[f32] {
        &self.probabilities
    }

    /// The emitters as kernels see them in `frame`.
    pub fn placed(&self, frame: &Frame) -> Vec<layout::Emitter> {
        let drawn = self.probabilities.iter().zip(&self.table);
        let placed = |(emitter, (&probability, &[threshold, other])): (&Emitter, (&f32, &[u32; 2]))| layout::Emitter {
            probability,
            threshold,
            other,
            ..emitter.placed(frame)
        };
        self.emitters.iter().zip(drawn).map(placed).collect()
    }

    /// Texels of the environment, none without one.
    pub fn texels(&self) -> &[[f32; 4]] {
        self.environment.as_ref().map_or(&[], |environment| &environment.texels)
    }

    /// The alias table over them.
    pub fn texel_table(&self) -> &[[u32; 2]] {
        self.environment.as_ref().map_or(&[], |environment| &environment.table)
    }
}

/// What kernels that light read beside the scene: group 2 of those on the device.
#[derive(Default)]
pub struct LampTables {
    lamps: Arc<Lamps>,
    emitters: Vec<layout::Emitter>,
    frame: Option<Frame>,
}

impl LampTables {
    /// Takes `lamps`, unless they are those that it has.
    pub fn set(&mut self, lamps: &Arc<Lamps>) {
        if !Arc::ptr_eq(&self.lamps, lamps) {
            (self.lamps, self.frame) = (lamps.clone(), None);
        }
    }

    /// Those that it has taken.
    pub fn lamps(&self) -> &Lamps {
        &self.lamps
    }

    /// The emitters in the present frame.
    pub fn emitters(&self) -> &[layout::Emitter] {
        &self.emitters
    }

    /// One of them by its number.
    pub fn emitter(&self, number: u32) -> &layout::Emitter {
        &self.emitters[number as usize]
    }

    /// Moves the emitters to `frame`, if they are not there yet.
    pub fn rebase(&mut self, frame: Frame) {
        if self.frame != Some(frame) {
            self.frame = Some(frame);
            self.emitters = self.lamps.placed(&frame);
        }
    }
}
