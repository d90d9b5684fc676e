//! The triangle test for the rays of a packet: [`intersect_triangle`] lane by lane, with the same operations in the
//! same order. Lanes whose numbers leave the range in which an f32 operation is what the kernel carries out in integers
//! are tested alone.

use super::hidden::is_hidden;
use super::leaf::BrickRay;
use super::packet::{Packet, RAYS, turned};
use crate::kernels::flat::{BLOCK, FlatBlock};
use crate::kernels::simd::isa::{INSIDE, Isa};
use crate::kernels::simd::wide::{Wide, three};
use crate::kernels::vector::{Vec3, each};
use crate::math::exact::{CLAMP_ULPS, TINY, TriangleHit, intersect_triangle};

impl Packet {
    /// Tests a triangle of the brick that `r` is in with `rays`, and keeps nearer hits as [`BrickRay::test_triangle`]
    /// does. With `any_hit` the rays that it ends are done.
    #[inline(always)]
    pub fn test_triangle<I: Isa>(&mut self, isa: I, r: &BrickRay, triangle: u32, rays: u64, any_hit: bool) -> bool {
        let corners = r.vertices(triangle);
        self.test(
            isa,
            r,
            triangle,
            (rays, any_hit),
            #[inline(always)]
            |packet, v| {
                let origin = three!(k => packet.origin[k].get(isa, v));
                three!(i => three!(k => isa.splat(corners[i][k]) - origin[k]))
            },
            #[inline(always)]
            |corners| {
                ends(
                    #[inline(always)]
                    |x| isa.splat(x),
                    corners,
                )
            },
        )
    }

    /// The same with a triangle of a block that rays from one point have seen.
    #[inline(always)]
    pub fn test_seen<I: Isa>(
        &mut self,
        isa: I,
        r: &BrickRay,
        (seen, triangle): (&Seen, u32),
        rays: u64,
        any_hit: bool,
    ) -> bool {
        let lane = triangle as usize % BLOCK;
        self.test(
            isa,
            r,
            triangle,
            (rays, any_hit),
            #[inline(always)]
            |_, _| three!(i => three!(k => isa.splat(seen.corners[i][k][lane]))),
            #[inline(always)]
            |_| {
                let end = &seen.ends;
                [three!(k => isa.splat(end[0][k][lane])), three!(k => isa.splat(end[1][k][lane]))]
            },
        )
    }

    /// Tests a triangle, of which rays of a vector see these corners, and [`ends`] of them.
    #[inline(always)]
    fn test<I: Isa>(
        &mut self,
        isa: I,
        r: &BrickRay,
        triangle: u32,
        (rays, any_hit): (u64, bool),
        corners: impl Fn(&Self, usize) -> [[I::Wide; 3]; 3],
        ends: impl Fn([[I::Wide; 3]; 3]) -> [[I::Wide; 3]; 2],
    ) -> bool {
        let mut is_nearer = false;
        for v in 0..self.vectors::<I>() {
            let shift = v * I::Wide::LANES;
            let lanes = ((rays >> shift) & (u64::MAX >> (RAYS - I::Wide::LANES))) as u32;
            if lanes == 0 {
                continue;
            }
            let [a, b, c] = corners(self, v);
            let axes = self.axes(shift, I::Wide::LANES);
            let by = [self.shear[0].get(isa, v), self.shear[1].get(isa, v)];
            let sa = shear(turned::<I>(a, self.axis, axes), by);
            let sb = shear(turned::<I>(b, self.axis, axes), by);
            let sc = shear(turned::<I>(c, self.axis, axes), by);
            let rays = Rays {
                along: self.along.get(isa, v),
                inverse: three!(k => self.inverse[k].get(isa, v)),
                t_min: self.t_min.get(isa, v),
                t_max: self.t.get(isa, v),
            };
            let met = meet(
                #[inline(always)]
                |x| isa.splat(x),
                [sa, sb, sc],
                #[inline(always)]
                || ends([a, b, c]),
                &rays,
                lanes,
            );
            let Some(Met { hit, mut alone, values }) = met else { continue };
            if hit != 0 {
                let kept = self.keep(isa, r, triangle, (v, hit), values);
                is_nearer |= kept != 0;
                self.done |= if any_hit { u64::from(kept) << shift } else { 0 };
            }
            while alone != 0 {
                let i = shift + alone.trailing_zeros() as usize;
                alone &= alone - 1;
                is_nearer |= self.test_alone(r, triangle, i, any_hit);
            }
        }
        is_nearer
    }

