//! Distances to occupied cells, in levels.

use super::flood::{NO_SEED, jump_flood, squared};
use crate::visibility::bom::Bom;
use half::f16;
use rayon::prelude::*;

/// Levels of a field: of as many cells as the map, of half and of a quarter on each axis.
pub const LEVELS: usize = 3;

/// The root of a whole number as f16, rounded toward zero: the largest whose square is not above it.
pub fn distance_f16(squared: u32) -> f16 {
    // An f16 has 11 bits, its square 22: exact in f64.
    let is_above = |x: f16| x.to_f64() * x.to_f64() > f64::from(squared);
    let mut root = f16::from_f64(f64::from(squared).sqrt());
    while is_above(root) {
        root = f16::from_bits(root.to_bits() - 1);
    }
    root
}

/// The distances of a map's cells to the nearest occupied one.
#[derive(Clone, Debug, PartialEq)]
pub struct DistanceField {
    /// Cells of the finest level on each axis.
    cells: u32,
    /// The side of a cell, world units.
    side: f64,
    /// Cell (0, 0, 0), in cells from the world's origin.
    first: [i64; 3],
    /// From the middle of a cell to that of the nearest occupied one, in cells of the finest level; infinite where none is. Cell
    /// (x, y, z) of a level of n on each axis is element (x n + y) n + z.
    levels: [Vec<f16>; LEVELS],
    has_seed: bool,
}

impl DistanceField {
    /// The field of a map by jump flooding.
    pub fn new(map: &Bom) -> Self {
        Self::of_nearest(map, &jump_flood(map))
    }

    /// The field of a map with the nearest occupied cell of each as of [`jump_flood`].
    pub fn of_nearest(map: &Bom, nearest: &[u32]) -> Self {
        let cells = map.cells();
        // Of all squared distances that there are.
        let roots: Vec<f16> = (0..=3 * (cells - 1).pow(2)).into_par_iter().map(distance_f16).collect();
        let finest: Vec<f16> = nearest
            .par_iter()
            .zip(0..cells.pow(3))
            .map(|(&seed, index)| {
                let cell = [index / (cells * cells), index / cells % cells, index % cells];
                if seed == NO_SEED { f16::INFINITY } else { roots[squared(cell, seed) as usize] }
            })
            .collect();
        let half = halved(&finest, cells);
        let quarter = halved(&half, cells / 2);
        Self::of_levels(map, [finest, half, quarter])
    }

    /// The field of a map with the distances of its levels as of [`level`](Self::level).
    pub fn of_levels(map: &Bom, levels: [Vec<f16>; LEVELS]) -> Self {
        debug_assert!((0..LEVELS).all(|level| levels[level].len() == (map.cells() >> level).pow(3) as usize));
        let has_seed = levels[0].first().is_some_and(|distance| distance.is_finite());
        Self { cells: map.cells(), side: map.side(), first: map.first, levels, has_seed }
    }

    /// The side of a cell of the finest level, world units.
    pub fn side(&self) -> f64 {
        self.side
    }

    /// Cells of a level on each axis.
    pub fn cells(&self, level: usize) -> u32 {
        self.cells >> level
    }

    /// Distances of a level, cells of the finest: cell (x, y, z) of n on each axis is element (x n + y) n + z.
    pub fn level(&self, level: usize) -> &[f16] {
        &self.levels[level]
    }

    /// Whether any cell is occupied.
    pub fn has_seed(&self) -> bool {
        self.has_seed
    }

    /// A point of the world in cells of the finest level, from the first: the map's are from 0 to its number of cells.
    pub fn local(&self, point: [f64; 3]) -> [f32; 3] {
        std::array::from_fn(|k| (point[k] / self.side - self.first[k] as f64) as f32)
    }

    /// The distance at a point, [`local`](Self::local), of a level: of the eight cells whose middles are around it, by their nearness; beyond the
    /// outermost middles as there. Cells of the finest level; infinite of a map without occupied cells.
    pub fn distance(&self, level: usize, point: [f32; 3]) -> f32 {
        if !self.has_seed {
            return f32::INFINITY;
        }
        let count = self.cells(level);
        let width = (1 << level) as f32;
        let at = point.map(|x| (x / width - 0.5).clamp(0.0, (count - 1) as f32));
        let low = at.map(|x| (x as u32).min(count - 2));
        let [u, v, w]: [f32; 3] = std::array::from_fn(|k| at[k] - low[k] as f32);
        let get = |x: u32, y: u32, z: u32| {
            let index = ((low[0] + x) * count + low[1] + y) * count + low[2] + z;
            self.levels[level][index as usize].to_f32()
        };
        let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
        let row = |x: u32, y: u32| mix(get(x, y, 0), get(x, y, 1), w);
        let face = |x: u32| mix(row(x, 0), row(x, 1), v);
        mix(face(0), face(1), u)
    }
}

/// The level after one of `cells` on each axis: the least of each eight.
fn halved(fine: &[f16], cells: u32) -> Vec<f16> {
    let (cells, half) = (cells as usize, cells as usize / 2);
    (0..half.pow(3))
        .into_par_iter()
        .map(|index| {
            let [x, y, z] = [index / (half * half), index / half % half, index % half].map(|at| 2 * at);
            let at = |corner: usize| {
                fine[((x + (corner >> 2 & 1)) * cells + y + (corner >> 1 & 1)) * cells + z + (corner & 1)]
            };
            (0..8).map(at).fold(f16::INFINITY, f16::min)
        })
        .collect()
}
