//! The trees over (instance, brick) leaves, in steps of the world's lattice.

use super::binary::{BinaryTree, Box3, LEAF};
use super::node::encode_top;
use super::wide::{WideTree, collapse, collapse_levels};
use crate::build::error::BuildError;
use crate::build::input::matrix::Affine;
use crate::build::triangles::lattice::Lattice;
use bricks::{Leaf, MAX_TOP_HEIGHT, MAX_TOP2_HEIGHT, TOP_LEAF, TopNode2, TopNode8};

/// Most levels of the binary tree, the root counted.
pub(crate) const BINARY_DEPTH: u32 = 64;

/// Both trees, over the same leaves.
#[derive(Debug, Default)]
pub(crate) struct TopLevel {
    /// In the order of the 8-wide tree.
    pub leaves: Vec<Leaf>,
    /// The binary tree.
    pub top2: Vec<TopNode2>,
    /// The 8-wide tree.
    pub top8: Vec<TopNode8>,
}

/// The box of a brick of an instance in steps of the world's lattice, outward: that of the image of the brick's box.
pub(crate) fn world_box(brick: Box3, object: &Lattice, matrix: &Affine, world: &Lattice) -> Box3 {
    // The lattice was chosen so that the images are in range.
    let [min, max] = bricks::world_box([brick.min, brick.max], object.step_log2, &matrix.0, world.step_log2);
    Box3 { min, max }
}

/// Builds the trees over leaves and their boxes.
pub(crate) fn build(leaves: &[Leaf], boxes: &[Box3]) -> Result<TopLevel, BuildError> {
    let limit = u64::from(u32::MAX / 2);
    if leaves.len() as u64 > limit {
        return Err(BuildError::TooMany { what: "bricks of all instances", found: leaves.len() as u64, limit });
    }
    if leaves.is_empty() {
        return Ok(TopLevel::default());
    }
    let binary = BinaryTree::by_splits(boxes, BINARY_DEPTH);
    let better = build_over(&binary.reinserted(boxes), leaves);
    Ok(better.or_else(|| build_over(&binary, leaves)).unwrap_or_else(|| {
        // Halving takes at most 32 levels, of which each wide node spans three.
        let binary = BinaryTree::by_splits(boxes, 0);
        laid_out(&binary, &collapse_levels(&binary, 1), leaves)
    }))
}

/// The trees that `binary` over the leaves makes; `None` if one of them is too high.
pub(crate) fn build_over(binary: &BinaryTree, leaves: &[Leaf]) -> Option<TopLevel> {
    if height(binary) > MAX_TOP2_HEIGHT {
        return None;
    }
    let mut wide = collapse(binary, 1);
    if wide.height > MAX_TOP_HEIGHT {
        wide = collapse_levels(binary, 1);
    }
    (wide.height <= MAX_TOP_HEIGHT).then(|| laid_out(binary, &wide, leaves))
}

/// Levels of a binary tree, the root counted.
fn height(tree: &BinaryTree) -> u32 {
    let mut levels = vec![1u32; tree.nodes.len()];
    for (index, node) in tree.nodes.iter().enumerate().filter(|(_, node)| node.right != LEAF) {
        for child in [node.left, node.right] {
            levels[child as usize] = levels[index] + 1;
        }
    }
    levels.into_iter().max().unwrap_or(0)
}

/// Both trees as they are stored.
fn laid_out(binary: &BinaryTree, wide: &WideTree, leaves: &[Leaf]) -> TopLevel {
    let mut new_of_old = vec![0u32; leaves.len()];
    for (new, &old) in (0u32..).zip(&wide.items) {
        new_of_old[old as usize] = new;
    }
    let top2 = binary.nodes.iter().map(|node| {
        let (left, right) = match node.right {
            LEAF => (new_of_old[node.left as usize], TOP_LEAF),
            right => (node.left, right),
        };
        TopNode2 { min: node.bounds.min, max: node.bounds.max, left, right }
    });
    TopLevel {
        leaves: wide.items.iter().map(|&old| leaves[old as usize]).collect(),
        top2: top2.collect(),
        top8: wide.nodes.iter().map(encode_top).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn height_is_bounded_for_series_and_duplicates() {
        let series = (0..3000).map(|i| {
            let x = (2f64.powi(43) * 0.985f64.powi(i)) as i64;
            Box3 { min: [x, x / 3, 0], max: [x + 1 + x / 100, x / 3 + 1, 9] }
        });
        let duplicates = (0..3000).map(|_| Box3 { min: [-5; 3], max: [7; 3] });
        for boxes in [series.collect::<Vec<_>>(), duplicates.collect()] {
            let leaves: Vec<Leaf> = (0..boxes.len() as u32).map(|brick| Leaf { instance: 0, brick }).collect();
            let top = build(&leaves, &boxes).unwrap();
            let mut levels = vec![1u32; top.top8.len()];
            for (index, node) in top.top8.iter().enumerate() {
                for child in 0..node.inner_mask.count_ones() {
                    levels[(node.child_base + child) as usize] = levels[index] + 1;
                }
            }
            assert!(*levels.iter().max().unwrap() <= MAX_TOP_HEIGHT);
            let mut bricks: Vec<u32> = top.leaves.iter().map(|leaf| leaf.brick).collect();
            assert_eq!(top.leaves.len(), leaves.len());
            bricks.sort_unstable();
            assert!(bricks.iter().zip(0..).all(|(&brick, index)| brick == index));
            for node in top.top2.iter().filter(|node| node.right == TOP_LEAF) {
                let brick = top.leaves[node.left as usize].brick as usize;
                assert_eq!(boxes[brick], Box3 { min: node.min, max: node.max });
            }
        }
    }
}
