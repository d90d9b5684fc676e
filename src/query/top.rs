//! The wide top level, as queries walk it: boxes in f64, and in f32 about the scene's middle.

use super::near::Near;
use super::space::{Boxes, Meets, children};
use super::walk::{Open, extent, walk};
use crate::kernels::frame::{Frame, Placement};
use crate::kernels::simd::isa::Isa;
use crate::kernels::trace::node::inner_before;
use crate::session::trace::Surroundings;
use bricks::{Node, Resident, TopNode8};
use glam::DVec3;

/// The wide top level.
pub(super) struct Top {
    /// In the frame.
    pub(super) nodes: Vec<Node>,
    /// Boxes of their children, world units.
    pub(super) boxes: Vec<Boxes<8>>,
    /// Of the scene's middle.
    pub(super) frame: Frame,
    /// `None`: the scene is empty.
    pub(super) surroundings: Option<Surroundings>,
    /// Units of the frame of a world unit.
    pub(super) per_unit: f64,
    /// World units of a step of the lattice.
    pub(super) step: f64,
    /// The greatest coordinate of boxes in the frame.
    pub(super) extent: f32,
    /// The greatest coordinate of anything in the scene.
    pub(super) far: f64,
    /// Its lower and upper corner.
    corners: [DVec3; 2],
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

impl Top {
    pub(super) fn new(resident: &Resident) -> Self {
        let step = f64::from(resident.objects[0].step_log2).exp2();
        let corners = resident.top2.first().map_or([DVec3::ZERO; 2], |root| {
            [root.min, root.max].map(|corner| DVec3::from_array(corner.map(|x| x as f64)) * step)
        });
        let middle = 0.5 * (corners[0] + corners[1]);
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
        let nodes = Placement::new(resident, &frame).top8;
        Self {
            extent: extent(&nodes),
            nodes,
            boxes: resident.top8.iter().map(boxes).collect(),
            per_unit: 1.0 / frame.unit,
            frame,
            surroundings: Surroundings::new(resident),
            step,
            far: corners[0].abs().max(corners[1].abs()).max_element(),
            corners,
        }
    }

    /// The greatest coordinate of anything in the scene as the frame has it, world units.
    pub(super) fn reach(&self) -> f64 {
        let [low, high] = self.corners.map(|corner| (corner - self.frame.origin).abs());
        low.max(high).max_element()
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
    /// squared; about the nearest first, and none farther than `within`, squared, and than `visit` last said. `open` is
    /// room to work in.
    #[inline(always)]
    pub(super) fn near_leaves<I: Isa>(
        &self,
        isa: I,
        point: DVec3,
        within: f64,
        open: &mut Vec<Open>,
        mut visit: impl FnMut(u32, f64) -> f64,
    ) {
        let Some(near) = Near::new(point, self.frame.origin, self.per_unit, (self.extent, self.far)) else {
            return self.leaves_from_afar(point, within, visit);
        };
        walk(
            isa,
            &self.nodes,
            &near,
            near.limit(within),
            open,
            #[inline(always)]
            |leaf, least| Some(near.limit(visit(leaf.start, near.squared(least)))),
        );
    }

    /// [`Self::near_leaves`] of a point that is too far away for the frame: all leaves in f64, the nearest first.
    #[cold]
    fn leaves_from_afar(&self, point: DVec3, mut within: f64, mut visit: impl FnMut(u32, f64) -> f64) {
        let of_node = |(node, boxes): (&Node, &Boxes<8>)| {
            let distances = boxes.distances_squared(point);
            let slots = (0..8).filter(|&slot| node.meta[slot] != 0);
            slots.map(|slot| (distances[slot], child(node, slot))).collect::<Vec<_>>()
        };
        let mut all: Vec<_> = self.nodes.iter().zip(&self.boxes).flat_map(of_node).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (least, child) in all {
            if let Child::Leaf(leaf) = child
                && least <= within
            {
                within = visit(leaf, least);
            }
        }
    }
}
