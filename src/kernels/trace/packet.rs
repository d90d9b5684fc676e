//! Up to 64 rays of one octant that walk the scene together, each with exactly the visits that it has alone: rays of an
//! octant meet the children of every node in the same order, and a ray takes part in what follows only where it would
//! have gone itself. So hits, uses and counters do not tell whether rays went together.
//!
//! All that is known of a ray lies in columns, a number or a word a ray, because it is read and written by vectors.

use super::brick::Best;
use super::levels::{Cone, spread_in};
use super::node::{FramedRay, framed_ray};
use crate::kernels::bound::Bound;
use crate::kernels::layout::NONE;
use crate::kernels::simd::isa::Isa;
use crate::kernels::simd::wide::{Wide, three};
use crate::kernels::vector::{Vec3, least, most};
use crate::math::exact::{GREATEST_INVERSE, LEAST_SHEAR, RayFrame, TriangleHit};

/// Most rays of a packet: a bit each in a u64.
pub const RAYS: usize = 64;

/// Components of directions are plain below this magnitude, and so is the largest above its inverse: quotients are what
/// f32 division gives.
const PLAIN: f32 = f32::from_bits((127 + 90) << 23);

/// Three numbers by axis, and zeros.
pub type Axes = [f32; 8];

/// Numbers by axis as a vector takes them.
#[inline(always)]
pub fn axes(v: Vec3) -> Axes {
    [v[0], v[1], v[2], 0.0, 0.0, 0.0, 0.0, 0.0]
}

/// A number a ray.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub struct Column(pub [f32; RAYS]);

/// A word a ray.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub struct Words(pub [u32; RAYS]);

impl Column {
    /// Zeros.
    pub const ZERO: Self = Self([0.0; RAYS]);

    /// The lanes of vector `number`.
    #[inline(always)]
    pub fn get<I: Isa>(&self, isa: I, number: usize) -> I::Wide {
        isa.load(&self.0[number * I::Wide::LANES..])
    }

    /// Writes the lanes of vector `number`.
    #[inline(always)]
    pub fn set<W: Wide>(&mut self, number: usize, x: W) {
        x.store(&mut self.0[number * W::LANES..]);
    }

    /// The least and the greatest of the first vectors.
    #[inline(always)]
    fn range<I: Isa>(&self, isa: I, vectors: usize) -> [f32; 2] {
        let first = self.get(isa, 0);
        let (mut low, mut high) = (first, first);
        for v in 1..vectors {
            let x = self.get(isa, v);
            (low, high) = (low.least(x), high.most(x));
        }
        let (mut least_of, mut most_of) = ([0.0; 16], [0.0; 16]);
        low.store(&mut least_of);
        high.store(&mut most_of);
        let mut half = I::Wide::LANES / 2;
        while half > 0 {
            for i in 0..half {
                least_of[i] = least(least_of[i], least_of[i + half]);
                most_of[i] = most(most_of[i], most_of[i + half]);
            }
            half /= 2;
        }
        [least_of[0], most_of[0]]
    }

    /// Writes those lanes of vector `number` whose bit is set.
    #[inline(always)]
    pub fn replace<I: Isa>(&mut self, isa: I, number: usize, lanes: u32, x: I::Wide) {
        self.set(number, x.or_else(lanes, self.get(isa, number)));
    }
}

impl Words {
    /// Nothing of any ray.
    pub const NONE: Self = Self([NONE; RAYS]);

    /// Writes the lanes of vector `number`.
    #[inline(always)]
    pub fn set<W: Wide>(&mut self, number: usize, x: W) {
        x.store(bytemuck::cast_slice_mut(&mut self.0[number * W::LANES..]));
    }

    /// The lanes of vector `number`.
    #[inline(always)]
    pub fn get<I: Isa>(&self, isa: I, number: usize) -> I::Wide {
        isa.load_bits(&self.0[number * I::Wide::LANES..])
    }

    /// Writes those lanes of vector `number` whose bit is set.
    #[inline(always)]
    pub fn replace<I: Isa>(&mut self, isa: I, number: usize, lanes: u32, x: I::Wide) {
        self.set(number, x.or_else(lanes, self.get(isa, number)));
    }
}

