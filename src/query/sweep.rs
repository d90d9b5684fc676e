//! Items against bricks, each brick once: rays or half-lines that meet all that lies on their way.
//!
//! Bricks are taken by runs that the cache holds together. For a run all items walk the top level, those of a chunk at
//! a time, and are sorted by the bricks that they enter. So a batch reads a brick once, however many items enter it, if
//! the cache has 8 MiB or more. Memory does not grow with the batch.

use super::room::Room;
use super::space::{Geometry, Meets, Placed};
use super::{Queries, Watch};
use crate::kernels::simd::isa::{Best, Isa, Work};
use crate::stream::Item;
use anyhow::Result;
use bricks::Resident;
use rayon::prelude::*;
use std::sync::Arc;

/// Pairs of an item and a leaf that are sorted at a time, about.
const MOST_PAIRS: usize = 4 << 20;
/// Items of the first chunk, before anything is known of how many leaves they enter.
const FIRST_CHUNK: usize = 64;
/// Items that go through a leaf on one thread.
const TASK: usize = 128;

/// What meets bricks.
pub(super) trait Sweep: Sync {
    /// What an item meets.
    type Found: Send;

    /// How an item asks boxes.
    type Asks: Meets;

    /// An item, as boxes are asked; `None`: it has its answer.
    fn asks(&self, item: usize) -> Option<Self::Asks>;

    /// Notes what an item meets in a leaf. Implementations are always inlined.
    fn meet<I: Isa>(&self, isa: I, item: usize, at: (u32, &Placed), room: &mut Room, found: &mut Vec<Self::Found>);
}

/// Items that meet leaves of one brick.
struct Task<'a, S> {
    sweep: &'a S,
    /// The number of the pairs' first item.
    first: usize,
    resident: &'a Resident,
    geometry: &'a Geometry<'a>,
    pairs: &'a [Pair],
}

impl<S: Sweep> Work for Task<'_, S> {
    type Out = Vec<S::Found>;

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> Vec<S::Found> {
        let (mut found, mut room) = (Vec::new(), Room::default());
        for of_leaf in self.pairs.chunk_by(|a, b| a.leaf == b.leaf) {
            let leaf = of_leaf[0].leaf;
            let brick = Placed::new(self.resident, leaf, self.geometry);
            for pair in of_leaf {
                let item = self.first + pair.item as usize;
                self.sweep.meet(isa, item, (leaf, &brick), &mut room, &mut found);
            }
        }
        found
    }
}

/// An item and a leaf that it is to meet, in the order in which they are taken.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Pair {
    /// The brick of the leaf.
    brick: u32,
    /// The leaf.
    leaf: u32,
    /// The item's number among those that are taken together.
    item: u32,
}

impl Queries {
    /// Hands all that `count` items meet to `take`, in an order that depends on the items alone.
    ///
    /// # Errors
    /// A damaged brick; what `watch` says.
    pub(super) fn sweep<S: Sweep>(
        &self,
        count: usize,
        sweep: &S,
        take: &mut dyn FnMut(S::Found),
        watch: &mut Watch,
    ) -> Result<()> {
        let resident = self.scene.resident();
        let top = self.top();
        let runs = self.store.runs();
        let (mut done, mut told) = (0u64, 0u64);
        for run in &runs {
            let marks = top.marked(|leaf| run.contains(&resident.leaves[leaf as usize].brick));
            let (mut first, mut size) = (0, FIRST_CHUNK);
            while first < count {
                let end = count.min(first + size);
                let add = |(mut pairs, mut open): (Vec<Pair>, Vec<u32>), item: usize| {
                    if let Some(asks) = sweep.asks(item) {
                        top.leaves(&marks, &asks, &mut open, |leaf| {
                            let brick = resident.leaves[leaf as usize].brick;
                            if run.contains(&brick) {
                                pairs.push(Pair { brick, leaf, item: (item - first) as u32 });
                            }
                        });
                    }
                    (pairs, open)
                };
                let pairs = self.threads.install(|| {
                    let parts = (first..end).into_par_iter().with_min_len(TASK).fold(Default::default, add);
                    let mut pairs = parts.map(|part| part.0).collect::<Vec<_>>().concat();
                    pairs.par_sort_unstable();
                    pairs
                });
                self.at_leaves(&pairs, sweep, first, take, watch)?;
                let each = (pairs.len() / (end - first)).max(1);
                done += (end - first) as u64;
                let all = done / runs.len() as u64;
                watch(all - told)?;
                told = all;
                first = end;
                size = (MOST_PAIRS / each).clamp(1, 4 * size);
            }
        }
        watch(count as u64 - told)
    }

    /// Has the items of sorted pairs, the first of which is `first`, meet their leaves on all threads, and hands what
    /// they find to `take`, in the order of pairs. Each brick is read once.
    fn at_leaves<S: Sweep>(
        &self,
        pairs: &[Pair],
        sweep: &S,
        first: usize,
        take: &mut dyn FnMut(S::Found),
        watch: &mut Watch,
    ) -> Result<()> {
        let (resident, isa) = (self.scene.resident(), Best::for_one());
        let groups: Vec<&[Pair]> = pairs.chunk_by(|a, b| a.brick == b.brick).collect();
        let items: Vec<Item> = groups.iter().map(|group| Item::geometry(group[0].brick)).collect();
        self.store.for_each(&items, |place, payloads| {
            let of_group = |(payload, group): (&Arc<[u8]>, &&[Pair])| -> Vec<Vec<S::Found>> {
                let geometry = Geometry::new(resident, group[0].brick, payload, &[]);
                let task = |pairs| isa.run(Task { sweep, first, resident, geometry: &geometry, pairs });
                group.par_chunks(TASK).map(task).collect()
            };
            let groups = &groups[place..place + payloads.len()];
            let found: Vec<_> =
                self.threads.install(|| payloads.par_iter().zip(groups).flat_map_iter(of_group).collect());
            found.into_iter().flatten().for_each(&mut *take);
            watch(0)
        })
    }
}
