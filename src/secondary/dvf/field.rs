//! A field, and what it says of rays.

use super::mask::{OCCLUDED, UNKNOWN, VISIBLE};
use super::{Areas, DvfUse, Shape, mask};
use glam::DVec3;
use rayon::prelude::*;

/// Masks and labels of all cells.
#[derive(Clone, Debug, PartialEq)]
pub struct DvfField {
    /// Where the cells lie.
    pub shape: Shape,
    /// Of each cell, the mask of directions that missed, then of those that hit.
    pub masks: Vec<u32>,
    /// Of each cell: [`VISIBLE`], [`OCCLUDED`] or [`UNKNOWN`].
    pub labels: Vec<u32>,
}

/// A field as it is kept: what it can be finished, and made anew in some of its cells, from.
#[derive(Clone, Debug, PartialEq)]
pub struct DvfKept {
    /// With masks that are not widened.
    pub field: DvfField,
    /// What its points were shared out by.
    pub areas: Areas,
}

/// What a field says of a ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// It meets nothing.
    Free,
    /// It meets something.
    Met,
    /// It is to be traced.
    Trace,
}

/// How a field does on rays whose answers are known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Trial {
    /// Cells along the longest side.
    pub longest: u32,
    /// Share of the rays that are traced.
    pub traced: f64,
    /// Share of all rays that are answered wrongly.
    pub wrong: f64,
}

/// Whether answers of a kind count in a cell with a label.
fn counts(label: u32, which: u32, how: DvfUse) -> bool {
    label == which || (how.doubt && label != UNKNOWN)
}

impl DvfKept {
    /// The field, its masks widened if they are to be.
    pub fn finished(&self, dilate: bool) -> DvfField {
        let mut field = self.field.clone();
        field.finish(dilate);
        field
    }
}

impl DvfField {
    /// Of nothing that is known.
    pub fn unknown(shape: Shape) -> Self {
        let cells = shape.cells() as usize;
        Self { masks: vec![0; cells * shape.words()], labels: vec![UNKNOWN; cells], shape }
    }

    /// The masks brought together in cells `factor` times as wide, without labels.
    pub fn coarser(&self, factor: u32) -> Self {
        let mut wide = Self::unknown(self.shape.coarser(factor));
        let (words, [sx, sy, _], [wx, wy, _]) = (self.shape.words(), self.shape.size, wide.shape.size);
        for (cell, masks) in (0u32..).zip(self.masks.chunks_exact(words)) {
            let [x, y, z] = [cell % sx, cell / sx % sy, cell / (sx * sy)].map(|n| n / factor);
            let first = ((z * wy + y) * wx + x) as usize * words;
            wide.masks[first..first + words].iter_mut().zip(masks).for_each(|(all, own)| *all |= own);
        }
        wide
    }

    /// Widens the masks, if they are to be, and labels the cells.
    pub fn finish(&mut self, dilate: bool) {
        let side = self.shape.octahedral;
        let cells = self.masks.par_chunks_exact_mut(self.shape.words()).zip(&mut self.labels);
        cells.for_each(|(masks, label)| {
            if dilate {
                masks.chunks_exact_mut(mask::words(side)).for_each(|mask| mask::dilate(mask, side));
            }
            *label = mask::label(masks);
        });
    }

    /// What the field says of a ray from `point` of the world.
    pub fn answer(&self, point: DVec3, direction: [f32; 3], how: DvfUse) -> Answer {
        let Some(cell) = self.shape.cell(point) else { return Answer::Trace };
        let texel = mask::texel(direction, self.shape.octahedral);
        let masks = &self.masks[cell as usize * self.shape.words()..][..self.shape.words()];
        let (missed, hit) = masks.split_at(masks.len() / 2);
        match (mask::has(missed, texel), mask::has(hit, texel), self.labels[cell as usize]) {
            (true, false, label) if counts(label, VISIBLE, how) => Answer::Free,
            (false, true, label) if counts(label, OCCLUDED, how) => Answer::Met,
            _ => Answer::Trace,
        }
    }

    /// Share of all directions in which rays from a cell are answered, of those in `texels`, a mask; `None`: nothing is
    /// known of the cell.
    pub fn answered(&self, cell: u32, texels: &[u32], how: DvfUse) -> Option<f64> {
        let (label, words) = (self.labels[cell as usize], texels.len());
        let (missed, hit) = self.masks[2 * words * cell as usize..][..2 * words].split_at(words);
        let of = |own: &[u32], other: &[u32], which: u32| -> u32 {
            let bits = own.iter().zip(other).zip(texels).map(|((own, other), texels)| own & !other & texels);
            if counts(label, which, how) { bits.map(u32::count_ones).sum() } else { 0 }
        };
        let answered = of(missed, hit, VISIBLE) + of(hit, missed, OCCLUDED);
        (label != UNKNOWN).then_some(f64::from(answered) / (32 * words) as f64)
    }

