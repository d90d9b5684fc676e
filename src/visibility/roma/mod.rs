//! ROMA, the ray-aligned occupancy map array (Zeng et al. 2023): rays are answered by shifts of bits.
//!
//! *Theory.* A map is a cube of cells, one bit each, whose columns run along one direction; a ray in that direction meets nothing but a part
//! of one column, which is a range of bits of a few words. An array has maps in K² directions, stratified over the hemisphere and drawn anew in
//! every frame and sample; each is made by looking its cells up in a base map ([`super::bom`]), and a ray takes the map of the stratum that its
//! direction lies in, upwards or downwards.
//!
//! *What we changed.* The paper's Algorithms 1 and 2 as corrected in [`bits`]. Base maps are conservative, and are looked up at steps of at most
//! one of their cells, so that sheets leak little. Cells of a map are moved by up to half a cell and maps are turned about their
//! direction, at random, in place of jittered geometry. There is an array for each of the [`super::bom::Cascades`]: a ray goes on in the next
//! where it leaves one.
//!
//! *Practice.* Snapped rays take their map's direction: for rays that go everywhere. Others pass from column to column (Amanatides, Woo
//! 1987), up to a number of them, and go on snapped from there.

pub mod bits;
pub mod directions;

use super::rsm::RsmSettings;

/// How the maps of an array are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    /// Square root of their number.
    pub k: u32,
    /// Texels on both axes, and cells of a column: a multiple of 32 up to 256.
    pub size: u32,
    /// Look-ups of the base map a cell, along the column: 1, 2 or 4; 0: as many as keep them one cell of the base map apart at most.
    pub samples: u32,
}

impl Grid {
    /// Cells of a map along one cell of a base map of `cells` on each axis. The map holds the ball around the base map, whose diameter is the
    /// diagonal, wherever it is moved by up to half a cell.
    pub fn scale(&self, cells: u32) -> f64 {
        f64::from(self.size - 1) / (3f64.sqrt() * f64::from(cells))
    }

    /// Look-ups a cell.
    pub fn samples(&self, cells: u32) -> u32 {
        match self.samples {
            0 => [1, 2].into_iter().find(|&samples| self.scale(cells) * f64::from(samples) >= 1.0).unwrap_or(4),
            given => given,
        }
    }

    /// Words of the maps of `levels` base maps.
    pub fn words(&self, levels: usize) -> u64 {
        levels as u64 * u64::from(self.k * self.k) * u64::from(self.size * self.size) * u64::from(self.size / 32)
    }
}

/// What maps do for the rays of a pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// They answer them.
    Answer,
    /// They answer what lies beyond so many cells of the base map that holds a ray's start from it; up to there rays are traced.
    Far(u32),
    /// They say which rays meet nothing. Of the others, one in so many is traced and counts for them all (Russian roulette).
    Sift(u32),
}

impl Role {
    /// Cells of a map by which rays start off their surface. What marks a plane reaches one cell of a base map above it, 0.58 of a map of as many
    /// cells, and is found from up to 1.03 cells of the map away: half a diagonal across the column, three quarters along it. So with the 1.5 of
    /// Zeng et al. (§6) a plane hardly occludes itself, where the worst of both come together. Rays that are sifted start lower: what is taken
    /// for something costs time only, and what lies below their start is overlooked.
    pub fn lift(self) -> f64 {
        if matches!(self, Self::Sift(_)) { 0.75 } else { 1.5 }
    }
}

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
    /// Occlusion rays.
    pub occlusion: RomaPass,
    /// Rays to the sun and to emitters.
    pub shadow: RomaPass,
    /// Diffuse rays; `None` where they are traced.
    pub diffuse: Option<RomaPass>,
    /// What lights the hits of diffuse rays.
    pub rsm: RsmSettings,
}

/// Most base maps: those of 8 x 8 directions and 128 cells take 96 MiB then.
pub const MOST_LEVELS: u32 = 6;

/// Most rays of which one is traced.
pub const MOST_ONE_IN: u32 = 16;

/// Most cells up to which a ray may be traced exactly.
pub const MOST_NEAR: u32 = 256;

/// Most columns that a ray may be given.
pub const MOST_STEPS: u32 = 64;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn look_ups_are_no_further_apart_than_cells() {
        for size in [32, 64, 128, 256] {
            let grid = Grid { k: 4, size, samples: 0 };
            assert_eq!(grid.samples(size), 2);
            assert!(grid.scale(size) * 2.0 >= 1.0);
            assert_eq!(grid.samples(size / 2), 1);
            assert_eq!(grid.samples(2 * size), 4);
            assert!(grid.scale(size) < 1.0, "one would not do");
            assert_eq!(Grid { samples: 1, ..grid }.samples(size), 1);
        }
        assert_eq!(Grid { k: 4, size: 128, samples: 0 }.words(1), 1 << 20);
        assert_eq!(Grid { k: 8, size: 128, samples: 0 }.words(2) * 4, 32 << 20);
    }
}
