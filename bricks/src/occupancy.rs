//! Occupancy maps: which cells of a grid the triangles of a brick touch, in seven levels.
//!
//! The cells of all bricks of an object lie on lattices of powers of two of its unit, so maps of different bricks are
//! brought together by shifting and OR alone. A cell counts as closed: what lies in its border touches it.

use crate::pack::{self, UnpackError};
use crate::records::LATTICE_LIMIT;
use bytemuck::{Pod, Zeroable};

/// Cells of the finest level on each axis.
pub const OCCUPANCY_CELLS: u32 = 64;

/// Levels: 64, 32, 16, 8, 4, 2 and 1 cells on each axis.
pub const OCCUPANCY_LEVELS: u32 = 7;

/// The level that is always resident: 16 cells on each axis.
pub const RESIDENT_LEVEL: u32 = 2;

/// Bytes of all levels, one after the other.
pub const OCCUPANCY_BYTES: usize = level_start(OCCUPANCY_LEVELS);

/// Largest magnitude of a lattice coordinate of a brick with an occupancy map: cells may be as small as a 32nd of a
/// step.
pub const OCCUPANCY_LIMIT: i64 = LATTICE_LIMIT >> 5;

/// Bytes before level `level`.
const fn level_start(level: u32) -> usize {
    let (mut start, mut before) = (0, 0);
    while before < level {
        start += level_bytes(before);
        before += 1;
    }
    start
}

/// Bytes of level `level`: a bit a cell.
const fn level_bytes(level: u32) -> usize {
    let cells = (OCCUPANCY_CELLS >> level) as usize;
    (cells * cells * cells).div_ceil(8)
}

/// The always-resident part of the occupancy of a brick.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Occupancy {
    /// log2 of the side of a cell of the finest level, in object units.
    pub cell_log2: i32,
    /// Zero.
    pub _reserved: u32,
    /// Cell (0, 0, 0) of the finest level, in cells from the object's origin.
    pub origin: [i64; 3],
    /// Level [`RESIDENT_LEVEL`], laid out as [`OccupancyMap::level`] says.
    pub bits: [u8; level_bytes(RESIDENT_LEVEL)],
}

/// Where the cells of a brick lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OccupancyGrid {
    /// log2 of the side of a cell of the finest level, in object units.
    pub cell_log2: i32,
    /// Cell (0, 0, 0) of the finest level, in cells from the object's origin.
    pub origin: [i64; 3],
}

impl OccupancyGrid {
    /// The grid of a brick with bounds `min` to `max` in steps of 2^`step_log2` object units, within
    /// ±[`OCCUPANCY_LIMIT`]: of the cells whose sides are powers of two, the smallest of which 63 span the brick on
    /// every axis. From the cell that `min` lies in, 64 hold it.
    pub fn of(step_log2: i32, min: [i64; 3], max: [i64; 3]) -> Self {
        let extent = (0..3).map(|k| i128::from(max[k]) - i128::from(min[k])).max().unwrap_or(0);
        let spans = |steps_log2: &i32| extent << 5 <= i128::from(OCCUPANCY_CELLS - 1) << (5 + steps_log2);
        let steps_log2 = (-5..64).find(spans).unwrap_or(64);
        let grid = Self { cell_log2: step_log2 + steps_log2, origin: [0; 3] };
        Self { origin: min.map(|x| grid.cell_at(steps_log2, x)), ..grid }
    }

    /// log2 of the side of a cell of the finest level, in lattice steps of 2^`step_log2` object units, at least -5.
    pub fn steps_log2(&self, step_log2: i32) -> i32 {
        self.cell_log2 - step_log2
    }

    /// The cell of the finest level that a point of the object's lattice lies in, or the one that starts there: 0 to 63
    /// on each axis if the point lies within the bounds of the brick.
    pub fn cell(&self, step_log2: i32, point: [i64; 3]) -> [i64; 3] {
        std::array::from_fn(|k| self.cell_at(self.steps_log2(step_log2), point[k]) - self.origin[k])
    }

