//! Binary trees over boxes on a lattice: topology by obvhs, or by splits of bounded depth.

use crate::build::cut::partition::{Item, split};
use glam::{DVec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::PlocBuilder;
use obvhs::ploc::morton::morton_encode_u64_unorm;

/// A box in lattice steps, bounds inclusive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Box3 {
    /// Least coordinates.
    pub min: [i64; 3],
    /// Greatest coordinates.
    pub max: [i64; 3],
}

impl Box3 {
    /// The box of some points; at least one.
    pub fn of(points: &[[i64; 3]]) -> Self {
        let mut all = Self { min: points[0], max: points[0] };
        for &point in &points[1..] {
            all = all.union(&Self { min: point, max: point });
        }
        all
    }

    /// The box of two boxes.
    pub fn union(&self, other: &Self) -> Self {
        Self {
            min: std::array::from_fn(|k| self.min[k].min(other.min[k])),
            max: std::array::from_fn(|k| self.max[k].max(other.max[k])),
        }
    }

    /// Half the surface, in squared steps, rounded.
    pub fn half_area(&self) -> f64 {
        let [x, y, z]: [f64; 3] = std::array::from_fn(|k| (self.max[k] - self.min[k]) as f64);
        x * y + y * z + z * x
    }

    /// The same box as an item of a split.
    fn item(&self, index: u32) -> Item {
        Item { min: self.min.map(|x| x as f64), max: self.max.map(|x| x as f64), index }
    }
}

/// [`BinaryNode::right`] of a leaf.
pub(crate) const LEAF: u32 = u32::MAX;

/// A node of a binary tree.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BinaryNode {
    /// Exact bounds.
    pub bounds: Box3,
    /// Left child, or the item of a leaf.
    pub left: u32,
    /// Right child, or [`LEAF`].
    pub right: u32,
}

/// Sum of the nodes' areas in areas of the root above which boxes are too crowded for reinsertion. It is about 50 for
/// meshes.
const CROWDED: f64 = 4096.0;

/// Nodes of a tree that are all inserted anew.
const REINSERTED: f32 = 16384.0;

/// Boxes below which the square of their number does not matter.
const LEAST_CHAIN: usize = 512;

/// Levels of the binary tree over boxes in a chain.
const CHAIN_DEPTH: u32 = 64;

/// A binary tree with one item a leaf: node 0 is the root, children follow their parent.
#[derive(Debug)]
pub(crate) struct BinaryTree {
    /// The nodes; `2 n - 1` over n items.
    pub nodes: Vec<BinaryNode>,
}

impl BinaryTree {
    /// A tree of good quality, of any depth, over at least one box whose coordinates are small against the range of
    /// f32: PLOC with reinsertion, on one thread; `is_fast` searches fewer neighbours and does not reinsert.
    pub fn by_obvhs(boxes: &[Box3], is_fast: bool) -> Self {
        let aabbs: Vec<Aabb> = boxes.iter().map(|b| Aabb::new(vector(b.min), vector(b.max))).collect();
        if is_chain(&aabbs) {
            return Self::by_splits(boxes, CHAIN_DEPTH);
        }
        let config = if is_fast { BvhBuildParams::fast_build() } else { BvhBuildParams::medium_build() };
        let mut bvh: Bvh2 = PlocBuilder::with_capacity(aabbs.len()).build(
            config.ploc_search_distance,
            &aabbs,
            (0..aabbs.len() as u32).collect(),
            config.sort_precision,
            config.search_depth_threshold,
        );
        if !is_fast {
            reinsert(&mut bvh, config.reinsertion_batch_ratio);
        }
        Self::of_obvhs(&bvh, boxes)
    }

    /// The same over the same boxes, coordinates as of [`Self::by_obvhs`], with nodes inserted anew where they are
    /// cheaper. It may be deeper.
    pub fn reinserted(&self, boxes: &[Box3]) -> Self {
        let nodes = self.nodes.iter().map(|node| {
            let count = u32::from(node.right == LEAF);
            Bvh2Node::new(Aabb::new(vector(node.bounds.min), vector(node.bounds.max)), count, node.left)
        });
        let mut bvh =
            Bvh2 { nodes: nodes.collect(), primitive_indices: (0..boxes.len() as u32).collect(), ..Bvh2::default() };
        // The nodes of small trees all, of large ones so many as of a brick's.
        let ratio =
            (REINSERTED / self.nodes.len() as f32).clamp(BvhBuildParams::medium_build().reinsertion_batch_ratio, 1.0);
        reinsert(&mut bvh, ratio);
        Self::of_obvhs(&bvh, boxes)
    }

