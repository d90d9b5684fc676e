//! The rays of a packet against the children of a node: first all of them by their bounds, then, where those do not
//! tell, ray by ray.

use super::node::UNIT;
use super::packet::{Axes, Column, Packet, RAYS, axes};
use crate::kernels::simd::isa::Isa;
use crate::kernels::simd::wide::{Wide, three};
use crate::kernels::vector::{Vec3, most};
use bricks::Node;

/// Where and how nodes are seen: see [`super::node::NodeFrame::new`].
#[derive(Clone, Copy)]
pub struct Place {
    offset_high: Axes,
    offset_low: Axes,
    slack: f32,
}

impl Place {
    /// Of nodes at an offset, with a padding of `slack` in units of the largest distance beside.
    pub fn new(offset_high: Vec3, offset_low: Vec3, slack: f32) -> Self {
        Self { offset_high: axes(offset_high), offset_low: axes(offset_low), slack }
    }
}

/// A node as all rays of a packet see it, by axis.
struct Seen {
    /// Its origin in their frame.
    at: Axes,
    /// Steps of its grid.
    step: Axes,
    /// The padding, but for the term of the largest distance.
    pad: [Axes; 2],
    /// Near and far planes for rays from one point.
    near: Axes,
    far: Axes,
    slack: f32,
}

/// The bytes that are not 0, a bit each.
#[inline(always)]
fn present(bytes: [u8; 8]) -> u32 {
    const LOW: u64 = 0x7f7f_7f7f_7f7f_7f7f;
    let x = u64::from_le_bytes(bytes);
    let high = (((x & LOW) + LOW) | x) & !LOW;
    ((high >> 7).wrapping_mul(0x0102_0408_1020_4080) >> 56) as u32
}

impl Packet {
    /// Which of `rays` enter each child of `node`, as [`super::node::node_hits`] says, written to `entered` for the
    /// children of the mask that comes back; no ray enters another child that exists. `entered` holds zeros before.
    #[inline(always)]
    pub fn open<I: Isa>(&self, isa: I, node: &Node, place: &Place, rays: u64, entered: &mut [u64; 8]) -> u32 {
        self.open_of(isa, (node, place, u32::MAX), rays, entered)
    }

    /// The same for the children of a mask alone.
    #[inline(always)]
    pub fn open_of<I: Isa>(&self, isa: I, what: (&Node, &Place, u32), rays: u64, entered: &mut [u64; 8]) -> u32 {
        self.meet::<I, false>(isa, what, rays, entered, |_, _, _| {})
    }

    /// The same, and where: of a child that any ray enters, `near` holds
    /// the distance of each ray of `rays`, as [`super::node::node_hits`] says.
    #[inline(always)]
    pub fn enter<I: Isa>(
        &self,
        isa: I,
        what: (&Node, &Place, u32),
        rays: u64,
        (entered, near): (&mut [u64; 8], &mut [Column; 8]),
    ) -> u32 {
        self.meet::<I, true>(isa, what, rays, entered, |i, v, tn| near[i].set(v, tn))
    }

