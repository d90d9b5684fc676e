//! Fields of scenes in which something moves.
//!
//! The paper makes the whole field anew in every frame (Günay, Akyüz 2025). A field stays of use where nothing moves: what has moved can only change the
//! answers of rays that lead to where it was or is, and those are traced.

use super::mask::UNKNOWN;
use super::{DvfField, Shape};
use glam::DVec3;
use rayon::prelude::*;

/// By how much of their sides cells are taken to be wider, on every side: what kernels round a point's cell by.
pub const MARGIN: f64 = 1.0 / 64.0;

/// Radians by which cones are taken to be wider: what kernels round a ray's texel by.
const ROUNDING: f64 = 1e-3;

/// The direction in the middle of every texel.
fn middles(side: u32) -> Vec<DVec3> {
    let at = |i: u32| (2.0 * f64::from(i) + 1.0) / f64::from(side) - 1.0;
    let direction = |texel: u32| {
        let (u, v) = (at(texel % side), at(texel / side));
        let z = 1.0 - u.abs() - v.abs();
        let folded = |x: f64, of: f64| if z < 0.0 { (1.0 - of.abs()) * 1f64.copysign(x) } else { x };
        DVec3::new(folded(u, v), folded(v, u), z).normalize()
    };
    (0..side * side).map(direction).collect()
}

/// Greatest angle between the middle of a texel and a direction in it, radians: a step δ along both axes of the map moves a point of the octahedron by 6^0.5 δ at
/// most, and no point of it is nearer to its middle than 3^-0.5.
fn reach(side: u32) -> f64 {
    18f64.sqrt() / f64::from(side)
}

/// What boxes concern of the cells of a grid.
struct Cones {
    shape: Shape,
    middles: Vec<DVec3>,
    /// Half a cell, made wider.
    half: DVec3,
    /// Greatest angle between the middle of a texel and a direction that a kernel may take for one of it.
    reach: f64,
}

impl Cones {
    fn new(shape: Shape) -> Self {
        let side = shape.octahedral;
        let half = DVec3::splat(shape.side * (0.5 + MARGIN));
        Self { shape, middles: middles(side), half, reach: reach(side) + ROUNDING }
    }

    /// Calls `mark` with all texels that may lead from a cell into boxes, with some again; `false`: one that meets the cell was found, and the rest is left.
    fn mark(&self, cell: u32, boxes: &[[DVec3; 2]], mut mark: impl FnMut(usize)) -> bool {
        let [sx, sy, _] = self.shape.size;
        let at = DVec3::from_array([cell % sx, cell / sx % sy, cell / (sx * sy)].map(|n| f64::from(n) + 0.5));
        let middle = self.shape.corner + self.shape.side * at;
        for [min, max] in boxes {
            // Ways from a point of one box to one of the other lie in a box, and that in a ball.
            let way = 0.5 * (*min + *max) - middle;
            let radius = (0.5 * (*max - *min) + self.half).length();
            if way.length() <= radius {
                return false;
            }
            let widest = (radius / way.length()).asin() + self.reach;
            let (axis, least) = (way.normalize(), widest.min(std::f64::consts::PI).cos());
            let texels = self.middles.iter().enumerate().filter(|(_, middle)| middle.dot(axis) >= least);
            texels.for_each(|(texel, _)| mark(texel));
        }
        true
    }
}

impl DvfField {
    /// The field for a scene in which what lay in some of `boxes`, world units, lies in others of them: rays from elsewhere that may lead into one are traced,
    /// and all those of the cells that one meets.
    pub fn with_movers(&self, boxes: &[[DVec3; 2]]) -> Self {
        let mut marked = self.clone();
        let (cones, words) = (Cones::new(self.shape), self.shape.words());
        let cells = marked.masks.par_chunks_exact_mut(words).zip(&mut marked.labels);
        cells.enumerate().filter(|(_, (_, label))| **label != UNKNOWN).for_each(|(cell, (masks, label))| {
            let (missed, hit) = masks.split_at_mut(words / 2);
            let mark = |texel: usize| {
                for mask in [&mut *missed, &mut *hit] {
                    mask[texel / 32] |= 1 << (texel % 32);
                }
            };
            if !cones.mark(cell as u32, boxes, mark) {
                *label = UNKNOWN;
            }
        });
        marked
    }

