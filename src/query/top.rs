//! The wide top level, as queries walk it: boxes in f64, and in f32 about the scene's middle for rays.

use super::room::{Room, nearest_on_top};
use super::space::{Boxes, Meets, children};
use crate::kernels::frame::{Frame, Placement};
use crate::kernels::trace::node::inner_before;
use crate::session::trace::Surroundings;
use bricks::{Node, Resident, TopNode8};
use glam::DVec3;

/// The wide top level.
pub(super) struct Top {
    /// In the frame.
    pub(super) nodes: Vec<Node>,
    /// Boxes of their children, world units.
    boxes: Vec<Boxes<8>>,
    /// Of the scene's middle.
    pub(super) frame: Frame,
    /// `None`: the scene is empty.
    pub(super) surroundings: Option<Surroundings>,
    /// Units of the frame of a world unit.
    pub(super) per_unit: f64,
    /// World units of a step of the lattice.
    pub(super) step: f64,
}

/// What a child of a node is.
#[derive(Clone, Copy)]
pub(super) enum Child {
    Node(u32),
    Leaf(u32),
}

/// The child in `slot`, which there is.
#[inline(always)]
pub(super) fn child(node: &Node, slot: usize) -> Child {
    if node.inner_mask >> slot & 1 != 0 {
        return Child::Node(node.child_base + inner_before(u32::from(node.inner_mask), slot as u32));
    }
    Child::Leaf(node.triangle_base + u32::from(node.meta[slot] & 31))
}

/// In a number of what is left to be visited: it is a leaf.
const LEAF: u32 = 1 << 31;

impl Child {
    /// As a number.
    #[inline(always)]
    pub(super) fn number(self) -> u32 {
        match self {
            Self::Node(node) => node,
            Self::Leaf(leaf) => leaf | LEAF,
        }
    }

    /// Of a number.
    #[inline(always)]
    pub(super) fn of(number: u32) -> Self {
        if number & LEAF != 0 { Self::Leaf(number & !LEAF) } else { Self::Node(number) }
    }
}

impl Top {
    pub(super) fn new(resident: &Resident) -> Self {
        let step = f64::from(resident.objects[0].step_log2).exp2();
        let middle = resident.top2.first().map_or(DVec3::ZERO, |root| {
            DVec3::from_array([0, 1, 2].map(|k| 0.5 * (root.min[k] as f64 + root.max[k] as f64) * step))
        });
        let frame = Frame::near(resident, middle);
        let boxes = |node: &TopNode8| {
            let grid = |bounds: &[[u8; 8]; 3]| {
                std::array::from_fn(|k| {
                    let (origin, grid) = (node.origin[k] as f64, f64::from(node.exponent[k]).exp2());
                    bounds[k].map(|q| (origin + f64::from(q) * grid) * step)
                })
            };
            Boxes::new(grid(&node.lo), grid(&node.hi))
        };
        Self {
            nodes: Placement::new(resident, &frame).top8,
            boxes: resident.top8.iter().map(boxes).collect(),
            per_unit: 1.0 / frame.unit,
            frame,
            surroundings: Surroundings::new(resident),
            step,
        }
    }

    /// Of each node, whether there is a leaf below it for which `has` holds.
    pub(super) fn marked(&self, has: impl Fn(u32) -> bool) -> Vec<bool> {
        let mut marks = vec![false; self.nodes.len()];
        // Children follow their parent.
        for (index, node) in self.nodes.iter().enumerate().rev() {
            marks[index] = (0..8).filter(|slot| node.meta[*slot] != 0).any(|slot| match child(node, slot) {
                Child::Node(child) => marks[child as usize],
                Child::Leaf(leaf) => has(leaf),
            });
        }
        marks
    }

    /// Calls `visit` for the leaves right below marked nodes whose boxes, and those above them, `what` may meet. `open`
    /// is room to work in.
    #[inline(always)]
    pub(super) fn leaves(&self, marks: &[bool], what: &impl Meets, open: &mut Vec<u32>, mut visit: impl FnMut(u32)) {
        open.clear();
        if marks.first() == Some(&true) {
            open.push(0);
        }
        while let Some(index) = open.pop() {
            let node = &self.nodes[index as usize];
            let mut met = what.meets(&self.boxes[index as usize]) & children(node);
            while met != 0 {
                let slot = met.trailing_zeros() as usize;
                met &= met - 1;
                match child(node, slot) {
                    Child::Leaf(leaf) => visit(leaf),
                    Child::Node(child) if marks[child as usize] => open.push(child),
                    Child::Node(_) => (),
                }
            }
        }
    }

    /// Calls `visit` for the leaves that may hold what is nearest to `point`, with no more than their distance from it,
    /// squared; about the nearest first, and none farther than `within`, squared, or than `visit` last said. `counts`
    /// says of a leaf whether what lies in it may be that.
    #[inline(always)]
    pub(super) fn near_leaves(
        &self,
        point: DVec3,
        mut within: f64,
        room: &mut Room,
        counts: impl Fn(u32) -> bool,
        mut visit: impl FnMut(&mut Room, u32, f64) -> f64,
    ) {
        room.near.clear();
        if !self.nodes.is_empty() {
            room.near.push((0.0, Child::Node(0).number()));
        }
        while let Some((distance, number)) = room.near.pop() {
            if distance > within {
                continue;
            }
            let index = match Child::of(number) {
                Child::Node(index) => index,
                Child::Leaf(leaf) => {
                    within = visit(room, leaf, distance).min(within);
                    continue;
                }
            };
            let (node, boxes) = (&self.nodes[index as usize], &self.boxes[index as usize]);
            let before = room.near.len();
            let distances = boxes.distances_squared(point);
            let mut left = children(node);
            while left != 0 {
                let slot = left.trailing_zeros() as usize;
                left &= left - 1;
                if distances[slot] <= within {
                    let child = child(node, slot);
                    if let Child::Leaf(leaf) = child {
                        if !counts(leaf) {
                            continue;
                        }
                        // Something lies in it.
                        within = within.min(boxes.farthest_squared(point, slot));
                    }
                    room.near.push((distances[slot], child.number()));
                }
            }
            nearest_on_top(&mut room.near[before..]);
        }
    }
}
