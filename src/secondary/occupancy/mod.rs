//! Base occupancy maps (Zeng et al., ROMA, §4.1): which cells of a cube something may be in, one bit a cell.
//!
//! The paper rasterises the scene from three sides into one map a frame. Here every brick has a map of its own, made
//! exactly at conversion, and a frame brings those around the camera together: no geometry is read, so rays are
//! answered where no brick is resident. Cells of all maps are powers of two on one lattice, so that a brick that is
//! placed without turning is brought in by shifting and OR; the cells of others are entered as boxes around their
//! images, rounded outward. What is far is held in maps with larger cells: [`Cascades`].
//!
//! A cell holds its lower faces and not its upper ones. Every point of a triangle within a map lies in an occupied
//! cell; a cell without one may be occupied too: where it is smaller than a brick's, where a brick was turned, where
//! only the 16³ level of a brick's map was at hand. So maps hide too much, never too little. [`voxelise`](voxelise())
//! has the paper's own form beside it, which does leak.

mod assemble;
#[cfg(test)]
mod assemble_tests;
mod base;
mod boxes;
mod clearance;
mod maps;
mod place;
mod plan;
#[cfg(feature = "lab")]
mod raster;
mod region;
#[cfg(feature = "lab")]
mod voxelise;

pub use assemble::{Assembler, BomError, assemble};
pub use base::{BaseMaps, BaseView, MOST_LEVELS};
pub use clearance::{BLOCK_CELLS, clearance, clearance_bytes};
pub use plan::Settings;
#[cfg(feature = "lab")]
pub use voxelise::{Voxelisation, voxelise};

use bricks::Resident;

/// A cube of cells of the world: a cell that a triangle has a point in is occupied, one that none has may be.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Bom {
    cells: u32,
    /// log2 of the side of a cell, world units.
    pub cell_log2: i32,
    /// Cell (0, 0, 0), in cells from the world's origin.
    pub first: [i64; 3],
    words: Vec<u32>,
}

impl Bom {
    /// An empty map of `cells` on each axis, a multiple of 32 up to 256.
    pub fn new(cells: u32, cell_log2: i32, first: [i64; 3]) -> Self {
        debug_assert!(cells.is_multiple_of(32) && (32..=256).contains(&cells));
        Self { cells, cell_log2, first, words: vec![0; (cells * cells * (cells / 32)) as usize] }
    }

    /// Cells on each axis.
    pub fn cells(&self) -> u32 {
        self.cells
    }

    /// The side of a cell, world units.
    pub fn side(&self) -> f64 {
        f64::from(self.cell_log2).exp2()
    }

    /// The bits: cell (x, y, z) is bit z % 32 of word (x + cells y) cells / 32 + z / 32, the lowest first.
    pub fn words(&self) -> &[u32] {
        &self.words
    }

    /// The bits, to be set.
    pub fn words_mut(&mut self) -> &mut [u32] {
        &mut self.words
    }

    /// The number of occupied cells.
    pub fn occupied(&self) -> u64 {
        self.words.iter().map(|word| u64::from(word.count_ones())).sum()
    }

    fn bit(&self, [x, y, z]: [u32; 3]) -> (usize, u32) {
        (((x + self.cells * y) * (self.cells / 32) + z / 32) as usize, 1 << (z % 32))
    }

    /// Whether a cell is occupied; none outside of the cube is.
    pub fn is_occupied(&self, cell: [i64; 3]) -> bool {
        if !cell.iter().all(|&x| (0..i64::from(self.cells)).contains(&x)) {
            return false;
        }
        let (word, bit) = self.bit(cell.map(|x| x as u32));
        self.words[word] & bit != 0
    }

    /// Marks a cell of the cube as occupied.
    pub fn occupy(&mut self, cell: [u32; 3]) {
        let (word, bit) = self.bit(cell);
        self.words[word] |= bit;
    }

    /// The cell that a point of the world lies in, which may be outside of the cube.
    pub fn cell_at(&self, point: [f64; 3]) -> [i64; 3] {
        std::array::from_fn(|k| ((point[k] / self.side()).floor() as i64).saturating_sub(self.first[k]))
    }
}

crate::settings::names! {
    /// What base maps are made of.
    Source {
        /// The maps that bricks carry. No geometry is read, and no occupied cell is missed.
        Bricks = "bricks",
        /// All triangles, in every sample anew: [`Voxelisation::Raster`]. A baseline.
        #[cfg(feature = "lab")]
        Triangles = "raster",
    }
}

// The variants are declared by a macro, which leaves no place for `#[default]`.
#[allow(clippy::derivable_impls)]
impl Default for Source {
    fn default() -> Self {
        Self::Bricks
    }
}

/// Maps around the camera, each with cells twice as large as the one before, which lies in its middle.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Cascades {
    /// The finest first.
    pub levels: Vec<Bom>,
}

/// The side of the scene's bounds, world units: the longest edge of its box; 0 of an empty scene.
pub fn extent(resident: &Resident) -> f64 {
    let step = f64::from(resident.objects[0].step_log2).exp2();
    resident
        .top2
        .first()
        .map_or(0.0, |root| (0..3).map(|k| (root.max[k] - root.min[k]) as f64 * step).fold(0.0, f64::max))
}
