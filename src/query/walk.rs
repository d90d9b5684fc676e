//! How rays find what they may meet: boxes in f32, in frames in which these are small. Triangles are the caller's, in
//! f64.
//!
//! A ray is rounded to f32 where it enters a brick, in the frame of the brick. The test of a node's boxes
//! ([`crate::kernels::trace::node`]) grows them by 64 units of their distance and by 4 of their coordinates, of which
//! the proof needs 8 of the one alone (docs/methods/exact.md): the rest is more than such a ray is off, as long as f64
//! knows places to 2^-20 of a step of the lattice. Where it does not, boxes are asked in f64.

use super::room::{Room, nearest_on_top};
use super::space::{Geometry, Placed, Slabs, children};
use super::top::{Child, Top, child};
use crate::kernels::layout::T_INFINITE;
use crate::kernels::simd::isa::{Isa, Lanes};
use crate::kernels::trace::node::{FramedRay, octant};
use crate::kernels::trace::walk_brick::Group;
use crate::math::crossing::{Crossing, Line, crossing, surely_misses};
use crate::math::exact::{GREATEST_INVERSE, RayFrame};
use crate::output::npy::Ray;
use crate::scene::placement::affine;
use crate::session::trace::Scaled;
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
    /// From the origin of any frame in world directions.
    ray: FramedRay,
    /// The interval, in lengths of the given direction; closed.
    pub(super) t_min: f64,
    /// Its end.
    pub(super) t_max: f64,
}

/// A ray in a frame, as boxes are asked: without what tests of triangles in f32 need.
#[inline(always)]
fn boxed(origin: DVec3, direction: DVec3) -> FramedRay {
    let (origin, direction) = (origin.as_vec3().to_array(), direction.as_vec3().to_array());
    let inverse = |x: f32| (1.0 / x.abs().max(f32::MIN_POSITIVE)).min(GREATEST_INVERSE).copysign(x);
    let inv = [inverse(direction[0]), inverse(direction[1]), inverse(direction[2])];
    let frame = RayFrame { kx: 1, ky: 2, kz: 0, sx: 0.0, sy: 0.0, iz: 1.0, inv };
    FramedRay { origin, t_min: 0.0, direction, flip: octant(direction), frame }
}

/// A ray in a frame.
struct Local {
    ray: FramedRay,
    lanes: Lanes,
    /// The frame's lengths of a length of the ray.
    factor: f64,
    /// How far along the ray the frame's begins.
    from: f64,
    /// What distances in the frame may be off by.
    slack: f64,
}

impl Local {
    fn new(ray: FramedRay, (factor, from, slack): (f64, f64, f64), near: f64) -> Self {
        let t_min = (near - from) * factor;
        let t_min = (t_min - t_min.abs() * ROUNDED - slack).max(0.0) as f32;
        let ray = FramedRay { t_min: t_min.min(T_INFINITE), ..ray };
        Self { lanes: Lanes::new(&ray, [0.0; 3], [0.0; 3]), ray, factor, from, slack }
    }

    /// No less than a distance along the ray.
    #[inline(always)]
    fn above(&self, distance: f64) -> f32 {
        let t = (distance - self.from) * self.factor;
        if t == f64::NEG_INFINITY {
            // Before everything.
            return -1.0;
        }
        let t = t + t.abs() * ROUNDED + self.slack;
        if t >= f64::from(T_INFINITE) { T_INFINITE } else { t as f32 }
    }
}