    /// In cells from the object's origin.
    fn cell_at(&self, steps_log2: i32, x: i64) -> i64 {
        if steps_log2 < 0 { x << -steps_log2 } else { x >> steps_log2.min(63) }
    }
}

/// The occupancy of a brick in all levels. A cell of a level is occupied if one of its eight in the level before is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OccupancyMap {
    bytes: Vec<u8>,
}

impl OccupancyMap {
    /// The map with the finest level `columns`: bit z of column x + 64 y is cell (x, y, z).
    pub fn of_finest(columns: &[u64; (OCCUPANCY_CELLS * OCCUPANCY_CELLS) as usize]) -> Self {
        let mut bytes = Vec::with_capacity(OCCUPANCY_BYTES);
        let mut columns = columns.to_vec();
        for level in 0..OCCUPANCY_LEVELS {
            if level > 0 {
                columns = coarser(&columns, OCCUPANCY_CELLS >> level);
            }
            append(&mut bytes, &columns, OCCUPANCY_CELLS >> level);
        }
        Self { bytes }
    }

    /// Reads a proxies payload.
    ///
    /// # Errors
    /// As of [`pack::unpack`].
    pub fn unpack(payload: &[u8]) -> Result<Self, UnpackError> {
        let mut bytes = vec![0; OCCUPANCY_BYTES];
        pack::unpack(payload, &mut bytes).map(|()| Self { bytes })
    }

    /// The proxies payload of a map.
    pub fn pack(&self) -> Vec<u8> {
        pack::pack(&self.bytes)
    }

    /// The bits of a level less than [`OCCUPANCY_LEVELS`]: of n = 64 >> `level` cells on each axis, cell (x, y, z) is
    /// bit z + n (x + n y), the lowest of a byte first.
    pub fn level(&self, level: u32) -> &[u8] {
        &self.bytes[level_start(level)..][..level_bytes(level)]
    }

    /// Whether a cell of a level is occupied. Coordinates are less than the cells of the level.
    pub fn is_occupied(&self, level: u32, [x, y, z]: [u32; 3]) -> bool {
        let cells = OCCUPANCY_CELLS >> level;
        let bit = z + cells * (x + cells * y);
        self.level(level)[bit as usize / 8] >> (bit % 8) & 1 != 0
    }

    /// The columns of the finest level, as [`Self::of_finest`] takes them.
    pub fn finest(&self) -> [u64; (OCCUPANCY_CELLS * OCCUPANCY_CELLS) as usize] {
        let words = self.level(0).as_chunks::<8>().0;
        std::array::from_fn(|column| u64::from_le_bytes(words[column]))
    }

    /// The always-resident record, of a map on `grid`.
    pub fn record(&self, grid: &OccupancyGrid) -> Occupancy {
        let mut bits = [0; level_bytes(RESIDENT_LEVEL)];
        bits.copy_from_slice(self.level(RESIDENT_LEVEL));
        Occupancy { cell_log2: grid.cell_log2, _reserved: 0, origin: grid.origin, bits }
    }
}

/// The columns of a level of `cells` on each axis from those of the level before.
fn coarser(fine: &[u64], cells: u32) -> Vec<u64> {
    let cells = cells as usize;
    let column = |index: usize| {
        let (x, y) = (index % cells, index / cells);
        let first = 2 * x + 2 * cells * 2 * y;
        halve(fine[first] | fine[first + 1] | fine[first + 2 * cells] | fine[first + 2 * cells + 1])
    };
    (0..cells * cells).map(column).collect()
}

/// Bit i of the result is bit 2i OR bit 2i + 1.
fn halve(bits: u64) -> u64 {
    let mut bits = (bits | bits >> 1) & 0x5555_5555_5555_5555;
    for (shift, mask) in [
        (1, 0x3333_3333_3333_3333),
        (2, 0x0f0f_0f0f_0f0f_0f0f),
        (4, 0x00ff_00ff_00ff_00ff),
        (8, 0x0000_ffff_0000_ffff),
        (16, 0x0000_0000_ffff_ffff),
    ] {
        bits = (bits | bits >> shift) & mask;
    }
    bits
}

