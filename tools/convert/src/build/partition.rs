//! Cuts the triangles of an object into bricks: top-down, binned SAH on the centroids of their boxes, each triangle in
//! exactly one part.
//!
//! A few triangles that are much larger than the others of their part would make its box, and with it the number of rays
//! that need it, as large as themselves. They are taken out of all parts and make up parts of their own.
//!
//! Where the cut goes depends on the triangles alone, not on how many a brick may hold, so parts for different limits are
//! levels of one tree. That tree cut at [`CANONICAL_TRIANGLES`] gives the extents from which the lattice follows.

use rayon::prelude::*;
use std::ops::Range;

/// Triangles of the chunks from whose extents the lattice follows, whatever a brick may hold.
pub(super) const CANONICAL_TRIANGLES: usize = 16384;

/// Bins per axis.
const BINS: usize = 16;

/// Items above which one node is examined by several threads.
const PARALLEL_ITEMS: usize = 1 << 16;

/// Below this, subtrees are not worth a task of their own.
const TASK_ITEMS: usize = 1 << 12;

/// A side of a cut holds at least this part of the items, which bounds the depth and keeps bricks filled.
const LEAST_SIDE: usize = 16;

/// How many times cheaper a part must get for its large items to be taken out.
const LARGE_GAIN: f64 = 1.5;

/// How many times smaller parts of large items are.
const LARGE_PARTS: usize = 64;

/// The box of a triangle or of a leaf.
#[derive(Clone, Copy, Debug)]
pub(super) struct Item {
    /// Least coordinates.
    pub min: [f64; 3],
    /// Greatest coordinates.
    pub max: [f64; 3],
    /// What it is the box of; distinct among the items.
    pub index: u32,
}

impl Item {
    /// Twice the centroid.
    fn centroid2(&self, axis: usize) -> f64 {
        self.min[axis] + self.max[axis]
    }
}

/// Bounds of boxes or points.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    /// Least coordinates; above [`Self::max`] when empty.
    pub min: [f64; 3],
    /// Greatest coordinates.
    pub max: [f64; 3],
}

impl Bounds {
    /// Of nothing.
    pub const EMPTY: Self = Self { min: [f64::INFINITY; 3], max: [f64::NEG_INFINITY; 3] };

    /// Extends to contain a box.
    pub fn extend(&mut self, min: [f64; 3], max: [f64; 3]) {
        for k in 0..3 {
            self.min[k] = self.min[k].min(min[k]);
            self.max[k] = self.max[k].max(max[k]);
        }
    }

    fn union(mut self, other: Self) -> Self {
        self.extend(other.min, other.max);
        self
    }

    /// Largest extent over the axes.
    pub fn extent(&self) -> f64 {
        (0..3).map(|k| self.max[k] - self.min[k]).fold(0.0, f64::max)
    }

    fn half_area(&self) -> f64 {
        let [x, y, z] = std::array::from_fn(|k| self.max[k] - self.min[k]);
        x * y + y * z + z * x
    }
}

/// The parts of an object, as ranges of the reordered items, in order.
#[derive(Debug, Default)]
pub(super) struct Parts {
    /// Parts of at most the number of items asked for.
    pub bricks: Vec<Range<u32>>,
    /// Largest extents of the parts of at most [`CANONICAL_TRIANGLES`] items.
    pub extents: Vec<f64>,
}

/// Cuts `items`, reordering them, into parts of at most `limit` (at least 1).
pub(super) fn partition(items: &mut Vec<Item>, limit: usize) -> Parts {
    if items.is_empty() {
        return Parts::default();
    }
    let mut parts = descend(items, 0, limit, false, false);
    separate_large(items, &mut parts.bricks, limit);
    parts
}

/// Moves the items that are too large for their parts into parts of their own, at the end.
fn separate_large(items: &mut Vec<Item>, parts: &mut Vec<Range<u32>>, limit: usize) {
    let mut slices = Vec::with_capacity(parts.len());
    let mut rest = items.as_mut_slice();
    for part in parts.iter() {
        let (slice, after) = rest.split_at_mut(part.len());
        slices.push(slice);
        rest = after;
    }
    let kept: Vec<usize> = slices.into_par_iter().map(move_large_to_end).collect();
    if kept.iter().zip(parts.iter()).all(|(kept, part)| *kept == part.len()) {
        return;
    }
    let (mut reordered, mut large) = (Vec::with_capacity(items.len()), Vec::new());
    for (part, kept) in parts.iter_mut().zip(kept) {
        let slice = &items[part.start as usize..part.end as usize];
        let start = reordered.len() as u32;
        reordered.extend_from_slice(&slice[..kept]);
        large.extend_from_slice(&slice[kept..]);
        *part = start..reordered.len() as u32;
    }
    // Small, so that far apart ones do not share a part. Canonical extents are those from before, whatever the limit is.
    let limit = limit.div_ceil(LARGE_PARTS);
    parts.extend(descend(&mut large, reordered.len(), limit, false, true).bricks);
    reordered.append(&mut large);
    *items = reordered;
}

