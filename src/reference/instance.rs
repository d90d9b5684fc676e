//! Objects placed in the world.

use super::decode::TruthObject;
use bricks::ORIGIN_STEPS;
use glam::{DMat3, DVec3};

/// An object placed in the world.
#[derive(Clone, Debug, PartialEq)]
pub struct TruthInstance {
    /// The object.
    pub object: u32,
    /// Global id of the object's triangle 0.
    pub base: u32,
    /// world_from_object, row-major 3x4; `None` for the identity, with which nothing is rounded.
    pub world_from_object: Option<[f64; 12]>,
}

/// The linear part of a row-major 3x4 matrix.
pub(super) fn linear(m: &[f64; 12]) -> DMat3 {
    DMat3::from_cols(DVec3::new(m[0], m[4], m[8]), DVec3::new(m[1], m[5], m[9]), DVec3::new(m[2], m[6], m[10]))
}

/// The last column of a row-major 3x4 matrix.
pub(super) fn translation(m: &[f64; 12]) -> DVec3 {
    DVec3::new(m[3], m[7], m[11])
}

pub(super) fn frobenius(m: &DMat3) -> f64 {
    m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Object lengths to world lengths, bounded from above; exactly 1 for the identity.
pub(super) fn stretch(instance: &TruthInstance) -> f64 {
    instance.world_from_object.as_ref().map_or(1.0, |m| frobenius(&linear(m)))
}

/// What [`super::bounds`] must know of a scene's instances: the worst of each.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Extremes {
    /// κ: greatest ratio of scales, bounded from above by Frobenius norms (then at least 3); 0 if all are the identity.
    pub(super) scale_ratio: f64,
    /// Greatest size of a cell of reference points, world units.
    pub(super) cell: f64,
    /// Greatest magnitude of what enters the f64 transform of an instance, but for the ray; world units.
    pub(super) reach: f64,
}

impl Extremes {
    pub(super) fn of(objects: &[TruthObject], instances: &[TruthInstance]) -> Self {
        let mut worst = Self::default();
        for instance in instances {
            let Some(m) = &instance.world_from_object else { continue };
            let object = &objects[instance.object as usize];
            let step = f64::from(object.step_log2).exp2();
            let (size, cell) = (frobenius(&linear(m)), step * ORIGIN_STEPS as f64);
            let corner = DVec3::from(std::array::from_fn(|k| {
                object.bounds[0][k].unsigned_abs().max(object.bounds[1][k].unsigned_abs()) as f64 * step
            }));
            let reach = translation(m).length() + size * (corner.length() + 4.0 * cell);
            worst.scale_ratio = worst.scale_ratio.max(size * frobenius(&linear(m).inverse()));
            worst.cell = worst.cell.max(size * cell);
            worst.reach = worst.reach.max(reach);
        }
        worst
    }
}
