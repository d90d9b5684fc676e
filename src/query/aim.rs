//! How rays find what they may meet: boxes in f32, in frames in which these are small. Triangles are the caller's, in
//! f64.
//!
//! A ray is rounded to f32 where it enters a brick, in the frame of the brick. All boxes of the brick are grown by 72
//! units of the greatest distance that any may have from there, of which the proof needs 8 of each one's own
//! (docs/methods/exact.md): the rest is more than such a ray is off, as long as f64 knows places to 2^-20 of a step of
//! the lattice. Where it does not, boxes are asked in f64. One distance for all is as good, for units are small beside
//! the grids of nodes, and it leaves little to be computed of a node before its boxes are.

use super::aims::{Aims, GROWN, LEAST_STEP, Locals, MOVED, ROUNDED, Told, inverse};
use super::given::Columns;
use super::room::Inner;
use super::space::{Geometry, Placed, Slabs};
use super::top::Top;
use super::walk::{Asks, Branch, Open, walk};
use crate::kernels::simd::isa::Isa;
use crate::kernels::simd::wide::{Wide, three};
use crate::math::crossing::{Crossing, Line, crossing_near};
use crate::output::npy::Ray;
use crate::scene::placement::affine;
use crate::session::trace::Scaled;
use bricks::planted::{self, Defect};
use glam::{DMat3, DVec3};

/// The greatest ratio of an instance's scales for which its inverse is good enough.
const MOST_RATIO: f64 = (1u64 << 20) as f64;

/// A ray on its way.
pub(super) type Aim = Aims<1>;

/// A ray in a frame.
pub(super) struct Local {
    of: Locals<1>,
    inverse: [f32; 3],
    /// Whether the direction is negative, so that upper bounds are near, by axis.
    is_negative: [bool; 3],
}

impl Local {
    #[inline(always)]
    fn new(of: Locals<1>, inverse: &[[f32; 1]; 3]) -> Self {
        let inverse = three!(k => inverse[k][0]);
        Self { of, is_negative: three!(k => inverse[k].is_sign_negative()), inverse }
    }
}

impl<B: Branch> Asks<B> for Local {
    #[inline(always)]
    fn ask<I: Isa>(&self, isa: I, node: &B, limit: f32) -> (u32, [f32; 8]) {
        let Locals { ahead, behind, t_min, .. } = &self.of;
        let (mut near, mut end) = (isa.eight(t_min[0]), isa.eight(limit));
        for k in 0..3 {
            let ((step, origin), inverse, is_negative) = (node.grid(k), self.inverse[k], self.is_negative[k]);
            let scale = isa.eight(step * inverse);
            let (first, last) = (node.bounds(isa, k, is_negative), node.bounds(isa, k, !is_negative));
            near = near.most(first * scale + isa.eight((origin - ahead[k][0]) * inverse));
            end = end.least(last * scale + isa.eight((origin - behind[k][0]) * inverse));
        }
        let mut nears = [0.0; 8];
        near.store(&mut nears);
        (near.less_equal(end), nears)
    }
}

impl<const N: usize> Aims<N> {
    /// Whether f64 knows a ray well enough in the frame of a brick that lies as its object does.
    #[inline(always)]
    pub(super) fn is_known(&self, i: usize, brick: &Placed, from: f64) -> bool {
        let &Geometry { reach, step, .. } = brick.geometry;
        MOVED * (self.near_reach[i] + 2.0 * from + reach) <= LEAST_STEP * step
    }

    /// Where a ray meets a triangle, in its interval. Distances that no f64 holds are the greatest that one does.
    #[inline(always)]
    pub(super) fn meet(&self, i: usize, vertices: [DVec3; 3]) -> Option<Crossing> {
        let (line, reach) = (self.lines.line(i), self.lines.reach(i));
        let mut met = crossing_near(&line, reach, vertices)?;
        met.t = met.t.min(f64::MAX);
        let is_behind = met.t < self.t_min[i] && !planted::is(Defect::LeastDistance);
        (!is_behind && met.t <= self.t_max[i]).then_some(met)
    }
}

impl Aim {
    /// A ray alone; `None`: it never comes near the scene.
    #[inline(always)]
    pub(super) fn alone(top: &Top, ray: &Ray) -> Option<Self> {
        let aim = Self::new(top, &Columns::of(ray));
        (aim.come != 0).then_some(aim)
    }

