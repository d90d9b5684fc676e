//! A column of a map: cells along a ray in words of 32 bits, depth t at bit 31 - t % 32 of word t / 32. Twin of
//! `shaders/roma/roma.wgsl`.
//!
//! Zeng et al., Algorithm 2, corrected: ranges are clipped word by word, words are taken in the order of travel, bits
//! are counted in integers, and a cell's depth is that of its middle in both directions.

/// First and last cell, of `size`, that lie between two depths; `None`: none does.
pub fn cells_between(from: f32, to: f32, size: u32) -> Option<(u32, u32)> {
    let (low, high) = if from < to { (from, to) } else { (to, from) };
    let last = size as f32 - 1.0;
    // False of a NaN, too.
    let meets = high >= 0.0 && low < size as f32;
    meets.then(|| (low.max(0.0) as u32, high.min(last) as u32))
}

/// Depth of the middle of the first occupied cell of `low` to `high`, in the order of travel.
pub fn first_cell(word: impl Fn(u32) -> u32, (low, high): (u32, u32), is_forward: bool) -> Option<f32> {
    let (first, last) = (low >> 5, high >> 5);
    for i in 0..=last - first {
        let w = if is_forward { first + i } else { last - i };
        let from = if w == first { low & 31 } else { 0 };
        let to = if w == last { high & 31 } else { 31 };
        let within = ((word(w) << from) >> (31 - to + from)) << (31 - to);
        if within != 0 {
            let cell = if is_forward { within.leading_zeros() } else { 31 - within.trailing_zeros() };
            return Some((32 * w + cell) as f32 + 0.5);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampling::pcg;

    /// The same, cell by cell.
    fn naive(is_occupied: impl Fn(i64) -> bool, from: f32, to: f32, size: u32, is_forward: bool) -> Option<f32> {
        let (low, high) = (from.min(to).floor() as i64, from.max(to).floor() as i64);
        let mut cells: Vec<i64> = (low..=high).filter(|t| (0..i64::from(size)).contains(t)).collect();
        if !is_forward {
            cells.reverse();
        }
        cells.into_iter().find(|&t| is_occupied(t)).map(|t| t as f32 + 0.5)
    }

    /// Columns of 32 `words` bits: nothing, everything, single cells at the joins of words, and noise of two densities.
    fn columns(words: u32) -> Vec<Vec<u32>> {
        let single = |t: u32| (0..words).map(|w| if t / 32 == w { 1 << (31 - t % 32) } else { 0 }).collect();
        let noise = |seed: u32| (0..words).map(|w| pcg(w ^ pcg(seed))).collect::<Vec<u32>>();
        let joins = (0..words).flat_map(|w| [0, 1, 15, 30, 31].map(|t| 32 * w + t));
        let mut all: Vec<Vec<u32>> = joins.map(single).collect();
        all.extend([vec![0; words as usize], vec![u32::MAX; words as usize], noise(1)]);
        all.push(noise(2).iter().zip(noise(3)).zip(noise(4)).map(|((a, b), c)| a & b & c).collect());
        all
    }

    /// How many of all pairs of depths, from outside and to outside included, in both directions, `find` gets wrong.
    fn wrong(find: impl Fn(&[u32], f32, f32, u32, bool) -> Option<f32>) -> usize {
        let mut wrong = 0;
        for words in 1..=8u32 {
            let size = 32 * words;
            for column in columns(words) {
                let is_occupied = |t: i64| column[t as usize / 32] >> (31 - t % 32) & 1 != 0;
                let ends: Vec<f32> = (-2..i64::from(size) + 2).map(|t| t as f32 + 0.25).collect();
                for (i, &from) in ends.iter().enumerate() {
                    // Every other start with every end, both parities of both.
                    for &to in ends.iter().skip(i % 2).step_by(if words > 4 { 2 } else { 1 }) {
                        for is_forward in [true, false] {
                            let expected = naive(is_occupied, from, to, size, is_forward);
                            wrong += usize::from(find(&column, from, to, size, is_forward) != expected);
                        }
                    }
                }
            }
        }
        wrong
    }

    #[test]
    fn all_depths_in_both_directions_are_those_of_a_walk_cell_by_cell() {
        let ours = |column: &[u32], from: f32, to: f32, size: u32, is_forward: bool| {
            cells_between(from, to, size).and_then(|range| first_cell(|w| column[w as usize], range, is_forward))
        };
        assert_eq!(wrong(ours), 0);
        // Controls: words the other way round, a range that is not clipped, a bit aside.
        let reversed = |column: &[u32], from: f32, to: f32, size: u32, is_forward: bool| {
            let last = column.len() as u32 - 1;
            cells_between(from, to, size)
                .and_then(|range| first_cell(|w| column[(last - w) as usize], range, is_forward))
        };
        assert!(wrong(reversed) > 0);
        let unclipped = |column: &[u32], _: f32, _: f32, size: u32, is_forward: bool| {
            first_cell(|w| column[w as usize], (0, size - 1), is_forward)
        };
        assert!(wrong(unclipped) > 0);
        let aside = |column: &[u32], from: f32, to: f32, size: u32, is_forward: bool| {
            cells_between(from + 1.0, to + 1.0, size).and_then(|r| first_cell(|w| column[w as usize], r, is_forward))
        };
        assert!(wrong(aside) > 0);
    }

    #[test]
    fn no_depth_is_no_cell() {
        for (from, to) in [(f32::NAN, 3.0), (3.0, f32::NAN), (f32::NAN, f32::NAN), (-1.0, -0.5), (64.0, 1e30)] {
            assert_eq!(cells_between(from, to, 64), None, "{from} {to}");
        }
        assert_eq!(cells_between(-1e30, 1e30, 64), Some((0, 63)));
        assert_eq!(cells_between(63.99, 64.0, 64), Some((63, 63)));
        assert_eq!(cells_between(31.0, 32.0, 64), Some((31, 32)));
    }
}
