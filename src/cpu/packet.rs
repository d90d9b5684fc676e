//! Up to 64 rays of one octant that walk the scene together, each with exactly the visits that it has alone: rays of an octant
//! meet the children of every node in the same order, and a ray takes part in what follows only where it would have gone itself.
//! So hits, uses and counters do not tell whether rays went together.

use super::brick::Best;
use super::isa::Isa;
use super::node::{FramedRay, UNIT};
use super::vector::{Vec3, each, least, most, most3};
use super::wide::{Wide, three};
use crate::kernel::layout::NONE;
use crate::math::exact::TriangleHit;
use bricks::Node;

/// Most rays of a packet: a bit each in a u64.
pub const RAYS: usize = 64;

/// A number a ray.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub struct Column(pub [f32; RAYS]);

impl Column {
    const ZERO: Self = Self([0.0; RAYS]);

    /// The lanes of vector `number`.
    #[inline(always)]
    pub fn get<I: Isa>(&self, isa: I, number: usize) -> I::Wide {
        isa.load(&self.0[number * I::Wide::LANES..])
    }
}

/// Rays with their hits.
pub struct Packet {
    /// Their number.
    pub count: usize,
    /// `slot ^ flip` ascends away from the origin of each.
    pub flip: u32,
    /// Rays that have ended, a bit each.
    pub done: u64,
    /// The axis of the largest component of all directions; 3: they differ.
    pub axis: u32,
    /// Rays whose directions are largest along x, and along y, a bit each.
    pub largest: [u64; 2],
    /// Where they begin.
    pub origin: [Column; 3],
    /// 1 / direction.
    pub inverse: [Column; 3],
    /// [`crate::math::exact::RayFrame::sx`].
    pub shear_x: Column,
    /// [`crate::math::exact::RayFrame::sy`].
    pub shear_y: Column,
    /// [`crate::math::exact::RayFrame::iz`].
    pub along: Column,
    /// Least parameters.
    pub t_min: Column,
    /// Distances of the hits.
    pub t: Column,
    /// Greatest magnitude of the origin's components.
    reach: Column,
    /// All of them, one by one.
    pub rays: [FramedRay; RAYS],
    /// Their hits, but for the distance.
    pub best: [Best; RAYS],
    bounds: Bounds,
}

/// Bounds of the rays of a packet.
#[derive(Clone, Copy, Default)]
struct Bounds {
    origin: [Vec3; 2],
    inverse: [Vec3; 2],
    t_min: f32,
    t_max: f32,
    reach: f32,
    /// Whether all begin at one point.
    is_point: bool,
}

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

impl Packet {
    /// Without rays.
    pub fn empty() -> Self {
        let ray = super::node::framed_ray([0.0; 3], [1.0, 0.0, 0.0], 0.0);
        let hit = TriangleHit::default();
        let zero = Column::ZERO;
        Self {
            count: 0,
            flip: 0,
            done: 0,
            axis: 3,
            largest: [0; 2],
            origin: [zero; 3],
            inverse: [zero; 3],
            shear_x: zero,
            shear_y: zero,
            along: zero,
            t_min: zero,
            t: zero,
            reach: zero,
            rays: [ray; RAYS],
            best: [Best { t: 0.0, id: NONE, leaf: NONE, triangle: 0, hit, source: NONE }; RAYS],
            bounds: Bounds::default(),
        }
    }

    /// Starts anew for rays of an octant.
    pub fn clear(&mut self, flip: u32) {
        (self.count, self.done, self.flip) = (0, 0, flip);
    }

    /// Adds a ray of the octant.
    #[inline(always)]
    pub fn add(&mut self, ray: FramedRay, best: Best) {
        let i = self.count;
        self.count += 1;
        for k in 0..3 {
            self.origin[k].0[i] = ray.origin[k];
            self.inverse[k].0[i] = ray.frame.inv[k];
        }
        (self.shear_x.0[i], self.shear_y.0[i], self.along.0[i]) = (ray.frame.sx, ray.frame.sy, ray.frame.iz);
        (self.t_min.0[i], self.t.0[i]) = (ray.t_min, best.t);
        self.reach.0[i] = most3(each(|k| ray.origin[k].abs()));
        self.rays[i] = ray;
        self.best[i] = best;
    }

    /// Completes the packet: lanes without a ray of their own repeat the first, and no mask has them.
    #[inline(always)]
    pub fn seal<I: Isa>(&mut self, _: I) {
        let kz = self.rays[0].frame.kz;
        let is_uniform = self.rays[..self.count].iter().all(|ray| ray.frame.kz == kz);
        self.axis = if is_uniform { kz } else { 3 };
        self.largest = [0, 1].map(|k| {
            let bits = self.rays[..self.count].iter().enumerate().map(|(i, ray)| u64::from(ray.frame.kz == k) << i);
            bits.sum()
        });
        for i in self.count..self.vectors::<I>() * I::Wide::LANES {
            for column in self.origin.iter_mut().chain(&mut self.inverse) {
                column.0[i] = column.0[0];
            }
            let columns = [&mut self.shear_x, &mut self.shear_y, &mut self.along, &mut self.t_min, &mut self.t];
            for column in columns {
                column.0[i] = column.0[0];
            }
            self.reach.0[i] = self.reach.0[0];
        }
        let range = |column: &Column| {
            let numbers = &column.0[..self.count];
            numbers.iter().fold((numbers[0], numbers[0]), |(lo, hi), &x| (least(lo, x), most(hi, x)))
        };
        let ranges = |columns: &[Column; 3]| {
            let all = [range(&columns[0]), range(&columns[1]), range(&columns[2])];
            [all.map(|r| r.0), all.map(|r| r.1)]
        };
        let (origin, inverse) = (ranges(&self.origin), ranges(&self.inverse));
        let is_point =
            (0..3).all(|k| self.origin[k].0[..self.count].iter().all(|x| x.to_bits() == origin[0][k].to_bits()));
        let (t_min, t_max, reach) = (range(&self.t_min).0, range(&self.t).1, range(&self.reach).1);
        self.bounds = Bounds { origin, inverse, t_min, t_max, reach, is_point };
    }

