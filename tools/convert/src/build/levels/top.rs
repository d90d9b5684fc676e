//! The top level over bricks and levels. What a level stands for lies below one node, beside the leaf of the level.

use super::super::tree::binary::{BinaryNode, BinaryTree, Box3, LEAF};
use super::super::tree::top_level::{self, TopLevel};
use crate::build::error::BuildError;
use bricks::{Leaf, Level, NONE};
use std::collections::HashMap;

/// A tree over leaves, while it is made: a leaf, or two trees.
#[derive(Clone, Copy)]
enum Branch {
    Leaf(u32),
    Both(u32, u32),
}

/// Branches with their boxes.
#[derive(Default)]
struct Branches(Vec<(Branch, Box3)>);

impl Branches {
    fn push(&mut self, branch: Branch, bounds: Box3) -> u32 {
        self.0.push((branch, bounds));
        self.0.len() as u32 - 1
    }

    fn join(&mut self, a: u32, b: u32) -> u32 {
        let bounds = self.0[a as usize].1.union(&self.0[b as usize].1);
        self.push(Branch::Both(a, b), bounds)
    }

    /// Halves, in order.
    fn join_all(&mut self, all: &[u32]) -> u32 {
        match all {
            [one] => *one,
            _ => {
                let (a, b) = all.split_at(all.len().div_ceil(2));
                let (a, b) = (self.join_all(a), self.join_all(b));
                self.join(a, b)
            }
        }
    }
}

/// Builds the trees over leaves and their boxes, which are bricks and levels of instances; `bricks` is the number of
/// all bricks.
pub(crate) fn build_top(
    leaves: &[Leaf],
    boxes: &[Box3],
    levels: &[Level],
    bricks: u32,
) -> Result<TopLevel, BuildError> {
    let places: HashMap<(u32, u32), u32> =
        (0u32..).zip(leaves).map(|(place, leaf)| ((leaf.instance, leaf.brick), place)).collect();
    let mut branches = Branches::default();
    let own: Vec<u32> = (0u32..).zip(boxes).map(|(place, &b)| branches.push(Branch::Leaf(place), b)).collect();
    // Children come first, so that their branches are whole when a level takes them.
    let mut order: Vec<u32> = (0..leaves.len() as u32).collect();
    order.sort_by_key(|&place| leaves[place as usize].brick);
    let (mut whole, mut is_root) = (own.clone(), vec![true; leaves.len()]);
    for place in order {
        let leaf = leaves[place as usize];
        let Some(level) = leaf.brick.checked_sub(bricks).map(|level| &levels[level as usize]) else { continue };
        let mut below = Vec::with_capacity(bricks::LEVEL_CHILDREN);
        for child in level.children() {
            let instance = if child.instance == NONE { leaf.instance } else { child.instance };
            if let Some(&place) = places.get(&(instance, child.brick)) {
                is_root[place as usize] = false;
                below.push(whole[place as usize]);
            }
        }
        if !below.is_empty() {
            let below = branches.join_all(&below);
            whole[place as usize] = branches.join(own[place as usize], below);
        }
    }
    let roots: Vec<u32> = (0..leaves.len()).filter(|&place| is_root[place]).map(|place| whole[place]).collect();
    if roots.is_empty() {
        return top_level::build(leaves, boxes);
    }
    let of_roots: Vec<Box3> = roots.iter().map(|&root| branches.0[root as usize].1).collect();
    let binary = grafted(&BinaryTree::by_splits(&of_roots, top_level::BINARY_DEPTH), &roots, &branches);
    match top_level::build_over(&binary, leaves) {
        Some(top) => Ok(top),
        None => top_level::build(leaves, boxes),
    }
}

/// `tree` with branches in place of its leaves.
fn grafted(tree: &BinaryTree, roots: &[u32], branches: &Branches) -> BinaryTree {
    enum From {
        Tree(u32),
        Branch(u32),
    }
    let mut nodes: Vec<BinaryNode> = Vec::new();
    let mut stack = vec![(From::Tree(0), 0usize)];
    nodes.push(tree.nodes[0]);
    while let Some((from, to)) = stack.pop() {
        let (bounds, children) = match from {
            From::Tree(index) => {
                let node = &tree.nodes[index as usize];
                if node.right == LEAF {
                    stack.push((From::Branch(roots[node.left as usize]), to));
                    continue;
                }
                (node.bounds, [From::Tree(node.left), From::Tree(node.right)])
            }
            From::Branch(index) => match branches.0[index as usize] {
                (Branch::Leaf(place), bounds) => {
                    nodes[to] = BinaryNode { bounds, left: place, right: LEAF };
                    continue;
                }
                (Branch::Both(a, b), bounds) => (bounds, [From::Branch(a), From::Branch(b)]),
            },
        };
        let left = nodes.len();
        nodes[to] = BinaryNode { bounds, left: left as u32, right: left as u32 + 1 };
        nodes.extend([nodes[to]; 2]);
        let [a, b] = children;
        stack.push((b, left + 1));
        stack.push((a, left));
    }
    BinaryTree { nodes }
}