    /// Of some cells of the scene's field, the texels in which rays may answer otherwise, as a mask has them, where there are any: all where a box meets
    /// the cell.
    pub fn concerned(&self, cells: &[u32], boxes: &[[DVec3; 2]]) -> Vec<Option<Vec<u32>>> {
        let (cones, words) = (Cones::new(self.shape), self.shape.words() / 2);
        let of_cell = |&cell: &u32| {
            let mut texels = vec![0u32; words];
            if !cones.mark(cell, boxes, |texel| texels[texel / 32] |= 1 << (texel % 32)) {
                return Some(vec![u32::MAX; words]);
            }
            // Nothing starts in a cell of which nothing is known and that no mover has come to.
            let is_known = self.labels[cell as usize] != UNKNOWN;
            (is_known && texels.iter().any(|&word| word != 0)).then_some(texels)
        };
        cells.par_iter().map(of_cell).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::field::Answer;
    use super::super::{DvfUse, Shape, mask};
    use super::*;
    use crate::math::sampling::random2;

    fn direction(i: u32, stream: u32) -> [f32; 3] {
        let [a, b] = random2(i, stream, 5).map(f64::from);
        let (z, angle) = (2.0 * a - 1.0, std::f64::consts::TAU * b);
        let across = (1.0 - z * z).max(0.0).sqrt();
        [across * angle.cos(), across * angle.sin(), z].map(|x| x as f32)
    }

    #[test]
    fn directions_are_no_farther_from_their_texels_than_stated() {
        for side in [8, 16, 32] {
            let middles = middles(side);
            for (texel, middle) in middles.iter().enumerate() {
                assert_eq!(mask::texel(middle.as_vec3().to_array(), side) as usize, texel);
            }
            let apart = |d: [f32; 3]| {
                let middle = middles[mask::texel(d, side) as usize];
                middle.angle_between(DVec3::from_array(d.map(f64::from)))
            };
            let greatest = (0..100_000).map(|i| apart(direction(i, 0))).fold(0.0, f64::max);
            assert!(greatest <= reach(side) && greatest > 0.3 * reach(side), "{greatest} of {}", reach(side));
        }
    }

    #[test]
    fn rays_toward_what_moves_are_traced_and_others_are_not() {
        let shape = Shape::new(DVec3::ZERO, DVec3::splat(10.0), 10, 16);
        let mut field = DvfField::unknown(shape);
        // All directions are free everywhere.
        field.masks.chunks_exact_mut(shape.words()).for_each(|masks| masks[..shape.words() / 2].fill(u32::MAX));
        field.finish(false);
        let boxes =
            [[DVec3::new(4.0, 4.0, 4.0), DVec3::new(5.0, 6.0, 4.5)], [DVec3::splat(-30.0), DVec3::splat(-29.0)]];
        let marked = field.with_movers(&boxes);
        let meets = |point: DVec3, d: DVec3, [min, max]: [DVec3; 2]| {
            let (a, b) = ((min - point) / d, (max - point) / d);
            let (near, far) = (a.min(b).max_element(), a.max(b).min_element());
            far >= near.max(0.0)
        };
        let (mut toward, mut free) = (0, 0);
        for i in 0..200_000 {
            let ([a, b], [c, _]) = (random2(i, 1, 7), random2(i, 2, 7));
            let point = 10.0 * DVec3::new(a.into(), b.into(), c.into());
            let d = direction(i, 3);
            let along = DVec3::from_array(d.map(f64::from));
            let answer = marked.answer(point, d, DvfUse::default());
            assert_eq!(field.answer(point, d, DvfUse::default()), Answer::Free, "control");
            if boxes.iter().any(|b| meets(point, along, *b)) {
                assert_eq!(answer, Answer::Trace, "{point} {d:?}");
                toward += 1;
            } else {
                free += u32::from(answer == Answer::Free);
            }
        }
        assert!(toward > 2000 && free > 120_000, "{toward} {free}");
        // What is made anew is what is traced.
        let cells: Vec<u32> = (0..shape.cells() as u32).collect();
        for (cell, texels) in cells.iter().zip(field.concerned(&cells, &boxes)) {
            let words = shape.words() / 2;
            let [before, after] =
                [&field, &marked].map(|field| &field.masks[2 * words * *cell as usize..][words..2 * words]);
            match (texels, marked.labels[*cell as usize]) {
                (texels, UNKNOWN) => assert_eq!(texels, Some(vec![u32::MAX; words])),
                (Some(texels), _) => assert!(before.iter().zip(&texels).zip(after).all(|((a, b), c)| a | b == *c)),
                (None, _) => assert_eq!(before, after),
            }
        }
        assert_eq!(field.with_movers(&[]), field);
    }
}