/// Moves the items without which the others are at least [`LARGE_GAIN`] times cheaper to the end; returns how many stay.
fn move_large_to_end(items: &mut [Item]) -> usize {
    let most = items.len() / LEAST_SIDE;
    if most == 0 {
        return items.len();
    }
    let extent = |item: &Item| Bounds { min: item.min, max: item.max }.extent();
    let by_extent = |a: &Item, b: &Item| extent(a).total_cmp(&extent(b)).then(a.index.cmp(&b.index));
    let sure = items.len() - most;
    items.select_nth_unstable_by(sure, by_extent);
    items[sure..].sort_unstable_by(by_extent);
    let mut small = bounds(&items[..sure]).0;
    let mut costs = Vec::with_capacity(most);
    let all = bounds(items).0.half_area();
    for (kept, item) in (sure..).zip(&items[sure..]) {
        costs.push((kept as f64 * small.half_area() + (items.len() - kept) as f64 * all, kept));
        small.extend(item.min, item.max);
    }
    // The last of the cheapest: as few items as possible are moved.
    let (cost, kept) =
        costs.into_iter().fold((f64::INFINITY, 0), |best, next| if next.0 <= best.0 { next } else { best });
    if cost * LARGE_GAIN <= items.len() as f64 * all { kept } else { items.len() }
}

fn descend(items: &mut [Item], first: usize, limit: usize, mut is_brick: bool, mut is_chunk: bool) -> Parts {
    let mut parts = Parts::default();
    if !is_brick && items.len() <= limit {
        is_brick = true;
        parts.bricks.push(first as u32..(first + items.len()) as u32);
    }
    if !is_chunk && items.len() <= CANONICAL_TRIANGLES {
        is_chunk = true;
        parts.extents.push(bounds(items).0.extent());
    }
    if is_brick && is_chunk {
        return parts;
    }
    let middle = split(items, items.len().div_ceil(LEAST_SIDE), false);
    let (left, right) = items.split_at_mut(middle);
    let is_task = left.len() + right.len() > TASK_ITEMS;
    let mut left = move || descend(left, first, limit, is_brick, is_chunk);
    let mut right = move || descend(right, first + middle, limit, is_brick, is_chunk);
    let (left, right) = if is_task { rayon::join(left, right) } else { (left(), right()) };
    for side in [left, right] {
        parts.bricks.extend(side.bricks);
        parts.extents.extend(side.extents);
    }
    parts
}

/// Reorders at least two items so that a cut lies at the returned index, with at least `least_side` items (at most half)
/// on either side: by SAH over bins, or at the median if that finds no cut or `median` is set.
#[inline(never)]
pub(super) fn split(items: &mut [Item], least_side: usize, median: bool) -> usize {
    let (_, centroids) = bounds(items);
    let cut = if median { None } else { sah_cut(items, &centroids, least_side) };
    if let Some(cut) = cut {
        let middle = cut.apply(items);
        if middle >= least_side && items.len() - middle >= least_side {
            return middle;
        }
    }
    let axis = (0..3).fold(0, |best, k| {
        let extent = |k: usize| centroids.max[k] - centroids.min[k];
        if extent(k) > extent(best) { k } else { best }
    });
    let middle = items.len() / 2;
    items.select_nth_unstable_by(middle, |a, b| {
        a.centroid2(axis).total_cmp(&b.centroid2(axis)).then(a.index.cmp(&b.index))
    });
    middle
}

