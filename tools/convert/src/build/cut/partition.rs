//! Cuts the triangles of an object into bricks: top-down, binned SAH on the centroids of their boxes, each triangle in
//! exactly one part.
//!
//! A few triangles that are much larger than the others of their part would make its box, and with it the number of
//! rays that need it, as large as themselves. They are taken out of all parts and make up parts of their own. Rays meet
//! these as well, so the part has to get cheaper by a multiple.
//!
//! Where the cut goes depends on the triangles alone, not on how many a brick may hold, so parts for different limits
//! are levels of one tree. That tree cut at [`CANONICAL_TRIANGLES`] gives the extents from which the lattice follows.

use crate::build::disk::journal::{WordReader, Words};
use rayon::prelude::*;
use std::ops::Range;

/// Triangles of the chunks from whose extents the lattice follows, whatever a brick may hold.
pub(crate) const CANONICAL_TRIANGLES: usize = 16384;

/// Bins per axis.
const BINS: usize = 16;

/// Items above which one node is examined by several threads.
const PARALLEL_ITEMS: usize = 1 << 16;

/// Below this, subtrees are not worth a task of their own.
const TASK_ITEMS: usize = 1 << 12;

/// A side of a cut holds at least this part of the items, which bounds the depth and keeps bricks filled.
const LEAST_SIDE: usize = 16;

/// How many times smaller parts of large items are.
const LARGE_PARTS: usize = 64;

/// The box of a triangle or of a leaf.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Item {
    /// Least coordinates.
    pub min: [f64; 3],
    /// Greatest coordinates.
    pub max: [f64; 3],
    /// What it is the box of; distinct among the items.
    pub index: u32,
}

impl Item {
    /// Twice the centroid.
    pub fn centroid2(&self, axis: usize) -> f64 {
        self.min[axis] + self.max[axis]
    }

    /// Twice the centroid.
    pub fn centroids2(&self) -> [f64; 3] {
        std::array::from_fn(|axis| self.centroid2(axis))
    }
}

/// Bounds of boxes or points.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
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

    /// Of both.
    pub fn union(mut self, other: Self) -> Self {
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

/// How far items are cut.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rule {
    /// Most items of a part, at least 1.
    pub limit: usize,
    /// Whether the items are those of an object; otherwise they are the large ones that were taken out of its parts.
    /// From an object its canonical extents are taken, and the items that are too large for their parts.
    pub is_object: bool,
}

impl Rule {
    /// How the large items that were taken out of the parts are cut: into small parts, so that far apart ones do not
    /// share one.
    pub fn of_large(self) -> Self {
        Self { limit: self.limit.div_ceil(LARGE_PARTS), is_object: false }
    }

    /// How many times cheaper a part must get for its large items to be taken out: rays that meet a part of large items
    /// walk down its levels as well.
    fn large_gain(self) -> f64 {
        let levels = self.of_large().limit.next_power_of_two().ilog2().div_ceil(bricks::NODE_WIDTH.ilog2());
        1.0 + f64::from(levels.max(1))
    }
}

/// What items were cut into.
#[derive(Clone, Debug, Default)]
pub(crate) struct Cuts {
    /// Indices of the items, by part, ascending within each.
    pub order: Vec<u32>,
    /// Number of items of each part.
    pub parts: Vec<u32>,
    /// Largest extents of the parts of at most [`CANONICAL_TRIANGLES`] items.
    pub extents: Vec<f64>,
    /// Items that are too large for their parts, in no particular order.
    pub large: Vec<Item>,
}

/// Cuts items, reordering them. What comes out depends on the set of the items, not on their order.
pub(crate) fn cut(items: &mut [Item], rule: Rule) -> Cuts {
    if items.is_empty() {
        return Cuts::default();
    }
    let found = descend(items, 0, rule.limit, false, !rule.is_object);
    let mut slices = Vec::with_capacity(found.parts.len());
    let mut rest = items;
    for part in &found.parts {
        let (slice, after) = rest.split_at_mut(part.len());
        slices.push(slice);
        rest = after;
    }
    let finish = |slice: &mut [Item]| {
        let kept = if rule.is_object { move_large_to_end(slice, rule.large_gain()) } else { slice.len() };
        let mut order: Vec<u32> = slice[..kept].iter().map(|item| item.index).collect();
        order.sort_unstable();
        (order, slice[kept..].to_vec())
    };
    let finished: Vec<(Vec<u32>, Vec<Item>)> = slices.into_par_iter().map(finish).collect();
    let mut cuts = Cuts { extents: found.extents, ..Cuts::default() };
    cuts.order.reserve_exact(finished.iter().map(|(order, _)| order.len()).sum());
    for (order, large) in finished {
        cuts.parts.push(order.len() as u32);
        cuts.order.extend(order);
        cuts.large.extend(large);
    }
    cuts
}

