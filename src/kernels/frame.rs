//! The resident part of a scene relative to the reference point of a frame, as kernels see it.
//!
//! The reference point R is a lattice point on multiples of 2²⁰ steps near the camera, each instance has its own on its
//! object's lattice, and a brick's offset d = O − R is exact in one f32 (near) or two (wide): docs/methods/exact.md,
//! "Positions".

use super::layout;
use crate::scene::placement::affine;
use bricks::{BRICK_WIDE, Brick, ORIGIN_STEPS, Resident, WIDE_HIGH_STEPS};
use glam::{DAffine3, DMat3, DVec3};

/// 2^e for any e that f64 holds.
fn exp2(e: i32) -> f64 {
    f64::from(e).exp2()
}

/// The reference point of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// R in steps of the world's lattice, multiples of 2²⁰.
    pub reference: [i64; 3],
    /// World units of one device unit.
    pub unit: f64,
    /// R in world units.
    pub origin: DVec3,
}

impl Frame {
    /// The frame of a viewer at `position` (world units): R is the nearest multiple of 2²⁰ steps, held to the scene's
    /// bounds so that offsets of bricks stay exact however far away the viewer is.
    pub fn near(resident: &Resident, position: DVec3) -> Self {
        let world = &resident.objects[0];
        let step = exp2(world.step_log2);
        let cell = step * ORIGIN_STEPS as f64;
        let mut reference = [0i64; 3];
        for k in 0..3 {
            let (lo, hi) = match resident.top2.first() {
                Some(root) => (root.min[k], root.max[k]),
                None => (0, 0),
            };
            let lo = lo.div_euclid(ORIGIN_STEPS) - 1;
            let hi = hi.div_euclid(ORIGIN_STEPS) + 1;
            // A float-to-integer cast saturates, and NaN becomes 0.
            reference[k] = ((position[k] / cell).round() as i64).clamp(lo, hi) * ORIGIN_STEPS;
        }
        let origin = DVec3::from_array(reference.map(|r| r as f64)) * step;
        Self { reference, unit: exp2(world.unit_log2), origin }
    }

    /// A world point in device units relative to R, rounded once.
    pub fn point(&self, p: DVec3) -> [f32; 3] {
        ((p - self.origin) / self.unit).as_vec3().to_array()
    }
}

/// A brick as kernels see it: word offsets of its arrays.
pub fn brick_record(brick: &Brick) -> layout::Brick {
    let geometry = bricks::GeometryLayout::of(brick);
    let attributes = bricks::AttributeLayout::of(brick);
    let words = |bytes: u64| (bytes / 4) as u32;
    layout::Brick {
        vertices: words(geometry.vertices),
        ids: words(geometry.ids),
        indices: words(geometry.indices),
        flags: brick.flags,
        surfaces: words(attributes.surfaces),
        attribute_indices: words(attributes.indices),
        opacity_of: words(geometry.opacity_of),
        opacities: words(geometry.opacities),
        details: words(attributes.details),
        ..Default::default()
    }
}

/// Instances, leaves and the top level as kernels see them in a frame.
pub struct Placement {
    /// Instances.
    pub instances: Vec<layout::Instance>,
    /// Leaves of the top level.
    pub leaves: Vec<layout::Leaf>,
    /// The binary top level.
    pub top2: Vec<layout::TopNode2>,
    /// The wide top level.
    pub top8: Vec<bricks::Node>,
    /// Relative padding of top-level boxes for the rounding of instance rays.
    pub instance_pad: f32,
}

impl Placement {
    /// Of everything in `resident`.
    pub fn new(resident: &Resident, frame: &Frame) -> Self {
        let placed: Vec<Placed> = resident.instances.iter().map(|i| Placed::new(resident, i, frame)).collect();
        let leaf =
            |leaf: &bricks::Leaf| placed[leaf.instance as usize].leaf(leaf, &resident.bricks[leaf.brick as usize]);
        let world = &resident.objects[0];
        let world_scale = exp2(world.step_log2 - world.unit_log2);
        Self {
            leaves: resident.leaves.iter().map(leaf).collect(),
            top2: resident.top2.iter().map(|n| rebase_top2(n, frame, world_scale)).collect(),
            top8: resident.top8.iter().map(|n| rebase_top8(n, frame, world_scale)).collect(),
            instance_pad: placed.iter().map(|i| i.pad).fold(0.0, f32::max),
            instances: placed.iter().map(|i| i.record).collect(),
        }
    }
}

/// An instance in the frame.
struct Placed {
    record: layout::Instance,
    /// R′ in steps of the object's lattice, multiples of 2²⁰.
    reference: [i64; 3],
    /// Device units of the object per lattice step.
    scale: f64,
    pad: f32,
}