    /// The tree `bvh` over these boxes, with one a leaf.
    fn of_obvhs(bvh: &Bvh2, boxes: &[Box3]) -> Self {
        let mut tree = Self::with_capacity(boxes.len());
        tree.nodes.push(PLACEHOLDER);
        let mut stack = vec![(0u32, 0u32)];
        while let Some((from, to)) = stack.pop() {
            let node = &bvh.nodes[from as usize];
            if node.is_leaf() {
                // One primitive a leaf, as nothing was collapsed.
                let item = bvh.primitive_indices[node.first_index as usize];
                tree.nodes[to as usize] = BinaryNode { bounds: boxes[item as usize], left: item, right: LEAF };
            } else {
                let (left, right) = tree.add_children(to);
                stack.push((node.first_index + 1, right));
                stack.push((node.first_index, left));
            }
        }
        tree.fit();
        tree
    }

    /// A tree over at least one box by splits: binned SAH down to a depth from which halving ends within `depth` levels
    /// (the root counted), or halving all the way if `depth` is 0.
    pub fn by_splits(boxes: &[Box3], depth: u32) -> Self {
        let mut items: Vec<Item> = (0u32..).zip(boxes).map(|(index, b)| b.item(index)).collect();
        let mut tree = Self::with_capacity(boxes.len());
        tree.nodes.push(PLACEHOLDER);
        let mut stack = vec![(0usize, items.len(), 0u32, 1u32)];
        while let Some((start, end, to, level)) = stack.pop() {
            let count = end - start;
            if count == 1 {
                let item = items[start].index;
                tree.nodes[to as usize] = BinaryNode { bounds: boxes[item as usize], left: item, right: LEAF };
                continue;
            }
            let levels_of_halving = (count - 1).ilog2() + 2;
            let median = level + levels_of_halving > depth;
            let middle = start + split(&mut items[start..end], 1, median);
            let (left, right) = tree.add_children(to);
            stack.push((middle, end, right, level + 1));
            stack.push((start, middle, left, level + 1));
        }
        tree.fit();
        tree
    }

    fn with_capacity(items: usize) -> Self {
        Self { nodes: Vec::with_capacity(2 * items) }
    }

    fn add_children(&mut self, parent: u32) -> (u32, u32) {
        let left = self.nodes.len() as u32;
        self.nodes.extend([PLACEHOLDER; 2]);
        self.nodes[parent as usize] = BinaryNode { left, right: left + 1, ..PLACEHOLDER };
        (left, left + 1)
    }

    /// Fits the bounds of inner nodes to their children.
    fn fit(&mut self) {
        for index in (0..self.nodes.len()).rev() {
            let BinaryNode { left, right, .. } = self.nodes[index];
            if right != LEAF {
                self.nodes[index].bounds = self.nodes[left as usize].bounds.union(&self.nodes[right as usize].bounds);
            }
        }
    }
}

/// A point in f32, rounded.
fn vector(point: [i64; 3]) -> Vec3A {
    Vec3A::from_array(point.map(|x| x as f32))
}

/// Inserts this share of the nodes anew where they are cheaper, again and again fewer (Meister, Bittner 2018, "Parallel
/// reinsertion for bounding volume hierarchy optimization").
fn reinsert(bvh: &mut Bvh2, share: f32) {
    // Where many nodes are as large as the root the search for a better place visits them all and finds none.
    let areas = bvh.nodes.iter().map(|node| f64::from(node.aabb().half_area())).sum::<f64>();
    let root = f64::from(bvh.nodes[0].aabb().half_area());
    if areas <= root * CROWDED {
        ReinsertionOptimizer::default().run(bvh, share, None);
    }
}

/// Whether PLOC would merge too few neighbours a round, of which it takes time in proportion to the square: duplicates,
/// and boxes in a row of growing size. It merges mutual nearest neighbours, so along its Morton order there is a local
/// minimum of the merged area for each; of scattered boxes that is every third.
fn is_chain(boxes: &[Aabb]) -> bool {
    if boxes.len() < LEAST_CHAIN {
        return false;
    }
    let all = boxes[1..].iter().fold(boxes[0], |all, b| all.union(b));
    let extent = all.diagonal().as_dvec3();
    let scale = DVec3::from_array(extent.to_array().map(|x| if x > 0.0 { 1.0 / x } else { 0.0 }));
    let mut order: Vec<(u64, u32)> = (0u32..)
        .zip(boxes)
        .map(|(index, b)| (morton_encode_u64_unorm((b.center() - all.min).as_dvec3() * scale), index))
        .collect();
    order.sort_unstable();
    let areas = order.windows(2).map(|pair| boxes[pair[0].1 as usize].union(&boxes[pair[1].1 as usize]).half_area());
    let (mut minima, mut before, mut is_falling) = (0, f32::INFINITY, false);
    for area in areas {
        minima += usize::from(is_falling && area > before);
        is_falling = area < before;
        before = area;
    }
    minima < boxes.len() / 8
}

