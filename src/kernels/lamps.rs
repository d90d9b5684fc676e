//! The environment and the emitters: what lamps beside the sun consist of, and as kernels see them.

use super::emitter_groups::{Group, groups};
pub use super::emitters::{Emitter, Shape};
use super::frame::Frame;
use super::layout;
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
    /// [`crate::math::alias::AliasTable::words`] over the texels.
    pub table: Vec<[u32; 2]>,
    /// Its turn about +Y, radians.
    pub turn: f64,
    /// What a white surface reflects of it, by terms of its normal: `ambient` in `shaders/shade/light.wgsl`.
    pub ambient: [[f32; 3]; 9],
    /// It is about as bright in all directions: they are drawn by the cosine at the surface, not by its light.
    pub is_even: bool,
}

/// All lamps beside the sun.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lamps {
    /// The background, where it is not the sky of [`layout::Params`].
    pub environment: Option<Environment>,
    emitters: Vec<Emitter>,
    /// Of each emitter, its share of the power of all.
    probabilities: Vec<f32>,
    /// By which one is drawn.
    groups: Vec<Group>,
    /// [`Emitter::power`] of all.
    power: f64,
}

impl Lamps {
    /// Of `emitters`, one of which is drawn for every ray, in a scene of this radius in world units. Those without
    /// light are left out.
    pub fn new(environment: Option<Environment>, mut emitters: Vec<Emitter>, radius: f64) -> Self {
        // What powers that overflow light is counted as not finite.
        let power = |emitter: &Emitter| emitter.power(radius).min(1e300);
        emitters.retain(|emitter| power(emitter) > 0.0);
        let greatest = emitters.iter().map(power).fold(0.0, f64::max);
        // What an f32 cannot divide by counts for a little more.
        let powers: Vec<f64> = emitters.iter().map(|e| (power(e) / greatest).max(1e-30)).collect();
        let sum: f64 = powers.iter().sum();
        let probabilities = powers.iter().map(|p| (p / sum) as f32).collect();
        let groups = groups(&emitters);
        Self { environment, emitters, probabilities, groups, power: sum * greatest }
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

    /// Of each emitter, its share of the power of all.
    pub fn probabilities(&self) -> &[f32] {
        &self.probabilities
    }

    /// The emitters as kernels see them in `frame`, and behind them their groups.
    pub fn placed(&self, frame: &Frame) -> Vec<layout::Emitter> {
        let placed =
            |(emitter, &probability): (&Emitter, &f32)| layout::Emitter { probability, ..emitter.placed(frame) };
        let emitters = self.emitters.iter().zip(&self.probabilities).map(placed);
        emitters.chain(self.groups.iter().map(|group| group.placed(frame))).collect()
    }

    /// How many [`Lamps::placed`] are.
    pub fn entries(&self) -> usize {
        self.emitters.len() + self.groups.len()
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

    /// The emitters in the present frame, and their groups.
    pub fn emitters(&self) -> &[layout::Emitter] {
        &self.emitters
    }

    /// One of them by its number; the last for what is no number of one, as on devices.
    pub fn emitter(&self, number: u32) -> &layout::Emitter {
        &self.emitters[(number as usize).min(self.emitters.len() - 1)]
    }

    /// Moves the emitters to `frame`, if they are not there yet.
    pub fn rebase(&mut self, frame: Frame) {
        if self.frame != Some(frame) {
            self.frame = Some(frame);
            self.emitters = self.lamps.placed(&frame);
        }
    }
}
