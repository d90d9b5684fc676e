//! NEON.

use super::{Isa, Lanes};
use crate::kernels::simd::wide::neon::{Eight, least_of_four as least, most_of_four as most};
use crate::kernels::trace::node::{FramedRay, NodeHits, UNIT, node_hits};
use crate::kernels::vector::xyz;
use bricks::Node;
use std::arch::aarch64::*;

/// NEON, of aarch64: part of every processor that the standard library of Rust runs on.
#[derive(Clone, Copy, Debug)]
pub struct Neon(());

impl Neon {
    /// If the processor has it.
    pub fn detect() -> Option<Self> {
        std::arch::is_aarch64_feature_detected!("neon").then_some(Self(()))
    }
}

isa_over_intrinsics!(Neon, Eight, Eight);

#[inline(always)]
fn prefetch_line(at: *const u8) {
    // SAFETY: a prefetch of any address does no harm.
    unsafe { std::arch::asm!("prfm pldl1keep, [{at}]", at = in(reg) at, options(nostack, preserves_flags, readonly)) }
}

#[inline]
#[target_feature(enable = "neon")]
fn vector(v: &[f32; 4]) -> float32x4_t {
    // SAFETY: all four numbers are there.
    unsafe { vld1q_f32(v.as_ptr()) }
}

#[inline]
#[target_feature(enable = "neon")]
fn vector_of_bytes(bytes: &[u8; 8]) -> uint8x8_t {
    vcreate_u8(u64::from_le_bytes(*bytes))
}

/// The greatest of the first three lanes, in all.
#[inline]
#[target_feature(enable = "neon")]
fn most3(x: float32x4_t) -> float32x4_t {
    let (y, z) = (vdupq_laneq_f32::<1>(x), vdupq_laneq_f32::<2>(x));
    vdupq_laneq_f32::<0>(most(x, most(y, z)))
}

/// Bytes as words.
#[inline]
#[target_feature(enable = "neon")]
fn words(bytes: uint8x8_t) -> [uint32x4_t; 2] {
    let halves = vmovl_u8(bytes);
    [vmovl_u16(vget_low_u16(halves)), vmovl_high_u16(halves)]
}

/// Eight bounds as numbers.
#[inline]
#[target_feature(enable = "neon")]
fn numbers(bytes: &[u8; 8]) -> float32x4x2_t {
    let [low, high] = words(vector_of_bytes(bytes));
    float32x4x2_t(vcvtq_f32_u32(low), vcvtq_f32_u32(high))
}

/// Eight words as numbers.
#[inline]
#[target_feature(enable = "neon")]
fn steps(words: &[u16; 8]) -> float32x4x2_t {
    // SAFETY: all eight words are there.
    let words = unsafe { vld1q_u16(words.as_ptr()) };
    float32x4x2_t(vcvtq_f32_u32(vmovl_u16(vget_low_u16(words))), vcvtq_f32_u32(vmovl_high_u16(words)))
}

/// Origin and steps of a node's grid; the last lanes are 0.
#[inline]
#[target_feature(enable = "neon")]
fn grid(node: &Node) -> [float32x4_t; 2] {
    let [first, ..]: &[[u32; 4]; 5] = bytemuck::cast_ref(node);
    // The last word holds the exponents and the mask of inner children; as a lane it is 0, because small numbers are
    // slow.
    let [exponents, _] = words(vcreate_u8(u64::from(first[3] & 0x00ff_ffff)));
    let p = vector(bytemuck::cast_ref(first));
    [vsetq_lane_f32::<3>(0.0, p), vreinterpretq_f32_u32(vshlq_n_u32::<23>(exponents))]
}

/// Four numbers, and four zeros.
#[inline]
#[target_feature(enable = "neon")]
fn extended(x: float32x4_t) -> float32x4x2_t {
    float32x4x2_t(x, vdupq_n_f32(0.0))
}

