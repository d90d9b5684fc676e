//! ROMA, the ray-aligned occupancy map array (Zeng et al. 2023): rays are answered by shifts of bits.
//!
//! *Theory.* A map is a cube of cells, one bit each, whose columns run along one direction; a ray in that direction
//! meets nothing but a part of one column, which is a range of bits of a few words. An array has maps in K² directions,
//! stratified over the hemisphere and drawn anew in every frame and sample; each is made by looking its cells up in a
//! base map ([`super::occupancy`]), and a ray takes the map of the stratum that its direction lies in, upwards or
//! downwards.
//!
//! *What we changed.* The paper's Algorithms 1 and 2 as corrected in [`bits`]. Base maps are conservative, and are
//! looked up at steps of at most one of their cells, so that sheets leak little. Cells of a map are moved by up to half
//! a cell and maps are turned about their direction, at random, in place of jittered geometry. Long rays around normals
//! draw their map by the cosine of its own direction, in place of the stratum that they lie in: within one the cosine
//! would be lost. There is an array for each of the [`super::occupancy::Cascades`]: a ray goes on in the next where it
//! leaves one.
//!
//! *Practice.* Snapped rays take their map's direction: for rays that go everywhere. Others pass from column to column
//! (Amanatides, Woo 1987), up to a number of them, and go on snapped from there.

pub mod answer;
pub mod bits;
pub mod cosine;
pub mod directions;
pub mod handover;
pub mod kernels;
pub mod maps;
mod settings;
pub mod twin;

pub use kernels::{Pilots, RomaPart, Sift};
pub use settings::{Options, Unsnapped};

use super::rsm::RsmSettings;

/// How the maps of an array are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    /// Square root of their number.
    pub k: u32,
    /// Texels on both axes, and cells of a column: a multiple of 32 up to 256.
    pub size: u32,
    /// Look-ups of the base map a cell, along the column: 1, 2 or 4.
    pub samples: u32,
}

impl Grid {
    /// Cells of a map along one cell of a base map of `cells` on each axis. The map holds the ball around the base map,
    /// whose diameter is the diagonal, wherever it is moved by up to half a cell.
    pub fn scale(&self, cells: u32) -> f64 {
        f64::from(self.size - 1) / (3f64.sqrt() * f64::from(cells))
    }

    /// Cells of its base maps on each axis, up to 256 twice its own: they take an eighth of what an array does for each
    /// of its maps, and what marks a thing is half as wide.
    pub fn base_cells(&self) -> u32 {
        (2 * self.size).min(MOST_CELLS)
    }

    /// Cells of its base maps in a length of which as many cells as it has on each axis are the base map's side.
    pub fn base_per_cell(&self) -> u32 {
        self.base_cells() / self.size
    }

    /// The same with the fewest look-ups, up to four, that are at most `stride` cells of a base map apart.
    pub fn with_stride(self, stride: f64) -> Self {
        let cells = self.scale(self.base_cells());
        let is_near = |samples: &u32| cells * f64::from(*samples) * stride >= 1.0;
        Self { samples: [1, 2].into_iter().find(is_near).unwrap_or(4), ..self }
    }
}

/// Cells of a base map between two look-ups of a column at most, of rays that must not pass through anything: those
/// that are sifted are free for good where nothing is found, sunlight behind a wall shows, and what shines behind a
/// wall lights.
pub const CLOSED: f64 = 1.0;

/// The same of occlusion rays. Thin sheets leak more, and cells, which are thicker than what is in them, are met less
/// often: both errors together are less than with [`CLOSED`].
pub const THIN: f64 = 2.0;

/// What maps do for the rays of a pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// They answer them.
    Answer,
    /// They say which rays meet nothing, and answer what lies so far from their start that they err little.
    Sift {
        /// Of a million rays, how many may be answered otherwise than exact ones, as far as it is measured; `None`:
        /// nothing is, and rays that meet something are traced to their ends.
        most_wrong: Option<u32>,
    },
    /// They answer them, and one ray in so many is traced, too, and counts for what they get wrong of all of these: the
    /// mean is that of traced rays, and its noise that of what maps get wrong (a control variate).
    Correct(u32),
}

impl Role {
    /// Whether they spare tracing part of the rays, with which all could be traced.
    pub fn is_help(self) -> bool {
        matches!(self, Self::Sift { .. } | Self::Correct(_))
    }
}

/// Cells of a map by which rays start off their surface. What marks a plane reaches one cell of a base map above it,
/// 0.29 of a map of half as many cells, and is found from up to 0.80 cells of the map away: half a diagonal across the
/// column, three eighths along it, since the middles of the cells that count lie beyond the start. So from 1.09 on a
/// plane does not occlude itself. Zeng et al. (§6) have 1.5, and cells that begin half a cell before their start on the
/// average. Rays that are sifted start lower, by 0.4 of it: what is taken for something costs time only, and what lies
/// below their start is overlooked.
pub const LIFT: f64 = 1.25;

/// How the rays of a pass are answered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RomaPass {
    /// Their maps.
    pub grid: Grid,
    /// Columns that a ray passes before it is finished snapped; 0: it is snapped.
    pub steps: u32,
    /// What the maps do for them.
    pub role: Role,
}

/// How ROMA answers the rays of walks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RomaSettings {
    /// Occlusion rays; `None` where maps do nothing for them.
    pub occlusion: Option<RomaPass>,
    /// Rays to the sun and to emitters.
    pub shadow: Option<RomaPass>,
    /// Diffuse rays.
    pub diffuse: Option<RomaPass>,
    /// What lights the hits of diffuse rays.
    pub rsm: RsmSettings,
}

impl RomaSettings {
    /// These, and those of `other` for rays that they do nothing for.
    pub fn or(self, other: Self) -> Self {
        Self {
            occlusion: self.occlusion.or(other.occlusion),
            shadow: self.shadow.or(other.shadow),
            diffuse: self.diffuse.or(other.diffuse),
            rsm: self.rsm,
        }
    }
}

/// Most cells of a map on each axis.
pub const MOST_CELLS: u32 = 256;

/// Cells of bricks than which no ray of use is shorter (spec §2).
pub const LEAST_CELLS: f64 = 3.0;

/// Rays around a normal as long as this, in cells that bricks have, draw their map by the cosine. Of shorter ones cells
/// add more to what is met than the cosine in a stratum takes away, and to draw it takes up to half of the time
/// (`docs/results/roma-errors.md`).
pub const LONG_CELLS: f64 = 32.0;

/// Most rays of which one is traced to correct maps by.
pub const MOST_ONE_IN: u32 = 16;

/// Most columns that a ray may be given.
pub const MOST_STEPS: u32 = 64;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn look_ups_are_no_further_apart_than_cells() {
        for size in [32, 64, 128, 256] {
            let grid = Grid { k: 4, size, samples: 1 };
            for stride in [THIN, CLOSED] {
                let samples = grid.with_stride(stride).samples;
                let apart = |samples: u32| 1.0 / (grid.scale(grid.base_cells()) * f64::from(samples));
                assert!(apart(samples) <= stride && (samples == 1 || apart(samples / 2) > stride), "fewer would do");
            }
            assert_eq!(grid.base_per_cell(), if size == 256 { 1 } else { 2 });
        }
    }
}
