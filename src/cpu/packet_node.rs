//! The rays of a packet against the children of a node: first all of them by their bounds, then, where those do not tell, ray by ray.

use super::isa::Isa;
use super::node::UNIT;
use super::packet::{Bounds, Packet, RAYS};
use super::vector::{Vec3, each, least, most, most3};
use super::wide::{Wide, three};
use bricks::Node;

/// A node as all rays of a packet see it.
struct Seen {
    /// Its origin in their frame.
    at: Vec3,
    /// Steps of its grid.
    step: Vec3,
    /// Terms of the padding by axis.
    pad: [Vec3; 2],
    slack: f32,
    /// Bounds of the children as numbers, by axis; near ones, then far ones.
    bounds: [[[f32; 8]; 3]; 2],
}

/// Where and how a node is seen.
#[derive(Clone, Copy)]
pub struct Place {
    /// See [`super::node::NodeFrame::new`].
    pub offset_high: Vec3,
    /// Its low part.
    pub offset_low: Vec3,
    /// Added to the padding, in units of the largest distance.
    pub slack: f32,
}

impl Packet {
    /// Which of `rays` enter each child of `node`, as [`super::node::node_hits`] says, written to `entered` for the children of the
    /// mask that comes back; no ray enters another child that exists.
    #[inline(always)]
    pub fn open<I: Isa>(&self, isa: I, node: &Node, place: &Place, rays: u64, entered: &mut [u64; 8]) -> u32 {
        let negative = [self.flip & 4 != 0, self.flip & 2 != 0, self.flip & 1 != 0];
        let at = each(|k| (node.origin[k] + place.offset_high[k]) + place.offset_low[k]);
        let mut seen = Seen {
            at,
            step: each(|k| f32::from_bits(u32::from(node.exponent[k]) << 23)),
            pad: [each(|k| 4.0 * UNIT * at[k].abs()), each(|k| 2.0 * UNIT * place.offset_low[k].abs())],
            slack: place.slack,
            bounds: [[[0.0; 8]; 3]; 2],
        };
        for k in 0..3 {
            let (near, far) = if negative[k] { (&node.hi[k], &node.lo[k]) } else { (&node.lo[k], &node.hi[k]) };
            for i in 0..8 {
                seen.bounds[0][k][i] = f32::from(near[i]);
                seen.bounds[1][k][i] = f32::from(far[i]);
            }
        }
        let mut exist = 0;
        for (i, &meta) in node.meta.iter().enumerate() {
            exist |= u32::from(meta != 0) << i;
        }
        let (some, every) = self.bounds.meet(&seen, negative);
        let (some, mut every) = (some & exist, every & exist);
        let unsure = some & !every;
        let mut met = every;
        while every != 0 {
            entered[every.trailing_zeros() as usize % 8] = rays;
            every &= every - 1;
        }
        if unsure == 0 {
            return met;
        }
        for v in 0..self.vectors::<I>() {
            let shift = v * I::Wide::LANES;
            let lanes = (rays >> shift) & (u64::MAX >> (RAYS - I::Wide::LANES));
            if lanes == 0 {
                continue;
            }
            let [scale, near, far] = self.planes(isa, v, &seen, negative);
            let (t_min, t_max) = (self.t_min.get(isa, v), self.t.get(isa, v));
            let mut left = unsure;
            while left != 0 {
                let i = left.trailing_zeros() as usize % 8;
                left &= left - 1;
                let n = three!(k => isa.splat(seen.bounds[0][k][i]) * scale[k] + near[k]);
                let f = three!(k => isa.splat(seen.bounds[1][k][i]) * scale[k] + far[k]);
                let (tn, tf) = (n[0].most(n[1]).most(n[2].most(t_min)), f[0].least(f[1]).least(f[2].least(t_max)));
                let bits = u64::from(tn.less_equal(tf)) & lanes;
                entered[i] |= bits << shift;
                met |= u32::from(bits != 0) << i;
            }
        }
        met
    }

