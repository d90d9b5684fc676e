//! The rays of a packet against the children of a node of a brick that is flat: [`super::packet_node`], but that what
//! rays add to boxes is made once a brick.

use super::flat_node::Sight;
use super::node::UNIT;
use super::packet::{Column, Packet, RAYS};
use crate::kernels::flat::{FlatBrick, FlatNode, Grid};
use crate::kernels::simd::isa::Isa;
use crate::kernels::simd::wide::{Wide, three};
use crate::kernels::vector::{Vec3, each, most, most3};

/// [`Sight`] of all rays of a packet, and bounds of it.
pub struct Sights {
    /// Whether those of single rays have been made, which not every brick needs.
    is_made: bool,
    scale: [Column; 3],
    near: [Column; 3],
    far: [Column; 3],
    /// What the ray that meets them first adds to bounds that are near, and what the one that leaves them last does to
    /// the others, before both are divided by directions.
    first: Vec3,
    last: Vec3,
    step: Vec3,
    side: [usize; 3],
    /// Where the grid's origin lies, and the part of the padding that depends on no ray.
    at: Vec3,
    pad: Vec3,
}

impl Sights {
    /// Of no brick.
    pub fn empty() -> Self {
        let (none, zero) = ([Column([0.0; RAYS]); 3], [0.0; 3]);
        Self {
            is_made: false,
            scale: none,
            near: none,
            far: none,
            first: zero,
            last: zero,
            step: zero,
            side: [0; 3],
            at: zero,
            pad: zero,
        }
    }

    /// Begins with a brick at an offset. As [`Sight::new`] says of every ray; each operation is monotonic in f32, too.
    #[inline(always)]
    pub fn begin(&mut self, packet: &Packet, brick: &FlatBrick, (offset_high, offset_low): (Vec3, Vec3)) {
        let bounds = &packet.bounds;
        let Grid { origin, step } = brick.grid;
        let at = each(|k| (origin[k] + offset_high[k]) + offset_low[k]);
        let pad = each(|k| 4.0 * UNIT * at[k].abs() + 2.0 * UNIT * offset_low[k].abs());
        let (low, high) = (each(|k| at[k] - bounds.origin[1][k]), each(|k| at[k] - bounds.origin[0][k]));
        let m = most3(each(|k| most(low[k].abs(), high[k].abs()) + Grid::STEPS * step[k]));
        let side = [2, 1, 0].map(|bit| (packet.flip >> bit & 1) as usize);
        for k in 0..3 {
            let delta = 64.0 * UNIT * m + pad[k];
            let ends = [low[k] - delta, high[k] + delta];
            (self.first[k], self.last[k]) = (ends[side[k]], ends[1 - side[k]]);
        }
        (self.is_made, self.side, self.at, self.pad, self.step) = (false, side, at, pad, step);
    }

    /// Makes those of single rays, unless they have been made.
    #[inline(always)]
    pub fn make<I: Isa>(&mut self, isa: I, packet: &Packet) {
        if std::mem::replace(&mut self.is_made, true) {
            return;
        }
        for v in 0..packet.vectors::<I>() {
            let inverse = three!(k => packet.inverse[k].get(isa, v));
            let w = three!(k => isa.splat(self.at[k]) - packet.origin[k].get(isa, v));
            let size = three!(k => w[k].abs() + isa.splat(Grid::STEPS * self.step[k]));
            let m = isa.splat(64.0 * UNIT) * size[0].most(size[1].most(size[2]));
            for k in 0..3 {
                let delta = m + isa.splat(self.pad[k]);
                let low = (w[k] - delta) * inverse[k];
                let high = (w[k] + delta) * inverse[k];
                let is_negative = self.side[k] != 0;
                self.scale[k].set(v, isa.splat(self.step[k]) * inverse[k]);
                self.near[k].set(v, if is_negative { high } else { low });
                self.far[k].set(v, if is_negative { low } else { high });
            }
        }
    }

