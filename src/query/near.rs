//! How points find what may be nearest: squared distances of boxes in f32, in frames in which these are small.

use super::walk::{Asks, Branch};
use crate::kernels::simd::isa::Isa;
use crate::kernels::simd::wide::Wide;
use crate::kernels::trace::node::UNIT;
use glam::DVec3;

/// Of coordinates that took part: many times the f64 roundings of what is computed from them.
pub(super) const MARGIN: f64 = 1.0 / (1u64 << 46) as f64;
/// Of squared distances: many times what is rounded of them.
const ROUNDED: f32 = 1.0 / (1u32 << 20) as f32;
/// Points that lie farther from a frame's origin are not asked in it: squares of their distances might overflow.
const FAR: f32 = 1e18;

/// A point in a frame.
pub(super) struct Near {
    at: [f32; 3],
    /// By how much boxes are grown.
    pad: f32,
    /// The frame's units of a world unit.
    per_unit: f64,
}

impl Near {
    /// `point` in the frame whose origin lies at `origin`; `extent` is that of its boxes, and `far` the greatest
    /// coordinate of what lies there, world units. `None`: it is too far away.
    #[inline(always)]
    pub(super) fn new(point: DVec3, origin: DVec3, per_unit: f64, (extent, far): (f32, f64)) -> Option<Self> {
        let at = ((point - origin) * per_unit).as_vec3();
        let reach = at.abs().max_element();
        let pad = (MARGIN * far.max(point.abs().max_element()) * per_unit) as f32;
        let pad = pad + 64.0 * UNIT * (reach + extent);
        (reach.max(pad) < FAR).then(|| Self { at: at.to_array(), pad, per_unit })
    }

    /// No less than a squared distance in the world.
    #[inline(always)]
    pub(super) fn limit(&self, squared: f64) -> f32 {
        let distance = (squared.sqrt() * self.per_unit).min(f64::from(FAR)) as f32;
        distance * distance * (1.0 + 4.0 * ROUNDED) + f32::MIN_POSITIVE
    }

    /// A squared distance in the world, no more than what `near` was the least for.
    #[inline(always)]
    pub(super) fn squared(&self, near: f32) -> f64 {
        let distance = f64::from(near).sqrt() / self.per_unit;
        distance * distance * (1.0 - MARGIN)
    }
}

impl<B: Branch> Asks<B> for Near {
    #[inline(always)]
    fn ask<I: Isa>(&self, isa: I, node: &B, limit: f32) -> (u32, [f32; 8]) {
        let (pad, zero) = (self.pad, isa.eight(0.0));
        let mut sum = zero;
        for k in 0..3 {
            let (step, origin) = node.grid(k);
            let (step, way) = (isa.eight(step), origin - self.at[k]);
            let below = node.bounds(isa, k, false) * step + isa.eight(way - pad);
            let above = isa.eight(-way - pad) - node.bounds(isa, k, true) * step;
            let gap = below.most(above).most(zero);
            sum = sum + gap * gap;
        }
        let least = sum * isa.eight(1.0 - ROUNDED);
        let mut near = [0.0; 8];
        least.store(&mut near);
        (least.less_equal(isa.eight(limit)), near)
    }
}

#[cfg(test)]
mod tests {
    use super::super::walk::extent;
    use super::*;
    use crate::kernels::simd::isa::for_each_isa;
    use crate::math::random::Rng;
    use bricks::Node;

    /// A node whose children's boxes are as the numbers draw them, in steps of 2^-6 to 2^1.
    fn node(rng: &mut Rng) -> Node {
        let mut byte = |most: f32| ((rng.signed() + 1.0) * 0.5 * most) as u8;
        let exponent = [0; 3].map(|_| 121 + byte(7.9));
        let lo = [[0; 8]; 3].map(|axis| axis.map(|_: u8| byte(200.0)));
        let hi = lo.map(|axis| axis.map(|low| low + byte(55.0)));
        let origin = [0; 3].map(|_| 300.0 * rng.signed());
        Node { origin, exponent, inner_mask: 255, child_base: 1, triangle_base: 0, meta: [0; 8], lo, hi }
    }

    /// The squared distance of a point from a child's box in the world, from what is given alone.
    fn squared(node: &Node, slot: usize, (origin, unit): (DVec3, f64), point: DVec3) -> f64 {
        let gap = |k: usize| {
            let step = f64::from(i32::from(node.exponent[k]) - 127).exp2();
            let at = |q: u8| origin[k] + (f64::from(node.origin[k]) + f64::from(q) * step) * unit;
            (at(node.lo[k][slot]) - point[k]).max(point[k] - at(node.hi[k][slot])).max(0.0)
        };
        gap(0) * gap(0) + gap(1) * gap(1) + gap(2) * gap(2)
    }

    #[test]
    fn boxes_are_no_farther_than_told_and_those_that_are_too_far_are_left_out() {
        for_each_isa!(isa => {
            let mut rng = Rng(4);
            let (mut asked, mut left_out) = (0, 0);
            for i in 0..4000 {
                let node = node(&mut rng);
                let unit = [1.0, 2.0f64.powi(-30), 2.0f64.powi(200)][i % 3];
                let mut place = |scale: f64| DVec3::from_array([0; 3].map(|_| scale * unit * f64::from(rng.signed())));
                let origin = place([0.0, 1e3, 1e9][i / 3 % 3]);
                let point = origin + place([1.0, 300.0, 1e4, 1e9][i / 9 % 4]);
                let far = origin.abs().max_element() + 2000.0 * unit;
                let near = Near::new(point, origin, 1.0 / unit, (extent(&[node]), far)).unwrap();
                let true_ones: [f64; 8] = std::array::from_fn(|slot| squared(&node, slot, (origin, unit), point));
                let within = true_ones[i % 8];
                let (mask, told) = near.ask(isa, &node, near.limit(within));
                for slot in 0..8 {
                    let is_asked = mask >> slot & 1 != 0;
                    assert!(near.squared(told[slot]) <= true_ones[slot] * (1.0 + 1e-12), "{i} {slot}");
                    assert!(is_asked || true_ones[slot] > within, "{i} {slot}");
                    (asked, left_out) = (asked + u32::from(is_asked), left_out + u32::from(!is_asked));
                }
            }
            assert!(asked > 12_000 && left_out > 8000, "{asked} {left_out}");
        });
        assert!(Near::new(DVec3::X * 1e19, DVec3::ZERO, 1.0, (1.0, 1.0)).is_none());
    }
}