/// Bounds of the boxes, and of twice their centroids.
pub(super) fn bounds(items: &[Item]) -> (Bounds, Bounds) {
    let of = |items: &[Item]| {
        let mut all = (Bounds::EMPTY, Bounds::EMPTY);
        for item in items {
            all.0.extend(item.min, item.max);
            let centroid = std::array::from_fn(|k| item.centroid2(k));
            all.1.extend(centroid, centroid);
        }
        all
    };
    if items.len() <= PARALLEL_ITEMS {
        return of(items);
    }
    // Minima and maxima do not depend on the order in which threads combine them.
    let join = |a: (Bounds, Bounds), b: (Bounds, Bounds)| (a.0.union(b.0), a.1.union(b.1));
    items.par_chunks(PARALLEL_ITEMS / 4).map(of).reduce(|| (Bounds::EMPTY, Bounds::EMPTY), join)
}

/// Assigns centroids to bins.
#[derive(Clone, Copy)]
struct Binning {
    axis: usize,
    low: f64,
    scale: f64,
}

impl Binning {
    fn bin(&self, item: &Item) -> usize {
        // A cast of NaN gives bin 0, of infinity the last one.
        (((item.centroid2(self.axis) - self.low) * self.scale) as usize).min(BINS - 1)
    }
}

/// Bins below `bin` go left.
struct Cut {
    binning: Binning,
    bin: usize,
}

impl Cut {
    /// Moves the left items to the front; returns their number.
    fn apply(&self, items: &mut [Item]) -> usize {
        let (mut low, mut high) = (0, items.len());
        while low < high {
            if self.binning.bin(&items[low]) < self.bin {
                low += 1;
            } else {
                high -= 1;
                items.swap(low, high);
            }
        }
        low
    }
}

#[derive(Clone, Copy)]
struct Bin {
    count: usize,
    bounds: Bounds,
}

type Bins = [[Bin; BINS]; 3];