const PLACEHOLDER: BinaryNode =
    BinaryNode { bounds: Box3 { min: [i64::MAX; 3], max: [i64::MIN; 3] }, left: LEAF, right: LEAF };

#[cfg(test)]
mod tests {
    use super::*;

    /// Boxes in clusters of different density, so that halving is not the best one can do.
    fn boxes(count: i64) -> Vec<Box3> {
        (0..count)
            .map(|i| {
                let (cluster, spread) = (i % 7, 10i64.pow((i % 5) as u32));
                let scattered = [i * 7919 % 1009, i * 104_729 % 997, i * 31 % 991];
                let min = scattered.map(|x| x * spread / 100 + cluster * 50_000);
                Box3 { min, max: min.map(|x| x + 1 + i % 5) }
            })
            .collect()
    }

    fn check(tree: &BinaryTree, boxes: &[Box3]) -> u32 {
        assert_eq!(tree.nodes.len(), 2 * boxes.len() - 1);
        let mut levels = vec![0u32; tree.nodes.len()];
        levels[0] = 1;
        let mut met = vec![0; boxes.len()];
        for (index, node) in tree.nodes.iter().enumerate() {
            assert!(levels[index] > 0);
            if node.right == LEAF {
                met[node.left as usize] += 1;
                assert_eq!(node.bounds, boxes[node.left as usize]);
                continue;
            }
            for child in [node.left, node.right] {
                assert!(child as usize > index);
                levels[child as usize] = levels[index] + 1;
                assert_eq!(node.bounds.union(&tree.nodes[child as usize].bounds), node.bounds);
            }
        }
        assert!(met.iter().all(|&count| count == 1));
        levels.into_iter().max().unwrap()
    }

    fn cost(tree: &BinaryTree) -> f64 {
        tree.nodes.iter().map(|node| node.bounds.half_area()).sum()
    }

    #[test]
    fn trees_are_trees_and_better_than_chance() {
        for count in [1, 2, 3, 17, 5000] {
            let boxes = boxes(count);
            let trees = [
                BinaryTree::by_obvhs(&boxes, false),
                BinaryTree::by_splits(&boxes, 64),
                BinaryTree::by_splits(&boxes, 0),
                BinaryTree::by_splits(&boxes, 64).reinserted(&boxes),
            ];
            check(&BinaryTree::by_obvhs(&boxes, true), &boxes);
            for tree in &trees {
                check(tree, &boxes);
            }
            if count == 5000 {
                assert!(cost(&trees[0]) <= cost(&trees[2]) && cost(&trees[1]) <= cost(&trees[2]));
                assert!(cost(&trees[3]) < 0.97 * cost(&trees[1]), "{} {}", cost(&trees[3]), cost(&trees[1]));
                assert_eq!(check(&trees[2], &boxes), 14, "halving gives the least depth");
            }
        }
    }

    #[test]
    fn depth_is_bounded_where_sah_peels() {
        let boxes: Vec<Box3> = (0..4000)
            .map(|i| {
                let x = (1e15 * 0.992f64.powi(i)) as i64;
                Box3 { min: [x, i64::from(i % 3), 0], max: [x + 1, i64::from(i % 3) + 1, 1] }
            })
            .collect();
        let free = check(&BinaryTree::by_splits(&boxes, 1000), &boxes);
        let bounded = check(&BinaryTree::by_splits(&boxes, 20), &boxes);
        assert!(free > 20, "the series is deep without a bound: {free}");
        assert!(bounded <= 20, "{bounded} levels");
    }

    fn is_chain_of(boxes: &[Box3]) -> bool {
        let aabbs: Vec<Aabb> = boxes.iter().map(|b| Aabb::new(vector(b.min), vector(b.max))).collect();
        is_chain(&aabbs)
    }

    #[test]
    fn crowds_and_chains_take_no_longer_than_others() {
        // Each takes seconds where PLOC and the reinsertion are let loose on it.
        let concentric = |i: i64| Box3 { min: [-i, -2 * i, -i], max: [i, 2 * i, i] };
        let series = (0..16384).map(|i| {
            let x = (1e12 * 0.999f64.powi(i)) as i64;
            Box3 { min: [x, 0, 0], max: [x + x / 1000, 9, 9] }
        });
        let chains = [vec![boxes(1)[0]; 16384], (1..16384).map(concentric).collect(), series.collect()];
        for boxes in chains {
            assert!(is_chain_of(&boxes));
            check(&BinaryTree::by_obvhs(&boxes, false), &boxes);
        }
        let shuffled: Vec<Box3> = (0..16381).map(|i| concentric(1 + i * 7919 % 16381)).collect();
        check(&BinaryTree::by_obvhs(&shuffled, false), &shuffled);
        check(&BinaryTree::by_splits(&shuffled, 64).reinserted(&shuffled), &shuffled);
        assert!(!is_chain_of(&boxes(16384)));
    }
}