/// Cuts items, with the large ones in parts of their own after the others.
pub(super) fn cut_all(items: &mut [Item], limit: usize) -> Cuts {
    let rule = Rule { limit, is_object: true };
    let mut cuts = cut(items, rule);
    let large = cut(&mut std::mem::take(&mut cuts.large), rule.of_large());
    cuts.parts.extend(large.parts);
    cuts.order.extend(large.order);
    cuts
}

/// Parts as ranges of the reordered items, in order.
#[derive(Debug, Default)]
struct Parts {
    /// Parts of at most the number of items asked for.
    parts: Vec<Range<u32>>,
    /// Largest extents of the parts of at most [`CANONICAL_TRIANGLES`] items.
    extents: Vec<f64>,
}

/// Moves the items without which the others are at least `gain` times cheaper to the end; returns how many stay.
fn move_large_to_end(items: &mut [Item], gain: f64) -> usize {
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
    if cost * gain <= items.len() as f64 * all { kept } else { items.len() }
}

fn descend(items: &mut [Item], first: usize, limit: usize, mut is_brick: bool, mut is_chunk: bool) -> Parts {
    let mut parts = Parts::default();
    if !is_brick && items.len() <= limit {
        is_brick = true;
        parts.parts.push(first as u32..(first + items.len()) as u32);
    }
    if !is_chunk && items.len() <= CANONICAL_TRIANGLES {
        is_chunk = true;
        parts.extents.push(bounds(items).0.extent());
    }
    if is_brick && is_chunk {
        return parts;
    }
    let middle = split(items, least_side(items.len()), false);
    let (left, right) = items.split_at_mut(middle);
    let is_task = left.len() + right.len() > TASK_ITEMS;
    let mut left = move || descend(left, first, limit, is_brick, is_chunk);
    let mut right = move || descend(right, first + middle, limit, is_brick, is_chunk);
    let (left, right) = if is_task { rayon::join(left, right) } else { (left(), right()) };
    for side in [left, right] {
        parts.parts.extend(side.parts);
        parts.extents.extend(side.extents);
    }
    parts
}

/// Reorders at least two items so that a cut lies at the returned index, with at least `least_side` items (at most
/// half) on either side: by SAH over bins, or at the median if that finds no cut or `median` is set.
#[inline(never)]
pub(crate) fn split(items: &mut [Item], least_side: usize, median: bool) -> usize {
    let (_, centroids) = bounds(items);
    let cut = if median { None } else { sah_cut(items, &centroids, least_side) };
    if let Some(cut) = cut {
        return cut.apply(items);
    }
    let axis = longest_axis(&centroids);
    let middle = items.len() / 2;
    items.select_nth_unstable_by(middle, |a, b| {
        a.centroid2(axis).total_cmp(&b.centroid2(axis)).then(a.index.cmp(&b.index))
    });
    middle
}

/// Items that either side of a cut of a part has at least.
pub(crate) fn least_side(items: usize) -> usize {
    items.div_ceil(LEAST_SIDE)
}

/// The axis along which items are halved where no cut is better.
pub(crate) fn longest_axis(centroids: &Bounds) -> usize {
    (0..3).fold(0, |best, k| {
        let extent = |k: usize| centroids.max[k] - centroids.min[k];
        if extent(k) > extent(best) { k } else { best }
    })
}