fn sah_cut(items: &[Item], centroids: &Bounds, least_side: usize) -> Option<Cut> {
    let binnings: [Binning; 3] = std::array::from_fn(|axis| {
        let (low, high) = (centroids.min[axis], centroids.max[axis]);
        Binning { axis, low, scale: if high > low { BINS as f64 / (high - low) } else { 0.0 } }
    });
    let empty: Bins = [[Bin { count: 0, bounds: Bounds::EMPTY }; BINS]; 3];
    let fill = |items: &[Item]| {
        let mut bins = empty;
        for item in items {
            for (bins, binning) in bins.iter_mut().zip(&binnings) {
                let bin = &mut bins[binning.bin(item)];
                bin.count += 1;
                bin.bounds.extend(item.min, item.max);
            }
        }
        bins
    };
    let bins = if items.len() <= PARALLEL_ITEMS {
        fill(items)
    } else {
        // Counts, minima and maxima do not depend on the order in which threads combine them.
        let merge = |mut a: Bins, b: Bins| {
            for (a, b) in a.iter_mut().flatten().zip(b.iter().flatten()) {
                *a = Bin { count: a.count + b.count, bounds: a.bounds.union(b.bounds) };
            }
            a
        };
        items.par_chunks(PARALLEL_ITEMS / 4).map(fill).reduce(|| empty, merge)
    };
    let mut best: Option<(f64, Cut)> = None;
    for (bins, binning) in bins.iter().zip(binnings) {
        if binning.scale == 0.0 {
            continue;
        }
        let mut right_costs = [0.0; BINS];
        let mut right = Bin { count: 0, bounds: Bounds::EMPTY };
        for bin in (1..BINS).rev() {
            right = Bin { count: right.count + bins[bin].count, bounds: right.bounds.union(bins[bin].bounds) };
            right_costs[bin] = if right.count > 0 { right.count as f64 * right.bounds.half_area() } else { 0.0 };
        }
        let mut left = Bin { count: 0, bounds: Bounds::EMPTY };
        for bin in 1..BINS {
            left = Bin { count: left.count + bins[bin - 1].count, bounds: left.bounds.union(bins[bin - 1].bounds) };
            if left.count < least_side || items.len() - left.count < least_side {
                continue;
            }
            let cost = left.count as f64 * left.bounds.half_area() + right_costs[bin];
            if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                best = Some((cost, Cut { binning, bin }));
            }
        }
    }
    best.map(|(_, cut)| cut)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scattered(count: u32) -> Vec<Item> {
        let mut state = 7u64;
        let mut next = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 40) as f64 / (1 << 24) as f64
        };
        (0..count)
            .map(|index| {
                let min = [next() * 100.0, next() * 10.0, next()];
                Item { min, max: min.map(|x| x + next() * 0.1), index }
            })
            .collect()
    }

    fn check(items: &mut Vec<Item>, limit: usize) -> Parts {
        let count = items.len();
        let parts = partition(items, limit);
        let mut end = 0;
        for range in &parts.bricks {
            assert!(range.start == end && !range.is_empty() && range.len() <= limit);
            end = range.end;
        }
        assert_eq!(end as usize, count, "every item in exactly one part");
        let mut indices: Vec<u32> = items.iter().map(|item| item.index).collect();
        indices.sort_unstable();
        assert!(indices.iter().zip(0..).all(|(&index, i)| index == i), "a permutation");
        parts
    }

    #[test]
    fn parts_cover_and_are_compact() {
        let mut items = scattered(100_000);
        let parts = check(&mut items, 1000);
        assert!(parts.bricks.len() < 300, "{} parts", parts.bricks.len());
        let area = |range: &Range<u32>| bounds(&items[range.start as usize..range.end as usize]).0.half_area();
        let total: f64 = parts.bricks.iter().map(area).sum();
        let scattered = scattered(100_000);
        let unsorted: f64 = scattered.chunks(1000).map(|items| bounds(items).0.half_area()).sum();
        assert!(total < unsorted / 20.0, "{total} against {unsorted} without a partition");
    }

    #[test]
    fn large_items_have_parts_of_their_own() {
        let mut items = scattered(20_000);
        let large = |index| Item { min: [-50.0, -1.0, -1.0], max: [150.0, 11.0, 2.0], index };
        items.extend((20_000..20_030).map(large));
        let mut plain = items.clone();
        let total = |items: &[Item], parts: &[Range<u32>]| -> f64 {
            let area = |range: &Range<u32>| bounds(&items[range.start as usize..range.end as usize]).0.half_area();
            parts.iter().map(area).sum()
        };
        let without = descend(&mut plain, 0, 1000, false, false).bricks;
        let parts = check(&mut items, 1000);
        let of_large = |range: &Range<u32>| {
            let items = &items[range.start as usize..range.end as usize];
            items.iter().filter(|item| item.index >= 20_000).count()
        };
        let mixed = parts.bricks.iter().filter(|range| ![0, range.len()].contains(&of_large(range))).count();
        assert_eq!(mixed, 0);
        assert!(total(&items, &parts.bricks) < 2.0 * total(&plain, &without), "parts of large items are few");
        let mut few = scattered(20_000);
        let before = descend(&mut few.clone(), 0, 1000, false, false).bricks;
        assert_eq!(check(&mut few, 1000).bricks, before, "without large items nothing changes");
    }

    #[test]
    fn the_limit_does_not_move_canonical_extents() {
        let extents = |limit| {
            let mut extents = partition(&mut scattered(100_000), limit).extents;
            extents.sort_by(f64::total_cmp);
            extents
        };
        let expected = extents(16384);
        assert!(expected.len() >= 7);
        assert_eq!(extents(100), expected);
        assert_eq!(extents(70_000), expected);
        let mut other = scattered(100_000);
        other.truncate(90_000);
        assert_ne!(partition(&mut other, 100).extents.len(), 0);
        assert_ne!(extents(16384).len(), partition(&mut scattered(10_000), 100).extents.len());
    }

    #[test]
    fn equal_centroids_are_halved() {
        let one = Item { min: [1.0; 3], max: [2.0; 3], index: 0 };
        let mut items: Vec<Item> = (0..1_000_000).map(|index| Item { index, ..one }).collect();
        let parts = check(&mut items, 1000);
        assert_eq!(parts.bricks.len(), 1024);
    }

    #[test]
    fn a_geometric_series_stays_shallow() {
        let mut items: Vec<Item> = (0..200_000)
            .map(|index| {
                let x = 0.9999f64.powi(index as i32);
                Item { min: [x, 0.0, 0.0], max: [x, 1e-3, 1e-3], index }
            })
            .collect();
        let parts = check(&mut items, 4);
        assert!(parts.bricks.len() < 200_000);
    }

    #[test]
    fn threads_do_not_change_the_order() {
        let order = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut items = scattered(150_000);
            let bricks = pool.install(|| partition(&mut items, 500)).bricks;
            (bricks, items.iter().map(|item| item.index).collect::<Vec<_>>())
        };
        let one = order(1);
        assert_eq!(one, order(3));
        assert_ne!(one.1, (0..150_000).collect::<Vec<_>>());
    }
}