    /// Of the lanes from `shift` on, those whose directions are largest along x, and along y.
    #[inline(always)]
    fn axes(&self, shift: usize, lanes: usize) -> [u32; 2] {
        let all = u64::MAX >> (RAYS - lanes);
        [((self.largest[0] >> shift) & all) as u32, ((self.largest[1] >> shift) & all) as u32]
    }

    /// [`BrickRay::keep`] for the lanes of `hit` of vector `v`, whose distances are not beyond what they have. Returns
    /// those that keep it.
    #[inline(always)]
    fn keep<I: Isa>(
        &mut self,
        isa: I,
        r: &BrickRay,
        triangle: u32,
        (v, mut hit): (usize, u32),
        [t, u, v_, w, det]: [I::Wide; 5],
    ) -> u32 {
        let found = &mut self.found;
        let id = isa.splat_bits(r.id(triangle));
        hit &= !self.t.get(isa, v).less_equal(t) | id.less_bits(found.id.get(isa, v));
        hit &= !id.same_bits(found.source.get(isa, v));
        if hit != 0 && is_hidden(r.hidden, r.id(triangle)) {
            return 0;
        }
        if hit != 0 && !r.brick.opacity.of.is_empty() {
            hit = self.stopped(r, triangle, (v, hit), [u, v_, w, det]);
        }
        let found = &mut self.found;
        if hit != 0 {
            self.t.replace(isa, v, hit, t);
            found.id.replace(isa, v, hit, id);
            found.leaf.replace(isa, v, hit, isa.splat_bits(r.leaf));
            found.triangle.replace(isa, v, hit, isa.splat_bits(triangle));
            found.edges[0].replace(isa, v, hit, u);
            found.edges[1].replace(isa, v, hit, v_);
            found.edges[2].replace(isa, v, hit, w);
            found.det.replace(isa, v, hit, det);
        }
        hit
    }

    /// Of the lanes of `hit` of vector `v`, which meet a triangle of a brick that rays may pass through, those that do
    /// not pass through it.
    fn stopped<W: Wide>(&self, r: &BrickRay, triangle: u32, (v, hit): (usize, u32), edges: [W; 4]) -> u32 {
        // The longest vectors have 16 lanes.
        let mut values = [[0.0; 16]; 4];
        for (lane, edge) in values.iter_mut().zip(edges) {
            edge.store(lane);
        }
        let id = r.id(triangle);
        let stops = |&i: &usize| {
            let [u, v_, w, det] = values.map(|lane| lane[i]);
            let alone = BrickRay { ray: self.ray(v * W::LANES + i), ..*r };
            // The distance decides nothing.
            !alone.passes(triangle, id, &TriangleHit { hit: true, t: 0.0, u, v: v_, w, det })
        };
        (0..W::LANES).filter(|i| hit >> i & 1 != 0).filter(stops).fold(0, |lanes, i| lanes | 1 << i)
    }

    /// Tests a triangle with ray `i` alone, and keeps the hit if it is the best so far.
    fn test_alone(&mut self, r: &BrickRay, triangle: u32, i: usize, any_hit: bool) -> bool {
        let (ray, mut best) = (self.ray(i), self.best(i));
        let [a, b, c] = r.vertices(triangle).map(|x| each(|k| x[k] - ray.origin[k]));
        let hit = intersect_triangle(&ray.frame, a, b, c, ray.t_min);
        let alone = BrickRay { ray, ..*r };
        if !hit.hit || !alone.keep(&mut best, triangle, hit) {
            return false;
        }
        self.set_best(i, &best);
        self.done |= u64::from(any_hit) << i;
        true
    }
}

/// What the test takes of rays, a lane each.
pub struct Rays<W> {
    /// [`crate::math::exact::RayFrame::iz`].
    pub along: W,
    /// 1 / direction, by axes in the order of the vertices'.
    pub inverse: [W; 3],
    /// Least parameters.
    pub t_min: W,
    /// Distances beyond which hits are of no use.
    pub t_max: W,
}

/// What it finds.
pub struct Met<W> {
    /// Lanes that hit.
    pub hit: u32,
    /// Lanes whose numbers leave the range: they are to be tested alone.
    pub alone: u32,
    /// Distances, edge values u, v, w and their sums.
    pub values: [W; 5],
}

