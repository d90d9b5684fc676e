//! Whether surfaces are closed, by one pass over all bricks that keeps a few numbers an object.
//!
//! Every triangle adds the hash of each of its edges, from vertex to vertex, and takes away that of the same edge the
//! other way round. The sum is zero if each edge is met as often in one direction as in the other: the surface is
//! closed and turned one way. Whether every edge is met an even number of times is told in the same manner by what the
//! edges, taken without direction, come to by exclusive or. Vertices are the same where they are on the lattice. Sums
//! of 128 bits that are zero by chance are as rare as hashes that are equal.

use super::Queries;
use crate::kernels::payloads::BrickView;
use crate::stream::Item;
use anyhow::Result;
use bricks::{Brick, Resident};
use rayon::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use xxhash_rust::xxh3::xxh3_128;

/// What is known of an object's surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Surface {
    /// Whether every edge is met by an even number of triangles.
    pub is_closed: bool,
    /// Whether every edge is met as often in either direction; such a surface is closed.
    pub is_turned: bool,
}

/// What edges add up to.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    directed: u128,
    parity: u128,
}

impl Sums {
    fn and(self, other: Self) -> Self {
        Self { directed: self.directed.wrapping_add(other.directed), parity: self.parity ^ other.parity }
    }

    fn add_edge(&mut self, from: [i64; 3], to: [i64; 3]) {
        if from == to {
            return;
        }
        let (low, high) = if from < to { (from, to) } else { (to, from) };
        let hash = xxh3_128(bytemuck::bytes_of(&[low, high]));
        self.parity ^= hash;
        self.directed = if from < to { self.directed.wrapping_add(hash) } else { self.directed.wrapping_sub(hash) };
    }

    fn add_triangle(&mut self, [a, b, c]: [[i64; 3]; 3]) {
        self.add_edge(a, b);
        self.add_edge(b, c);
        self.add_edge(c, a);
    }
}

/// Which triangles of an object have been met, where some lie in several bricks.
struct Seen(Vec<AtomicU32>);

impl Seen {
    /// Whether this is the first time.
    fn note(&self, id: u32) -> bool {
        let Some(word) = self.0.get(id as usize / 32) else { return true };
        word.fetch_or(1 << (id % 32), Ordering::Relaxed) >> (id % 32) & 1 == 0
    }
}

/// The edges of a brick's triangles that `seen` has not met.
fn of_brick(resident: &Resident, brick: &Brick, geometry: &[u8], seen: &Seen) -> Sums {
    let object = &resident.objects[brick.object as usize];
    let steps = f64::from(object.unit_log2 - object.step_log2).exp2();
    let view = BrickView::new(brick, geometry, &[]);
    let mut sums = Sums::default();
    for triangle in 0..brick.triangle_count {
        if seen.note(view.ids[triangle as usize]) {
            // Vertices lie on the lattice, so these are whole numbers.
            let vertex = |corner: [f64; 3]| std::array::from_fn(|k| brick.origin[k] + (corner[k] * steps) as i64);
            sums.add_triangle(view.corners(triangle).map(vertex));
        }
    }
    sums
}

/// Whether some triangle of the scene lies in several bricks.
pub(super) fn has_copies(resident: &Resident) -> bool {
    resident.objects.iter().any(|object| {
        let first = object.first_brick as usize;
        let own = &resident.bricks[first..first + object.brick_count as usize];
        own.iter().map(|brick| u64::from(brick.triangle_count)).sum::<u64>() > u64::from(object.triangle_count)
    })
}

impl Queries {
    /// What is known of the surface of each object, by one pass over all geometry the first time.
    ///
    /// # Errors
    /// A damaged brick.
    pub fn surfaces(&self) -> Result<&[Surface]> {
        if let Some(known) = self.surfaces.get() {
            return Ok(known);
        }
        let resident = self.scene.resident();
        let mut all = Vec::with_capacity(resident.objects.len());
        for object in &resident.objects {
            let words = if self.has_copies { object.triangle_ids.div_ceil(32) } else { 0 };
            let seen = Seen((0..words).map(|_| AtomicU32::new(0)).collect());
            let items: Vec<Item> =
                (object.first_brick..object.first_brick + object.brick_count).map(Item::geometry).collect();
            let mut sums = Sums::default();
            self.store.for_each(&items, |place, payloads| {
                let one = |(payload, item): (&Arc<[u8]>, &Item)| {
                    of_brick(resident, &resident.bricks[item.number as usize], payload, &seen)
                };
                let own = self
                    .threads
                    .install(|| payloads.par_iter().zip(&items[place..]).map(one).reduce(Sums::default, Sums::and));
                sums = sums.and(own);
                Ok(())
            })?;
            all.push(Surface { is_closed: sums.parity == 0, is_turned: sums.parity == 0 && sums.directed == 0 });
        }
        Ok(self.surfaces.get_or_init(|| all))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TETRAHEDRON: [[usize; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
    const CORNERS: [[i64; 3]; 4] = [[0, 0, 0], [5, 0, 0], [0, 7, 0], [0, 0, 9]];

    fn sums(triangles: &[[usize; 3]]) -> [bool; 2] {
        let mut sums = Sums::default();
        triangles.iter().for_each(|triangle| sums.add_triangle(triangle.map(|i| CORNERS[i])));
        [sums.parity == 0, sums.directed == 0]
    }

    #[test]
    fn closed_turned_and_open() {
        assert_eq!(sums(&TETRAHEDRON), [true, true]);
        let [a, b, c, d] = TETRAHEDRON;
        assert_eq!(sums(&[a, b, c]), [false, false]);
        let [i, j, k] = d;
        assert_eq!(sums(&[a, b, c, [j, i, k]]), [true, false], "one is turned round");
        assert_eq!(sums(&[c, [1, 1, 2], a, [j, k, i], b]), [true, true], "a triangle that is an edge");
        assert_eq!(sums(&[a, [c[0], c[2], c[1]], c, a]), [true, false]);
    }
}
