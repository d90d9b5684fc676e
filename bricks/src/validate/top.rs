//! Checks of top-level trees, over bricks alone and over bricks and levels of detail. Each is a tree over exactly the
//! leaves, children after parents.

use super::node::NodeView;
use super::rule::rule;
use crate::error::{Flaw, Part};
use crate::layout::Section;
use crate::records::{LATTICE_LIMIT, MAX_TOP_EXPONENT, MAX_TOP_HEIGHT, MAX_TOP2_HEIGHT, TOP_LEAF, TopNode2, TopNode8};

/// Levels of the nodes of a tree, found parents first.
struct Levels {
    section: Section,
    limit: u32,
    /// Level of each node, the root's 1; 0 while no parent was met.
    nodes: Vec<u8>,
    /// Whether each leaf was met.
    leaves: Vec<bool>,
}

impl Levels {
    fn new(section: Section, limit: u32, nodes: usize, leaves: usize) -> Self {
        let mut levels = Self { section, limit, nodes: vec![0; nodes], leaves: vec![false; leaves] };
        if let Some(root) = levels.nodes.first_mut() {
            *root = 1;
        }
        levels
    }

    /// The level of a node, all nodes before it having been met.
    fn of(&self, node: u32) -> Result<u8, Flaw> {
        let level = self.nodes[node as usize];
        rule(level != 0, Part::Record(self.section, node), || ("a node without a parent", "a tree"))?;
        Ok(level)
    }

    /// Meets a child, which lies in the tree and after its parent.
    fn child(&mut self, node: u32, level: u8, child: u32) -> Result<(), Flaw> {
        let part = Part::Record(self.section, node);
        rule(u32::from(level) < self.limit, part, || {
            (format!("children on level {}", level + 1), format!("at most {} levels", self.limit))
        })?;
        rule(self.nodes[child as usize] == 0, part, || (format!("child {child}, which another node has"), "a tree"))?;
        self.nodes[child as usize] = level + 1;
        Ok(())
    }

    /// Meets a leaf.
    fn leaf(&mut self, node: u32, leaf: u32) -> Result<(), Flaw> {
        let part = Part::Record(self.section, node);
        let count = self.leaves.len();
        let met = self.leaves.get_mut(leaf as usize);
        rule(met.is_some(), part, || (format!("leaf {leaf}"), format!("less than {count}")))?;
        if let Some(met) = met {
            rule(!*met, part, || (format!("leaf {leaf}, which another node has"), "every leaf once"))?;
            *met = true;
        }
        Ok(())
    }

    /// Every leaf was met, and there are nodes only if there are leaves.
    fn finish(self) -> Result<(), Flaw> {
        let part = Part::Section(self.section);
        rule(self.nodes.is_empty() == self.leaves.is_empty(), part, || {
            (format!("{} nodes over {} leaves", self.nodes.len(), self.leaves.len()), "nodes if and only if leaves")
        })?;
        let missed = self.leaves.iter().position(|met| !met);
        rule(missed.is_none(), part, || {
            (format!("no node with leaf {}", missed.unwrap_or(0)), format!("all {} leaves", self.leaves.len()))
        })
    }
}

/// Checks a binary tree. Bounds of children lie within those of their parent.
pub(super) fn binary(section: Section, nodes: &[TopNode2], leaves: usize) -> Result<(), Flaw> {
    let mut levels = Levels::new(section, MAX_TOP2_HEIGHT, nodes.len(), leaves);
    for (index, node) in (0u32..).zip(nodes) {
        let part = Part::Record(section, index);
        let level = levels.of(index)?;
        for axis in 0..3 {
            let (min, max) = (node.min[axis], node.max[axis]);
            rule(-LATTICE_LIMIT <= min && min <= max && max <= LATTICE_LIMIT, part, || {
                (format!("bounds {:?} to {:?}", node.min, node.max), format!("bounds in order within ±{LATTICE_LIMIT}"))
            })?;
        }
        if node.right == TOP_LEAF {
            levels.leaf(index, node.left)?;
            continue;
        }
        for child in [node.left, node.right] {
            rule(child > index && (child as usize) < nodes.len(), part, || {
                (format!("child {child}"), format!("a node after {index} and before {}", nodes.len()))
            })?;
            levels.child(index, level, child)?;
            let bounds = &nodes[child as usize];
            let within = (0..3).all(|axis| bounds.min[axis] >= node.min[axis] && bounds.max[axis] <= node.max[axis]);
            rule(within, part, || {
                let found = format!("child {child} with bounds {:?} to {:?}", bounds.min, bounds.max);
                (found, format!("bounds within its own, {:?} to {:?}", node.min, node.max))
            })?;
        }
    }
    levels.finish()
}

/// Checks an 8-wide tree. Each leaf child has one leaf.
pub(super) fn wide(section: Section, nodes: &[TopNode8], leaves: usize) -> Result<(), Flaw> {
    let mut levels = Levels::new(section, MAX_TOP_HEIGHT, nodes.len(), leaves);
    for (index, node) in (0u32..).zip(nodes) {
        let part = Part::Record(section, index);
        let level = levels.of(index)?;
        rule(node._reserved == 0, part, || (format!("{:#x} in the reserved word", node._reserved), "zero"))?;
        for axis in 0..3 {
            let (origin, exponent) = (node.origin[axis], node.exponent[axis]);
            rule(origin.abs_diff(0) <= LATTICE_LIMIT as u64 && exponent <= MAX_TOP_EXPONENT, part, || {
                (
                    format!("origin {:?} and exponents {:?}", node.origin, node.exponent),
                    format!("origins within ±{LATTICE_LIMIT} and exponents up to {MAX_TOP_EXPONENT}"),
                )
            })?;
        }
        let view = NodeView::of_top(node);
        view.check(index, nodes.len() as u32, leaves as u32, "leaves").map_err(|flaw| flaw.of_node(part, "a node"))?;
        for slot in (0..8).filter(|&slot| view.has_child(slot)) {
            let order = (0..3).all(|axis| node.lo[axis][slot] <= node.hi[axis][slot]);
            rule(order, part, || {
                (format!("bounds of child {slot} that are not in order"), "lower before upper bounds")
            })?;
        }
        for child in 0..view.inner_count() {
            levels.child(index, level, view.child_base + child)?;
        }
        for (slot, first, count) in view.leaves() {
            rule(count == 1, part, || (format!("{count} leaves in child {slot}"), "one"))?;
            levels.leaf(index, first)?;
        }
    }
    levels.finish()
}
