//! Collapses a binary tree to 8-wide nodes and places children in slots.
//!
//! Which nodes are pulled together follows Ylitie, Karras, Laine 2017, section 3.1: dynamic programming over the
//! surface area cost of representing each binary subtree by up to seven roots. Slots follow their section 3.2: slot bit
//! 2 is x, bit 1 y, bit 0 z, set for a child in the upper half, so that visiting slots in the order of `slot ^ octant`
//! goes roughly from near to far. We assign greedily where they run an auction.

use super::binary::{BinaryTree, Box3, LEAF};
use bricks::NODE_WIDTH;

/// Cost of a primitive test against that of a node visit.
pub const ITEM_COST: f32 = 0.3;

/// A child of a wide node.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WideChild {
    /// Exact bounds.
    pub bounds: Box3,
    /// Items of a leaf, 1 to 3; 0: an inner node.
    pub count: u8,
}

/// A wide node before its boxes are quantised.
#[derive(Clone, Debug)]
pub(crate) struct WideNode {
    /// Exact bounds.
    pub bounds: Box3,
    /// Children by slot.
    pub children: [Option<WideChild>; NODE_WIDTH],
    /// First inner child; the others follow in order of slots.
    pub child_base: u32,
    /// First item of the leaf children; the others follow in order of slots.
    pub item_base: u32,
}

impl WideNode {
    /// What each child is and which are inner, as the format encodes them.
    pub fn meta(&self) -> ([u8; NODE_WIDTH], u8) {
        let (mut meta, mut inner, mut items) = ([0; NODE_WIDTH], 0, 0);
        for (slot, child) in self.children.iter().enumerate() {
            match child {
                None => {}
                Some(WideChild { count: 0, .. }) => {
                    meta[slot] = 0b001_00000 | (24 + slot as u8);
                    inner |= 1 << slot;
                }
                Some(WideChild { count, .. }) => {
                    meta[slot] = ((1 << count) - 1) << 5 | items;
                    items += count;
                }
            }
        }
        (meta, inner)
    }
}

/// A tree of wide nodes: node 0 is the root, children follow their parent.
#[derive(Debug)]
pub(crate) struct WideTree {
    /// The nodes.
    pub nodes: Vec<WideNode>,
    /// Items in the order of the leaves.
    pub items: Vec<u32>,
    /// Levels, the root counted.
    pub height: u32,
}

/// What the cheapest way is to represent a binary subtree by up to some number of roots.
#[derive(Clone, Copy, Default)]
struct Decision {
    cost: f32,
    /// Up to how many roots (less one) each child gets; those of [`Kind::Inner`] make up the eight of its node.
    left: u8,
    right: u8,
    kind: Kind,
}

#[derive(Clone, Copy, Default, PartialEq)]
enum Kind {
    /// One leaf of the wide tree.
    Leaf,
    /// One inner node of the wide tree.
    #[default]
    Inner,
    /// The roots of both children.
    Spread,
}

/// Most roots of a subtree within its parent.
const ROOTS: usize = NODE_WIDTH - 1;

/// Collapses `tree` with up to `leaf_items` (1 to 3) items a leaf, at the least cost.
pub(crate) fn collapse(tree: &BinaryTree, leaf_items: u32) -> WideTree {
    emit(tree, &decide(tree, leaf_items, cheapest))
}

/// Collapses `tree` with up to `leaf_items` (1 to 3) items a leaf, three binary levels to each wide one: the height is
/// at most a third of the binary tree's, rounded up.
pub(crate) fn collapse_levels(tree: &BinaryTree, leaf_items: u32) -> WideTree {
    emit(tree, &decide(tree, leaf_items, three_levels))
}

