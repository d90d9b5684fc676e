//! Splits items that do not fit in memory: the same cuts as `partition` makes, in passes over files.

use crate::build::cut::partition::{Bins, Bounds, Cut, Item, least_side, longest_axis};
use crate::build::disk::journal::{WordReader, Words};
use crate::build::disk::shard::{Blocks, ShardWriter};
use crate::build::error::BuildError;
use bytemuck::{Pod, Zeroable};
use rayon::prelude::*;

/// Bits of the key of an item that one pass over its file decides on.
const DIGIT_BITS: u32 = 16;

/// An [`Item`] on the disk.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C, packed(4))]
pub(super) struct PackedItem {
    min: [f64; 3],
    max: [f64; 3],
    index: u32,
}

impl From<&Item> for PackedItem {
    fn from(&Item { min, max, index }: &Item) -> Self {
        Self { min, max, index }
    }
}

impl From<&PackedItem> for Item {
    fn from(&PackedItem { min, max, index }: &PackedItem) -> Self {
        Self { min, max, index }
    }
}

/// Items on the disk that are to be cut.
#[derive(Clone, Debug)]
pub(super) struct Node {
    /// Names of its shards.
    pub shards: Vec<String>,
    /// Number of items.
    pub count: u64,
    /// Bounds of twice their centroids.
    pub centroids: Bounds,
}

/// Appends items.
pub(super) fn append(items: &[Item], shard: &ShardWriter) -> Result<(), BuildError> {
    shard.append_all(0, &items.iter().map(PackedItem::from).collect::<Vec<_>>())
}

fn read(blocks: &Blocks<PackedItem>, block: usize) -> Result<Vec<Item>, BuildError> {
    let mut packed = Vec::new();
    blocks.read(block, &mut packed)?;
    Ok(packed.iter().map(Item::from).collect())
}

/// Reads all items.
pub(super) fn load(blocks: &Blocks<PackedItem>) -> Result<Vec<Item>, BuildError> {
    let mut items = Vec::with_capacity(blocks.records() as usize);
    let mut packed = Vec::new();
    for block in 0..blocks.len() {
        packed.clear();
        blocks.read(block, &mut packed)?;
        items.extend(packed.iter().map(Item::from));
    }
    Ok(items)
}

/// Folds all items, in no particular order.
fn fold<A: Clone + Send + Sync>(
    blocks: &Blocks<PackedItem>,
    empty: A,
    add: impl Fn(A, &[Item]) -> A + Sync,
    merge: impl Fn(A, A) -> A + Sync + Send,
) -> Result<A, BuildError> {
    let of_block = |block| Ok(add(empty.clone(), &read(blocks, block)?));
    (0..blocks.len()).into_par_iter().map(of_block).try_reduce(|| empty.clone(), |a, b| Ok(merge(a, b)))
}

/// Where items are split.
pub(super) enum Place {
    /// Between bins.
    Bin(Cut),
    /// Below this key along an axis.
    Key(usize, u128),
}

impl Place {
    fn is_left(&self, item: &Item) -> bool {
        match self {
            Self::Bin(cut) => cut.is_left(item),
            Self::Key(axis, middle) => key(item, *axis) < *middle,
        }
    }
}

/// Counts items into the bins of a node.
pub(super) fn count(node: &Node, blocks: &Blocks<PackedItem>) -> Result<Bins, BuildError> {
    fold(blocks, Bins::new(&node.centroids), |bins, items| bins.count(items), Bins::merge)
}

/// Where `partition` would split the items of `node`: after its bins, if these have a cut, what of it is to be noted.
/// `blocks` are all its items, which are read only if it has none.
pub(super) fn place(
    node: &Node,
    bins: &Bins,
    blocks: impl FnOnce() -> Result<Blocks<PackedItem>, BuildError>,
    words: &mut Words,
) -> Result<(), BuildError> {
    bins.put(words);
    let middle = match bins.cheapest(node.count as usize, least_side(node.count as usize)) {
        Some(_) => 0,
        None => key_of_rank(&blocks()?, longest_axis(&node.centroids), node.count / 2)?,
    };
    words.put(middle as u64).put((middle >> 64) as u64);
    Ok(())
}

/// The place that was noted.
pub(super) fn take_place(node: &Node, words: &mut WordReader) -> Option<Place> {
    let bins = Bins::take(words, &node.centroids)?;
    let middle = u128::from(words.take()?) | u128::from(words.take()?) << 64;
    let cut = bins.cheapest(node.count as usize, least_side(node.count as usize));
    Some(cut.map_or_else(|| Place::Key(longest_axis(&node.centroids), middle), Place::Bin))
}

/// Appends the items to the left of a place to the first shard and the others to the second. Returns for both how many
/// there are and the bounds of twice their centroids.
pub(super) fn separate(
    blocks: &Blocks<PackedItem>,
    to: [&ShardWriter; 2],
    place: &Place,
) -> Result<[(u64, Bounds); 2], BuildError> {
    let of_block = |block| {
        let mut sides = [(0, Bounds::EMPTY); 2];
        let (left, right): (Vec<Item>, Vec<Item>) = read(blocks, block)?.iter().partition(|item| place.is_left(item));
        for ((side, items), to) in sides.iter_mut().zip([left, right]).zip(to) {
            side.0 += items.len() as u64;
            items.iter().map(Item::centroids2).for_each(|centroid| side.1.extend(centroid, centroid));
            append(&items, to)?;
        }
        Ok(sides)
    };
    let merge = |a: [(u64, Bounds); 2], b: [(u64, Bounds); 2]| {
        Ok(std::array::from_fn(|side| (a[side].0 + b[side].0, a[side].1.union(b[side].1))))
    };
    (0..blocks.len()).into_par_iter().map(of_block).try_reduce(|| [(0, Bounds::EMPTY); 2], merge)
}

/// A number whose order is that of centroids along an axis, of equal ones that of indices.
fn key(item: &Item, axis: usize) -> u128 {
    let bits = item.centroid2(axis).to_bits();
    // The order of `f64::total_cmp`.
    let ordered = bits ^ if bits >> 63 != 0 { u64::MAX } else { 1 << 63 };
    u128::from(ordered) << 32 | u128::from(item.index)
}

/// The key that exactly `rank` of the items are below: digit by digit from the highest.
fn key_of_rank(blocks: &Blocks<PackedItem>, axis: usize, mut rank: u64) -> Result<u128, BuildError> {
    let (mut prefix, mut shift) = (0u128, 96);
    while shift > 0 {
        shift -= DIGIT_BITS;
        let add = |mut counts: Vec<u64>, items: &[Item]| {
            for key in items.iter().map(|item| key(item, axis)).filter(|key| key >> (shift + DIGIT_BITS) == prefix) {
                counts[(key >> shift) as usize & ((1 << DIGIT_BITS) - 1)] += 1;
            }
            counts
        };
        let merge = |mut a: Vec<u64>, b: Vec<u64>| {
            a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
            a
        };
        let counts = fold(blocks, vec![0u64; 1 << DIGIT_BITS], add, merge)?;
        let mut digit = 0;
        while digit + 1 < counts.len() && rank >= counts[digit] {
            rank -= counts[digit];
            digit += 1;
        }
        prefix = prefix << DIGIT_BITS | digit as u128;
    }
    Ok(prefix)
}
