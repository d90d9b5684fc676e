//! Fields of scenes in which something moves.
//!
//! The paper makes the whole field anew in every frame (Günay, Akyüz 2025). A field stays of use where nothing moves:
//! what has moved can only change the answers of rays that lead to where it was or is, and those are traced.

use super::mask::UNKNOWN;
use super::shape::MARGIN;
use super::{DvfField, Shape};
use glam::DVec3;
use rayon::prelude::*;

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

/// Greatest angle between the middle of a texel and a direction in it, radians: a step δ along both axes of the map
/// moves a point of the octahedron by 6^0.5 δ at most, and no point of it is nearer to its middle than 3^-0.5.
fn reach(side: u32) -> f64 {
    18f64.sqrt() / f64::from(side)
}

/// Texels of a block on both axes: blocks are looked at before their texels.
const BLOCK: usize = 4;

/// A block of texels.
struct Block {
    /// Unit vector in the middle of its texels.
    axis: DVec3,
    /// Cosine and sine of the greatest angle between that and the middle of a texel.
    widest: [f64; 2],
    /// Coordinates of the directions in the middles of its texels, row by row.
    middles: [[f64; BLOCK * BLOCK]; 3],
    /// Of each row the word of a mask that has its texels, and where its bits begin.
    rows: [(usize, u32); BLOCK],
}

/// Blocks of all texels.
fn blocks(side: u32) -> Vec<Block> {
    let middles = middles(side);
    let (side, across) = (side as usize, side as usize / BLOCK);
    let block = |i: usize| {
        let first = (i / across * side + i % across) * BLOCK;
        let middle = |k: usize| middles[first + k / BLOCK * side + k % BLOCK];
        let axis = (0..BLOCK * BLOCK).map(middle).sum::<DVec3>().normalize();
        let widest = (0..BLOCK * BLOCK).map(|k| middle(k).angle_between(axis)).fold(0.0, f64::max);
        Block {
            axis,
            widest: [widest.cos(), widest.sin()],
            middles: std::array::from_fn(|axis| std::array::from_fn(|k| middle(k)[axis])),
            rows: std::array::from_fn(|row| first + row * side).map(|texel| (texel / 32, texel as u32 % 32)),
        }
    };
    (0..across * across).map(block).collect()
}

impl Block {
    /// Which of its texels have middles no farther from a unit vector than an angle of cosine and sine `widest`, less
    /// than pi; a bit each.
    fn within(&self, axis: DVec3, widest: [f64; 2]) -> u32 {
        /// More than what cosines are rounded by.
        const SLACK: f64 = 1e-9;
        let ([cos, sin], [own_cos, own_sin]) = (widest, self.widest);
        let near = self.axis.dot(axis);
        // Sums of angles beyond half a turn leave nothing out.
        if sin * own_cos + cos * own_sin > 0.0 && near < cos * own_cos - sin * own_sin - SLACK {
            return 0;
        }
        if sin * own_cos - cos * own_sin > 0.0 && near > cos * own_cos + sin * own_sin + SLACK {
            return (1 << (BLOCK * BLOCK)) - 1;
        }
        let [x, y, z] = &self.middles;
        let is_near: [bool; BLOCK * BLOCK] =
            std::array::from_fn(|k| x[k] * axis.x + y[k] * axis.y + z[k] * axis.z >= cos);
        (0..).zip(is_near).map(|(k, is_near)| u32::from(is_near) << k).sum()
    }
}

/// A box of a tree of boxes, or one around several.
struct Node {
    middle: DVec3,
    half: DVec3,
    /// The second of its two parts, the first of which follows it; `None`: it is a box itself.
    second: Option<u32>,
}

/// Adds the tree of `boxes`, of which there are some.
fn grow(tree: &mut Vec<Node>, boxes: &mut [[DVec3; 2]]) {
    let around = |[a, b]: [DVec3; 2], [c, d]: &[DVec3; 2]| [a.min(*c), b.max(*d)];
    let [min, max] = boxes.iter().fold([DVec3::INFINITY, DVec3::NEG_INFINITY], around);
    let at = tree.len();
    tree.push(Node { middle: 0.5 * (min + max), half: 0.5 * (max - min), second: None });
    if boxes.len() > 1 {
        let extent = (max - min).to_array();
        let axis = (0..3).max_by(|&a, &b| extent[a].total_cmp(&extent[b])).unwrap_or(0);
        boxes.sort_by(|a, b| (a[0][axis] + a[1][axis]).total_cmp(&(b[0][axis] + b[1][axis])));
        let (first, second) = boxes.split_at_mut(boxes.len() / 2);
        grow(tree, first);
        tree[at].second = Some(tree.len() as u32);
        grow(tree, second);
    }
}