/// Makes the wide tree that was decided on.
fn emit(tree: &BinaryTree, decisions: &[Choices]) -> WideTree {
    let mut out = WideTree {
        nodes: Vec::with_capacity(tree.nodes.len() / 6 + 1),
        items: Vec::with_capacity(tree.nodes.len() / 2 + 1),
        height: 0,
    };
    let empty = |binary: u32| WideNode {
        bounds: tree.nodes[binary as usize].bounds,
        children: [None; NODE_WIDTH],
        child_base: 0,
        item_base: 0,
    };
    out.nodes.push(empty(0));
    let mut stack = vec![(0u32, 0u32, 1u32)];
    let mut roots = Vec::with_capacity(NODE_WIDTH);
    while let Some((binary, wide, level)) = stack.pop() {
        out.height = out.height.max(level);
        roots.clear();
        if decisions[binary as usize][0].kind == Kind::Leaf {
            // Only the root of a tree that fits one leaf.
            roots.push(binary);
        } else {
            let Decision { left, right, .. } = decisions[binary as usize][0];
            push_roots(tree, decisions, tree.nodes[binary as usize].left, left, &mut roots);
            push_roots(tree, decisions, tree.nodes[binary as usize].right, right, &mut roots);
        }
        let slots = assign_slots(tree, binary, &roots);
        let (child_base, item_base) = (out.nodes.len() as u32, out.items.len() as u32);
        let mut node = WideNode { child_base, item_base, ..empty(binary) };
        let first = stack.len();
        for (slot, root) in slots.into_iter().enumerate() {
            let Some(root) = root else { continue };
            let before = out.items.len();
            if decisions[root as usize][0].kind == Kind::Leaf {
                push_items(tree, root, &mut out.items);
            } else {
                stack.push((root, out.nodes.len() as u32, level + 1));
                out.nodes.push(empty(root));
            }
            let count = (out.items.len() - before) as u8;
            node.children[slot] = Some(WideChild { bounds: tree.nodes[root as usize].bounds, count });
        }
        // The first child is done next, so that subtrees lie together.
        stack[first..].reverse();
        out.nodes[wide as usize] = node;
    }
    out
}

/// The decisions of one node's children, of up to so many roots less one.
type Choices = [Decision; ROOTS];

/// Fills the table of decisions from the leaves up; `choose` decides on a node that is no leaf, from its area and the
/// choices of its children.
fn decide(tree: &BinaryTree, leaf_items: u32, choose: fn(f32, &Choices, &Choices) -> Choices) -> Vec<Choices> {
    let mut decisions = vec![[Decision::default(); ROOTS]; tree.nodes.len()];
    let mut counts = vec![1u32; tree.nodes.len()];
    for (index, node) in tree.nodes.iter().enumerate().rev() {
        let area = node.bounds.half_area() as f32;
        if node.right == LEAF {
            decisions[index] = [Decision { cost: area * ITEM_COST, kind: Kind::Leaf, left: 0, right: 0 }; ROOTS];
            continue;
        }
        let mut own = choose(area, &decisions[node.left as usize], &decisions[node.right as usize]);
        let count = counts[node.left as usize].saturating_add(counts[node.right as usize]);
        let leaf_cost = area * count as f32 * ITEM_COST;
        if count <= leaf_items && leaf_cost <= own[0].cost {
            // Also where one root is the best choice of more.
            for choice in own.iter_mut().filter(|choice| choice.kind == Kind::Inner || leaf_cost <= choice.cost) {
                *choice = Decision { cost: leaf_cost, kind: Kind::Leaf, ..*choice };
            }
        }
        counts[index] = count;
        decisions[index] = own;
    }
    decisions
}

