//! How rays find what they may meet: boxes in f32, in frames in which these are small. Triangles are the caller's, in
//! f64.
//!
//! A ray is rounded to f32 where it enters a brick, in the frame of the brick. All boxes of the brick are grown by 72
//! units of the greatest distance that any may have from there, of which the proof needs 8 of each one's own
//! (docs/methods/exact.md): the rest is more than such a ray is off, as long as f64 knows places to 2^-20 of a step of
//! the lattice. Where it does not, boxes are asked in f64. One distance for all is as good, for units are small beside
//! the grids of nodes, and it leaves little to be computed of a node before its boxes are.

use super::room::Inner;
use super::space::{Geometry, Placed, Slabs};
use super::top::Top;
use super::walk::{Asks, Open, walk};
use crate::kernels::layout::T_INFINITE;
use crate::kernels::simd::isa::Isa;
use crate::kernels::simd::wide::{Wide, three};
use crate::kernels::trace::node::UNIT;
use crate::math::crossing::{Crossing, Line, crossing_near};
use crate::math::exact::GREATEST_INVERSE;
use crate::output::npy::Ray;
use crate::scene::placement::affine;
use crate::session::trace::Scaled;
use bricks::Node;
use bricks::planted::{self, Defect};
use glam::{DMat3, DVec3};

/// Of numbers of f32: more than a conversion rounds by.
const ROUNDED: f64 = 1.0 / (1u64 << 22) as f64;
/// Of a step of the lattice: by how much rays may be off.
const LEAST_STEP: f64 = 1.0 / (1u64 << 20) as f64;
/// Of coordinates: more than moving a ray in f64 rounds by.
const MOVED: f64 = 1.0 / (1u64 << 51) as f64;
/// The greatest ratio of an instance's scales for which its inverse is good enough.
const MOST_RATIO: f64 = (1u64 << 20) as f64;

/// A ray on its way. Distances along it are counted from `near`, in lengths of `direction`.
pub(super) struct Aim {
    /// The given ray.
    pub(super) line: Line,
    /// The greatest magnitude of its origin's components.
    reach: f64,
    /// And of those of `near`.
    near_reach: f64,
    /// Where it comes near the scene.
    near: DVec3,
    /// The way there, in lengths of the given direction.
    start: f64,
    scaled: Scaled,
    /// Inverse of the direction's components.
    pub(super) inverse: [f32; 3],
    /// The interval, in lengths of the given direction; closed.
    pub(super) t_min: f64,
    /// Its end.
    pub(super) t_max: f64,
}

/// Inverses of a direction's components, finite.
#[inline(always)]
fn inverse(direction: DVec3) -> [f32; 3] {
    let d = direction.as_vec3();
    let of = |x: f32| (1.0 / x.abs().max(f32::MIN_POSITIVE)).min(GREATEST_INVERSE).copysign(x);
    [of(d.x), of(d.y), of(d.z)]
}

/// Units of distances by which boxes are grown.
const GROWN: f32 = 72.0 * UNIT;

/// A ray in a frame.
pub(super) struct Local {
    /// Its origin, moved by as much as boxes are grown: on, for their bounds that are near.
    pub(super) ahead: [f32; 3],
    /// And back, for the others.
    pub(super) behind: [f32; 3],
    inverse: [f32; 3],
    /// Whether the direction is negative, so that upper bounds are near, by axis.
    is_negative: [bool; 3],
    pub(super) t_min: f32,
    /// The frame's lengths of a length of the ray.
    factor: f64,
    /// How far along the ray the frame's begins.
    from: f64,
    /// What distances in the frame may be off by.
    slack: f64,
}

impl Local {
    /// `extent` is that of the frame's boxes.
    #[inline(always)]
    fn new(
        (origin, extent): (DVec3, f32),
        inverse: [f32; 3],
        (factor, from, slack): (f64, f64, f64),
        near: f64,
    ) -> Self {
        let t_min = (near - from) * factor;
        let t_min = (t_min - t_min.abs() * ROUNDED - slack).max(0.0) as f32;
        let origin = origin.as_vec3();
        let grown = GROWN * (origin.abs().max_element() + extent);
        let on = three!(k => grown.copysign(inverse[k]));
        Self {
            ahead: three!(k => origin[k] + on[k]),
            behind: three!(k => origin[k] - on[k]),
            is_negative: inverse.map(f32::is_sign_negative),
            inverse,
            t_min: t_min.min(T_INFINITE),
            factor,
            from,
            slack,
        }
    }

    /// No less than a distance along the ray.
    #[inline(always)]
    pub(super) fn above(&self, distance: f64) -> f32 {
        let t = (distance - self.from) * self.factor;
        if t == f64::NEG_INFINITY {
            // Before everything.
            return -1.0;
        }
        let t = t + t.abs() * ROUNDED + self.slack;
        if t >= f64::from(T_INFINITE) { T_INFINITE } else { t as f32 }
    }
}

