//! Jump flooding in three dimensions.

use crate::secondary::occupancy::Bom;
use rayon::prelude::*;

/// The cell that is nearest to one where there is none.
pub const NO_SEED: u32 = u32::MAX;

/// A cell's coordinates in 10 bits each, the first lowest.
fn pack([x, y, z]: [u32; 3]) -> u32 {
    x | y << 10 | z << 20
}

/// Squared distance of a cell to a packed one, cells.
pub(crate) fn squared([x, y, z]: [u32; 3], seed: u32) -> u32 {
    let of = |a: u32, b: u32| a.wrapping_sub(b & 1023).wrapping_mul(a.wrapping_sub(b & 1023));
    of(x, seed).wrapping_add(of(y, seed >> 10)).wrapping_add(of(z, seed >> 20))
}

/// Begins flooding a map of these words: the nearest occupied cell to one that is occupied is itself, to others none is
/// known. Twin of `shaders/df/flood_seeds.wgsl`.
pub fn seeds(cells: u32, words: &[u32], nearest: &mut [u32]) {
    nearest.par_chunks_mut(plane(cells)).zip(0..cells).for_each(|(out, x)| {
        for (cell, (y, z)) in out.iter_mut().zip((0..cells).flat_map(|y| (0..cells).map(move |z| (y, z)))) {
            let is_seed = words[((x + y * cells) * (cells / 32) + z / 32) as usize] >> (z % 32) & 1 != 0;
            *cell = if is_seed { pack([x, y, z]) } else { NO_SEED };
        }
    });
}

/// One step of flooding, from `nearest` to `next`. Twin of `shaders/df/jump_flood.wgsl`.
pub fn flood(nearest: &[u32], next: &mut [u32], cells: u32, step: u32) {
    next.par_chunks_mut(plane(cells)).zip(0..cells).for_each(|(out, x)| flood_plane(nearest, cells, x, step, out));
}

/// How far the steps of flooding a map of `cells` on each axis look away, cells.
pub fn flood_steps(cells: u32) -> impl Iterator<Item = u32> {
    std::iter::successors(Some(cells.next_power_of_two() / 2), |step| Some(step / 2)).take_while(|step| *step > 0)
}

/// Cells of one x.
fn plane(cells: u32) -> usize {
    (cells * cells) as usize
}

/// For each cell of a map an occupied one that is the nearest or little farther, in 10 bits an axis, or [`NO_SEED`] if
/// there is none: cell (x, y, z) is element (x cells + y) cells + z. Of equally far ones it is the one with the lowest
/// number.
pub fn jump_flood(map: &Bom) -> Vec<u32> {
    let cells = map.cells();
    let mut nearest = vec![NO_SEED; cells.pow(3) as usize];
    seeds(cells, map.words(), &mut nearest);
    if nearest.iter().all(|&seed| seed == NO_SEED) {
        return nearest;
    }
    let mut next = nearest.clone();
    for step in flood_steps(cells) {
        flood(&nearest, &mut next, cells, step);
        std::mem::swap(&mut nearest, &mut next);
    }
    nearest
}

/// The cells of one x: of their own nearest and those of the 26 neighbours `step` away, the nearest to them.
fn flood_plane(nearest: &[u32], cells: u32, x: u32, step: u32, out: &mut [u32]) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: AVX2 has been detected.
        return unsafe { flood_plane_avx2(nearest, cells, x, step, out) };
    }
    flood_rows(nearest, cells, x, step, out);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn flood_plane_avx2(nearest: &[u32], cells: u32, x: u32, step: u32, out: &mut [u32]) {
    flood_rows(nearest, cells, x, step, out);
}

/// [`flood_plane`] row by row, for whatever vectors the caller's instructions have.
#[inline(always)]
fn flood_rows(nearest: &[u32], cells: u32, x: u32, step: u32, out: &mut [u32]) {
    let around =
        |at: u32| [at.checked_sub(step), Some(at), Some(at + step).filter(|&at| at < cells)].into_iter().flatten();
    let (row, step) = (cells as usize, step as usize);
    // Squared distances of the best so far; of equal ones the lower cell is it. Signed: vectors compare no others.
    let mut best = vec![i32::MAX; row];
    for (y, out) in (0..cells).zip(out.chunks_mut(row)) {
        best.fill(i32::MAX);
        out.fill(NO_SEED);
        for first in around(x).flat_map(|nx| around(y).map(move |ny| ((nx * cells + ny) * cells) as usize)) {
            let given = &nearest[first..first + row];
            let mut ask = |low: usize, seeds: &[u32]| {
                let own = best[low..].iter_mut().zip(&mut out[low..]);
                for (z, ((best, out), &seed)) in (low as u32..).zip(own.zip(seeds)) {
                    let found = if seed == NO_SEED { i32::MAX } else { squared([x, y, z], seed) as i32 };
                    let is_nearer = (found < *best) | ((found == *best) & ((seed as i32) < *out as i32));
                    (*best, *out) = if is_nearer { (found, seed) } else { (*best, *out) };
                }
            };
            ask(0, given);
            ask(step, &given[..row - step]);
            ask(0, &given[step..]);
        }
    }
}
