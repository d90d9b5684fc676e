//! Distances to occupied cells, in levels.

use super::flood::{NO_SEED, jump_flood, squared};
use crate::secondary::occupancy::Bom;
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
    pub side: f64,
    /// Cell (0, 0, 0), in cells from the world's origin.
    first: [i64; 3],
    /// From the middle of a cell to that of the nearest occupied one, in cells of the finest level; infinite where none
    /// is. Cell (x, y, z) of a level of n on each axis is element (x n + y) n + z.
    levels: [Vec<f16>; LEVELS],
}

/// Distances of cells from the nearest occupied ones, as of [`jump_flood`]. Twin of `shaders/df/flood_distances.wgsl`.
pub fn distances(nearest: &[u32], cells: u32, distances: &mut [f16]) {
    // Of all squared distances that there are.
    let roots: Vec<f16> = (0..=3 * (cells - 1).pow(2)).into_par_iter().map(distance_f16).collect();
    distances.par_iter_mut().zip(nearest).zip(0..cells.pow(3)).for_each(|((distance, &seed), index)| {
        let cell = [index / (cells * cells), index / cells % cells, index % cells];
        *distance = if seed == NO_SEED { f16::INFINITY } else { roots[squared(cell, seed) as usize] };
    });
}

/// The level after `fine`, which has `cells` on each axis: the least of each eight. Twin of
/// `shaders/df/halve_distances.wgsl`.
pub fn halve(fine: &[f16], cells: u32, coarse: &mut [f16]) {
    let (cells, half) = (cells as usize, cells as usize / 2);
    coarse.par_iter_mut().enumerate().for_each(|(index, least)| {
        let [x, y, z] = [index / (half * half), index / half % half, index % half].map(|at| 2 * at);
        let at =
            |corner: usize| fine[((x + (corner >> 2 & 1)) * cells + y + (corner >> 1 & 1)) * cells + z + (corner & 1)];
        *least = (0..8).map(at).fold(f16::INFINITY, f16::min);
    });
}

impl DistanceField {
    /// The field of a map by jump flooding.
    pub fn new(map: &Bom) -> Self {
        let cells = map.cells();
        let mut levels: [_; LEVELS] =
            std::array::from_fn(|level| vec![f16::INFINITY; (cells >> level).pow(3) as usize]);
        distances(&jump_flood(map), cells, &mut levels[0]);
        for level in 1..LEVELS {
            let (fine, coarse) = levels.split_at_mut(level);
            halve(&fine[level - 1], cells >> (level - 1), &mut coarse[0]);
        }
        Self { cells, side: map.side(), first: map.first, levels }
    }

    /// Cells of a level on each axis.
    pub fn cells(&self, level: usize) -> u32 {
        self.cells >> level
    }

    /// Distances of a level, cells of the finest: cell (x, y, z) of n on each axis is element (x n + y) n + z.
    pub fn level(&self, level: usize) -> &[f16] {
        &self.levels[level]
    }

    /// A point of the world in cells of the finest level, from the first: the map's are from 0 to its number of cells.
    pub fn local(&self, point: [f64; 3]) -> [f32; 3] {
        std::array::from_fn(|k| (point[k] / self.side - self.first[k] as f64) as f32)
    }

    /// Its distances.
    pub fn view(&self) -> FieldView<'_> {
        FieldView { cells: self.cells, levels: std::array::from_fn(|level| &self.levels[level][..]) }
    }

    /// The distance at a point of a level, as of its [`view`](Self::view).
    pub fn distance(&self, level: usize, point: [f32; 3]) -> f32 {
        self.view().distance(level, point)
    }
}

/// The distances of a field.
#[derive(Clone, Copy, Debug)]
pub struct FieldView<'a> {
    /// Cells of the finest level on each axis.
    pub cells: u32,
    /// Its levels.
    pub levels: [&'a [f16]; LEVELS],
}

impl FieldView<'_> {
    /// Cells of a level on each axis.
    pub fn cells(&self, level: usize) -> u32 {
        self.cells >> level
    }

    /// Whether any cell is occupied: then flooding has found one near every cell.
    pub fn has_seed(&self) -> bool {
        self.levels[0].first().is_some_and(|distance| distance.is_finite())
    }

    /// The distance at a point, [`DistanceField::local`], of a level: of the eight cells whose middles are around it,
    /// by their nearness; beyond the outermost middles as there. Cells of the finest level; infinite of a map without
    /// occupied cells.
    pub fn distance(&self, level: usize, point: [f32; 3]) -> f32 {
        if !self.has_seed() {
            return f32::INFINITY;
        }
        let count = self.cells(level);
        let per_cell = 1.0 / (1 << level) as f32;
        let at = point.map(|x| (x * per_cell - 0.5).clamp(0.0, (count - 1) as f32));
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
