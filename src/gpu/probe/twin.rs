//! The twin of the intersection kernels: every ray with every triangle of a scene, in f32, with nothing left out.

use crate::kernels::frame::{Frame, Placement};
use crate::kernels::layout;
use crate::kernels::layout::{INSTANCE_IDENTITY, NONE};
use crate::kernels::payloads::BrickView;
use crate::kernels::trace::leaf::{BrickRay, rows_direction, rows_point};
use crate::kernels::trace::node::framed_ray;
use crate::math::exact::{divide, intersect_triangle, ray_frame};
use bricks::{Payload, SceneFile};

/// All triangles of a scene, each of every instance, relative to the reference point of a frame.
pub struct Twin {
    instances: Vec<layout::Instance>,
    triangles: Vec<Triangle>,
}

struct Triangle {
    instance: usize,
    id: u32,
    /// In the frame of the instance's object.
    vertices: [[f32; 3]; 3],
}

impl Twin {
    /// Reads every brick of `scene`.
    ///
    /// # Errors
    /// A damaged brick.
    pub fn new(scene: &SceneFile, frame: &Frame) -> Result<Self, bricks::Error> {
        let resident = scene.resident();
        let placement = Placement::new(resident, frame);
        let mut triangles = Vec::new();
        for leaf in &placement.leaves {
            let brick = &resident.bricks[leaf.brick as usize];
            let payload = Payload::Geometry(leaf.brick);
            let mut words = vec![0u32; scene.span(payload).bytes as usize / 4];
            scene.copy(payload, bytemuck::cast_slice_mut(&mut words))?;
            let instance = leaf.instance as usize;
            let r = BrickRay {
                offset_high: leaf.offset_high,
                offset_low: leaf.offset_low,
                base: placement.instances[instance].base,
                brick: BrickView::new(brick, bytemuck::cast_slice(&words), &[]),
                ..BrickRay::outside(&framed_ray([0.0; 3], [1.0, 0.0, 0.0], 0.0))
            };
            let triangle = |i| Triangle { instance, id: r.id(i), vertices: r.vertices(i) };
            triangles.extend((0..brick.triangle_count).map(triangle));
        }
        Ok(Self { instances: placement.instances, triangles })
    }

    /// Vertices of every triangle in the frame.
    pub fn world_triangles(&self) -> impl Iterator<Item = [[f32; 3]; 3]> + '_ {
        self.triangles.iter().map(|triangle| {
            let instance = &self.instances[triangle.instance];
            triangle.vertices.map(|v| rows_point(&instance.world_from_object, v))
        })
    }

    /// Every triangle that `ray` meets within its range.
    pub fn hits(&self, ray: &layout::Ray) -> Vec<layout::Hit> {
        let in_object = |instance: &layout::Instance| {
            let identity = instance.flags & INSTANCE_IDENTITY != 0;
            let rows = &instance.object_from_world;
            let (o, d) = (ray.origin, ray.direction);
            let (o, d) = if identity { (o, d) } else { (rows_point(rows, o), rows_direction(rows, d)) };
            (o, ray_frame(d))
        };
        let rays: Vec<_> = self.instances.iter().map(in_object).collect();
        let meet = |triangle: &Triangle| {
            let (origin, frame) = &rays[triangle.instance];
            let [a, b, c] = triangle.vertices.map(|v| [0, 1, 2].map(|k| v[k] - origin[k]));
            let h = intersect_triangle(frame, a, b, c, ray.t_min.max(0.0));
            (h.hit && h.t <= ray.t_max).then(|| layout::Hit {
                t: h.t,
                id: triangle.id,
                u: divide(h.v, h.det),
                v: divide(h.w, h.det),
            })
        };
        if ray.t_min <= ray.t_max { self.triangles.iter().filter_map(meet).collect() } else { Vec::new() }
    }
}

/// The nearest of `hits`, of equally near ones that with the lowest id; without any, what a miss of `ray` leaves.
pub fn closest(ray: &layout::Ray, hits: &[layout::Hit]) -> layout::Hit {
    let miss = layout::Hit { t: ray.t_max, id: NONE, u: 0.0, v: 0.0 };
    hits.iter().copied().min_by(|a, b| a.t.total_cmp(&b.t).then(a.id.cmp(&b.id))).unwrap_or(miss)
}