    /// Vectors that hold the rays.
    #[inline(always)]
    pub fn vectors<I: Isa>(&self) -> usize {
        self.count.div_ceil(I::Wide::LANES)
    }

    /// A bit for every ray.
    #[inline(always)]
    pub fn all(&self) -> u64 {
        u64::MAX >> (RAYS - self.count)
    }

    /// The rays whose hits are not nearer than `near`.
    #[inline(always)]
    pub fn reaching<I: Isa>(&self, isa: I, near: f32) -> u64 {
        let bits = |v: usize| u64::from(isa.splat(near).less_equal(self.t.get(isa, v))) << (v * I::Wide::LANES);
        (0..self.vectors::<I>()).map(bits).sum::<u64>() & self.all()
    }

    /// Takes note that hits have come nearer.
    #[inline(always)]
    pub fn shorten<I: Isa>(&mut self, isa: I) {
        let mut far = self.t.get(isa, 0);
        for v in 1..self.vectors::<I>() {
            far = far.most(self.t.get(isa, v));
        }
        let mut lanes = [0.0; 16];
        far.store(&mut lanes);
        // Halves at a time; distances are not negative.
        for half in [8, 4, 2, 1] {
            for i in 0..half {
                lanes[i] = most(lanes[i], lanes[i + half]);
            }
        }
        self.bounds.t_max = lanes[0];
    }

    /// Which of `rays` enter each child of `node`, as [`super::node::node_hits`] says, written to `entered` for the children of the
    /// mask that comes back; no ray enters another child that exists. See [`super::node::NodeFrame::new`] for offset and slack.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)]
    pub fn open<I: Isa>(
        &self,
        isa: I,
        node: &Node,
        offset_high: Vec3,
        offset_low: Vec3,
        slack: f32,
        rays: u64,
        entered: &mut [u64; 8],
    ) -> u32 {
        let negative = [self.flip & 4 != 0, self.flip & 2 != 0, self.flip & 1 != 0];
        let at = each(|k| (node.origin[k] + offset_high[k]) + offset_low[k]);
        let mut seen = Seen {
            at,
            step: each(|k| f32::from_bits(u32::from(node.exponent[k]) << 23)),
            pad: [each(|k| 4.0 * UNIT * at[k].abs()), each(|k| 2.0 * UNIT * offset_low[k].abs())],
            slack,
            bounds: [[[0.0; 8]; 3]; 2],
        };
        for (k, negative) in negative.into_iter().enumerate() {
            let (near, far) = if negative { (&node.hi[k], &node.lo[k]) } else { (&node.lo[k], &node.hi[k]) };
            for i in 0..8 {
                seen.bounds[0][k][i] = f32::from(near[i]);
                seen.bounds[1][k][i] = f32::from(far[i]);
            }
        }
        let mut exist = 0;
        for (i, &meta) in node.meta.iter().enumerate() {
            exist |= u32::from(meta != 0) << i;
        }
        let some = self.bounds.meet(&seen, negative) & exist;
        let mut met = 0;
        for v in 0..self.vectors::<I>() {
            let shift = v * I::Wide::LANES;
            let lanes = (rays >> shift) & (u64::MAX >> (RAYS - I::Wide::LANES));
            if lanes == 0 {
                continue;
            }
            let [scale, near, far] = self.frame(isa, v, &seen, negative);
            let (t_min, t_max) = (self.t_min.get(isa, v), self.t.get(isa, v));
            let mut left = some;
            while left != 0 {
                let i = left.trailing_zeros() as usize;
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
    fn frame<I: Isa>(&self, isa: I, v: usize, seen: &Seen, negative: [bool; 3]) -> [[I::Wide; 3]; 3] {
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
    /// The children that a ray within the bounds may enter.
    #[inline(always)]
    fn meet(&self, seen: &Seen, negative: [bool; 3]) -> u32 {
        let (low, high) = seen.padded(self.origin, self.reach);
        let [slow, fast] = self.inverse;
        // Inverses have one sign on an axis.
        let lesser = |k: usize, x: f32| least(x * slow[k], x * fast[k]);
        let greater = |k: usize, x: f32| most(x * slow[k], x * fast[k]);
        let near = each(|k| lesser(k, if negative[k] { high[k] } else { low[k] }));
        let far = each(|k| greater(k, if negative[k] { low[k] } else { high[k] }));
        let scale = [each(|k| seen.step[k] * slow[k]), each(|k| seen.step[k] * fast[k])];
        let (mut tn, mut tf) = ([self.t_min; 8], [self.t_max; 8]);
        for k in 0..3 {
            for i in 0..8 {
                tn[i] = most(seen.bounds[0][k][i] * scale[0][k] + near[k], tn[i]);
                tf[i] = least(seen.bounds[1][k][i] * scale[1][k] + far[k], tf[i]);
            }
        }
        let mut bits = 0;
        for i in 0..8 {
            bits |= u32::from(tn[i] <= tf[i]) << i;
        }
        bits
    }
}