    /// How it does on rays from points of the world of which it is known whether they meet anything.
    pub fn trial(&self, rays: &[(DVec3, [f32; 3], bool)], how: DvfUse) -> Trial {
        let count = |is: &(dyn Fn(Answer, bool) -> bool + Sync)| {
            let counted =
                rays.par_iter().filter(|(point, direction, hit)| is(self.answer(*point, *direction, how), *hit));
            counted.count() as f64 / rays.len().max(1) as f64
        };
        Trial {
            longest: self.shape.size.into_iter().max().unwrap_or(0),
            traced: count(&|answer, _| answer == Answer::Trace),
            wrong: count(&|answer, hit| answer == if hit { Answer::Free } else { Answer::Met }),
        }
    }

    /// Cells of which something is known.
    pub fn known_cells(&self) -> usize {
        self.labels.iter().filter(|&&label| label != UNKNOWN).count()
    }
}

/// Which of `trials` is best: the fewest rays traced among those with at most `wrong` of them answered wrongly; where
/// there are none, the least wrong. Decided by counts alone.
pub fn best(trials: &[Trial], wrong: f64) -> Option<usize> {
    let within = (0..trials.len()).filter(|&i| trials[i].wrong <= wrong);
    let fewest = within.min_by(|&a, &b| trials[a].traced.total_cmp(&trials[b].traced));
    fewest.or_else(|| (0..trials.len()).min_by(|&a, &b| trials[a].wrong.total_cmp(&trials[b].wrong)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn field() -> DvfField {
        let shape = Shape::new(DVec3::ZERO, DVec3::splat(4.0), 5, 8);
        let mut field = DvfField::unknown(shape);
        let cell = shape.cell(DVec3::ONE).unwrap() as usize * shape.words();
        let [up, down] = [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]].map(|d| mask::texel(d, 8));
        field.masks[cell + up as usize / 32] |= 1 << (up % 32);
        field.masks[cell + 2 + down as usize / 32] |= 1 << (down % 32);
        field
    }

    #[test]
    fn what_is_not_known_is_traced() {
        let mut field = field();
        field.finish(false);
        let [label, doubt] = [false, true].map(|doubt| DvfUse { doubt, ..DvfUse::default() });
        let (up, down, aside) = ([0.1, 0.0, 5.0], [0.05, 0.02, -5.0], [1.0, 0.2, 0.1]);
        assert_eq!(field.answer(DVec3::ONE, up, label), Answer::Free);
        assert_eq!(field.answer(DVec3::ONE, down, label), Answer::Trace, "the cell is mostly visible");
        assert_eq!(field.answer(DVec3::ONE, down, doubt), Answer::Met);
        assert_eq!(field.answer(DVec3::ONE, aside, doubt), Answer::Trace);
        for far in [DVec3::splat(3.9), DVec3::splat(-9.0)] {
            assert_eq!(field.answer(far, up, doubt), Answer::Trace, "empty cells and what lies outside");
        }
        let rays =
            [(DVec3::ONE, up, false), (DVec3::ONE, up, true), (DVec3::ONE, down, true), (DVec3::ONE, aside, true)];
        let trial = field.trial(&rays, label);
        assert_eq!((trial.traced, trial.wrong), (0.5, 0.25));
        // Of 64 texels one is free and one met, and the cell is mostly visible.
        let cell = field.shape.cell(DVec3::ONE).unwrap();
        let of = |texels: [u32; 2], how| field.answered(cell, &texels, how);
        assert_eq!((of([u32::MAX; 2], label), of([u32::MAX; 2], doubt)), (Some(1.0 / 64.0), Some(2.0 / 64.0)));
        assert_eq!((of([0; 2], doubt), field.answered(0, &[u32::MAX; 2], doubt)), (Some(0.0), None));
    }

    #[test]
    fn coarser_cells_know_what_finer_ones_do() {
        let fine = field();
        let mut wide = fine.coarser(2);
        wide.finish(true);
        assert_eq!(wide.known_cells(), 1);
        let bits = |field: &DvfField| field.masks.iter().map(|word| word.count_ones()).sum::<u32>();
        assert_eq!(bits(&fine), bits(&fine.coarser(2)));
        assert_eq!(wide.answer(DVec3::splat(0.2), [0.0, 0.0, 1.0], DvfUse::default()), Answer::Free);
    }

    #[test]
    fn the_fewest_rays_within_the_error_are_best() {
        let trial = |traced, wrong| Trial { longest: 1, traced, wrong };
        let trials = [trial(0.1, 0.02), trial(0.3, 0.001), trial(0.2, 0.0009), trial(0.5, 0.0)];
        assert_eq!(best(&trials, 0.001), Some(2));
        assert_eq!(best(&trials, -1.0), Some(3));
        assert_eq!(best(&[], 1.0), None);
    }
}