/// Appends columns of `cells` bits.
fn append(bytes: &mut Vec<u8>, columns: &[u64], cells: u32) {
    if cells >= 8 {
        columns.iter().for_each(|column| bytes.extend_from_slice(&column.to_le_bytes()[..cells as usize / 8]));
        return;
    }
    let bits = columns.iter().rev().fold(0u64, |bits, column| bits << cells | column);
    bytes.extend(&bits.to_le_bytes()[..((cells * cells * cells) as usize).div_ceil(8)]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grids_are_the_smallest_that_hold_the_brick() {
        for (extent, steps_log2) in [
            (1, -5),
            (2, -4),
            (3, -4),
            (4, -3),
            (63, 0),
            (64, 1),
            (126, 1),
            (127, 2),
            (63 << 30, 30),
            ((63 << 30) + 1, 31),
        ] {
            for start in [0, -1, 1, -17, 5 << 20, -(1 << 44) - 3] {
                let (min, max) = ([start, 0, 7], [start + extent, 1, 7]);
                let grid = OccupancyGrid::of(-9, min, max);
                assert_eq!(grid.steps_log2(-9), steps_log2, "{extent}");
                assert_eq!(grid.cell_log2, steps_log2 - 9);
                let (first, last) = (grid.cell(-9, min), grid.cell(-9, max));
                assert_eq!(first, [0; 3]);
                assert!(last.iter().all(|x| (0..64).contains(x)), "{last:?}");
                // The grid starts less than a cell before the brick.
                let side = 2f64.powi(steps_log2);
                let before = start as f64 - grid.origin[0] as f64 * side;
                assert!((0.0..side).contains(&before), "{before}");
            }
        }
    }

    /// Cells without order, sparse and dense.
    fn maps() -> Vec<Vec<[u32; 3]>> {
        let mut state = 0x2545_f491_4f6c_dd1du64;
        let mut next = || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 40) as u32 % 64
        };
        let corners = vec![[0, 0, 0], [63, 0, 0], [0, 63, 0], [0, 0, 63]];
        [1, 30, 3000]
            .into_iter()
            .map(|count| (0..count).map(|_| [next(), next(), next()]).collect())
            .chain([corners])
            .collect()
    }

    #[test]
    fn levels_are_the_or_of_the_finest() {
        for cells in maps() {
            let mut columns = [0; 4096];
            cells.iter().for_each(|&[x, y, z]| columns[(x + 64 * y) as usize] |= 1 << z);
            let map = OccupancyMap::of_finest(&columns);
            assert_eq!(map.finest(), columns);
            assert_eq!(map.bytes.len(), OCCUPANCY_BYTES);
            for level in 0..OCCUPANCY_LEVELS {
                let n = 64 >> level;
                let expected: std::collections::BTreeSet<_> = cells.iter().map(|c| c.map(|x| x >> level)).collect();
                let all = (0..n).flat_map(|x| (0..n).flat_map(move |y| (0..n).map(move |z| [x, y, z])));
                let found: std::collections::BTreeSet<_> = all.filter(|&cell| map.is_occupied(level, cell)).collect();
                assert_eq!(found, expected, "level {level}");
                let bits: u32 = map.level(level).iter().map(|byte| byte.count_ones()).sum();
                assert_eq!(bits as usize, expected.len(), "no bit besides cells");
            }
            assert_eq!(OccupancyMap::unpack(&map.pack()), Ok(map));
        }
    }

    #[test]
    fn other_bytes_are_no_map() {
        assert!(OccupancyMap::unpack(&[]).is_err());
        let short = pack::pack(&[0; OCCUPANCY_BYTES - 1]);
        assert!(OccupancyMap::unpack(&short).is_err());
    }
}