/// Shares out roots at the least cost.
fn cheapest(area: f32, left: &Choices, right: &Choices) -> Choices {
    // The cheapest way to share out `roots + 2` roots, of which each child gets at least one.
    let share = |roots: usize| {
        let mut best = Decision { cost: f32::INFINITY, kind: Kind::Spread, left: 0, right: 0 };
        for i in 0..=roots {
            let cost = left[i].cost + right[roots - i].cost;
            if cost < best.cost {
                best = Decision { cost, kind: Kind::Spread, left: i as u8, right: (roots - i) as u8 };
            }
        }
        best
    };
    let mut own = [Decision::default(); ROOTS];
    let eight = share(ROOTS - 1);
    own[0] = Decision { cost: eight.cost + area, kind: Kind::Inner, ..eight };
    for roots in 1..ROOTS {
        let spread = share(roots - 1);
        own[roots] = if spread.cost < own[roots - 1].cost { spread } else { own[roots - 1] };
    }
    own
}

/// Shares out eight roots as four and four, four as two and two, two as one and one.
fn three_levels(_: f32, _: &Choices, _: &Choices) -> Choices {
    std::array::from_fn(|roots| {
        let (kind, half) = match roots {
            0 => (Kind::Inner, 3),
            1 | 2 => (Kind::Spread, 0),
            _ => (Kind::Spread, 1),
        };
        // Without costs any leaf that fits is taken.
        Decision { cost: f32::INFINITY, kind, left: half, right: half }
    })
}

/// Collects the roots that represent `node` within its wide parent, at most `budget + 1`. The depth is at most 7: each
/// level of the recursion shares out at least one root less.
fn push_roots(tree: &BinaryTree, decisions: &[Choices], node: u32, budget: u8, roots: &mut Vec<u32>) {
    let decision = decisions[node as usize][budget as usize];
    if decision.kind == Kind::Spread {
        push_roots(tree, decisions, tree.nodes[node as usize].left, decision.left, roots);
        push_roots(tree, decisions, tree.nodes[node as usize].right, decision.right, roots);
    } else {
        roots.push(node);
    }
}

/// Collects the items of a subtree of at most three.
fn push_items(tree: &BinaryTree, node: u32, items: &mut Vec<u32>) {
    let node = &tree.nodes[node as usize];
    if node.right == LEAF {
        items.push(node.left);
    } else {
        push_items(tree, node.left, items);
        push_items(tree, node.right, items);
    }
}

/// Places up to eight children: of the free slots and children left, the pair whose child lies farthest toward its
/// slot's corner goes first.
fn assign_slots(tree: &BinaryTree, parent: u32, children: &[u32]) -> [Option<u32>; NODE_WIDTH] {
    let bounds = &tree.nodes[parent as usize].bounds;
    let mut gains = [[0.0f64; NODE_WIDTH]; NODE_WIDTH];
    for (gains, &child) in gains.iter_mut().zip(children) {
        let child = &tree.nodes[child as usize].bounds;
        // Twice the offset of the child's centre from the parent's.
        let offset: [f64; 3] =
            std::array::from_fn(|k| ((child.min[k] + child.max[k]) - (bounds.min[k] + bounds.max[k])) as f64);
        for (slot, gain) in gains.iter_mut().enumerate() {
            *gain = (0..3).map(|k| if slot >> (2 - k) & 1 != 0 { offset[k] } else { -offset[k] }).sum();
        }
    }
    let mut slots = [None; NODE_WIDTH];
    let mut placed = [false; NODE_WIDTH];
    for _ in 0..children.len() {
        let mut best: Option<(f64, usize, usize)> = None;
        for child in (0..children.len()).filter(|&child| !placed[child]) {
            for slot in (0..NODE_WIDTH).filter(|&slot| slots[slot].is_none()) {
                if best.is_none_or(|(gain, ..)| gains[child][slot] > gain) {
                    best = Some((gains[child][slot], child, slot));
                }
            }
        }
        if let Some((_, child, slot)) = best {
            placed[child] = true;
            slots[slot] = Some(children[child]);
        }
    }
    slots
}

#[cfg(test)]
mod tests {
    use super::*;

    fn boxes(count: i64) -> Vec<Box3> {
        (0..count)
            .map(|i| {
                let min = [i * 7919 % 10_007, i * 104_729 % 5_003, i * 31 % 997];
                Box3 { min, max: min.map(|x| x + 1 + i % 5) }
            })
            .collect()
    }