    /// Whether what is entered at `from` may be met before `t`, which is in lengths of the given direction.
    pub(super) fn may_enter(&self, from: f64, t: f64) -> bool {
        let limit = self.limit(0, t);
        from <= limit + limit.abs() * ROUNDED
    }

    /// The ray in a frame in world directions, as of [`Aims::locals`].
    #[inline(always)]
    fn local(&self, frame: (DVec3, f32), per_unit: f64, from: (f64, f64)) -> Local {
        Local::new(self.locals(frame, per_unit, from), &self.inverse)
    }

    /// The ray in the frame of a brick; `None` where f64 does not know it well enough.
    #[inline(always)]
    fn in_brick(&self, brick: &Placed, from: f64) -> Option<Local> {
        let geometry = brick.geometry;
        let &Geometry { origin, per_unit, step, extent, .. } = geometry;
        let Some(matrix) = brick.matrix else {
            return self.is_known(0, brick, from).then(|| self.local((origin, extent), per_unit, (from, step)));
        };
        let [near, way] = [&self.near, &self.way].map(|of| DVec3::from_array(three!(k => of[k][0])));
        let reach = self.near_reach[0] + 2.0 * from;
        let world = affine(matrix);
        let object = world.inverse();
        let norm = |m: &DMat3| m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt();
        let size = norm(&object.matrix3);
        let ratio = norm(&world.matrix3) * size;
        let terms = size * (reach + world.translation.abs().max_element()) + geometry.reach;
        // What is no number is not known, either.
        let is_known = ratio <= MOST_RATIO && 8.0 * MOVED * ratio * terms <= LEAST_STEP * step;
        if !is_known {
            return None;
        }
        let direction = Scaled::of((object.matrix3 * way).to_array());
        let at = (object.transform_point3(near + way * from) - origin) * per_unit;
        let told = Told { factor: direction.scaled(1.0) * per_unit, from, slack: LEAST_STEP * step * per_unit };
        let inverse = inverse(&three!(k => [direction.direction[k]]));
        let locals = Locals::new((&three!(k => [at[k]]), extent, GROWN), &inverse, told, &self.begins());
        Some(Local::new(locals, &inverse))
    }

    /// Calls `visit` for the leaves of the top level that the ray may enter, about as it does, with where at the
    /// earliest: until it meets something before that, which `visit` returns in lengths of the given direction.
    #[inline(always)]
    pub(super) fn leaves<I: Isa>(
        &self,
        isa: I,
        top: &Top,
        open: &mut Vec<Open>,
        mut visit: impl FnMut(u32, f64) -> f64,
    ) {
        let unit = top.frame.unit;
        let local = self.local((top.frame.origin, top.extent), top.per_unit, (0.0, top.step));
        let limit = local.of.told.above(self.limit(0, self.t_max[0]));
        walk(
            isa,
            &top.nodes,
            &local,
            limit,
            open,
            #[inline(always)]
            |leaf, near| Some(local.of.told.above(self.limit(0, visit(leaf.start, f64::from(near) * unit)))),
        );
    }

    /// Calls `visit` for the triangles of a brick, which the ray enters `from` on at the earliest, that it may meet up
    /// to `t_max`, and to what `visit` returns; with none it ends.
    #[inline(always)]
    pub(super) fn triangles<I: Isa>(
        &self,
        isa: I,
        brick: &Placed,
        (from, t_max): (f64, f64),
        room: &mut Inner,
        mut visit: impl FnMut(u32) -> Option<f64>,
    ) {
        let Some(local) = self.in_brick(brick, from) else {
            let Line { origin, direction, .. } = self.lines.line(0);
            let slabs = Slabs::new(origin, direction, self.t_min[0], self.t_max[0]);
            return brick.walk(&slabs, &mut room.nodes, |triangle| visit(triangle).is_some());
        };
        let (mut t_max, mut limit) = (t_max, local.of.told.above(self.limit(0, t_max)));
        walk(
            isa,
            brick.geometry.view.nodes,
            &local,
            limit,
            &mut room.open,
            #[inline(always)]
            |triangles, _| {
                for triangle in triangles {
                    let now = visit(triangle)?;
                    if now != t_max {
                        (t_max, limit) = (now, local.of.told.above(self.limit(0, now)));
                    }
                }
                Some(limit)
            },
        );
    }
}