/// All bits set in the lanes of the children that `ray` enters: `NodeFrame::new` and `node_hits`.
#[inline]
#[target_feature(enable = "neon")]
fn entered(ray: &FramedRay, lanes: &Lanes, node: &Node, t_max: f32) -> [uint32x4_t; 2] {
    let [p, s] = grid(node);
    let low = vector(&lanes.offset_low);
    let pc = vaddq_f32(vaddq_f32(p, vector(&lanes.offset_high)), low);
    let origin = vector(&lanes.origin);
    let w = vsubq_f32(pc, origin);
    let m = most3(vaddq_f32(vabsq_f32(w), vmulq_n_f32(s, 255.0)));
    let all = vmulq_n_f32(m, 64.0 * UNIT);
    let delta =
        vaddq_f32(vaddq_f32(all, vmulq_n_f32(vabsq_f32(pc), 4.0 * UNIT)), vmulq_n_f32(vabsq_f32(low), 2.0 * UNIT));
    let inverse = vector(&lanes.inverse);
    let sign = vandq_u32(vreinterpretq_u32_f32(inverse), vdupq_n_u32(1 << 31));
    let signed_delta = vreinterpretq_f32_u32(veorq_u32(vreinterpretq_u32_f32(delta), sign));
    let scale = vmulq_f32(s, inverse);
    let near = vmulq_f32(vsubq_f32(w, signed_delta), inverse);
    let far = vmulq_f32(vaddq_f32(w, signed_delta), inverse);
    let [x, y, z, _] = lanes.inverse.map(|inverse| (inverse.to_bits() >> 31) as usize);
    let bounds = [&node.lo, &node.hi];
    // The product and the sum of an axis, rounded one after the other.
    macro_rules! distances {
        ($axis:literal, $bytes:expr, $offset:ident) => {{
            let (q, offset) = (numbers($bytes), vdupq_laneq_f32::<$axis>($offset));
            [
                vaddq_f32(vmulq_laneq_f32::<$axis>(q.0, scale), offset),
                vaddq_f32(vmulq_laneq_f32::<$axis>(q.1, scale), offset),
            ]
        }};
    }
    let near_x = distances!(0, &bounds[x][0], near);
    let near_y = distances!(1, &bounds[y][1], near);
    let near_z = distances!(2, &bounds[z][2], near);
    let far_x = distances!(0, &bounds[1 - x][0], far);
    let far_y = distances!(1, &bounds[1 - y][1], far);
    let far_z = distances!(2, &bounds[1 - z][2], far);
    let (t_min, t_max) = (vdupq_n_f32(ray.t_min), vdupq_n_f32(t_max));
    [0, 1].map(|i| {
        let tn = most(most(near_x[i], near_y[i]), most(near_z[i], t_min));
        let tf = least(least(far_x[i], far_y[i]), least(far_z[i], t_max));
        vcleq_f32(tn, tf)
    })
}

/// The lanes, all in one.
#[inline]
#[target_feature(enable = "neon")]
fn any(x: [uint32x4_t; 2]) -> u32 {
    let x = vorrq_u32(x[0], x[1]);
    let x = vget_lane_u64::<0>(vreinterpret_u64_u32(vorr_u32(vget_low_u32(x), vget_high_u32(x))));
    (x | x >> 32) as u32
}

/// Left to the compiler.
#[target_feature(enable = "neon")]
fn hits(ray: &FramedRay, lanes: &Lanes, node: &Node, slack: f32, t_max: f32) -> NodeHits {
    node_hits(ray, node, xyz(lanes.offset_high), xyz(lanes.offset_low), slack, t_max)
}

#[inline]
#[target_feature(enable = "neon")]
fn open(ray: &FramedRay, lanes: &Lanes, node: &Node, t_max: f32) -> u32 {
    let entered = entered(ray, lanes, node, t_max);
    let what = vector_of_bytes(&node.meta);
    let count = words(vshr_n_u8::<5>(what));
    let both = vdup_n_u8(24);
    // In nodes that are valid, and all have been checked, these are inner children, and their count is 1.
    let inner = vceq_u8(vand_u8(what, both), both);
    let priority = vsub_u8(vdup_n_u8(31), veor_u8(vand_u8(what, vdup_n_u8(7)), vdup_n_u8(ray.flip as u8)));
    let first = vand_u8(what, vdup_n_u8(31));
    let shift = words(vbsl_u8(inner, priority, first));
    any([0, 1].map(|i| vshlq_u32(vandq_u32(count[i], entered[i]), vreinterpretq_s32_u32(shift[i]))))
}
