//! Where the bays are and what each is for.

use crate::mesh::Frame;
use crate::rings::ring;
use crate::rng::{Rng, noise};
use glam::{DVec2, DVec3};

/// Metres from way to way.
pub const PITCH: f64 = 16.0;
/// Half the width of a way, metres.
pub const AISLE: f64 = 1.6;
/// Metres from floor to floor.
pub const HEIGHT: f64 = 6.0;

/// What a bay is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Use {
    /// Nothing but pipes.
    Rack,
    /// One wide tank.
    Tank,
    /// Several tanks.
    Tanks,
    /// Columns that rise above everything.
    Column,
    /// A furnace with a chimney.
    Boiler,
    /// Heat exchangers.
    Exchangers,
}

/// A bay, from way to way.
#[derive(Clone, Copy, Debug)]
pub struct Bay {
    /// Column.
    pub i: i64,
    /// Row.
    pub j: i64,
    /// Its least corner, on the ground.
    pub corner: DVec3,
    /// Its floors, the ground counted.
    pub levels: u32,
    /// What it is for.
    pub purpose: Use,
}

impl Bay {
    /// The bay at column `i`, row `j`.
    pub fn new(seed: u64, i: i64, j: i64) -> Self {
        let corner = DVec3::new(i as f64, 0.0, j as f64) * PITCH;
        let mut rng = Rng::new(seed, &[30, i, j]);
        let purpose = match rng.int(0, 19) {
            0..=6 => Use::Rack,
            7 | 8 => Use::Tank,
            9..=11 => Use::Tanks,
            12 | 13 => Use::Column,
            14 | 15 => Use::Boiler,
            _ => Use::Exchangers,
        };
        let center = (DVec2::new(i as f64, j as f64) + 0.5) / 3.3;
        let height = noise(seed, &[35], center);
        let levels = if ring(i, j) == 0 { 4 } else { 2 + (3.4 * height) as u32 };
        // Around the first crossing, something of everything.
        let purpose = match (i, j) {
            (0, 0) => Use::Tank,
            (-1, 0) => Use::Rack,
            (0, -1) => Use::Boiler,
            (-1, -1) => Use::Column,
            _ => purpose,
        };
        Self { i, j, corner, levels, purpose }
    }

    /// The side `k` as seen from its way: u along it from corner to corner, n toward the middle of the way, which is at
    /// 0, so that the block begins at −[`AISLE`].
    pub fn side(&self, k: usize) -> Frame {
        let [x0, z0] = [self.corner.x, self.corner.z];
        let corners = [[x0, z0 + PITCH], [x0 + PITCH, z0 + PITCH], [x0 + PITCH, z0], [x0, z0]].map(DVec2::from_array);
        Frame::wall(corners[k], corners[(k + 1) % 4], 0.0).0
    }

    /// Axis, number and half of the way at side `k`.
    pub fn half_way(&self, k: usize) -> (i64, i64, i64) {
        match k {
            0 => (0, self.j + 1, 0),
            1 => (1, self.i + 1, 0),
            2 => (0, self.j, 1),
            _ => (1, self.i, 1),
        }
    }
}
