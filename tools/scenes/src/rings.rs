//! Growth in rings: the order in which cells around the origin are built, until a count of triangles is reached.
//!
//! A cell does not depend on what is built around it, so that the centre is the same in every size. The last one gets
//! what is left of the count.

use brickwalk_convert::progress::Progress;
use rayon::prelude::*;

/// Cells made at once.
const BATCH: usize = 64;
/// Triangles that are not worth beginning a cell.
const LEAST: u64 = 4_000;

/// How many cells lie between cell (i, j) and the corner at the origin. Ring r has 8 r + 4 cells.
pub fn ring(i: i64, j: i64) -> i64 {
    let index = |k: i64| if k >= 0 { k } else { -1 - k };
    index(i).max(index(j))
}

/// The cells of ring `r`, the first beside cell (r, r) of the diagonal through cell (0, 0), then around.
pub fn ring_cells(r: i64) -> Vec<(i64, i64)> {
    let mut cells = Vec::with_capacity((8 * r + 4) as usize);
    cells.extend((-r..=r).rev().map(|i| (i, r)));
    cells.extend((-r..=r).rev().map(|j| (-r - 1, j)));
    cells.extend((-r - 1..r).map(|i| (i, -r - 1)));
    cells.extend((-r - 1..r).map(|j| (r, j)));
    cells.dedup();
    cells
}

/// The ring of the last of `count` cells.
pub fn last_ring(count: usize) -> i64 {
    let mut last = 0;
    while 4 * (last + 1) * (last + 1) < count as i64 {
        last += 1;
    }
    last
}

/// The cell with number `index`.
pub fn cell_of(index: usize) -> (i64, i64) {
    let r = last_ring(index + 1);
    let cell = ring_cells(r)[index - (4 * r * r) as usize];
    debug_assert_eq!(ring(cell.0, cell.1), r);
    cell
}

/// The cells of the last ring that `count` cells leave empty.
pub fn empty_cells(count: usize) -> Vec<(i64, i64)> {
    let last = last_ring(count);
    ring_cells(last).split_off(count - (4 * last * last) as usize)
}

/// Takes cell after cell while it fits into `wanted` triangles; returns the budget and the plan of each.
///
/// `plan` counts the triangles of the cell with a number within a budget, `around` those of what surrounds so many
/// cells; `usual` is what a cell takes on average.
pub fn grow<P: Send>(
    wanted: u64,
    usual: u64,
    progress: &Progress,
    around: impl Fn(usize) -> u64,
    plan: impl Fn(usize, u64) -> (u64, P) + Sync,
) -> Vec<(u64, P)> {
    let mut cells: Vec<(u64, P)> = Vec::new();
    let mut total = 0;
    loop {
        let guess = ((wanted - total) / usual + 1) as usize;
        let batch = cells.len()..cells.len() + guess.min(BATCH);
        let plans: Vec<_> = batch.into_par_iter().map(|index| plan(index, u64::MAX)).collect();
        for (triangles, one) in plans {
            let left = wanted.saturating_sub(total + around(cells.len() + 1));
            if triangles <= left {
                cells.push((u64::MAX, one));
                progress.advance(triangles);
                total += triangles;
                continue;
            }
            if left >= LEAST || cells.is_empty() {
                cells.push((left, plan(cells.len(), left).1));
            }
            return cells;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn rings_tile_the_plane_once() {
        let mut seen = HashSet::new();
        for r in 0..6 {
            let cells = ring_cells(r);
            assert_eq!(cells.len() as i64, 8 * r + 4);
            for (i, j) in cells {
                assert_eq!(ring(i, j), r, "cell {i} {j}");
                assert_eq!(cell_of(seen.len()), (i, j));
                assert!(seen.insert((i, j)), "cell {i} {j} twice");
            }
        }
        assert_eq!(seen.len(), 12 * 12);
        assert_eq!(ring_cells(0)[0], (0, 0));
        for count in 1..144 {
            let mut all: HashSet<_> = (0..count).map(cell_of).collect();
            all.extend(empty_cells(count));
            assert_eq!(all.len() as i64, 4 * (last_ring(count) + 1).pow(2));
        }
    }

    #[test]
    fn growth_takes_what_fits_and_cuts_the_last() {
        // Cells of 10,000 triangles, 100 of surroundings for each.
        let plan = |index: usize, budget: u64| (budget.min(10_000), index);
        let grown = |wanted| grow(wanted, 7_000, &Progress::hidden(), |cells| 100 * cells as u64, plan);
        assert_eq!(grown(30_300), [(u64::MAX, 0), (u64::MAX, 1), (u64::MAX, 2)]);
        assert_eq!(grown(30_299), [(u64::MAX, 0), (u64::MAX, 1), (9_999, 2)]);
        assert_eq!(grown(24_000), [(u64::MAX, 0), (u64::MAX, 1)], "less than the least is left");
        assert_eq!(grown(1_000), [(900, 0)], "the first is begun with anything");
        assert_eq!(grown(2_000_000).len(), 198);
    }
}
