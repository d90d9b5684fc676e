//! Cells of a field that are made anew while all others stay.
//!
//! *Theory.* The paper makes all of a field anew in every frame in which something moves (Günay, Akyüz 2025). A point's
//! place, its rays and how many there are on a triangle depend on that triangle, the seed, and scale and sum of all
//! areas alone, so that of a field of which these are kept any part can be made by itself, and is what making all of it
//! would give.
//!
//! *Practice.* Rays answer as before but for those that lead into a box in which something was or is. Of a cell that no
//! such box meets, only rays in texels that may lead into one are traced again ([`super::DvfField::concerned`]); its
//! other bits are those that it was made with, before masks were widened.

use super::{DvfField, DvfKept, Shape, mask};
use bricks::NONE;

/// Which cells are made anew, and in which texels: each has an entry.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Fresh {
    /// By entry.
    cells: Vec<u32>,
    /// Of each cell of the grid its entry or [`NONE`], then of each entry its texels, as kernels read them.
    words: Vec<u32>,
    /// Where the texels begin.
    first: usize,
    /// Words of the texels of an entry.
    stride: usize,
}

impl Fresh {
    /// Of cells of a grid, and their texels as a mask has them.
    pub fn new<'a>(shape: &Shape, all: impl IntoIterator<Item = (u32, &'a [u32])>) -> Self {
        let (first, stride) = (shape.cells() as usize, mask::words(shape.octahedral));
        let (mut cells, mut words) = (Vec::new(), vec![NONE; first]);
        for (cell, texels) in all {
            words[cell as usize] = cells.len() as u32;
            words.extend_from_slice(texels);
            cells.push(cell);
        }
        Self { cells, words, first, stride }
    }

    /// The cells, by entry.
    pub fn cells(&self) -> &[u32] {
        &self.cells
    }

    /// How many cells are made anew.
    pub fn entries(&self) -> usize {
        self.cells.len()
    }

    /// What kernels read.
    pub fn words(&self) -> &[u32] {
        &self.words
    }

    fn view(&self) -> FreshView<'_> {
        FreshView { words: &self.words, first: self.first, stride: self.stride }
    }

    /// The entry of a cell; `None`: it is not made anew.
    pub fn entry(&self, cell: usize) -> Option<usize> {
        self.view().entry(cell)
    }

    /// The texels in which an entry is made anew.
    pub fn texels(&self, entry: usize) -> &[u32] {
        self.view().texels(entry)
    }

    /// Enters what an entry's rays met into its cell of `field`; other bits are those of `kept`.
    pub fn enter(&self, entry: usize, met: &[u32], kept: &DvfKept, dilate: bool, field: &mut DvfField) {
        let (cell, words, side) = (self.cells[entry] as usize, 2 * self.stride, field.shape.octahedral);
        let masks = &mut field.masks[cell * words..][..words];
        let own = &kept.field.masks[cell * words..][..words];
        for (i, word) in masks.iter_mut().enumerate() {
            *word = own[i] & !self.texels(entry)[i % self.stride] | met[i];
        }
        if dilate {
            masks.chunks_exact_mut(self.stride).for_each(|mask| mask::dilate(mask, side));
        }
        field.labels[cell] = mask::label(masks);
    }
}

/// [`Fresh::words`], as kernels read them.
#[derive(Clone, Copy)]
pub struct FreshView<'a> {
    words: &'a [u32],
    first: usize,
    stride: usize,
}

impl<'a> FreshView<'a> {
    /// Of a grid of so many cells, whose masks have so many texels on both axes.
    pub fn new(words: &'a [u32], cells: usize, octahedral: u32) -> Self {
        Self { words, first: cells, stride: mask::words(octahedral) }
    }

    /// The entry of a cell; `None`: it is not made anew.
    pub fn entry(self, cell: usize) -> Option<usize> {
        let entry = self.words[cell];
        (entry != NONE).then_some(entry as usize)
    }

    /// The texels in which an entry is made anew.
    pub fn texels(self, entry: usize) -> &'a [u32] {
        &self.words[self.first + entry * self.stride..][..self.stride]
    }

    /// Whether an entry is made anew in a texel.
    pub fn has(self, entry: usize, texel: u32) -> bool {
        mask::has(self.texels(entry), texel)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::secondary::dvf::Areas;
    use crate::secondary::dvf::mask::{OCCLUDED, VISIBLE};
    use glam::DVec3;

    #[test]
    fn other_texels_and_cells_stay() {
        let shape = Shape::new(DVec3::ZERO, DVec3::splat(2.0), 3, 8);
        let mut field = DvfField::unknown(shape);
        // Everything was free.
        field.masks.chunks_exact_mut(4).for_each(|masks| masks.copy_from_slice(&[u32::MAX, u32::MAX, 0, 0]));
        let kept = DvfKept { field: field.clone(), areas: Areas::default() };
        field.finish(false);
        let before = field.clone();
        let fresh = Fresh::new(&shape, [(5, &[0xffff_0000, u32::MAX][..]), (2, &[u32::MAX; 2])]);
        assert_eq!((fresh.entry(5), fresh.entry(2), fresh.entry(3)), (Some(0), Some(1), None));
        let view = fresh.view();
        assert!(view.has(0, 16) && !view.has(0, 15) && view.has(1, 15));
        fresh.enter(0, &[0, 0, 0xffff_0000, u32::MAX], &kept, false, &mut field);
        fresh.enter(1, &[0, 0, 1, 0], &kept, false, &mut field);
        assert_eq!(field.masks[20..24], [0xffff, 0, 0xffff_0000, u32::MAX]);
        assert_eq!(field.masks[8..12], [0, 0, 1, 0]);
        assert_eq!([field.labels[5], field.labels[2], field.labels[3]], [OCCLUDED, OCCLUDED, VISIBLE]);
        let same = |cell: usize| field.masks[4 * cell..4 * cell + 4] == before.masks[4 * cell..4 * cell + 4];
        assert!((0..shape.cells() as usize).all(|cell| same(cell) != [2, 5].contains(&cell)));
        // Widened, a bit of the texels reaches into others.
        fresh.enter(0, &[0, 0, 1 << 16, 0], &kept, true, &mut field);
        assert_eq!(field.masks[22] & 0xffff, 0x300, "the row before");
    }
}