/// Bounds of the boxes, and of twice their centroids.
pub(crate) fn bounds(items: &[Item]) -> (Bounds, Bounds) {
    let of = |items: &[Item]| {
        let mut all = (Bounds::EMPTY, Bounds::EMPTY);
        for item in items {
            all.0.extend(item.min, item.max);
            let centroid = item.centroids2();
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
pub(crate) struct Cut {
    binning: Binning,
    bin: usize,
}

impl Cut {
    /// Whether an item goes left.
    pub fn is_left(&self, item: &Item) -> bool {
        self.binning.bin(item) < self.bin
    }

    /// Moves the left items to the front; returns their number.
    fn apply(&self, items: &mut [Item]) -> usize {
        let (mut low, mut high) = (0, items.len());
        while low < high {
            if self.is_left(&items[low]) {
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

impl Bin {
    const EMPTY: Self = Self { count: 0, bounds: Bounds::EMPTY };

    fn union(self, other: Self) -> Self {
        Self { count: self.count + other.count, bounds: self.bounds.union(other.bounds) }
    }
}

/// Items counted by bin and axis. Counts, minima and maxima do not depend on the order in which items are counted.
#[derive(Clone)]
pub(crate) struct Bins {
    binnings: [Binning; 3],
    bins: [[Bin; BINS]; 3],
}

impl Bins {
    /// No items; `centroids` are the bounds of twice the centroids of those to come.
    pub fn new(centroids: &Bounds) -> Self {
        let binnings = std::array::from_fn(|axis| {
            let (low, high) = (centroids.min[axis], centroids.max[axis]);
            Binning { axis, low, scale: if high > low { BINS as f64 / (high - low) } else { 0.0 } }
        });
        Self { binnings, bins: [[Bin::EMPTY; BINS]; 3] }
    }

    /// Counts items.
    pub fn count(mut self, items: &[Item]) -> Self {
        for item in items {
            for (bins, binning) in self.bins.iter_mut().zip(&self.binnings) {
                let bin = &mut bins[binning.bin(item)];
                bin.count += 1;
                bin.bounds.extend(item.min, item.max);
            }
        }
        self
    }

    /// For the journal.
    pub fn put(&self, words: &mut Words) {
        for bin in self.bins.iter().flatten() {
            words.put(bin.count as u64).put_point(bin.bounds.min).put_point(bin.bounds.max);
        }
    }

    /// From the journal; `centroids` as in [`Self::new`].
    pub fn take(words: &mut WordReader, centroids: &Bounds) -> Option<Self> {
        let mut bins = Self::new(centroids);
        for bin in bins.bins.iter_mut().flatten() {
            bin.count = words.take()? as usize;
            bin.bounds = Bounds { min: words.take_point()?, max: words.take_point()? };
        }
        Some(bins)
    }

    /// The items of both, counted in the same bins.
    pub fn merge(mut self, other: Self) -> Self {
        for (own, other) in self.bins.iter_mut().flatten().zip(other.bins.iter().flatten()) {
            *own = own.union(*other);
        }
        self
    }

    /// The cheapest cut with at least `least_side` of the `count` items on either side.
    pub fn cheapest(&self, count: usize, least_side: usize) -> Option<Cut> {
        let mut best: Option<(f64, Cut)> = None;
        for (bins, &binning) in self.bins.iter().zip(&self.binnings) {
            if binning.scale == 0.0 {
                continue;
            }
            let mut right_costs = [0.0; BINS];
            let mut right = Bin::EMPTY;
            for bin in (1..BINS).rev() {
                right = right.union(bins[bin]);
                right_costs[bin] = if right.count > 0 { right.count as f64 * right.bounds.half_area() } else { 0.0 };
            }
            let mut left = Bin::EMPTY;
            for bin in 1..BINS {
                left = left.union(bins[bin - 1]);
                if left.count < least_side || count - left.count < least_side {
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
}

fn sah_cut(items: &[Item], centroids: &Bounds, least_side: usize) -> Option<Cut> {
    let empty = Bins::new(centroids);
    let bins = if items.len() <= PARALLEL_ITEMS {
        empty.count(items)
    } else {
        let fill = |items: &[Item]| empty.clone().count(items);
        items.par_chunks(PARALLEL_ITEMS / 4).map(fill).reduce(|| empty.clone(), Bins::merge)
    };
    bins.cheapest(items.len(), least_side)
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

    fn check(items: &[Item], limit: usize) -> Cuts {
        let cuts = cut_all(&mut items.to_vec(), limit);
        assert!(cuts.parts.iter().all(|&count| count > 0 && count as usize <= limit));
        assert_eq!(cuts.parts.iter().sum::<u32>() as usize, items.len(), "every item in exactly one part");
        let mut indices = cuts.order.clone();
        indices.sort_unstable();
        assert!(indices.iter().zip(0..).all(|(&index, i)| index == i), "a permutation");
        cuts
    }

    /// The parts as indices of items.
    fn parts(cuts: &Cuts) -> impl Iterator<Item = &[u32]> {
        cuts.parts.iter().scan(0, |end, &count| {
            *end += count as usize;
            Some(&cuts.order[*end - count as usize..*end])
        })
    }

    fn area(items: &[Item], part: &[u32]) -> f64 {
        bounds(&part.iter().map(|&index| items[index as usize]).collect::<Vec<_>>()).0.half_area()
    }

    #[test]
    fn parts_cover_and_are_compact() {
        let items = scattered(100_000);
        let cuts = check(&items, 1000);
        assert!(cuts.parts.len() < 300, "{} parts", cuts.parts.len());
        assert!(parts(&cuts).all(|part| part.is_sorted()));
        let total: f64 = parts(&cuts).map(|part| area(&items, part)).sum();
        let unsorted: f64 = items.chunks(1000).map(|items| bounds(items).0.half_area()).sum();
        assert!(total < unsorted / 20.0, "{total} against {unsorted} without a partition");
    }

    #[test]
    fn large_items_have_parts_of_their_own() {
        let mut items = scattered(20_000);
        let large = |index| Item { min: [-50.0, -1.0, -1.0], max: [150.0, 11.0, 2.0], index };
        items.extend((20_000..20_030).map(large));
        let total = |cuts: &Cuts| -> f64 { parts(cuts).map(|part| area(&items, part)).sum() };
        let without = cut(&mut items.clone(), Rule { limit: 1000, is_object: false });
        let cuts = check(&items, 1000);
        let of_large = |part: &[u32]| part.iter().filter(|&&index| index >= 20_000).count();
        let mixed = parts(&cuts).filter(|part| ![0, part.len()].contains(&of_large(part))).count();
        assert_eq!(mixed, 0);
        assert!(total(&cuts) < 2.0 * total(&without), "parts of large items are few");
        let few = scattered(20_000);
        let before = cut(&mut few.clone(), Rule { limit: 1000, is_object: false });
        assert_eq!(check(&few, 1000).order, before.order, "without large items nothing changes");
    }

    #[test]
    fn parts_of_more_levels_have_to_gain_more() {
        let gains = [1, 64, 200, 512, 513, 4096, 16384, 1 << 20];
        let gains = gains.map(|limit| Rule { limit, is_object: true }.large_gain());
        assert_eq!(gains, [2.0, 2.0, 2.0, 2.0, 3.0, 3.0, 4.0, 6.0]);
        // 30 without which 1000 others are 4.9 times cheaper.
        let mut items = scattered(1000);
        items.extend((1000..1030).map(|index| Item { min: [0.0; 3], max: [60.5, 60.5, 0.0], index }));
        let kept = [2.0, 4.0, 6.0].map(|gain| move_large_to_end(&mut items.clone(), gain));
        assert_eq!(kept, [1000, 1000, 1030]);
    }

    #[test]
    fn the_limit_does_not_move_canonical_extents() {
        let extents = |limit| {
            let mut extents = cut_all(&mut scattered(100_000), limit).extents;
            extents.sort_by(f64::total_cmp);
            extents
        };
        let expected = extents(16384);
        assert!(expected.len() >= 7);
        assert_eq!(extents(100), expected);
        assert_eq!(extents(70_000), expected);
        let mut other = scattered(100_000);
        other.truncate(90_000);
        assert_ne!(cut_all(&mut other, 100).extents.len(), 0);
        assert_ne!(extents(16384).len(), cut_all(&mut scattered(10_000), 100).extents.len());
    }

    #[test]
    fn equal_centroids_are_halved() {
        let one = Item { min: [1.0; 3], max: [2.0; 3], index: 0 };
        let items: Vec<Item> = (0..1_000_000).map(|index| Item { index, ..one }).collect();
        assert_eq!(check(&items, 1000).parts.len(), 1024);
    }

    #[test]
    fn a_geometric_series_stays_shallow() {
        let items: Vec<Item> = (0..200_000)
            .map(|index| {
                let x = 0.9999f64.powi(index as i32);
                Item { min: [x, 0.0, 0.0], max: [x, 1e-3, 1e-3], index }
            })
            .collect();
        assert!(check(&items, 4).parts.len() < 200_000);
    }

    #[test]
    fn neither_threads_nor_the_order_of_items_change_anything() {
        let order = |threads, items: &[Item]| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let cuts = pool.install(|| cut_all(&mut items.to_vec(), 500));
            (cuts.parts, cuts.order)
        };
        let mut items = scattered(150_000);
        let one = order(1, &items);
        assert_eq!(one, order(3, &items));
        items.reverse();
        assert_eq!(one, order(3, &items));
        items.truncate(149_999);
        assert_ne!(one, order(1, &items));
    }
}