impl Aim {
    /// `None`: the ray never comes near the scene.
    #[inline(always)]
    pub(super) fn new(top: &Top, ray: &Ray) -> Option<Self> {
        let approach = top.surroundings.as_ref()?.approach(ray)?;
        let &Ray { origin, direction, t_min, t_max } = ray;
        let near = DVec3::from_array(approach.ray.origin);
        let (scaled, t_min) = (Scaled::of(direction), t_min.max(0.0));
        Some(Self {
            line: Line { reference: [0.0; 3], origin, direction },
            reach: DVec3::from_array(origin).abs().max_element(),
            near,
            near_reach: near.abs().max_element(),
            start: approach.start,
            scaled,
            ray: boxed(DVec3::ZERO, scaled.direction),
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
    fn limit(&self, t: f64) -> f64 {
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
        if surely_misses(&self.line, self.reach, vertices) {
            return None;
        }
        let mut met = crossing(&self.line, vertices.map(|vertex| vertex.to_array()))?;
        met.t = met.t.min(f64::MAX);
        (self.t_min..=self.t_max).contains(&met.t).then_some(met)
    }

    /// Whether what is entered at `from` may be met before `t`, which is in lengths of the given direction.
    pub(super) fn may_enter(&self, from: f64, t: f64) -> bool {
        let limit = self.limit(t);
        from <= limit + limit.abs() * ROUNDED
    }

    /// The ray in a frame in world directions that has its origin at `origin`, from `from` on.
    #[inline(always)]
    fn local(&self, origin: DVec3, per_unit: f64, (from, step): (f64, f64)) -> Local {
        let at = ((self.near - origin) + self.scaled.direction * from) * per_unit;
        let ray = FramedRay { origin: at.as_vec3().to_array(), ..self.ray };
        Local::new(ray, (per_unit, from, LEAST_STEP * step * per_unit), self.begin())
    }

    /// The ray in the frame of a brick; `None` where f64 does not know it well enough.
    #[inline(always)]
    fn in_brick(&self, brick: &Placed, from: f64) -> Option<Local> {
        let geometry = brick.geometry;
        let &Geometry { origin, per_unit, step, .. } = geometry;
        let reach = self.near_reach + 2.0 * from;
        let Some(matrix) = brick.matrix else {
            let is_known = MOVED * (reach + geometry.reach) <= LEAST_STEP * step;
            return is_known.then(|| self.local(origin, per_unit, (from, step)));
        };
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
        let ray = boxed(at * per_unit, direction.direction);
        let factor = direction.scaled(1.0) * per_unit;
        Some(Local::new(ray, (factor, from, LEAST_STEP * step * per_unit), self.begin()))
    }

    /// Calls `visit` for the leaves of the top level that the ray may enter, about as it does, with where at the
    /// earliest: until it meets something before that, which `visit` returns in lengths of the given direction.
    #[inline(always)]
    pub(super) fn leaves<I: Isa>(
        &self,
        isa: I,
        top: &Top,
        room: &mut Room,
        mut visit: impl FnMut(&mut Room, u32, f64) -> f64,
    ) {
        if top.nodes.is_empty() {
            return;
        }
        let unit = top.frame.unit;
        let local = self.local(top.frame.origin, top.per_unit, (0.0, top.step));
        let mut limit = local.above(self.limit(self.t_max));
        room.top.clear();
        room.top.push((local.ray.t_min, 0));
        while let Some((near, entry)) = room.top.pop() {
            if near > limit {
                continue;
            }
            let index = match Child::of(entry) {
                Child::Node(index) => index,
                Child::Leaf(leaf) => {
                    limit = local.above(self.limit(visit(room, leaf, f64::from(near) * unit)));
                    continue;
                }
            };
            let node = &top.nodes[index as usize];
            let entered = isa.hits(&local.ray, &local.lanes, node, 0.0, limit);
            let before = room.top.len();
            let mut left = entered.mask & children(node);
            while left != 0 {
                let slot = left.trailing_zeros() as usize;
                left &= left - 1;
                room.top.push((entered.near[slot], child(node, slot).number()));
            }
            nearest_on_top(&mut room.top[before..]);
        }
    }

    /// Calls `visit` for the triangles of a brick, which the ray enters `from` on at the earliest, that it may meet up
    /// to `t_max`, and to what `visit` returns; with none it ends.
    #[inline(always)]
    pub(super) fn triangles<I: Isa>(
        &self,
        isa: I,
        brick: &Placed,
        (from, t_max): (f64, f64),
        room: &mut Room,
        mut visit: impl FnMut(u32) -> Option<f64>,
    ) {
        let Some(local) = self.in_brick(brick, from) else {
            let Line { origin, direction, .. } = self.line;
            let slabs = Slabs::new(origin, direction, self.t_min, self.t_max);
            return brick.walk(&slabs, &mut room.nodes, |triangle| visit(triangle).is_some());
        };
        let view = &brick.geometry.view;
        let flip = local.ray.flip;
        let mut limit = local.above(self.limit(t_max));
        let mut group = Group::root(flip);
        room.groups.clear();
        loop {
            if !group.has_children() {
                let Some(next) = room.groups.pop() else { return };
                group = next;
            }
            let (slot, rest) = group.nearest_child(flip);
            let node = &view.nodes[group.child_index(slot) as usize];
            let mask = isa.open(&local.ray, &local.lanes, node, limit);
            if rest.has_children() {
                room.groups.push(rest);
            }
            group = Group { base: node.child_base, bits: mask & 0xff00_0000 | u32::from(node.inner_mask) };
            let mut triangles = mask & 0x00ff_ffff;
            while triangles != 0 {
                let triangle = node.triangle_base + triangles.trailing_zeros();
                triangles &= triangles - 1;
                let Some(t_max) = visit(triangle) else { return };
                limit = local.above(self.limit(t_max));
            }
        }
    }
}
