//! The padded test of a ray against the eight child boxes of a wide node: twin of `shaders/trace/node.wgsl`.

use crate::kernels::vector::{Vec3, each, least, most, most3};
use crate::math::exact::{RayFrame, ray_frame};
use bricks::Node;

/// 2^-24.
pub const UNIT: f32 = 5.960_464_5e-8;

/// A ray with all that traversal derives from it once, in the world's frame or an instance's.
#[derive(Clone, Copy, Debug)]
pub struct FramedRay {
    /// Origin.
    pub origin: Vec3,
    /// Least parameter, not negative.
    pub t_min: f32,
    /// Direction, not normalised.
    pub direction: Vec3,
    /// `slot ^ flip` ascends away from the ray's origin.
    pub flip: u32,
    /// What its direction contributes to the tests.
    pub frame: RayFrame,
}

/// A ray's frame, and the order in which it meets children.
pub fn framed_ray(origin: Vec3, direction: Vec3, t_min: f32) -> FramedRay {
    FramedRay { origin, t_min: most(t_min, 0.0), direction, flip: octant(direction), frame: ray_frame(direction) }
}

/// The octant that a direction points to: [`FramedRay::flip`].
#[inline(always)]
pub fn octant(direction: Vec3) -> u32 {
    let negative = direction.map(|d| d.to_bits() >> 31);
    // Slots are placed by octant: slot bit 2 is x, bit 1 y, bit 0 z, set for the upper half of the parent.
    (negative[0] << 2) | (negative[1] << 1) | negative[2]
}

/// Which children of a node a ray enters, and where.
#[derive(Clone, Copy, Debug)]
pub struct NodeHits {
    /// Distance of the entry into each.
    pub near: [f32; 8],
    /// Bit i: child i is entered.
    pub mask: u32,
}

/// What a node and a ray contribute to the test of each of the node's children: distances are q * `scale` + `near` and
/// q * `scale` + `far`, q being the child's bounds in steps of the grid.
pub struct NodeFrame {
    /// Per step of the grid.
    pub scale: Vec3,
    /// Of the padded lower plane along the ray.
    pub near: Vec3,
    /// Of the padded upper plane along the ray.
    pub far: Vec3,
    /// Whether the direction is negative on the axis, so that upper bounds are near.
    pub negative: [bool; 3],
}

impl NodeFrame {
    /// The frame of `node` and `ray`. The offset turns node space into the ray's; `slack` adds to the padding in units
    /// of the largest distance.
    #[inline(always)]
    pub fn new(ray: &FramedRay, node: &Node, offset_high: Vec3, offset_low: Vec3, slack: f32) -> Self {
        let s = node.exponent.map(|e| f32::from_bits(u32::from(e) << 23));
        let pc = each(|k| (node.origin[k] + offset_high[k]) + offset_low[k]);
        let w = each(|k| pc[k] - ray.origin[k]);
        let m = most3(each(|k| w[k].abs() + 255.0 * s[k]));
        let o = most3(ray.origin.map(f32::abs));
        let all = 64.0 * UNIT * m + slack * (m + o);
        // The last term covers the roundings of a wide brick's offset and is below the others for near bricks.
        let delta = each(|k| all + 4.0 * UNIT * pc[k].abs() + 2.0 * UNIT * offset_low[k].abs());
        let inverse = ray.frame.inv;
        let negative = inverse.map(|i| i < 0.0);
        let signed_delta = each(|k| if negative[k] { -delta[k] } else { delta[k] });
        Self {
            scale: each(|k| s[k] * inverse[k]),
            near: each(|k| (w[k] - signed_delta[k]) * inverse[k]),
            far: each(|k| (w[k] + signed_delta[k]) * inverse[k]),
            negative,
        }
    }
}

/// The padded test of `ray` against the children of `node` up to `t_max`; see [`NodeFrame::new`].
#[inline(always)]
pub fn node_hits(
    ray: &FramedRay,
    node: &Node,
    offset_high: Vec3,
    offset_low: Vec3,
    slack: f32,
    t_max: f32,
) -> NodeHits {
    let f = NodeFrame::new(ray, node, offset_high, offset_low, slack);
    let bounds = |k: usize| if f.negative[k] { (&node.hi[k], &node.lo[k]) } else { (&node.lo[k], &node.hi[k]) };
    let [(near_x, far_x), (near_y, far_y), (near_z, far_z)] = [bounds(0), bounds(1), bounds(2)];
    let mut out = NodeHits { near: [0.0; 8], mask: 0 };
    for i in 0..8 {
        let tn = most(
            most(f32::from(near_x[i]) * f.scale[0] + f.near[0], f32::from(near_y[i]) * f.scale[1] + f.near[1]),
            most(f32::from(near_z[i]) * f.scale[2] + f.near[2], ray.t_min),
        );
        let tf = least(
            least(f32::from(far_x[i]) * f.scale[0] + f.far[0], f32::from(far_y[i]) * f.scale[1] + f.far[1]),
            least(f32::from(far_z[i]) * f.scale[2] + f.far[2], t_max),
        );
        // Not pruned at equality: a hit at equal distance with a lower id must be found.
        out.mask |= u32::from(tn <= tf) << i;
        out.near[i] = tn;
    }
    out
}

/// Turns entered children into a traversal mask: bits 24..31 inner children by priority (the highest is nearest), bits
/// 0..23 triangles of leaf children.
#[inline(always)]
pub fn traversal_mask(entered: u32, node: &Node, flip: u32) -> u32 {
    let mut bits = 0;
    let mut left = entered;
    while left != 0 {
        let i = left.trailing_zeros();
        left &= left - 1;
        let what = u32::from(node.meta[i as usize]);
        let count = what >> 5;
        let inner = what & 24 == 24 && count == 1;
        bits |= count << if inner { 31 - ((what & 7) ^ flip) } else { what & 31 };
    }
    bits
}

/// The entered children that exist, inner ones and leaves alike, by priority in the high byte.
#[inline(always)]
pub fn by_priority(mut entered: u32, node: &Node, flip: u32) -> u32 {
    let mut bits = 0;
    while entered != 0 {
        let i = entered.trailing_zeros();
        entered &= entered - 1;
        if node.meta[i as usize] != 0 {
            bits |= 0x8000_0000 >> (i ^ flip);
        }
    }
    bits
}

/// The entered children that exist, a bit each, and where the nearest is entered.
#[inline(always)]
pub fn entered_children(hits: &NodeHits, node: &Node) -> (u32, f32) {
    let (mut mask, mut near) = (0, crate::kernels::layout::T_INFINITE);
    for i in 0..8 {
        if hits.mask & 1 << i != 0 && node.meta[i] != 0 {
            mask |= 1 << i;
            near = least(near, hits.near[i]);
        }
    }
    (mask, near)
}

/// Index of inner child `slot` among the children of a node: they lie in the order of their slots.
#[inline(always)]
pub fn inner_before(inner_mask: u32, slot: u32) -> u32 {
    (inner_mask & ((1 << slot) - 1)).count_ones()
}