/// What the rays of a packet have found, but for the distances: [`Best`] by columns.
pub struct Found {
    /// Global ids.
    pub id: Words,
    /// Leaves; NONE where nothing has been found.
    pub leaf: Words,
    /// Numbers in the brick.
    pub triangle: Words,
    /// Triangles that rays start from.
    pub source: Words,
    /// Edge values u, v, w, not divided.
    pub edges: [Column; 3],
    /// Their sums.
    pub det: Column,
}

/// Rays with their hits.
pub struct Packet {
    /// Their number.
    pub count: usize,
    /// `slot ^ flip` ascends away from the origin of each.
    pub flip: u32,
    /// Rays that have ended, a bit each.
    pub done: u64,
    /// Rays that ask for a brick.
    pub asking: u64,
    /// The axis of the largest component of all directions; 3: they differ.
    pub axis: u32,
    /// Rays whose directions are largest along x, and along y, a bit each.
    pub largest: [u64; 2],
    /// Where they begin.
    pub origin: [Column; 3],
    /// Where they go.
    pub direction: [Column; 3],
    /// 1 / direction.
    pub inverse: [Column; 3],
    /// [`RayFrame::sx`] and [`RayFrame::sy`].
    pub shear: [Column; 2],
    /// [`RayFrame::iz`].
    pub along: Column,
    /// Least parameters.
    pub t_min: Column,
    /// Distances of the hits.
    pub t: Column,
    /// [`crate::kernels::layout::Surface::pending`].
    pub pending: Words,
    /// Greatest magnitude of the origin's components.
    pub reach: Column,
    /// Their hits.
    pub found: Found,
    /// Bounds of all of this.
    pub bounds: Bounds,
}

/// Bounds of the rays of a packet.
#[derive(Clone, Copy, Default)]
pub struct Bounds {
    /// Least and greatest origin.
    pub origin: [Axes; 2],
    /// Least and greatest inverse of the direction.
    pub inverse: [Axes; 2],
    /// Least and greatest first parameter.
    pub t_min: [f32; 2],
    /// Least and greatest distance of the hits.
    pub t: [f32; 2],
    /// Greatest magnitude of an origin's component.
    pub reach: f32,
    /// Whether all begin at one point.
    pub is_point: bool,
}

impl Packet {
    /// Without rays.
    pub fn empty() -> Self {
        let (zero, none) = (Column::ZERO, Words::NONE);
        let found = Found { id: none, leaf: none, triangle: none, source: none, edges: [zero; 3], det: zero };
        Self {
            count: 0,
            flip: 0,
            done: 0,
            asking: 0,
            axis: 3,
            largest: [0; 2],
            origin: [zero; 3],
            direction: [zero; 3],
            inverse: [zero; 3],
            shear: [zero; 2],
            along: zero,
            t_min: zero,
            t: zero,
            pending: none,
            reach: zero,
            found,
            bounds: Bounds::default(),
        }
    }

    /// Completes the packet of rays of one octant, which is `flip`: the frames of all rays, and their bounds.
    #[inline(always)]
    pub fn seal<I: Isa>(&mut self, isa: I, flip: u32) {
        (self.done, self.flip, self.largest) = (0, flip, [0; 2]);
        for v in 0..self.vectors::<I>() {
            self.frame(isa, v);
        }
        let all = self.all();
        self.axis = match self.largest.map(|rays| rays & all) {
            [x, _] if x == all => 0,
            [_, y] if y == all => 1,
            [0, 0] => 2,
            _ => 3,
        };
        let vectors = self.vectors::<I>();
        let origin = three!(k => self.origin[k].range(isa, vectors));
        let inverse = three!(k => self.inverse[k].range(isa, vectors));
        self.bounds = Bounds {
            origin: [axes(three!(k => origin[k][0])), axes(three!(k => origin[k][1]))],
            inverse: [axes(three!(k => inverse[k][0])), axes(three!(k => inverse[k][1]))],
            t_min: self.t_min.range(isa, vectors),
            t: self.t.range(isa, vectors),
            reach: self.reach.range(isa, vectors)[1],
            is_point: origin.iter().all(|x| x[0] == x[1]),
        };
    }

