//! A ray at a leaf of the top level, transformed into the frame of the leaf's instance: twin of
//! `shaders/trace/leaf.wgsl`.

use super::node::{FramedRay, UNIT, framed_ray};
use crate::kernels::bound::{Bound, Scene};
use crate::kernels::layout::{Entry, INSTANCE_IDENTITY, PARAM_REFRACT, Params};
use crate::kernels::payloads::BrickView;
use crate::kernels::simd::isa::Lanes;
use crate::kernels::vector::{Vec3, each, least, most, most3};
use crate::math::exact::barrier;

/// What numbers are drawn from where rays pass through triangles at random, beside ray and triangle.
#[derive(Clone, Copy, Default)]
pub struct Draw {
    /// `Params.seed`.
    pub seed: u32,
    /// `Params.stream`.
    pub stream: u32,
    /// Bodies that refract stop all rays.
    pub refracts: bool,
}

/// A ray in a brick.
#[derive(Clone, Copy)]
pub struct BrickRay<'a> {
    /// In the object's frame.
    pub ray: FramedRay,
    /// Brick origin in the object's frame: high part.
    pub offset_high: Vec3,
    /// Low part.
    pub offset_low: Vec3,
    /// The leaf.
    pub leaf: u32,
    /// Global id of the instance's triangle 0.
    pub base: u32,
    /// The brick's geometry, once it has been entered.
    pub brick: BrickView<'a>,
    /// What is drawn from where rays pass through triangles at random.
    pub draw: Draw,
    /// What is hidden: [`Scene::hidden`].
    pub hidden: &'a [u32],
    /// The ray and the offset as vectors.
    pub lanes: Lanes,
}

/// A row of a matrix with a direction.
#[inline(always)]
pub fn row_direction(row: [f32; 4], d: Vec3) -> f32 {
    barrier(barrier(barrier(row[0] * d[0]) + barrier(row[1] * d[1])) + barrier(row[2] * d[2]))
}

/// A row of a matrix with a point.
#[inline(always)]
pub fn row_point(row: [f32; 4], p: Vec3) -> f32 {
    barrier(row_direction(row, p) + row[3])
}

/// Rows of a matrix with a direction.
pub fn rows_direction(rows: &[[f32; 4]; 3], d: Vec3) -> Vec3 {
    rows.map(|row| row_direction(row, d))
}

/// Rows of a matrix with a point.
pub fn rows_point(rows: &[[f32; 4]; 3], p: Vec3) -> Vec3 {
    rows.map(|row| row_point(row, p))
}

impl<'a> BrickRay<'a> {
    /// `world` outside of all bricks.
    pub fn outside(world: &FramedRay) -> Self {
        Self {
            ray: *world,
            offset_high: [0.0; 3],
            offset_low: [0.0; 3],
            leaf: 0,
            base: 0,
            brick: BrickView::default(),
            draw: Draw::default(),
            hidden: &[],
            lanes: Lanes::default(),
        }
    }

    /// Points the ray at the geometry of a brick.
    #[inline(always)]
    pub fn enter_brick(&mut self, bound: &Bound<'a>, brick: usize) {
        self.brick = bound.bricks[brick];
        let Params { seed, stream, .. } = *bound.params;
        self.draw = Draw { seed, stream, refracts: bound.has(PARAM_REFRACT) };
        self.hidden = &bound.scene.hidden;
    }

    /// Points the ray at a leaf. The ray of the instance is made anew only where the instance is not the world.
    #[inline(always)]
    pub fn enter_leaf(&mut self, scene: &Scene, world: &FramedRay, leaf: u32) {
        let l = &scene.leaves[leaf as usize];
        let instance = &scene.instances[l.instance as usize];
        self.leaf = leaf;
        self.offset_high = l.offset_high;
        self.offset_low = l.offset_low;
        self.base = instance.base;
        if instance.flags & INSTANCE_IDENTITY != 0 {
            self.ray = *world;
        } else {
            let rows = &instance.object_from_world;
            self.ray = framed_ray(rows_point(rows, world.origin), rows_direction(rows, world.direction), world.t_min);
        }
        self.lanes = Lanes::new(&self.ray, self.offset_high, self.offset_low);
    }
}

impl Bound<'_> {
    /// Whether the ray enters a box of the binary top level in its range, padded as in `node_hits`.
    #[inline(always)]
    pub fn enters(&self, ray: &FramedRay, node: u32, t_max: f32) -> bool {
        let n = &self.scene.top2[node as usize];
        let (lo, hi) = (n.min, n.max);
        let m = most3(each(|k| most((lo[k] - ray.origin[k]).abs(), (hi[k] - ray.origin[k]).abs())));
        let o = most3(ray.origin.map(f32::abs));
        let all = 64.0 * UNIT * m + self.params.instance_pad * (m + o);
        let delta = each(|k| all + 8.0 * UNIT * most(lo[k].abs(), hi[k].abs()));
        let a = each(|k| (lo[k] - delta[k] - ray.origin[k]) * ray.frame.inv[k]);
        let b = each(|k| (hi[k] + delta[k] - ray.origin[k]) * ray.frame.inv[k]);
        let near = each(|k| least(a[k], b[k]));
        let far = each(|k| most(a[k], b[k]));
        most(most(near[0], near[1]), most(near[2], ray.t_min)) <= least(least(far[0], far[1]), least(far[2], t_max))
    }

    /// The leaf of the top level that an entry of a list stands for.
    #[inline(always)]
    pub fn leaf_of(&self, entry: &Entry) -> u32 {
        self.scene.top2[entry.node as usize].left
    }

    /// Whether the rays of a leaf node are those of the world: no instance transforms them.
    #[inline(always)]
    pub fn is_world(&self, node: u32) -> bool {
        let leaf = self.scene.top2[node as usize].left;
        let instance = self.scene.leaves[leaf as usize].instance;
        self.scene.instances[instance as usize].flags & INSTANCE_IDENTITY != 0
    }

    /// Whether the ray may meet the brick of a leaf node. To transform a ray costs more than to ask first whether it
    /// enters the box.
    #[inline(always)]
    pub fn may_meet(&self, ray: &FramedRay, node: u32, t_max: f32) -> bool {
        self.is_world(node) || self.enters(ray, node, t_max)
    }
}