    /// Checks the structure; returns the number of leaf children.
    fn check(tree: &WideTree, boxes: &[Box3], leaf_items: u8) -> usize {
        let mut parents = vec![0; tree.nodes.len()];
        let mut met = vec![0; boxes.len()];
        let mut leaves = 0;
        for (index, node) in tree.nodes.iter().enumerate() {
            let (mut inner, mut item) = (node.child_base as usize, node.item_base as usize);
            for child in node.children.iter().flatten() {
                assert_eq!(node.bounds.union(&child.bounds), node.bounds);
                if child.count == 0 {
                    assert!(inner > index);
                    parents[inner] += 1;
                    assert_eq!(tree.nodes[inner].bounds, child.bounds);
                    inner += 1;
                } else {
                    assert!(child.count <= leaf_items);
                    leaves += 1;
                    for _ in 0..child.count {
                        let b = boxes[tree.items[item] as usize];
                        assert_eq!(child.bounds.union(&b), child.bounds);
                        met[tree.items[item] as usize] += 1;
                        item += 1;
                    }
                }
            }
        }
        assert!(parents[0] == 0 && parents[1..].iter().all(|&parents| parents == 1));
        assert!(met.iter().all(|&count| count == 1));
        leaves
    }

    #[test]
    fn collapsed_trees_hold_every_item_once() {
        for count in [1, 2, 3, 4, 8, 9, 25, 3000] {
            let boxes = boxes(count);
            let binary = BinaryTree::by_obvhs(&boxes, false);
            check(&collapse(&binary, 3), &boxes, 3);
            let halved = BinaryTree::by_splits(&boxes, 0);
            for leaf_items in [1, 3] {
                let low = collapse_levels(&halved, u32::from(leaf_items));
                check(&low, &boxes, leaf_items);
                assert!(3 * low.height < (count as u64).next_power_of_two().ilog2() + 5, "{} levels", low.height);
            }
            let single = collapse(&binary, 1);
            assert_eq!(check(&single, &boxes, 1), count as usize);
            if count == 3000 {
                let full = single.nodes.iter().map(|node| node.children.iter().flatten().count()).sum::<usize>();
                assert!(
                    full as f64 > 3.5 * single.nodes.len() as f64,
                    "{full} children of {} nodes",
                    single.nodes.len()
                );
                assert!(single.height >= 4 && single.height <= 12);
            }
        }
    }

    #[test]
    fn slots_are_octants() {
        // Eight unit boxes at the corners of a cube, shuffled; corner bit 2 is x.
        let corner = |c: i64| [c >> 2 & 1, c >> 1 & 1, c & 1].map(|bit| bit * 10);
        let order = [5, 0, 7, 2, 1, 6, 3, 4];
        let boxes: Vec<Box3> = order.iter().map(|&c| Box3 { min: corner(c), max: corner(c).map(|x| x + 1) }).collect();
        let tree = collapse(&BinaryTree::by_obvhs(&boxes, false), 1);
        let root = &tree.nodes[0];
        for (slot, child) in root.children.iter().enumerate() {
            assert_eq!(child.unwrap().bounds.min, corner(slot as i64), "slot {slot}");
        }
        assert_eq!(root.meta().1, 0);
    }

    #[test]
    fn meta_is_as_the_format_says() {
        let child = |count| Some(WideChild { bounds: Box3 { min: [0; 3], max: [1; 3] }, count });
        let children = [None, child(2), child(0), child(3), None, child(1), child(0), child(1)];
        let node = WideNode { bounds: Box3 { min: [0; 3], max: [1; 3] }, children, child_base: 1, item_base: 0 };
        let expected = [0, 0b011_00000, 0b001_11010, 0b111_00010, 0, 0b001_00101, 0b001_11110, 0b001_00110];
        assert_eq!(node.meta(), (expected, 0b0100_0100));
    }
}