impl Asks for Local {
    #[inline(always)]
    fn ask<I: Isa>(&self, isa: I, node: &Node, limit: f32) -> (u32, [f32; 8]) {
        let (mut near, mut end) = (isa.eight(self.t_min), isa.eight(limit));
        for k in 0..3 {
            let (step, inverse) = (f32::from_bits(u32::from(node.exponent[k]) << 23), self.inverse[k]);
            let scale = isa.eight(step * inverse);
            let (first, last) =
                if self.is_negative[k] { (&node.hi[k], &node.lo[k]) } else { (&node.lo[k], &node.hi[k]) };
            near = near.most(isa.numbers(first) * scale + isa.eight((node.origin[k] - self.ahead[k]) * inverse));
            end = end.least(isa.numbers(last) * scale + isa.eight((node.origin[k] - self.behind[k]) * inverse));
        }
        let mut nears = [0.0; 8];
        near.store(&mut nears);
        (near.less_equal(end), nears)
    }
}

impl Aim {
    /// `None`: the ray never comes near the scene.
    #[inline(always)]
    pub(super) fn new(top: &Top, ray: &Ray) -> Option<Self> {
        let &Ray { origin, direction, t_min, t_max } = ray;
        let (near, start) = top.surroundings.as_ref()?.near(ray)?;
        let (scaled, t_min) = (Scaled::of(direction), t_min.max(0.0));
        Some(Self {
            line: Line { reference: [0.0; 3], origin, direction },
            reach: DVec3::from_array(origin).abs().max_element(),
            near,
            near_reach: near.abs().max_element(),
            start,
            inverse: inverse(scaled.direction),
            scaled,
            t_min,
            t_max,
        })
    }

    /// A distance along the ray, of one in lengths of the given direction.
    #[inline(always)]
    fn along(&self, t: f64) -> f64 {
        self.scaled.scaled(t - self.start)
    }

    /// No less than the distance along the ray of what is met at `t`, in lengths of the given direction. Of a ray from
    /// far away a distance that small is rounded by much.
    #[inline(always)]
    pub(super) fn limit(&self, t: f64) -> f64 {
        if t == f64::NEG_INFINITY { t } else { self.along(t + t.abs() * MOVED) }
    }

    /// No more than the distance along the ray where its interval begins.
    #[inline(always)]
    fn begin(&self) -> f64 {
        self.along(self.t_min - self.t_min * MOVED)
    }

    /// Where the ray meets a triangle, in its interval. Distances that no f64 holds are the greatest that one does.
    #[inline(always)]
    pub(super) fn meet(&self, vertices: [DVec3; 3]) -> Option<Crossing> {
        let mut met = crossing_near(&self.line, self.reach, vertices)?;
        met.t = met.t.min(f64::MAX);
        let is_behind = met.t < self.t_min && !planted::is(Defect::LeastDistance);
        (!is_behind && met.t <= self.t_max).then_some(met)
    }

    /// Whether what is entered at `from` may be met before `t`, which is in lengths of the given direction.
    pub(super) fn may_enter(&self, from: f64, t: f64) -> bool {
        let limit = self.limit(t);
        from <= limit + limit.abs() * ROUNDED
    }

    /// The ray in a frame in world directions that has its origin at `origin`, from `from` on.
    #[inline(always)]
    pub(super) fn local(&self, (origin, extent): (DVec3, f32), per_unit: f64, (from, step): (f64, f64)) -> Local {
        let at = ((self.near - origin) + self.scaled.direction * from) * per_unit;
        Local::new((at, extent), self.inverse, (per_unit, from, LEAST_STEP * step * per_unit), self.begin())
    }

    /// Whether f64 knows the ray well enough in the frame of a brick that lies as its object does.
    #[inline(always)]
    pub(super) fn is_known(&self, brick: &Placed, from: f64) -> bool {
        let &Geometry { reach, step, .. } = brick.geometry;
        MOVED * (self.near_reach + 2.0 * from + reach) <= LEAST_STEP * step
    }

    /// The ray in the frame of a brick; `None` where f64 does not know it well enough.
    #[inline(always)]
    fn in_brick(&self, brick: &Placed, from: f64) -> Option<Local> {
        let geometry = brick.geometry;
        let &Geometry { origin, per_unit, step, extent, .. } = geometry;
        let Some(matrix) = brick.matrix else {
            return self.is_known(brick, from).then(|| self.local((origin, extent), per_unit, (from, step)));
        };
        let reach = self.near_reach + 2.0 * from;
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
        let direction = Scaled::of((object.matrix3 * self.scaled.direction).to_array());
        let at = object.transform_point3(self.near + self.scaled.direction * from) - origin;
        let factor = direction.scaled(1.0) * per_unit;
        let slack = LEAST_STEP * step * per_unit;
        Some(Local::new((at * per_unit, extent), inverse(direction.direction), (factor, from, slack), self.begin()))
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
        let limit = local.above(self.limit(self.t_max));
        walk(
            isa,
            &top.nodes,
            &local,
            limit,
            open,
            #[inline(always)]
            |leaf, near| Some(local.above(self.limit(visit(leaf.start, f64::from(near) * unit)))),
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
            let Line { origin, direction, .. } = self.line;
            let slabs = Slabs::new(origin, direction, self.t_min, self.t_max);
            return brick.walk(&slabs, &mut room.nodes, |triangle| visit(triangle).is_some());
        };
        let (mut t_max, mut limit) = (t_max, local.above(self.limit(t_max)));
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
                        (t_max, limit) = (now, local.above(self.limit(now)));
                    }
                }
                Some(limit)
            },
        );
    }
}