/// What boxes concern of the cells of a grid.
struct Cones {
    shape: Shape,
    tree: Vec<Node>,
    blocks: Vec<Block>,
    /// Half a cell, made wider.
    half: DVec3,
    /// Greatest angle between the middle of a texel and a direction that a kernel may take for one of it.
    reach: f64,
}

impl Cones {
    fn new(shape: Shape, boxes: &[[DVec3; 2]]) -> Self {
        let side = shape.octahedral;
        let half = DVec3::splat(shape.side * (0.5 + MARGIN));
        let mut tree = Vec::new();
        if !boxes.is_empty() {
            grow(&mut tree, &mut boxes.to_vec());
        }
        Self { shape, tree, blocks: blocks(side), half, reach: reach(side) + ROUNDING }
    }

    fn middle(&self, cell: u32) -> DVec3 {
        let [sx, sy, _] = self.shape.size;
        let at = DVec3::from_array([cell % sx, cell / sx % sy, cell / (sx * sy)].map(|n| f64::from(n) + 0.5));
        self.shape.corner + self.shape.side * at
    }

    /// Adds all texels to a mask that may lead from the cell around `middle` into boxes of a node, none of which meets
    /// it.
    fn mark(&self, at: u32, middle: DVec3, mask: &mut [u32]) {
        let node = &self.tree[at as usize];
        // Ways from a point of one box to one of the other lie in a box, and that in a ball.
        let way = node.middle - middle;
        let (length, radius) = (way.length(), (node.half + self.half).length());
        if let Some(second) = node.second {
            // Boxes go as one that are small together, against the cell or from there against a texel.
            let small = 0.5 * self.half.length().max(self.reach * length);
            if length <= radius || node.half.length() > small {
                self.mark(at + 1, middle, mask);
                return self.mark(second, middle, mask);
            }
        }
        let widest = (radius / length).asin() + self.reach;
        let (axis, widest) = (way / length, [widest.cos(), widest.sin()]);
        for block in &self.blocks {
            let texels = block.within(axis, widest);
            for (row, (word, shift)) in block.rows.iter().enumerate() {
                mask[*word] |= (texels >> (row * BLOCK) & ((1 << BLOCK) - 1)) << shift;
            }
        }
    }

    /// Whether the ball around a box of a node and half a cell holds `middle`.
    fn meets(&self, at: u32, middle: DVec3) -> bool {
        let node = &self.tree[at as usize];
        // No ball around a box of the node is wider than its own, and their middles lie in it.
        let radius = (node.half + self.half).length();
        let away = (node.middle - middle).abs();
        match node.second {
            Some(second) => {
                (away - node.half).max(DVec3::ZERO).length() <= radius
                    && (self.meets(at + 1, middle) || self.meets(second, middle))
            }
            None => away.length() <= radius,
        }
    }
}

/// The texels of a field's cells in which rays may answer otherwise since something has moved.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Concerned {
    /// Of each cell a mask; of a cell that a box meets all.
    texels: Vec<u32>,
    /// Which cells boxes meet.
    is_met: Vec<bool>,
}

impl Concerned {
    /// Those of a cell, as a mask has them; `None`: there are none.
    pub fn texels(&self, cell: u32) -> Option<&[u32]> {
        let words = self.texels.len() / self.is_met.len();
        let texels = &self.texels[cell as usize * words..][..words];
        texels.iter().any(|&word| word != 0).then_some(texels)
    }
}

impl DvfField {
    /// What is concerned where what lay in some of `boxes`, world units, lies in others of them: directions that may
    /// lead into one, all in cells that one meets. None of other cells of which nothing is known: nothing starts there.
    pub fn concerned(&self, boxes: &[[DVec3; 2]]) -> Concerned {
        let (cones, words) = (Cones::new(self.shape, boxes), self.shape.words() / 2);
        let mut texels = vec![0; words * self.labels.len()];
        let of_cell = |(cell, (texels, label)): (usize, (&mut [u32], &u32))| {
            let middle = cones.middle(cell as u32);
            let is_met = !boxes.is_empty() && cones.meets(0, middle);
            if is_met {
                texels.fill(u32::MAX);
            } else if *label != UNKNOWN && !boxes.is_empty() {
                cones.mark(0, middle, texels);
            }
            is_met
        };
        let cells = texels.par_chunks_exact_mut(words).zip(&self.labels);
        let is_met = cells.enumerate().map(of_cell).collect();
        Concerned { texels, is_met }
    }

