//! Boxes of cells of a map: clearing, filling and moving them.

use super::Bom;

/// Cells of a map from `lo` up to, not including, `hi`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Region {
    pub lo: [u32; 3],
    pub hi: [u32; 3],
}

/// Bits `from` up to, not including, `to` of a column that fall into its word `word`.
fn part(word: u32, from: u32, to: u32) -> u32 {
    let (start, end) = (from.max(32 * word), to.min(32 * word + 32));
    if start < end { u32::MAX >> (32 - (end - start)) << (start - 32 * word) } else { 0 }
}

/// Sets bits `from` up to, not including, `to` of a column.
pub(crate) fn set_bits(column: &mut [u32], from: u32, to: u32) {
    if from < to {
        (from / 32..=(to - 1) / 32).for_each(|word| column[word as usize] |= part(word, from, to));
    }
}

impl Region {
    /// All cells of a map of `cells` on each axis.
    pub fn whole(cells: u32) -> Self {
        Self { lo: [0; 3], hi: [cells; 3] }
    }

    /// The cells of `map` among those of its lattice from `lo` up to, not including, `hi`; `None`: there are none.
    pub fn within(map: &Bom, lo: [i64; 3], hi: [i64; 3]) -> Option<Self> {
        let local = |x: i64, k: usize| x.saturating_sub(map.first[k]).clamp(0, i64::from(map.cells)) as u32;
        let region =
            Self { lo: std::array::from_fn(|k| local(lo[k], k)), hi: std::array::from_fn(|k| local(hi[k], k)) };
        (0..3).all(|k| region.lo[k] < region.hi[k]).then_some(region)
    }

    /// The cells of both; `None`: there are none.
    pub fn and(&self, other: &Self) -> Option<Self> {
        let region = Self {
            lo: std::array::from_fn(|k| self.lo[k].max(other.lo[k])),
            hi: std::array::from_fn(|k| self.hi[k].min(other.hi[k])),
        };
        (0..3).all(|k| region.lo[k] < region.hi[k]).then_some(region)
    }

    /// Number of cells.
    pub fn count(&self) -> u64 {
        (0..3).map(|k| u64::from(self.hi[k] - self.lo[k])).product()
    }
}

impl Bom {
    /// Words of a column.
    pub(crate) fn column_words(&self) -> u32 {
        self.cells / 32
    }

    /// The words of column (x, y).
    pub(crate) fn column_mut(&mut self, x: u32, y: u32) -> &mut [u32] {
        let words = self.column_words();
        &mut self.words[((x + self.cells * y) * words) as usize..][..words as usize]
    }

    /// Marks all cells of a region as occupied.
    pub(crate) fn fill(&mut self, region: &Region) {
        for y in region.lo[1]..region.hi[1] {
            (region.lo[0]..region.hi[0]).for_each(|x| set_bits(self.column_mut(x, y), region.lo[2], region.hi[2]));
        }
    }

    /// Marks all cells of a region as empty.
    pub(crate) fn clear(&mut self, region: &Region) {
        for y in region.lo[1]..region.hi[1] {
            for x in region.lo[0]..region.hi[0] {
                for (word, bits) in (0u32..).zip(self.column_mut(x, y)) {
                    *bits &= !part(word, region.lo[2], region.hi[2]);
                }
            }
        }
    }

    /// The map with its corner at `first`, and the regions of it that this one does not have, which are empty there.
    pub(crate) fn moved(&self, first: [i64; 3]) -> (Self, Vec<Region>) {
        if first == self.first {
            return (self.clone(), Vec::new());
        }
        let mut map = Self::new(self.cells, self.cell_log2, first);
        let cells = i64::from(self.cells);
        let end = self.first.map(|x| x + cells);
        let Some(mut kept) = Region::within(&map, self.first, end) else {
            return (map, vec![Region::whole(self.cells)]);
        };
        let by: [i64; 3] = std::array::from_fn(|k| first[k] - self.first[k]);
        let words = self.column_words() as usize;
        for y in kept.lo[1]..kept.hi[1] {
            let from_y = (i64::from(y) + by[1]) as u32;
            for x in kept.lo[0]..kept.hi[0] {
                let from_x = (i64::from(x) + by[0]) as u32;
                let column = &self.words[((from_x + self.cells * from_y) as usize) * words..][..words];
                shift_bits(map.column_mut(x, y), column, by[2] as i32);
            }
        }
        // Slabs that do not overlap: along an axis the whole of what those before left.
        let mut rest = Region::whole(self.cells);
        let mut fresh = Vec::new();
        for k in 0..3 {
            for (lo, hi) in [(0, kept.lo[k]), (kept.hi[k], self.cells)] {
                if lo < hi {
                    let mut slab = rest;
                    (slab.lo[k], slab.hi[k]) = (lo, hi);
                    fresh.push(slab);
                }
            }
            (rest.lo[k], rest.hi[k]) = (kept.lo[k], kept.hi[k]);
        }
        kept = rest;
        debug_assert_eq!(kept.count() + fresh.iter().map(Region::count).sum::<u64>(), (cells * cells * cells) as u64);
        (map, fresh)
    }
}

/// Bit z of `to` becomes bit z + `by` of `from`, or 0 where that has none.
fn shift_bits(to: &mut [u32], from: &[u32], by: i32) {
    let (words, bits) = (by.div_euclid(32), by.rem_euclid(32) as u32);
    let word = |i: i32| usize::try_from(i).ok().and_then(|i| from.get(i)).copied().unwrap_or(0);
    for (i, out) in (words..).zip(to) {
        let high = if bits == 0 { 0 } else { word(i + 1) << (32 - bits) };
        *out = word(i) >> bits | high;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A map with every seventh cell or so occupied.
    fn map(cells: u32) -> Bom {
        let mut map = Bom::new(cells, 0, [-5, 3, 100]);
        let mut state = 0x9e37_79b9u32;
        for word in map.words_mut() {
            state ^= state << 13;
            state ^= state >> 17;
            state ^= state << 5;
            *word = state & state.rotate_left(7) & state.rotate_left(19);
        }
        map
    }

    #[test]
    fn moving_keeps_every_cell_where_it_is() {
        let old = map(64);
        for by in [
            [0, 0, 0],
            [8, 0, 0],
            [0, -8, 0],
            [0, 0, 32],
            [0, 0, -31],
            [3, -5, 7],
            [63, 1, -63],
            [64, 0, 0],
            [0, 0, -900],
        ] {
            let first: [i64; 3] = std::array::from_fn(|k| old.first[k] + by[k]);
            let (new, fresh) = old.moved(first);
            let mut is_fresh = map(64);
            is_fresh.clear(&Region::whole(64));
            assert_eq!(is_fresh.occupied(), 0);
            for region in &fresh {
                let before = is_fresh.occupied();
                is_fresh.fill(region);
                assert_eq!(is_fresh.occupied() - before, region.count(), "regions do not overlap");
            }
            for (x, y, z) in (0..64).flat_map(|x| (0..64).flat_map(move |y| (0..64).map(move |z| (x, y, z)))) {
                let there = [x + by[0], y + by[1], z + by[2]];
                assert_eq!(new.is_occupied([x, y, z]), old.is_occupied(there), "{by:?} {x} {y} {z}");
                let was_in = there.iter().all(|x| (0..64).contains(x));
                assert_eq!(is_fresh.is_occupied([x, y, z]), !was_in, "{by:?} {x} {y} {z}");
            }
        }
    }
}
