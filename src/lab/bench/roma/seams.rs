//! Errors by the distance from seams: sides of the cubes of base maps, where rays go on with cells twice as large.

use crate::metrics::Image;
use crate::secondary::occupancy::Bom;
use std::collections::BTreeMap;

/// Distances that are looked at, cells of the finer map's resolution to both sides.
pub const REACH: i32 = 16;

/// Cells of a bin.
pub const BIN: i32 = 2;

/// Cells that a map is taken to have on each axis, whatever finer ones it is made of.
const CELLS: f64 = 128.0;

/// Cells from the seam to a bin's middle, outward.
pub fn bins() -> impl Iterator<Item = i32> {
    (-REACH..REACH).step_by(BIN as usize).map(|first| first + BIN / 2)
}

/// The bin of a point: of the finest map near whose side it is.
fn bin_of(levels: &[Bom], point: [f64; 3]) -> Option<i32> {
    let finer = levels.split_last()?.1;
    finer.iter().find_map(|bom| {
        let half = f64::from(bom.cells()) / 2.0;
        let off = |k: usize| (point[k] / bom.side() - bom.first[k] as f64 - half).abs();
        let outward = (off(0).max(off(1)).max(off(2)) - half) * CELLS / (2.0 * half);
        let first = (outward / f64::from(BIN)).floor() * f64::from(BIN);
        (first >= f64::from(-REACH) && first < f64::from(REACH)).then_some(first as i32 + BIN / 2)
    })
}

/// Sums over the pixels that show a point in a bin, bin by bin: how many there are, their differences, the magnitudes
/// of these, and the reference.
#[derive(Clone, Debug, Default)]
pub struct Seams(BTreeMap<i32, (u64, [f64; 3])>);

impl Seams {
    /// Adds the pixels of a picture; `points` are what they show.
    pub fn add(&mut self, levels: &[Bom], points: &[Option<[f64; 3]>], image: &Image, reference: &Image) {
        for ((point, one), other) in points.iter().zip(&image.rgb).zip(&reference.rgb) {
            let Some(bin) = point.and_then(|point| bin_of(levels, point)) else { continue };
            let [one, other] = [one, other].map(|rgb| rgb.iter().map(|&x| f64::from(x)).sum::<f64>() / 3.0);
            let (count, sum) = self.0.entry(bin).or_default();
            *count += 1;
            for (sum, x) in sum.iter_mut().zip([one - other, (one - other).abs(), other]) {
                *sum += x;
            }
        }
    }

    /// Of every bin its pixels, the mean of their differences and that of their magnitudes, relative to the mean of the
    /// reference there.
    pub fn errors(&self) -> BTreeMap<i32, (u64, f64, f64)> {
        let relative = |(&bin, &(count, [bias, size, mean])): (&i32, &(u64, [f64; 3]))| {
            (mean > 0.0).then(|| (bin, (count, bias / mean, size / mean)))
        };
        self.0.iter().filter_map(relative).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_told_apart_by_their_distance_from_the_finer_side() {
        // Cubes of 64 and 128, around the origin.
        let levels = [Bom::new(64, 0, [-32; 3]), Bom::new(64, 1, [-32; 3])];
        let at = |x: f64| bin_of(&levels, [0.0, x, 3.0]);
        // A cell of 128 of them on a side of 64 is half as wide.
        assert_eq!([at(32.1), at(-32.1), at(31.9), at(32.9), at(33.1)], [1, 1, -1, 1, 3].map(Some));
        assert_eq!([at(23.0), at(40.1), at(64.1), at(-24.0)], [None, None, None, Some(-15)]);
        let image = |x: f32| Image { width: 2, height: 1, rgb: vec![[x; 3], [1.0; 3]] };
        let points = [Some([0.0, 32.1, 0.0]), None];
        let mut found = Seams::default();
        found.add(&levels, &points, &image(0.75), &image(0.5));
        assert_eq!(found.errors().into_iter().collect::<Vec<_>>(), [(1, (1, 0.5, 0.5))]);
        // Pixels of another picture, as many: means are those of both.
        found.add(&levels, &points, &image(0.25), &image(0.5));
        assert_eq!(found.errors().into_iter().collect::<Vec<_>>(), [(1, (2, 0.0, 0.5))]);
        assert_eq!(bins().collect::<Vec<_>>(), (-15..16).step_by(2).collect::<Vec<_>>());
    }
}