    /// [`framed_ray`] of the rays of a vector.
    #[inline(always)]
    fn frame<I: Isa>(&mut self, isa: I, v: usize) {
        let d = three!(k => self.direction[k].get(isa, v));
        let (zero, one, sign) = (isa.splat(0.0), isa.splat(1.0), isa.splat(-0.0));
        let m = three!(k => d[k].abs());
        let is_y = m[0].less(m[1]);
        let is_z = m[0].most(m[1]).less(m[2]);
        let along_xy = [!is_y & !is_z, is_y & !is_z];
        let largest = m[0].most(m[1].most(m[2]));
        let plain = largest.less(isa.splat(PLAIN)) & isa.splat(1.0 / PLAIN).less(largest);
        let inverse = three!(k => {
            (one / m[k].most(isa.splat(f32::MIN_POSITIVE))).least(isa.splat(GREATEST_INVERSE)) ^ (d[k] & sign)
        });
        let along = turned::<I>(inverse, 3, along_xy)[2];
        let across = turned::<I>(d, 3, along_xy);
        for (column, across) in self.shear.iter_mut().zip(across) {
            let shear = across * along;
            column.set(v, zero.or_else(shear.abs().less(isa.splat(LEAST_SHEAR)), shear));
        }
        for (column, inverse) in self.inverse.iter_mut().zip(inverse) {
            column.set(v, inverse);
        }
        self.along.set(v, along);
        let o = three!(k => self.origin[k].get(isa, v).abs());
        self.reach.set(v, o[0].most(o[1].most(o[2])));
        let (lanes, shift) = (u32::MAX >> (32 - I::Wide::LANES), v * I::Wide::LANES);
        for (largest, along) in self.largest.iter_mut().zip(along_xy) {
            *largest |= u64::from(along & lanes) << shift;
        }
        let mut alone = !plain & lanes;
        while alone != 0 {
            let i = shift + alone.trailing_zeros() as usize;
            alone &= alone - 1;
            let frame = framed_ray([0.0; 3], [0, 1, 2].map(|k| self.direction[k].0[i]), 0.0).frame;
            for k in 0..3 {
                self.inverse[k].0[i] = frame.inv[k];
            }
            (self.shear[0].0[i], self.shear[1].0[i], self.along.0[i]) = (frame.sx, frame.sy, frame.iz);
            for k in 0..2 {
                self.largest[k] &= !(1 << i);
                self.largest[k] |= u64::from(frame.kz == k as u32) << i;
            }
        }
    }

    /// Ray `i`.
    #[inline(always)]
    pub fn ray(&self, i: usize) -> FramedRay {
        let i = i % RAYS;
        let at = |columns: &[Column; 3]| [columns[0].0[i], columns[1].0[i], columns[2].0[i]];
        let kz = match (self.largest[0] >> i & 1, self.largest[1] >> i & 1) {
            (1, _) => 0,
            (_, 1) => 1,
            _ => 2,
        };
        let (kx, ky) = ((kz + 1) % 3, (kz + 2) % 3);
        let (sx, sy, iz) = (self.shear[0].0[i], self.shear[1].0[i], self.along.0[i]);
        let frame = RayFrame { kx, ky, kz, sx, sy, iz, inv: at(&self.inverse) };
        let (origin, direction) = (at(&self.origin), at(&self.direction));
        FramedRay { origin, t_min: self.t_min.0[i], direction, flip: self.flip, frame }
    }

    /// What ray `i` has found.
    #[inline(always)]
    pub fn best(&self, i: usize) -> Best {
        let (i, found) = (i % RAYS, &self.found);
        let [u, v, w] = [found.edges[0].0[i], found.edges[1].0[i], found.edges[2].0[i]];
        let hit = TriangleHit { hit: true, t: self.t.0[i], u, v, w, det: found.det.0[i] };
        let (id, leaf, triangle) = (found.id.0[i], found.leaf.0[i], found.triangle.0[i]);
        Best { t: self.t.0[i], id, leaf, triangle, hit, source: found.source.0[i] }
    }

    /// Has ray `i` have found what `best` says.
    #[inline(always)]
    pub fn set_best(&mut self, i: usize, best: &Best) {
        let (i, found) = (i % RAYS, &mut self.found);
        self.t.0[i] = best.t;
        self.bounds.t[0] = least(self.bounds.t[0], best.t);
        (found.id.0[i], found.leaf.0[i], found.triangle.0[i]) = (best.id, best.leaf, best.triangle);
        for (column, x) in found.edges.iter_mut().zip([best.hit.u, best.hit.v, best.hit.w]) {
            column.0[i] = x;
        }
        found.det.0[i] = best.hit.det;
    }

