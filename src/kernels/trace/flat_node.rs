//! One ray against the children of a node of a brick that is flat ([`crate::kernels::flat`]).

use super::node::{FramedRay, UNIT, inner_before};
use super::walk_brick::{Group, OpenedNode, STACK_SIZE};
use crate::kernels::flat::{FlatBrick, FlatNode, Grid};
use crate::kernels::simd::isa::Isa;
use crate::kernels::simd::wide::{Wide, three};
use crate::kernels::vector::{Vec3, each, most3};

/// What a ray makes of the grid of a brick: distances are steps * `scale` + `near`, and the same with `far`.
#[derive(Clone, Copy, Default)]
pub struct Sight {
    /// A step.
    pub scale: Vec3,
    /// Of the padded bounds that are near.
    pub near: Vec3,
    /// Of the others.
    pub far: Vec3,
    /// Which bounds are near by axis: 0 lower, 1 upper.
    pub side: [usize; 3],
}

impl Sight {
    /// Of a ray in a frame in which the brick lies at an offset: [`super::node::NodeFrame`] of the brick's grid. Of a
    /// distance m to its farthest bound and an offset p of its origin, distances are off by less than 4 m + p units,
    /// fused or not, and those of triangles reach by 36 m beyond their boxes ([`crate::math::exact`]).
    #[inline(always)]
    pub fn new(ray: &FramedRay, brick: &FlatBrick, offset_high: Vec3, offset_low: Vec3) -> Self {
        let Grid { origin, step } = brick.grid;
        let at = each(|k| (origin[k] + offset_high[k]) + offset_low[k]);
        let w = each(|k| at[k] - ray.origin[k]);
        let m = most3(each(|k| w[k].abs() + Grid::STEPS * step[k]));
        let delta = each(|k| 64.0 * UNIT * m + 4.0 * UNIT * at[k].abs() + 2.0 * UNIT * offset_low[k].abs());
        let inverse = ray.frame.inv;
        let side = inverse.map(|i| usize::from(i < 0.0));
        let signed = each(|k| if side[k] != 0 { -delta[k] } else { delta[k] });
        Self {
            scale: each(|k| step[k] * inverse[k]),
            near: each(|k| (w[k] - signed[k]) * inverse[k]),
            far: each(|k| (w[k] + signed[k]) * inverse[k]),
            side,
        }
    }

    /// Opens a node between `t_min` and `t_max`: what the ray enters of its children goes to `open`, what of its
    /// triangles it may meet comes back.
    #[inline(always)]
    pub fn open<I: Isa>(&self, isa: I, node: &FlatNode, (t_min, t_max): (f32, f32), open: &mut FlatOpen) -> Group {
        let scale = three!(k => isa.eight(self.scale[k]));
        let near = three!(k => {
            isa.steps(&node.bounds[self.side[k]][k]).times_plus(scale[k], isa.eight(self.near[k]))
        });
        let far = three!(k => {
            isa.steps(&node.bounds[1 - self.side[k]][k]).times_plus(scale[k], isa.eight(self.far[k]))
        });
        let near = near[0].most(near[1]).most(near[2].most(isa.eight(t_min)));
        let far = far[0].least(far[1]).least(far[2].least(isa.eight(t_max)));
        // Not pruned at equality: a hit at equal distance with a lower id must be found.
        let (children, triangles) = node.met(near.less_equal(far));
        (open.left, open.inner_mask, open.base) = (children, node.inner_mask.into(), node.child_base);
        near.store(&mut open.near);
        triangles
    }
}

/// Nodes that a ray is to visit.
pub type FlatStack = [FlatOpen; STACK_SIZE];

/// A node's entered inner children, still to be visited.
#[derive(Clone, Copy, Default)]
#[repr(C, align(32))]
pub struct FlatOpen {
    /// No more than the distance at which the ray enters each.
    pub near: [f32; 8],
    /// Those, a bit each.
    left: u32,
    /// As of the node.
    inner_mask: u32,
    /// The first of its children.
    base: u32,
}

impl FlatOpen {
    /// Takes the next child of the topmost of `depth` nodes: the nearest, if it is entered up to `t_max`. A ray that
    /// asks for any hit is given its octant, and visits children in the order of packed nodes: which hit comes first
    /// depends on it. Its `t_max` stays as it was when nodes were opened.
    #[inline(always)]
    pub fn take(stack: &mut FlatStack, depth: &mut usize, octant: Option<u32>, t_max: f32) -> Option<u32> {
        while *depth > 0 {
            let top = &mut stack[*depth - 1];
            let order = |slot: usize| octant.map_or(top.near[slot], |octant| (slot as u32 ^ octant) as f32);
            if top.left != 0 {
                let mut slot = top.left.trailing_zeros() as usize % 8;
                let mut others = top.left & (top.left - 1);
                while others != 0 {
                    let other = others.trailing_zeros() as usize % 8;
                    others &= others - 1;
                    slot = if order(other) < order(slot) { other } else { slot };
                }
                // Where the nearest is too far, all are.
                if top.near[slot] <= t_max {
                    top.left &= !(1 << slot);
                    *depth -= usize::from(top.left == 0);
                    return Some(top.base + inner_before(top.inner_mask, slot as u32));
                }
            }
            *depth -= 1;
        }
        None
    }
}

/// The bits of a byte by priority: bit i at 7 - (i ^ `flip`).
#[inline(always)]
fn by_priority(bits: u32, flip: u32) -> u32 {
    // As bits of a byte are reversed, but that each of the steps is made or not.
    let step = |x: u32, by: u32, low: u32| if flip & by == 0 { (x & low) << by | x >> by & low } else { x };
    step(step(step(bits, 1, 0x55), 2, 0x33), 4, 0x0f)
}

impl FlatNode {
    /// What is met of it where children are entered, a bit each: inner children, a bit each, and triangles.
    #[inline(always)]
    fn met(&self, entered: u32) -> (u32, Group) {
        let (inner_mask, present) = (u32::from(self.inner_mask), u32::from(self.present));
        let inner = entered & inner_mask;
        let mut leaves = entered & present & !inner_mask;
        let mut triangles = 0;
        while leaves != 0 {
            triangles |= self.triangles_of(leaves.trailing_zeros() as usize);
            leaves &= leaves - 1;
        }
        (inner, Group { base: self.triangle_base, bits: triangles })
    }

    /// The same with the inner children by priority.
    #[inline(always)]
    pub fn opened(&self, entered: u32, flip: u32) -> OpenedNode {
        let (inner, triangles) = self.met(entered);
        let bits = by_priority(inner, flip) << 24 | u32::from(self.inner_mask);
        OpenedNode { children: Group { base: self.child_base, bits }, triangles }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::probe;
    use crate::kernels::trace::node::traversal_mask;

    #[test]
    fn children_have_the_priorities_of_packed_nodes() {
        let file = probe::scene().unwrap();
        let mut masks = std::collections::BTreeSet::new();
        for brick in &file.resident().bricks {
            let flat = FlatBrick::new(&[brick.root], std::iter::empty());
            for (entered, flip) in (0..256).flat_map(|entered| (0..8).map(move |flip| (entered, flip))) {
                let OpenedNode { children, triangles } = flat.nodes[0].opened(entered, flip);
                let packed = traversal_mask(entered, &brick.root, flip);
                assert_eq!(children.bits & 0xff00_0000 | triangles.bits, packed, "{entered:#b} {flip}");
                assert_eq!(children.bits & 0xff, u32::from(brick.root.inner_mask));
                masks.insert(packed);
            }
        }
        assert!(masks.len() > 100, "only {} masks", masks.len());
    }
}