    /// That of ray `i`, once they have been made.
    #[inline(always)]
    pub fn of(&self, i: usize) -> Sight {
        let at = |columns: &[Column; 3]| three!(k => columns[k].0[i % RAYS]);
        Sight { scale: at(&self.scale), near: at(&self.near), far: at(&self.far), side: self.side }
    }

    /// Which of `rays` enter each child of `node`, written to `entered` for the children of the mask that comes back,
    /// and no more than the least distance of any to `least`; no ray enters another child that exists. `entered` holds
    /// zeros before.
    #[inline(always)]
    pub fn open<I: Isa>(
        &mut self,
        isa: I,
        packet: &Packet,
        node: &FlatNode,
        rays: u64,
        (entered, least): (&mut [u64; 8], &mut [f32; 8]),
    ) -> u32 {
        let (bounds, side) = (&packet.bounds, self.side);
        let (begin, end) =
            (three!(k => isa.steps(&node.bounds[side[k]][k])), three!(k => isa.steps(&node.bounds[1 - side[k]][k])));
        // Products with powers of two are exact.
        let near = three!(k => begin[k].times_plus(isa.eight(self.step[k]), isa.eight(self.first[k])));
        let far = three!(k => end[k].times_plus(isa.eight(self.step[k]), isa.eight(self.last[k])));
        let (slow, fast) = (&bounds.inverse[0], &bounds.inverse[1]);
        let (near_slow, near_fast) =
            (three!(k => near[k] * isa.eight(slow[k])), three!(k => near[k] * isa.eight(fast[k])));
        let (far_slow, far_fast) = (three!(k => far[k] * isa.eight(slow[k])), three!(k => far[k] * isa.eight(fast[k])));
        let tn = three!(k => near_slow[k].least(near_fast[k]));
        let tf = three!(k => far_slow[k].most(far_fast[k]));
        let tn = tn[0].most(tn[1]).most(tn[2].most(isa.eight(bounds.t_min[0])));
        let tf = tf[0].least(tf[1]).least(tf[2].least(isa.eight(bounds.t[1])));
        let some = tn.less_equal(tf) & u32::from(node.present);
        if some == 0 {
            return 0;
        }
        tn.store(least);
        // Those that every ray enters. Rays from several points have planes of their own.
        let mut every = 0;
        if bounds.is_point {
            let tn = three!(k => near_slow[k].most(near_fast[k]));
            let tf = three!(k => far_slow[k].least(far_fast[k]));
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
        self.make(isa, packet);
        let mut sides = [[[0.0; 8]; 3]; 2];
        for k in 0..3 {
            begin[k].store(&mut sides[0][k]);
            end[k].store(&mut sides[1][k]);
        }
        for v in 0..packet.vectors::<I>() {
            let shift = v * I::Wide::LANES;
            let lanes = (rays >> shift) & (u64::MAX >> (RAYS - I::Wide::LANES));
            if lanes == 0 {
                continue;
            }
            let scale = three!(k => self.scale[k].get(isa, v));
            let (near, far) = (three!(k => self.near[k].get(isa, v)), three!(k => self.far[k].get(isa, v)));
            let (t_min, t_max) = (packet.t_min.get(isa, v), packet.t.get(isa, v));
            let mut left = unsure;
            while left != 0 {
                let i = left.trailing_zeros() as usize % 8;
                left &= left - 1;
                let n = three!(k => isa.splat(sides[0][k][i]).times_plus(scale[k], near[k]));
                let f = three!(k => isa.splat(sides[1][k][i]).times_plus(scale[k], far[k]));
                let (tn, tf) = (n[0].most(n[1]).most(n[2].most(t_min)), f[0].least(f[1]).least(f[2].least(t_max)));
                let bits = u64::from(tn.less_equal(tf)) & lanes;
                entered[i] |= bits << shift;
                met |= u32::from(bits != 0) << i;
            }
        }
        met
    }
}