    /// [`super::node::NodeFrame`] of the rays of a vector: scale, near, far.
    #[inline(always)]
    fn planes<I: Isa>(&self, isa: I, v: usize, seen: &Seen, negative: [bool; 3]) -> [[I::Wide; 3]; 3] {
        let inverse = three!(k => self.inverse[k].get(isa, v));
        let scale = three!(k => isa.splat(seen.step[k]) * inverse[k]);
        if self.bounds.is_point {
            let (low, high) = seen.padded(self.bounds.origin, self.bounds.reach);
            let near = three!(k => isa.splat(if negative[k] { high[k] } else { low[k] }) * inverse[k]);
            let far = three!(k => isa.splat(if negative[k] { low[k] } else { high[k] }) * inverse[k]);
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
        let near = three!(k => (if negative[k] { w[k] + delta[k] } else { w[k] - delta[k] }) * inverse[k]);
        let far = three!(k => (if negative[k] { w[k] - delta[k] } else { w[k] + delta[k] }) * inverse[k]);
        [scale, near, far]
    }
}

impl Seen {
    /// The least padded lower and the greatest padded upper plane relative to origins within bounds. Each operation is
    /// monotonic in f32, too.
    #[inline(always)]
    fn padded(&self, origin: [Vec3; 2], reach: f32) -> (Vec3, Vec3) {
        let (low, high) = (each(|k| self.at[k] - origin[1][k]), each(|k| self.at[k] - origin[0][k]));
        let m = most3(each(|k| most(low[k].abs(), high[k].abs()) + 255.0 * self.step[k]));
        let all = 64.0 * UNIT * m + self.slack * (m + reach);
        let delta = each(|k| all + self.pad[0][k] + self.pad[1][k]);
        (each(|k| low[k] - delta[k]), each(|k| high[k] + delta[k]))
    }
}

impl Bounds {
    /// The children that a ray within the bounds may enter, and those that every ray enters.
    #[inline(always)]
    fn meet(&self, seen: &Seen, negative: [bool; 3]) -> (u32, u32) {
        let (low, high) = seen.padded(self.origin, self.reach);
        let [slow, fast] = self.inverse;
        // Inverses have one sign on an axis.
        let lesser = |k: usize, x: f32| least(x * slow[k], x * fast[k]);
        let greater = |k: usize, x: f32| most(x * slow[k], x * fast[k]);
        let near = each(|k| if negative[k] { high[k] } else { low[k] });
        let far = each(|k| if negative[k] { low[k] } else { high[k] });
        let scale = [each(|k| seen.step[k] * slow[k]), each(|k| seen.step[k] * fast[k])];
        let (first, last) = (each(|k| lesser(k, near[k])), each(|k| greater(k, far[k])));
        let (mut tn, mut tf) = ([self.t_min[0]; 8], [self.t[1]; 8]);
        for k in 0..3 {
            for i in 0..8 {
                tn[i] = most(seen.bounds[0][k][i] * scale[0][k] + first[k], tn[i]);
                tf[i] = least(seen.bounds[1][k][i] * scale[1][k] + last[k], tf[i]);
            }
        }
        let mut some = 0;
        for i in 0..8 {
            some |= u32::from(tn[i] <= tf[i]) << i;
        }
        // Rays from several points have planes of their own.
        if !self.is_point || some == 0 {
            return (some, 0);
        }
        let (first, last) = (each(|k| greater(k, near[k])), each(|k| lesser(k, far[k])));
        let (mut tn, mut tf) = ([self.t_min[1]; 8], [self.t[0]; 8]);
        for k in 0..3 {
            for i in 0..8 {
                tn[i] = most(seen.bounds[0][k][i] * scale[1][k] + first[k], tn[i]);
                tf[i] = least(seen.bounds[1][k][i] * scale[0][k] + last[k], tf[i]);
            }
        }
        let mut every = 0;
        for i in 0..8 {
            every |= u32::from(tn[i] <= tf[i]) << i;
        }
        (some, every)
    }
}