/// [`intersect_triangle`] lane by lane: vertices as seen from the origins, turned and sheared, and [`ends`]. `None`: no
/// lane hits.
#[inline(always)]
pub fn meet<W: Wide>(
    splat: impl Fn(f32) -> W,
    [sa, sb, sc]: [[W; 3]; 3],
    ends: impl FnOnce() -> [[W; 3]; 2],
    rays: &Rays<W>,
    lanes: u32,
) -> Option<Met<W>> {
    let u = sc[0] * sb[1] - sc[1] * sb[0];
    let v = sa[0] * sc[1] - sa[1] * sc[0];
    let w = sb[0] * sa[1] - sb[1] * sa[0];
    let (zero, tiny) = (splat(0.0), splat(TINY));
    let mut alone = (u.abs().less(tiny) | v.abs().less(tiny) | w.abs().less(tiny)) & lanes;
    let beside = u.least(v.least(w)).less(zero) & zero.less(u.most(v.most(w)));
    let mut hit = lanes & !beside & !alone;
    if hit | alone == 0 {
        return None;
    }
    let det = u + v + w;
    hit &= det.less(zero) | zero.less(det);
    let sum = u * sa[2] + v * sb[2] + w * sc[2];
    let quotient = sum / det;
    let inside = |x: W| splat(INSIDE[0]).less_equal(x.abs()) & x.abs().less(splat(INSIDE[1]));
    let plain = inside(sum) & inside(det) & inside(quotient);
    alone |= hit & !plain;
    hit &= plain;
    let t = quotient * rays.along;
    hit &= rays.t_min.less_equal(t);
    if hit | alone == 0 {
        return None;
    }
    let [low, high] = ends();
    let t0 = three!(k => low[k] * rays.inverse[k]);
    let t1 = three!(k => high[k] * rays.inverse[k]);
    let near = three!(k => t0[k].least(t1[k]));
    let far = three!(k => t0[k].most(t1[k]));
    let n = near[0].most(near[1].most(near[2]));
    let x = far[0].least(far[1].least(far[2]));
    hit &= !x.less(rays.t_min);
    let t = t.least(x).most(n.most(rays.t_min)).abs();
    hit &= t.less_equal(rays.t_max);
    Some(Met { hit, alone, values: [t, u, v, w, det] })
}

/// The box that distances to a triangle are clamped to, lower and upper ends: its own, widened by the error of
/// distances, as seen from the origins.
#[inline(always)]
pub fn ends<W: Wide>(splat: impl Fn(f32) -> W, [a, b, c]: [[W; 3]; 3]) -> [[W; 3]; 2] {
    let low = three!(k => a[k].least(b[k].least(c[k])));
    let high = three!(k => a[k].most(b[k].most(c[k])));
    let m = three!(k => low[k].abs().most(high[k].abs()));
    let e = splat(CLAMP_ULPS) * m[0].most(m[1].most(m[2]));
    [three!(k => low[k] - e), three!(k => high[k] + e)]
}

/// The triangles of a block as rays from one point see them, one a lane.
#[derive(Default)]
pub struct Seen {
    /// Vertices by axes.
    corners: [[[f32; BLOCK]; 3]; 3],
    /// [`ends`].
    ends: [[[f32; BLOCK]; 3]; 2],
}

impl Seen {
    /// Has the rays of a packet look at a block that lies at an offset.
    #[inline(always)]
    pub fn look<I: Isa>(&mut self, isa: I, packet: &Packet, block: &FlatBlock, offset: Vec3) {
        let bounds = &packet.bounds;
        let (offset, origin) = (three!(k => isa.eight(offset[k])), three!(k => isa.eight(bounds.origin[0][k])));
        let corners = three!(i => three!(k => (isa.load_eight(&block.vertices[i][k]) + offset[k]) - origin[k]));
        let ends = ends(
            #[inline(always)]
            |x| isa.eight(x),
            corners,
        );
        for k in 0..3 {
            let [a, b, c] = &mut self.corners;
            corners[0][k].store(&mut a[k]);
            corners[1][k].store(&mut b[k]);
            corners[2][k].store(&mut c[k]);
            ends[0][k].store(&mut self.ends[0][k]);
            ends[1][k].store(&mut self.ends[1][k]);
        }
    }
}

/// [`crate::math::exact::shear`] of components in their order.
#[inline(always)]
pub fn shear<W: Wide>(p: [W; 3], by: [W; 2]) -> [W; 3] {
    [p[0] - by[0] * p[2], p[1] - by[1] * p[2], p[2]]
}
