//! Voxelises the triangles of a brick: the cells of its occupancy map that they touch, exactly.
//!
//! A triangle touches a closed box unless one of thirteen axes separates the two (Akenine-Möller 2001). The axes group
//! into the box's own, the triangle's normal, and for each of the three projections along an axis the normals of the
//! projected edges (Schwarz and Seidel 2010). Each is a linear inequality in the cell's integer coordinates:
//!
//! max over the box of m·x ≥ m·p ⇔ Σ m\[k\] i\[k\] ≥ ⌈m·p / side⌉ − Σ max(m\[k\], 0)
//!
//! for the cell from i·side to (i + 1)·side. So the cells along a line that satisfy one are a range, a mask of 64 bits,
//! and a triangle costs a few masks for each column that it touches. All numbers are integers; nothing is rounded.

use bricks::{OccupancyGrid, OccupancyMap};
use std::ops::{Add, Mul, Neg, Sub};

/// Cells of a grid on each axis.
const CELLS: u32 = bricks::OCCUPANCY_CELLS;

/// log2 of the largest side of a cell with which 64 bits hold all values: corners are within 2^26 of each other,
/// normals within 2^53, their products with cells within 2^61.
const NARROW_SIDE_LOG2: u32 = 20;

/// Cells in a row up to which trying each is faster than dividing.
const TRIED_CELLS: u32 = 4;

/// The map of triangles, corners in lattice steps, on `grid`, which is that of their bounds.
pub(super) fn voxelise(
    step_log2: i32,
    grid: &OccupancyGrid,
    triangles: impl Iterator<Item = [[i64; 3]; 3]>,
) -> OccupancyMap {
    let mut voxels = Voxels::new(step_log2, grid);
    triangles.for_each(|triangle| voxels.add(&triangle));
    OccupancyMap::of_finest(&voxels.columns)
}

/// Cells as triangles are added.
struct Voxels {
    /// Bit z of column x + 64 y is cell (x, y, z).
    columns: Box<[u64; (CELLS * CELLS) as usize]>,
    /// Where the grid begins, in units.
    origin: [i64; 3],
    /// log2 of units in a lattice step: units are steps, or cells if these are smaller.
    units_log2: u32,
    /// log2 of the side of a cell, in units.
    side_log2: u32,
}

impl Voxels {
    fn new(step_log2: i32, grid: &OccupancyGrid) -> Self {
        let steps_log2 = grid.steps_log2(step_log2);
        let side_log2 = steps_log2.max(0) as u32;
        let origin = grid.origin.map(|cell| cell << side_log2);
        let units_log2 = (-steps_log2).max(0) as u32;
        Self { columns: Box::new([0; (CELLS * CELLS) as usize]), origin, units_log2, side_log2 }
    }

    /// Adds a triangle with an area, corners in lattice steps.
    fn add(&mut self, corners: &[[i64; 3]; 3]) {
        let corners = corners
            .map(|corner| -> [i64; 3] { std::array::from_fn(|k| (corner[k] << self.units_log2) - self.origin[k]) });
        let axis = |k: usize| corners.map(|corner| corner[k]);
        // The cells that the bounds touch. A corner on the border between two touches both.
        let lo: [u32; 3] = std::array::from_fn(|k| {
            let min = axis(k).into_iter().fold(i64::MAX, i64::min);
            ((min - 1) >> self.side_log2).max(0) as u32
        });
        let hi: [u32; 3] = std::array::from_fn(|k| {
            let max = axis(k).into_iter().fold(i64::MIN, i64::max);
            (max >> self.side_log2).min(i64::from(CELLS - 1)) as u32
        });
        let block = Block { lo, hi, side_log2: self.side_log2 };
        if self.side_log2 <= NARROW_SIDE_LOG2 {
            self.sweep::<i64>(&corners, &block);
        } else {
            self.sweep::<i128>(&corners, &block);
        }
    }

