//! What a ray meets inside one brick: twin of `shaders/trace/brick.wgsl`.

use super::hidden::is_hidden;
use super::leaf::{BrickRay, row_direction, rows_point};
use super::node::UNIT;
use crate::kernels::bound::Scene;
use crate::kernels::layout::{Hit, INSTANCE_IDENTITY, NONE, Surface};
use crate::kernels::rays::Slot;
use crate::kernels::vector::{Vec3, each, most3};
use crate::math::exact::{
    SurfacePoint, TriangleHit, barrier, divide, intersect_triangle, length_of, offset_origin, surface_point,
};

/// The nearest hit so far.
#[derive(Clone, Copy, Debug)]
pub struct Best {
    /// Distance.
    pub t: f32,
    /// Global id of the triangle.
    pub id: u32,
    /// Its leaf; NONE while this dispatch has found nothing.
    pub leaf: u32,
    /// Its number in the brick.
    pub triangle: u32,
    /// Its edge values, not divided.
    pub hit: TriangleHit,
    /// Triangle that the ray starts from.
    pub source: u32,
}

impl Best {
    /// What is known of a ray before a dispatch.
    #[inline(always)]
    pub fn before(slot: &Slot) -> Self {
        let (before, source) = (&slot.hit, slot.surface.source);
        Self { t: before.t, id: before.id, leaf: NONE, triangle: 0, hit: TriangleHit::default(), source }
    }

    /// What a ray is told that asks whether it hits anything: no ray starts from there. By what probability it was
    /// drawn counts no more.
    #[inline(always)]
    pub fn write_occluder(&self, hit: &mut Hit, surface: &mut Surface) {
        (hit.t, hit.id) = (self.t, self.id);
        (surface.leaf, surface.triangle, surface.area) = (self.leaf, self.triangle, 0.0);
    }
}

impl BrickRay<'_> {
    /// The vertices of a triangle in the object's frame.
    #[inline(always)]
    pub fn vertices(&self, triangle: u32) -> [Vec3; 3] {
        self.brick.vertices(triangle, self.offset_high, self.offset_low)
    }

    /// The global id of a triangle.
    #[inline(always)]
    pub fn id(&self, triangle: u32) -> u32 {
        let own = match self.brick.flat {
            Some(flat) => flat.id(triangle),
            None => self.brick.ids[triangle as usize],
        };
        self.base.wrapping_add(own)
    }

    /// Tests one triangle and keeps the nearer hit; at equal distance the lower global id, so that no order shows.
    /// The triangle that the ray starts from is never met. Returns whether it is the best so far.
    #[inline(always)]
    pub fn test_triangle(&self, best: &mut Best, triangle: u32) -> bool {
        let [a, b, c] = self.vertices(triangle);
        let relative = |v: Vec3| each(|k| barrier(v[k] - self.ray.origin[k]));
        let (a, b, c) = (relative(a), relative(b), relative(c));
        let hit = intersect_triangle(&self.ray.frame, a, b, c, self.ray.t_min);
        hit.hit && self.keep(best, triangle, hit)
    }

    /// Keeps the hit of a triangle that is met, if it is the best so far.
    #[inline(always)]
    pub fn keep(&self, best: &mut Best, triangle: u32, hit: TriangleHit) -> bool {
        if hit.t > best.t {
            return false;
        }
        let id = self.id(triangle);
        if (hit.t == best.t && id >= best.id) || id == best.source {
            return false;
        }
        if is_hidden(self.hidden, id) || self.passes(triangle, id, &hit) {
            return false;
        }
        *best = Best { t: hit.t, id, leaf: self.leaf, triangle, hit, source: best.source };
        true
    }

    /// A hit that became the best in this dispatch: distance, id, barycentrics, and the point secondary rays start
    /// from.
    pub fn write_hit(&self, scene: &Scene, best: &Best, world_direction: Vec3, hit: &mut Hit, surface: &mut Surface) {
        let instance = &scene.instances[scene.leaves[best.leaf as usize].instance as usize];
        let [a, b, c] = self.vertices(best.triangle);
        let s = surface_point(a, b, c, &best.hit, self.ray.direction);
        let det = best.hit.det;
        *hit = Hit { t: best.t, id: best.id, u: divide(best.hit.v, det), v: divide(best.hit.w, det) };
        let (mut point, mut normal, mut area) = (offset_origin(&s), s.n, s.area);
        if instance.flags & INSTANCE_IDENTITY == 0 {
            // Normals go by the inverse transpose: the columns of object_from_world.
            let rows = &instance.object_from_world;
            let n = each(|k| row_direction([rows[0][k], rows[1][k], rows[2][k], 0.0], s.n));
            let stretch = length_of(n);
            normal = n.map(|x| divide(x, stretch));
            // Area vectors go by the cofactor matrix, det * inverse transpose.
            area = barrier(barrier(area * stretch) * instance.volume);
            let m = &instance.world_from_object;
            let p = rows_point(m, point);
            // The rounding of the transforms there and back (src/kernels/frame.rs), along the normal.
            let reach = most3(p.map(f32::abs)).max(most3(each(|k| m[k][3].abs())));
            let delta = 16.0 * UNIT * instance.scale * reach;
            // A zero component moves away from where the ray points.
            let sign = |k: usize| (if normal[k] == 0.0 { -world_direction[k] } else { normal[k] }).to_bits() >> 31;
            let down = sign(0) | (sign(1) << 1) | (sign(2) << 2);
            point = offset_origin(&SurfacePoint { p, delta, n: normal, down, area });
        }
        *surface = Surface {
            point,
            leaf: best.leaf,
            normal,
            triangle: best.triangle,
            area,
            source: best.source,
            pending: surface.pending,
            emitter: surface.emitter,
        };
    }
}
