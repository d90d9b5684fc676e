//! Items against bricks, each brick once: rays or half-lines that meet all that lies on their way.
//!
//! Bricks are taken by runs that the cache holds together. For a run all items walk the top level, those of a chunk at
//! a time, and are sorted by the bricks that they enter. So a batch reads a brick once, however many items enter it, if
//! the cache has 8 MiB or more. Memory does not grow with the batch.

use super::space::{Meets, Placed, Top};
use super::{Queries, Watch};
use crate::stream::Item;
use anyhow::Result;
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

    /// Notes what an item meets in a leaf. `open` is room to work in.
    fn meet(&self, item: usize, leaf: u32, brick: &Placed, open: &mut Vec<u32>, found: &mut Vec<Self::Found>);
}

/// An item and a leaf that it is to meet, in the order in which they are taken.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Pair {
    /// The brick of the leaf.
    pub(super) brick: u32,
    /// The leaf.
    pub(super) leaf: u32,
    /// The item's number among those that are taken together.
    pub(super) item: u32,
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
        let top = Top::new(resident);
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
                            pairs.push(Pair { brick, leaf, item: (item - first) as u32 });
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
                self.at_leaves(
                    &pairs,
                    |item, leaf, brick, open, found| sweep.meet(first + item as usize, leaf, brick, open, found),
                    take,
                    watch,
                )?;
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

    /// Calls `meet` for sorted pairs, with room to work in and a list for what it finds, on all threads. Then hands
    /// what was found to `take`, in the order of pairs. Each brick is read once.
    ///
    /// # Errors
    /// A damaged brick; what `watch` says.
    pub(super) fn at_leaves<O: Default, F: Send>(
        &self,
        pairs: &[Pair],
        meet: impl Fn(u32, u32, &Placed, &mut O, &mut Vec<F>) + Sync,
        take: &mut dyn FnMut(F),
        watch: &mut Watch,
    ) -> Result<()> {
        let resident = self.scene.resident();
        let groups: Vec<&[Pair]> = pairs.chunk_by(|a, b| a.brick == b.brick).collect();
        let items: Vec<Item> = groups.iter().map(|group| Item::geometry(group[0].brick)).collect();
        self.store.for_each(&items, |place, payloads| {
            let task = |(pairs, payload): (&[Pair], &Arc<[u8]>)| {
                let (mut found, mut open) = (Vec::new(), O::default());
                for of_leaf in pairs.chunk_by(|a, b| a.leaf == b.leaf) {
                    let leaf = of_leaf[0].leaf;
                    let brick = Placed::new(resident, leaf, payload);
                    for pair in of_leaf {
                        meet(pair.item, leaf, &brick, &mut open, &mut found);
                    }
                }
                found
            };
            let found: Vec<Vec<F>> = self.threads.install(|| {
                let of_payloads = payloads.par_iter().zip(&groups[place..place + payloads.len()]);
                let tasks = of_payloads.flat_map(|(payload, group)| group.par_chunks(TASK).map(move |p| (p, payload)));
                tasks.map(task).collect()
            });
            found.into_iter().flatten().for_each(&mut *take);
            watch(0)
        })
    }
}