    /// Sets the cells of a block that a triangle touches, whose bounds touch all of them.
    fn sweep<T: Whole>(&mut self, corners: &[[i64; 3]; 3], block: &Block) {
        let Block { lo, hi, .. } = *block;
        let rows = lo[1]..=hi[1];
        // Where all cells share the coordinate on an axis, the projection along it decides: above every point of a
        // projected cell and triangle lies one of both.
        match std::array::from_fn(|k| hi[k] > lo[k]) {
            [false, false, _] => *self.column(lo[0], lo[1]) |= range(lo[2], hi[2]),
            [true, false, false] => (lo[0]..=hi[0]).for_each(|x| *self.column(x, lo[1]) |= 1 << lo[2]),
            [false, true, false] => rows.for_each(|y| *self.column(lo[0], y) |= 1 << lo[2]),
            [true, true, false] => {
                let xy = Projection::<T>::new(corners, [0, 1], block);
                for y in rows {
                    ones(xy.touched(y, range(lo[0], hi[0]))).for_each(|x| *self.column(x, y) |= 1 << lo[2]);
                }
            }
            [false, true, true] => {
                let zy = Projection::<T>::new(corners, [2, 1], block);
                rows.for_each(|y| *self.column(lo[0], y) |= zy.touched(y, range(lo[2], hi[2])));
            }
            [true, false, true] => {
                let zx = Projection::<T>::new(corners, [2, 0], block);
                (lo[0]..=hi[0]).for_each(|x| *self.column(x, lo[1]) |= zx.touched(x, range(lo[2], hi[2])));
            }
            [true, true, true] => self.sweep_block::<T>(corners, block),
        }
    }

    fn sweep_block<T: Whole>(&mut self, corners: &[[i64; 3]; 3], block: &Block) {
        let Block { lo, hi, .. } = *block;
        let [xy, zy, zx] = [[0, 1], [2, 1], [2, 0]].map(|axes| Projection::<T>::new(corners, axes, block));
        let planes = planes::<T>(corners, block);
        let mut by_x = [0; CELLS as usize];
        (lo[0]..=hi[0]).for_each(|x| by_x[x as usize] = zx.touched(x, range(lo[2], hi[2])));
        for y in lo[1]..=hi[1] {
            let by_y = zy.touched(y, range(lo[2], hi[2]));
            for x in ones(xy.touched(y, range(lo[0], hi[0]))) {
                let mut cells = by_y & by_x[x as usize];
                for ([a, b, c], least) in planes {
                    let rest = least - a * T::from(i64::from(x)) - b * T::from(i64::from(y));
                    cells &= at_least(c, rest, cells);
                }
                *self.column(x, y) |= cells;
            }
        }
    }

    fn column(&mut self, x: u32, y: u32) -> &mut u64 {
        &mut self.columns[(x + CELLS * y) as usize]
    }
}

/// Cells that the bounds of a triangle touch.
struct Block {
    /// The first on each axis.
    lo: [u32; 3],
    /// The last on each axis.
    hi: [u32; 3],
    /// log2 of the side of a cell, in the units of the corners.
    side_log2: u32,
}

/// An integer wide enough for the brick at hand.
trait Whole: Copy + Ord + From<i64> + Into<i128> + Neg<Output = Self>
where
    Self: Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self>,
{
    /// A value that is known to fit.
    fn narrow(value: i128) -> Self;

    /// ⌊self / divisor⌋ for a positive divisor.
    fn floor_div(self, divisor: Self) -> Self;
}

impl Whole for i64 {
    fn narrow(value: i128) -> Self {
        value as Self
    }

    fn floor_div(self, divisor: Self) -> Self {
        self.div_euclid(divisor)
    }
}

impl Whole for i128 {
    fn narrow(value: i128) -> Self {
        value
    }

    fn floor_div(self, divisor: Self) -> Self {
        self.div_euclid(divisor)
    }
}

/// The least value of `normal`·i over the coordinates i of a cell that reaches the plane through `point`.
fn least<T: Whole, const N: usize>(normal: [T; N], point: [i64; N], side_log2: u32) -> T {
    let product = |k: usize| -> i128 { normal[k].into() * i128::from(point[k]) };
    let ahead: T = normal.into_iter().fold(T::from(0), |sum, m| sum + m.max(T::from(0)));
    T::narrow(-(-(0..N).map(product).sum::<i128>() >> side_log2)) - ahead
}