    /// [`Packet::open`] of the children of a mask; with `EACH` calls `keep` with child, vector and distances.
    #[inline(always)]
    fn meet<I: Isa, const EACH: bool>(
        &self,
        isa: I,
        (node, place, children): (&Node, &Place, u32),
        rays: u64,
        entered: &mut [u64; 8],
        mut keep: impl FnMut(usize, usize, I::Wide),
    ) -> u32 {
        let is_negative = (self.flip >> 2 & 1) | (self.flip & 2) | (self.flip << 2 & 4);
        let bounds = &self.bounds;
        let [origin, step] = isa.grid(node);
        let offset_low = isa.load_eight(&place.offset_low);
        let at = (origin + isa.load_eight(&place.offset_high)) + offset_low;
        let pads = [isa.eight(4.0 * UNIT) * at.abs(), isa.eight(2.0 * UNIT) * offset_low.abs()];
        // The least padded lower and the greatest padded upper plane relative to the origins. Each operation is
        // monotonic in f32, too.
        let (low, high) = (at - isa.load_eight(&bounds.origin[1]), at - isa.load_eight(&bounds.origin[0]));
        let mut sizes = [0.0; 8];
        (low.abs().most(high.abs()) + isa.eight(255.0) * step).store(&mut sizes);
        let m = most(sizes[0], most(sizes[1], sizes[2]));
        let all = 64.0 * UNIT * m + place.slack * (m + bounds.reach);
        let delta = isa.eight(all) + pads[0] + pads[1];
        let (low, high) = (low - delta, high + delta);
        let (near, far) = (high.or_else(is_negative, low), low.or_else(is_negative, high));
        // Inverses have one sign on an axis.
        let [slow, fast] = [isa.load_eight(&bounds.inverse[0]), isa.load_eight(&bounds.inverse[1])];
        let (near_slow, near_fast, far_slow, far_fast) = (near * slow, near * fast, far * slow, far * fast);
        let mut planes = [[0.0; 8]; 6];
        near_slow.least(near_fast).store(&mut planes[0]);
        far_slow.most(far_fast).store(&mut planes[1]);
        (step * slow).store(&mut planes[2]);
        (step * fast).store(&mut planes[3]);
        near_slow.most(near_fast).store(&mut planes[4]);
        far_slow.least(far_fast).store(&mut planes[5]);
        let near_of = |k: usize| if is_negative >> k & 1 != 0 { &node.hi[k] } else { &node.lo[k] };
        let far_of = |k: usize| if is_negative >> k & 1 != 0 { &node.lo[k] } else { &node.hi[k] };
        let (first, last) = (three!(k => isa.numbers(near_of(k))), three!(k => isa.numbers(far_of(k))));
        let [scale, scale_fast] = [2, 3].map(|i: usize| planes[i]);
        let tn = three!(k => first[k] * isa.eight(scale[k]) + isa.eight(planes[0][k]));
        let tf = three!(k => last[k] * isa.eight(scale_fast[k]) + isa.eight(planes[1][k]));
        let tn = tn[0].most(tn[1]).most(tn[2].most(isa.eight(bounds.t_min[0])));
        let tf = tf[0].least(tf[1]).least(tf[2].least(isa.eight(bounds.t[1])));
        let some = tn.less_equal(tf) & present(node.meta) & children;
        if some == 0 {
            return 0;
        }
        // Those that every ray enters. Rays from several points have planes of their own.
        let mut every = 0;
        if bounds.is_point && !EACH {
            let tn = three!(k => first[k] * isa.eight(scale_fast[k]) + isa.eight(planes[4][k]));
            let tf = three!(k => last[k] * isa.eight(scale[k]) + isa.eight(planes[5][k]));
            let tn = tn[0].most(tn[1]).most(tn[2].most(isa.eight(bounds.t_min[1])));
            let tf = tf[0].least(tf[1]).least(tf[2].least(isa.eight(bounds.t[0])));
            every = tn.less_equal(tf) & some;
        }
        let unsure = some & !every;
        let mut met = every;
        while every != 0 {
            entered[every.trailing_zeros() as usize % 8] = rays;
            every &= every - 1;
        }
        if unsure == 0 {
            return met;
        }
        let none = [0.0; 8];
        let mut seen = Seen { at: none, step: none, pad: [none; 2], near: none, far: none, slack: place.slack };
        let mut sides = [[none; 3]; 2];
        for k in 0..3 {
            first[k].store(&mut sides[0][k]);
            last[k].store(&mut sides[1][k]);
        }
        step.store(&mut seen.step);
        if bounds.is_point {
            near.store(&mut seen.near);
            far.store(&mut seen.far);
        } else {
            at.store(&mut seen.at);
            pads[0].store(&mut seen.pad[0]);
            pads[1].store(&mut seen.pad[1]);
        }
        for v in 0..self.vectors::<I>() {
            let shift = v * I::Wide::LANES;
            let lanes = (rays >> shift) & (u64::MAX >> (RAYS - I::Wide::LANES));
            if lanes == 0 {
                continue;
            }
            let [scale, near, far] = self.planes(isa, v, &seen, is_negative);
            let (t_min, t_max) = (self.t_min.get(isa, v), self.t.get(isa, v));
            let mut left = unsure;
            while left != 0 {
                let i = left.trailing_zeros() as usize % 8;
                left &= left - 1;
                let n = three!(k => isa.splat(sides[0][k][i]) * scale[k] + near[k]);
                let f = three!(k => isa.splat(sides[1][k][i]) * scale[k] + far[k]);
                let (tn, tf) = (n[0].most(n[1]).most(n[2].most(t_min)), f[0].least(f[1]).least(f[2].least(t_max)));
                if EACH {
                    keep(i, v, tn);
                }
                let bits = u64::from(tn.less_equal(tf)) & lanes;
                entered[i] |= bits << shift;
                met |= u32::from(bits != 0) << i;
            }
        }
        met
    }

    /// [`super::node::NodeFrame`] of the rays of a vector: scale, near, far.
    #[inline(always)]
    fn planes<I: Isa>(&self, isa: I, v: usize, seen: &Seen, is_negative: u32) -> [[I::Wide; 3]; 3] {
        let inverse = three!(k => self.inverse[k].get(isa, v));
        let scale = three!(k => isa.splat(seen.step[k]) * inverse[k]);
        if self.bounds.is_point {
            let near = three!(k => isa.splat(seen.near[k]) * inverse[k]);
            let far = three!(k => isa.splat(seen.far[k]) * inverse[k]);
            return [scale, near, far];
        }
        let w = three!(k => isa.splat(seen.at[k]) - self.origin[k].get(isa, v));
        let size = three!(k => w[k].abs() + isa.splat(255.0 * seen.step[k]));
        let m = size[0].most(size[1].most(size[2]));
        let mut all = isa.splat(64.0 * UNIT) * m;
        if seen.slack != 0.0 {
            all = all + isa.splat(seen.slack) * (m + self.reach.get(isa, v));
        }
        let delta = three!(k => all + isa.splat(seen.pad[0][k]) + isa.splat(seen.pad[1][k]));
        let low = three!(k => (w[k] - delta[k]) * inverse[k]);
        let high = three!(k => (w[k] + delta[k]) * inverse[k]);
        let near = three!(k => if is_negative >> k & 1 != 0 { high[k] } else { low[k] });
        let far = three!(k => if is_negative >> k & 1 != 0 { low[k] } else { high[k] });
        [scale, near, far]
    }
}
