//! What a ray meets inside one brick: twin of `shaders/trace/brick.wgsl`.

use super::indices::Indices;
use super::leaf::{BrickRay, row_direction, rows_point};
use super::node::UNIT;
use super::opacity::OpacityView;
use crate::kernels::bound::Scene;
use crate::kernels::layout::{BRICK_WIDE, Hit, INSTANCE_IDENTITY, NONE, Surface};
use crate::kernels::rays::Slot;
use crate::kernels::vector::{Vec3, each, most3};
use crate::math::exact::{
    SurfacePoint, TriangleHit, barrier, divide, intersect_triangle, length_of, offset_origin, surface_point,
};
use bricks::{Brick, GeometryLayout, Node};

/// The arrays of a brick's geometry where they lie. What indices they hold has been checked when the payload was
/// loaded; they are checked on every use all the same.
#[derive(Clone, Copy, Default)]
pub struct BrickView<'a> {
    /// Nodes, the root first.
    pub nodes: &'a [Node],
    /// Three numbers a vertex, or six of a wide brick.
    vertices: &'a [f32],
    /// Mesh-local ids of the triangles.
    ids: &'a [u32],
    /// The triangles' vertices.
    indices: Indices<'a>,
    /// Whether vertices have two parts.
    is_wide: bool,
    /// Which rays pass through its triangles.
    pub opacity: OpacityView<'a>,
}

impl<'a> BrickView<'a> {
    /// The arrays in the verified geometry of `brick`, which is aligned for u32 and of the length that the record
    /// implies; `table` is that of [`crate::kernels::opacity`].
    pub fn new(brick: &Brick, bytes: &'a [u8], table: &'a [[u32; 4]]) -> Self {
        let layout = GeometryLayout::of(brick);
        let part = |from: u64, to: u64| &bytes[from as usize..to as usize];
        Self {
            nodes: bytemuck::cast_slice(part(0, layout.vertices)),
            vertices: bytemuck::cast_slice(part(layout.vertices, layout.ids)),
            ids: bytemuck::cast_slice(part(layout.ids, layout.indices)),
            indices: Indices::new(brick, part(layout.indices, layout.opacity_of)),
            opacity: OpacityView {
                of: bytemuck::cast_slice(part(layout.opacity_of, layout.opacities)),
                triangles: bytemuck::cast_slice(part(layout.opacities, layout.bytes)),
                table,
            },
            is_wide: brick.flags & BRICK_WIDE != 0,
        }
    }

    /// A vertex in the object's frame, in which the brick's origin lies at the offset: the correctly rounded difference
    /// of its lattice position and the reference point.
    #[inline(always)]
    fn vertex(&self, index: u32, offset_high: Vec3, offset_low: Vec3) -> Vec3 {
        if !self.is_wide {
            let at = 3 * index as usize;
            let l = &self.vertices[at..at + 3];
            return each(|k| barrier(l[k] + offset_high[k]));
        }
        let at = 6 * index as usize;
        let l = &self.vertices[at..at + 6];
        each(|k| barrier(barrier(l[k] + offset_high[k]) + barrier(l[3 + k] + offset_low[k])))
    }

    /// The vertices of a triangle in the object's frame.
    #[inline(always)]
    pub fn vertices(&self, triangle: u32, offset_high: Vec3, offset_low: Vec3) -> [Vec3; 3] {
        let [a, b, c] = self.indices.of(triangle);
        let vertex = |index| self.vertex(index, offset_high, offset_low);
        [vertex(a), vertex(b), vertex(c)]
    }
}

impl Best {
    /// What is known of a ray before a dispatch.
    #[inline(always)]
    pub fn before(slot: &Slot) -> Self {
        let (before, source) = (&slot.hit, slot.surface.source);
        Self { t: before.t, id: before.id, leaf: NONE, triangle: 0, hit: TriangleHit::default(), source }
    }
}

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

impl BrickRay<'_> {
    /// The vertices of a triangle in the object's frame.
    #[inline(always)]
    pub fn vertices(&self, triangle: u32) -> [Vec3; 3] {
        self.brick.vertices(triangle, self.offset_high, self.offset_low)
    }

    /// The global id of a triangle.
    #[inline(always)]
    pub fn id(&self, triangle: u32) -> u32 {
        self.base.wrapping_add(self.brick.ids[triangle as usize])
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
        if (hit.t == best.t && id >= best.id) || id == best.source || self.passes(triangle, id, &hit) {
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
            // The rounding of the transforms there and back (numerics.md, "Instances"), along the normal.
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
            padding: 0,
        };
    }
}
