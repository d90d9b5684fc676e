//! How far what is empty reaches: what walks through a map may pass over without looking.

use super::Bom;

/// Cells of a block on each axis.
pub const BLOCK_CELLS: u32 = 4;

/// Bytes of the [`clearance`] of a map of so many cells on each axis.
pub fn clearance_bytes(cells: u32) -> usize {
    ((cells / BLOCK_CELLS) as usize).pow(3)
}

/// Of every block of [`BLOCK_CELLS`]³ cells of a map, blocks along x first, then y, z fastest: the number of blocks to
/// the nearest one with an occupied cell, by the axis on which they are furthest apart; 255 where there is none within
/// so many.
///
/// From a cell of a block whose number is k > 0, every cell that is at most [`BLOCK_CELLS`] (k - 1) cells away on every
/// axis is empty.
pub fn clearance(map: &Bom) -> Vec<u8> {
    let n = map.cells();
    let side = (n / BLOCK_CELLS) as usize;
    // A row of blocks along z is a word.
    let mut reached = vec![0u64; side * side];
    for y in 0..n {
        for x in 0..n {
            let column = (x + n * y) * (n / 32);
            let row = &mut reached[(x / BLOCK_CELLS) as usize * side + (y / BLOCK_CELLS) as usize];
            for w in 0..n / 32 {
                let word = map.words()[(column + w) as usize];
                for block in 0..32 / BLOCK_CELLS {
                    let is_any = word >> (BLOCK_CELLS * block) & ((1 << BLOCK_CELLS) - 1) != 0;
                    *row |= u64::from(is_any) << (32 / BLOCK_CELLS * w + block);
                }
            }
        }
    }
    let whole = u64::MAX >> (64 - side);
    let mut distances = vec![255u8; side * side * side];
    let mut before = vec![0u64; side * side];
    for distance in 0..255u8 {
        let mut is_new = false;
        for (i, (&now, before)) in reached.iter().zip(&mut before).enumerate() {
            let mut fresh = now & !*before;
            is_new |= fresh != 0;
            while fresh != 0 {
                distances[i * side + fresh.trailing_zeros() as usize] = distance;
                fresh &= fresh - 1;
            }
            *before = now;
        }
        if !is_new {
            break;
        }
        let along_z: Vec<u64> = reached.iter().map(|row| (row | row << 1 | row >> 1) & whole).collect();
        let around = |i: usize, last: usize| (i.saturating_sub(1)..=(i + 1).min(last)).collect::<Vec<_>>();
        let all = |rows: &[u64], places: &mut dyn Iterator<Item = usize>| places.fold(0, |all, i| all | rows[i]);
        let along_y: Vec<u64> = (0..side * side)
            .map(|i| all(&along_z, &mut around(i % side, side - 1).into_iter().map(|y| i / side * side + y)))
            .collect();
        reached = (0..side * side)
            .map(|i| all(&along_y, &mut around(i / side, side - 1).into_iter().map(|x| x * side + i % side)))
            .collect();
    }
    distances
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_distance_to_the_nearest_occupied_block() {
        let mut state = 5u64;
        let mut random = |n: u32| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as u32 % n
        };
        for cells in [32, 64, 256] {
            let mut map = Bom::new(cells, 0, [0; 3]);
            assert!(clearance(&map).iter().all(|&distance| distance == 255), "nothing is near");
            let occupied: Vec<[u32; 3]> = (0..3).map(|_| [0; 3].map(|_| random(cells))).collect();
            occupied.iter().for_each(|&cell| map.occupy(cell));
            let side = cells / BLOCK_CELLS;
            let found = clearance(&map);
            for x in 0..side {
                for y in 0..side {
                    for z in 0..side {
                        let apart = |cell: &[u32; 3]| {
                            let block = cell.map(|x| x / BLOCK_CELLS);
                            block[0].abs_diff(x).max(block[1].abs_diff(y)).max(block[2].abs_diff(z))
                        };
                        let nearest = occupied.iter().map(apart).min();
                        assert_eq!(Some(u32::from(found[((x * side + y) * side + z) as usize])), nearest);
                    }
                }
            }
        }
    }
}