/// The two sides of a triangle's plane: a cell touches it if normal·i is at least the number for both.
fn planes<T: Whole>([p, q, r]: &[[i64; 3]; 3], block: &Block) -> [([T; 3], T); 2] {
    let e: [T; 3] = std::array::from_fn(|k| T::from(q[k] - p[k]));
    let f: [T; 3] = std::array::from_fn(|k| T::from(r[k] - p[k]));
    let normal = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]];
    [normal, normal.map(Neg::neg)].map(|normal| (normal, least(normal, *p, block.side_log2)))
}

/// A triangle projected along an axis: a cell touches it if normal·i is at least the number for all edges.
struct Projection<T> {
    edges: [([T; 2], T); 3],
}

impl<T: Whole> Projection<T> {
    /// Projects to two axes.
    fn new(corners: &[[i64; 3]; 3], axes: [usize; 2], block: &Block) -> Self {
        let points = corners.map(|corner| axes.map(|k| corner[k]));
        let across = |from: [i64; 2], to: [i64; 2]| [T::from(from[1] - to[1]), T::from(to[0] - from[0])];
        let side = |from: usize, normal: [T; 2], to: usize| {
            let [x, y] = std::array::from_fn(|k| T::from(points[to][k] - points[from][k]));
            normal[0] * x + normal[1] * y
        };
        let edge = |normal: [T; 2], from: usize| (normal, least(normal, points[from], block.side_log2));
        let turned = |normal: [T; 2]| normal.map(Neg::neg);
        let area = side(0, across(points[0], points[1]), 2);
        if area == T::from(0) {
            // A segment. Its longest edge is one of two, for not all three points are one.
            let from = if points[0] == points[1] { 2 } else { 1 };
            let normal = across(points[0], points[from]);
            let both = [edge(normal, 0), edge(turned(normal), 0)];
            return Self { edges: [both[0], both[1], both[1]] };
        }
        let inward = |normal: [T; 2]| if area > T::from(0) { normal } else { turned(normal) };
        let of = |from: usize| edge(inward(across(points[from], points[(from + 1) % 3])), from);
        Self { edges: [of(0), of(1), of(2)] }
    }

    /// Of `cells` along the first axis those touched, at `at` on the second.
    fn touched(&self, at: u32, cells: u64) -> u64 {
        self.edges.iter().fold(cells, |cells, &([a, b], least)| at_least(a, least - b * T::from(i64::from(at)), cells))
    }
}

/// Of `cells`, those i with m i ≥ `least`.
fn at_least<T: Whole>(m: T, least: T, cells: u64) -> u64 {
    if cells == 0 {
        return 0;
    }
    let (first, last) = (cells.trailing_zeros(), 63 - cells.leading_zeros());
    if last - first < TRIED_CELLS {
        let mut value = m * T::from(i64::from(first));
        return (first..=last).fold(0, |found, i| {
            let is_in = u64::from(value >= least);
            value = value + m;
            found | is_in << i
        }) & cells;
    }
    let zero = T::from(0);
    let bounded = |i: T| i.max(T::from(-1)).min(T::from(i64::from(CELLS))).into() as i64;
    if m > zero {
        // i ≥ ⌈least / m⌉
        let start = bounded(-(-least).floor_div(m)).max(0);
        if start < i64::from(CELLS) { cells & u64::MAX << start } else { 0 }
    } else if m < zero {
        // i ≤ ⌊-least / -m⌋
        let end = bounded((-least).floor_div(-m)) + 1;
        if end < i64::from(CELLS) { cells & !(u64::MAX << end) } else { cells }
    } else if least <= zero {
        cells
    } else {
        0
    }
}

/// Bits `first` to `last`.
fn range(first: u32, last: u32) -> u64 {
    u64::MAX >> (63 - last) & u64::MAX << first
}

/// The numbers of the bits that are set.
fn ones(mut bits: u64) -> impl Iterator<Item = u32> {
    std::iter::from_fn(move || {
        let next = (bits != 0).then(|| bits.trailing_zeros());
        bits &= bits.wrapping_sub(1);
        next
    })
}
