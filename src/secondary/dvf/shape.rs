//! The grid of a field.

use super::mask;
use glam::DVec3;

/// By how much of their sides cells are taken to be wider, on every side: what kernels round a point's cell by.
pub const MARGIN: f64 = 1.0 / 64.0;

/// Where the cells of a field lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shape {
    /// The corner of cell 0, world units.
    pub corner: DVec3,
    /// Side of a cell, world units.
    pub side: f64,
    /// Cells on each axis; the cell at (x, y, z) is number (z sy + y) sx + x.
    pub size: [u32; 3],
    /// Texels of a mask on both axes: 8, 16 or 32.
    pub octahedral: u32,
}

/// By how much of a cell the grid begins before its region: so that surfaces in the planes of simple numbers, of which
/// scenes have many, do not lie in the faces of cells, where roundings would say on which side.
const BEFORE: f64 = 0.381_966;

impl Shape {
    /// Of cells of which `longest` lie along the longest side of the region between `min` and `max`. A flat region has
    /// cells across, too.
    pub fn new(min: DVec3, max: DVec3, longest: u32, octahedral: u32) -> Self {
        let extent = (max - min).max(DVec3::ZERO);
        let greatest = extent.max_element();
        // A point has a cell of some size.
        let greatest = if greatest > 0.0 { greatest } else { 1.0 };
        // The last cell holds the region's end, by the same margin about.
        let side = greatest / (f64::from(longest) - 0.5);
        let size = extent.to_array().map(|x| ((x / side + BEFORE).floor() + 1.0) as u32);
        Self { corner: min - BEFORE * side, side, size, octahedral }
    }

    /// Number of cells.
    pub fn cells(&self) -> u64 {
        self.size.iter().map(|&n| u64::from(n)).product()
    }

    /// Words of both masks of a cell.
    pub fn words(&self) -> usize {
        2 * mask::words(self.octahedral)
    }

    /// Bytes of all masks.
    pub fn bytes(&self) -> u64 {
        4 * self.cells() * self.words() as u64
    }

    /// The same with cells `factor` times as wide.
    pub fn coarser(&self, factor: u32) -> Self {
        Self { side: self.side * f64::from(factor), size: self.size.map(|n| n.div_ceil(factor)), ..*self }
    }

    /// The cell that holds a point of the world.
    pub fn cell(&self, point: DVec3) -> Option<u32> {
        let at = (point - self.corner) / self.side;
        let inside = (0..3).all(|k| at[k] >= 0.0 && at[k] < f64::from(self.size[k]));
        let [x, y, z] = at.to_array().map(|x| x as u32);
        inside.then(|| (z * self.size[1] + y) * self.size[0] + x)
    }

    /// The cells that a box of the world meets, by the roundings of kernels.
    pub fn cells_of(&self, [min, max]: [DVec3; 2]) -> impl Iterator<Item = u32> + use<> {
        let Self { corner, side, size, .. } = *self;
        let range = |k: usize| {
            let at = |x: f64| (x - corner[k]) / side;
            // A float-to-integer cast saturates.
            let (first, end) = ((at(min[k]) - MARGIN).max(0.0), (at(max[k]) + MARGIN).floor() + 1.0);
            first as u32..(end.max(0.0) as u32).min(size[k])
        };
        let (y, z) = (range(1), range(2));
        let rows = z.flat_map(move |z| y.clone().map(move |y| (z * size[1] + y) * size[0]));
        let x = range(0);
        rows.flat_map(move |row| x.clone().map(move |x| row + x))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_cover_the_region_and_are_as_many_as_asked() {
        for longest in [1, 2, 3, 8, 77] {
            let (min, max) = (DVec3::new(-3.0, 1.0, 1e6), DVec3::new(5.0, 1.0, 1e6 + 2.0));
            let shape = Shape::new(min, max, longest, 16);
            assert_eq!(shape.size[0], longest, "{:?}", shape.size);
            assert!(shape.size[1] >= 1);
            for corner in [min, max, 0.5 * (min + max)] {
                assert!(shape.cell(corner).is_some(), "{longest} {corner}");
            }
            assert_eq!(shape.cell(max + shape.side), None);
            assert_eq!(shape.cell(min - shape.side), None);
        }
        assert_eq!(Shape::new(DVec3::ONE, DVec3::ONE, 16, 8).cells(), 1);
    }

    #[test]
    fn the_cells_of_a_box_hold_its_points() {
        let shape = Shape::new(DVec3::ZERO, DVec3::new(10.0, 3.0, 7.0), 21, 8);
        let bounds = [DVec3::new(-1.0, 0.7, 2.0), DVec3::new(4.0, 1.1, 2.0)];
        let cells: Vec<u32> = shape.cells_of(bounds).collect();
        let mut found: Vec<u32> = (0..1000u32)
            .filter_map(|i| {
                let [a, b] = crate::math::sampling::random2(i, 0, 0).map(f64::from);
                shape.cell(bounds[0] + (bounds[1] - bounds[0]) * DVec3::new(a, b, 0.0))
            })
            .collect();
        found.sort_unstable();
        found.dedup();
        assert_eq!(cells, found);
        let whole = [DVec3::splat(-1e30), DVec3::splat(1e30)];
        assert_eq!(shape.cells_of(whole).count() as u64, shape.cells());
        assert_eq!(shape.cells_of([DVec3::splat(-9.0), DVec3::splat(-8.0)]).count(), 0);
        assert_eq!(shape.cells_of([DVec3::splat(80.0), DVec3::splat(90.0)]).count(), 0);
    }

    #[test]
    fn coarser_cells_hold_the_finer_ones() {
        let shape = Shape::new(DVec3::ZERO, DVec3::new(10.0, 3.0, 7.0), 21, 8);
        let coarse = shape.coarser(4);
        for i in 0..1000u32 {
            let [a, b] = crate::math::sampling::random2(i, 0, 0).map(f64::from);
            let point = DVec3::new(10.0 * a, 3.0 * b, 7.0 * (a + b).fract());
            let (fine, wide) = (shape.cell(point).unwrap(), coarse.cell(point).unwrap());
            let [x, y] = [shape.size[0], shape.size[1]];
            let of_fine = [fine % x / 4, fine / x % y / 4, fine / (x * y) / 4];
            assert_eq!((of_fine[2] * coarse.size[1] + of_fine[1]) * coarse.size[0] + of_fine[0], wide);
        }
    }
}