impl Placed {
    fn new(resident: &Resident, instance: &bricks::Instance, frame: &Frame) -> Self {
        let object = &resident.objects[instance.object as usize];
        let scale = exp2(object.step_log2 - object.unit_log2);
        let mut record = layout::Instance {
            base: instance.base,
            flags: instance.flags,
            scale: 1.0,
            volume: 1.0,
            ..Default::default()
        };
        if instance.flags & bricks::INSTANCE_IDENTITY != 0 {
            for k in 0..3 {
                record.object_from_world[k][k] = 1.0;
                record.world_from_object[k][k] = 1.0;
            }
            return Self { record, reference: frame.reference, scale, pad: 0.0 };
        }
        let DAffine3 { matrix3: linear, translation } = affine(&instance.world_from_object);
        let inverse = linear.inverse();
        let object_unit = exp2(object.unit_log2);
        let step = exp2(object.step_log2);
        // R' near R, held to the object's own neighbourhood as R is to the scene's: a function of R alone, as
        // what rays hit must be.
        let near = inverse * (frame.origin - translation) / (step * ORIGIN_STEPS as f64);
        let bounds = object_bounds(resident, object);
        let mut reference = [0i64; 3];
        for k in 0..3 {
            let (lo, hi) = (bounds[0][k].div_euclid(ORIGIN_STEPS) - 1, bounds[1][k].div_euclid(ORIGIN_STEPS) + 1);
            reference[k] = (near[k].round() as i64).clamp(lo, hi) * ORIGIN_STEPS;
        }
        let reference_point = DVec3::from_array(reference.map(|r| r as f64)) * step;
        let forward = linear * (object_unit / frame.unit);
        let backward = inverse * (frame.unit / object_unit);
        let c = (inverse * (frame.origin - translation) - reference_point) / object_unit;
        let t = (linear * reference_point + translation - frame.origin) / frame.unit;
        for k in 0..3 {
            record.object_from_world[k] = backward.row(k).as_vec3().extend(c[k] as f32).to_array();
            record.world_from_object[k] = forward.row(k).as_vec3().extend(t[k] as f32).to_array();
        }
        // Frobenius norms bound the ratio of scales from above.
        let norm = |m: &DMat3| m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt();
        let ratio = (norm(&linear) * norm(&inverse)).max(1.0);
        record.scale = ratio as f32;
        if is_stretched(&linear) {
            record.flags |= layout::INSTANCE_STRETCHED;
        }
        record.volume = forward.determinant().abs() as f32;
        // Measured: 3.5 u κ on the direction and 3.7 u κ (|o| + |c|) on the origin; c, seen from the world, is bounded
        // by |t| and the scene's own extent, which the kernel's reach holds. 32 leaves a wide margin.
        let pad = (32.0 * f64::from(f32::EPSILON) / 2.0 * ratio) as f32;
        Self { record, reference, scale, pad }
    }

    /// A leaf of this instance: the brick's offset from R′.
    fn leaf(&self, leaf: &bricks::Leaf, brick: &Brick) -> layout::Leaf {
        let mut out = layout::Leaf { instance: leaf.instance, brick: leaf.brick, ..Default::default() };
        for k in 0..3 {
            let d = brick.origin[k] - self.reference[k];
            if brick.flags & BRICK_WIDE != 0 {
                let high = (d + WIDE_HIGH_STEPS / 2).div_euclid(WIDE_HIGH_STEPS) * WIDE_HIGH_STEPS;
                out.offset_high[k] = (high as f64 * self.scale) as f32;
                out.offset_low[k] = ((d - high) as f64 * self.scale) as f32;
            } else {
                out.offset_high[k] = (d as f64 * self.scale) as f32;
            }
        }
        out
    }
}

/// Whether a matrix scales directions differently, by more than rounding: then the inverse transpose of a sum of
/// normals is not along the sum of theirs.
pub fn is_stretched(linear: &DMat3) -> bool {
    let squares = linear.transpose() * *linear;
    let size = (squares.x_axis.x + squares.y_axis.y + squares.z_axis.z) / 3.0;
    let off = (squares - DMat3::from_diagonal(DVec3::splat(size))).to_cols_array();
    off.into_iter().any(|x| x.abs() > 1e-6 * size)
}

/// Bounds of an object's bricks in its lattice steps.
fn object_bounds(resident: &Resident, object: &bricks::Object) -> [[i64; 3]; 2] {
    let first = object.first_brick as usize;
    let own = &resident.bricks[first..first + object.brick_count as usize];
    let least = |k: usize| own.iter().map(|b| b.min[k]).min().unwrap_or(0);
    let greatest = |k: usize| own.iter().map(|b| b.max[k]).max().unwrap_or(0);
    [std::array::from_fn(least), std::array::from_fn(greatest)]
}

fn rebase_top8(node: &bricks::TopNode8, frame: &Frame, scale: f64) -> bricks::Node {
    let scale_log2 = scale.log2().round() as i32;
    bricks::Node {
        // Rounded to nearest; the kernel's padding by 4 u |p| holds that.
        origin: std::array::from_fn(|k| ((node.origin[k] - frame.reference[k]) as f64 * scale) as f32),
        exponent: node.exponent.map(|e| (i32::from(e) + scale_log2 + 127).clamp(1, 254) as u8),
        inner_mask: node.inner_mask,
        child_base: node.child_base,
        triangle_base: node.leaf_base,
        meta: node.meta,
        lo: node.lo,
        hi: node.hi,
    }
}

fn rebase_top2(node: &bricks::TopNode2, frame: &Frame, scale: f64) -> layout::TopNode2 {
    // The kernel pads by more than the rounding to f32.
    let point = |p: &[i64; 3]| std::array::from_fn(|k| ((p[k] - frame.reference[k]) as f64 * scale) as f32);
    layout::TopNode2 { min: point(&node.min), left: node.left, max: point(&node.max), right: node.right }
}