    /// The field for a scene in which something has moved: rays that this concerns are traced.
    pub fn marked(&self, concerned: &Concerned) -> Self {
        let (mut marked, words) = (self.clone(), self.shape.words());
        let texels = concerned.texels.par_chunks_exact(words / 2).zip(&concerned.is_met);
        let cells = marked.masks.par_chunks_exact_mut(words).zip(&mut marked.labels).zip(texels);
        cells.filter(|((_, label), _)| **label != UNKNOWN).for_each(|((masks, label), (texels, is_met))| {
            if *is_met {
                *label = UNKNOWN;
                return;
            }
            for mask in masks.chunks_exact_mut(words / 2) {
                mask.iter_mut().zip(texels).for_each(|(word, texels)| *word |= texels);
            }
        });
        marked
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampling::random2;
    use crate::secondary::dvf::field::Answer;
    use crate::secondary::dvf::{DvfUse, Shape, mask};

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
        let concerned = field.concerned(&boxes);
        let marked = field.marked(&concerned);
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
        let words = shape.words() / 2;
        for cell in 0..shape.cells() as u32 {
            let [before, after] =
                [&field, &marked].map(|field| &field.masks[2 * words * cell as usize..][words..2 * words]);
            match (concerned.texels(cell), marked.labels[cell as usize]) {
                (texels, UNKNOWN) => assert_eq!(texels, Some(&vec![u32::MAX; words][..])),
                (Some(texels), _) => assert!(before.iter().zip(texels).zip(after).all(|((a, b), c)| a | b == *c)),
                (None, _) => assert_eq!(before, after),
            }
        }
        assert_eq!(field.marked(&field.concerned(&[])), field);
    }

    #[test]
    fn many_boxes_mark_what_each_of_them_does_and_little_else() {
        for (side, size) in [(8, 0.1), (16, 1.5), (32, 0.02)] {
            let shape = Shape::new(DVec3::ZERO, DVec3::splat(10.0), 10, side);
            let place = |i: u32, stream: u32| {
                let ([a, b], [c, _]) = (random2(i, stream, 11), random2(i, stream + 1, 11));
                DVec3::new(a.into(), b.into(), c.into())
            };
            // In a row of heaps, and one that stands alone.
            let boxes: Vec<[DVec3; 2]> = (0..60)
                .map(|i| {
                    let heap = DVec3::new(f64::from(i % 4) * 2.0, 3.0, 5.0);
                    let min = if i == 7 { DVec3::splat(40.0) } else { heap + 0.6 * place(i, 0) };
                    [min, min + size * place(i, 2)]
                })
                .collect();
            let cones = Cones::new(shape, &boxes);
            let middles = middles(side);
            let (mut all, mut more, mut inside) = (0, 0, 0);
            for cell in 0..shape.cells() as u32 {
                let is_outside = !cones.meets(0, cones.middle(cell));
                let mut marked = vec![0; shape.words() / 2];
                if is_outside {
                    cones.mark(0, cones.middle(cell), &mut marked);
                }
                let is_marked = |texel: usize| mask::has(&marked, texel as u32);
                // The same by every box for itself, and texel by texel; and ways from one to the other.
                let at = [cell % 10, cell / 10 % 10, cell / 100].map(|n| f64::from(n) + 0.5);
                let middle = shape.corner + shape.side * DVec3::from_array(at);
                let mut own = vec![false; middles.len()];
                let mut meets = false;
                for (i, [min, max]) in (0..).zip(&boxes) {
                    let way = 0.5 * (*min + *max) - middle;
                    let radius = (0.5 * (*max - *min) + cones.half).length();
                    meets |= way.length() <= radius;
                    let widest = (radius / way.length()).min(1.0).asin() + cones.reach;
                    for (texel, own) in own.iter_mut().enumerate() {
                        *own |= middles[texel].angle_between(way) <= widest;
                    }
                    let start = middle + shape.side * (place(cell, 4 + i) - DVec3::splat(0.5));
                    let end = *min + (*max - *min) * place(cell, 100 + i);
                    let way = (end - start).normalize().as_vec3().to_array();
                    assert!(
                        !is_outside || is_marked(mask::texel(way, side) as usize),
                        "cell {cell} of {side}, box {i}"
                    );
                }
                assert_eq!(is_outside, !meets);
                inside += u32::from(meets);
                if is_outside {
                    all += own.iter().filter(|own| **own).count();
                    more += (0..middles.len()).filter(|&texel| is_marked(texel)).count();
                }
            }
            println!("{side}: {all} texels of boxes, {more} marked, {inside} cells met");
            assert!(inside > 10 && more as f64 <= 1.15 * all as f64, "{more} of {all}");
        }
    }
}