    /// Vectors that hold the rays.
    #[inline(always)]
    pub fn vectors<I: Isa>(&self) -> usize {
        self.count.div_ceil(I::Wide::LANES).min(RAYS / I::Wide::LANES)
    }

    /// A bit for every ray.
    #[inline(always)]
    pub fn all(&self) -> u64 {
        u64::MAX >> (RAYS - self.count)
    }

    /// The rays whose hits are not nearer than `near`.
    #[inline(always)]
    pub fn reaching<I: Isa>(&self, isa: I, near: f32) -> u64 {
        let mut rays = 0;
        for v in 0..self.vectors::<I>() {
            rays |= u64::from(isa.splat(near).less_equal(self.t.get(isa, v))) << (v * I::Wide::LANES);
        }
        rays & self.all()
    }

    /// Of `rays` those whose hits are not nearer than their distances in `near`.
    #[inline(always)]
    pub fn reaching_each<I: Isa>(&self, isa: I, near: &Column, rays: u64) -> u64 {
        let mut reaching = 0;
        for v in 0..self.vectors::<I>() {
            reaching |= u64::from(near.get(isa, v).less_equal(self.t.get(isa, v))) << (v * I::Wide::LANES);
        }
        reaching & rays
    }

    /// Of `rays` those that take a leaf of the top level.
    #[inline(always)]
    pub fn taking(&self, bound: &Bound, leaf: u32, rays: u64) -> u64 {
        if !bound.has_levels() { rays } else { self.whose_cones(bound, rays, |cone| bound.takes(cone, leaf)) }
    }

    /// Of `rays` those that may meet the brick of a leaf node.
    #[inline(always)]
    pub fn meeting(&self, bound: &Bound, node: u32, rays: u64) -> u64 {
        if bound.is_world(node) {
            return rays;
        }
        let (mut left, mut met) = (rays, 0);
        while left != 0 {
            let i = left.trailing_zeros() as usize % RAYS;
            left &= left - 1;
            met |= u64::from(bound.enters(&self.ray(i), node, self.t.0[i])) << i;
        }
        met
    }

    /// Of `rays` those for which no level stands for all below a node of the wide top level.
    #[inline(always)]
    pub fn left_by_levels(&self, bound: &Bound, node: u32, rays: u64) -> u64 {
        if !bound.has_levels() { rays } else { self.whose_cones(bound, rays, |c| !bound.is_stood_for_wide(c, node)) }
    }

    /// Of `rays` those whose cones are as asked; the same cones are asked about once.
    #[inline(always)]
    pub fn whose_cones(&self, bound: &Bound, rays: u64, ask: impl Fn(&Cone) -> bool) -> u64 {
        if bound.are_cones_empty() {
            return if ask(&Cone::default()) { rays } else { 0 };
        }
        let (mut left, mut found, mut last) = (rays, 0, None);
        while left != 0 {
            let i = left.trailing_zeros() as usize % RAYS;
            left &= left - 1;
            let at = |columns: &[Column; 3]| [columns[0].0[i], columns[1].0[i], columns[2].0[i]];
            let cone = bound.cone_of(at(&self.origin), at(&self.direction), spread_in(self.pending.0[i]));
            let is_so = match last {
                Some((before, answer)) if before == cone => answer,
                _ => ask(&cone),
            };
            last = Some((cone, is_so));
            found |= u64::from(is_so) << i;
        }
        found
    }

    /// Takes note that hits have come nearer.
    #[inline(always)]
    pub fn shorten<I: Isa>(&mut self, isa: I) {
        self.bounds.t = self.t.range(isa, self.vectors::<I>());
    }
}

/// A vector's components in the order of [`RayFrame`]: kx, ky, kz.
#[inline(always)]
pub fn turned<I: Isa>(x: [I::Wide; 3], axis: u32, [along_x, along_y]: [u32; 2]) -> [I::Wide; 3] {
    match axis {
        0 => [x[1], x[2], x[0]],
        1 => [x[2], x[0], x[1]],
        2 => x,
        _ => [
            x[1].or_else(along_x, x[2].or_else(along_y, x[0])),
            x[2].or_else(along_x, x[0].or_else(along_y, x[1])),
            x[0].or_else(along_x, x[1].or_else(along_y, x[2])),
        ],
    }
}
