//! Traversal of one brick, the inner part of every intersection kernel's loop: twin of `shaders/trace/walk_brick.wgsl`.

use super::brick::Best;
use super::leaf::BrickRay;
use super::node::{FramedRay, inner_before};
use crate::kernels::bound::{Bound, Tally};
use crate::kernels::layout::{
    COUNTER_NODES, COUNTER_STACK_OVERFLOW, COUNTER_TRIANGLES, Hit, NONE, PARAM_ANY_HIT, Surface,
};
use crate::kernels::simd::isa::Isa;

/// MAX_BRICK_HEIGHT + MAX_TOP_HEIGHT and the entries that a change of tree leaves.
pub const STACK_SIZE: usize = 52;

/// Groups that are left to be visited.
pub type Stack = [Group; STACK_SIZE];

/// A node's entered inner children, still to be visited.
#[derive(Clone, Copy, Debug, Default)]
pub struct Group {
    /// The base of its children.
    pub base: u32,
    /// Priorities in the high byte (the highest is nearest) and the mask of inner slots in the low byte.
    pub bits: u32,
}

/// What a ray meets of a node.
pub struct OpenedNode {
    /// The inner children that it enters.
    pub children: Group,
    /// Triangles: `base` is the first of the node's, `bits` count from there on.
    pub triangles: Group,
}

impl Group {
    /// Whether it holds children to be visited.
    #[inline(always)]
    pub fn has_children(self) -> bool {
        self.bits > 0x00ff_ffff
    }

    /// Slot of the nearest child, and the group without it.
    #[inline(always)]
    pub fn nearest_child(self, flip: u32) -> (u32, Self) {
        let bit = 31 - self.bits.leading_zeros();
        ((31 - bit) ^ flip, Self { base: self.base, bits: self.bits & !(1 << bit) })
    }

    /// Slot of the nearest child; the others are left on the stack, of which `depth` are in use. `None`: there is no
    /// room for them, which is counted.
    #[inline(always)]
    pub fn take_nearest(self, flip: u32, stack: &mut Stack, depth: &mut usize, tally: &mut Tally) -> Option<u32> {
        let (child, rest) = self.nearest_child(flip);
        if rest.has_children() {
            if *depth == STACK_SIZE {
                tally.add(COUNTER_STACK_OVERFLOW, 1);
                return None;
            }
            stack[*depth] = rest;
            *depth += 1;
        }
        Some(child)
    }

    /// Node index of the inner child in `slot`: children lie in the order of their slots.
    #[inline(always)]
    pub fn child_index(self, slot: u32) -> u32 {
        self.base + inner_before(self.bits & 0xff, slot)
    }

    /// A group whose one child is node 0: slot 0 is set by its priority, and no inner child lies below it.
    #[inline(always)]
    pub fn root(flip: u32) -> Self {
        Self { base: 0, bits: 0x8000_0000 >> flip }
    }
}

/// Nodes visited and triangles tested by one ray.
#[derive(Clone, Copy, Debug, Default)]
pub struct Visits {
    /// Nodes.
    pub nodes: u32,
    /// Triangles.
    pub triangles: u32,
}

impl BrickRay<'_> {
    /// Opens node `index` of the brick.
    #[inline(always)]
    pub fn open_node<I: Isa>(&self, isa: I, bound: &Bound, visits: &mut Visits, t_max: f32, index: u32) -> OpenedNode {
        let node = &self.brick.nodes[index as usize];
        let mask = isa.open(&self.ray, &self.lanes, node, t_max);
        visits.nodes += 1;
        if index == 0 && mask != 0 {
            bound.note_use(self.leaf);
        }
        OpenedNode {
            children: Group { base: node.child_base, bits: (mask & 0xff00_0000) | u32::from(node.inner_mask) },
            triangles: Group { base: node.triangle_base, bits: mask & 0x00ff_ffff },
        }
    }

    /// Tests a group of triangles. With `any_hit` the first one accepted ends it.
    #[inline(always)]
    pub fn test_triangles(&self, visits: &mut Visits, best: &mut Best, group: Group, any_hit: bool) {
        let mut triangles = group.bits;
        visits.triangles += triangles.count_ones();
        while triangles != 0 {
            let bit = triangles.trailing_zeros();
            triangles &= triangles - 1;
            if self.test_triangle(best, group.base + bit) && any_hit {
                break;
            }
        }
    }
}

/// Writes what a walk found, if it found something nearer than was known.
#[inline(always)]
pub fn write_found(bound: &Bound, world: &FramedRay, best: &Best, hit: &mut Hit, surface: &mut Surface) {
    if best.leaf != NONE && bound.has(PARAM_ANY_HIT) {
        best.write_occluder(hit, surface);
    } else if best.leaf != NONE {
        let mut r = BrickRay::outside(world);
        r.enter_leaf(bound.scene, world, best.leaf);
        r.enter_brick(bound, bound.brick_of(best.leaf));
        r.write_hit(bound.scene, best, world.direction, hit, surface);
        bound.start_off(surface);
    }
}

impl Visits {
    /// Counts them, if they are asked for.
    #[inline(always)]
    pub fn count(self, bound: &Bound, tally: &mut Tally) {
        if bound.count {
            tally.add(COUNTER_NODES, self.nodes);
            tally.add(COUNTER_TRIANGLES, self.triangles);
        }
    }
}
