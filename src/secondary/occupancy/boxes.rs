//! Boxes of the children of a brick's root: thin where a brick is flat and its cells are not.

use super::Bom;
use super::region::Region;
use crate::scene::placement::affine;
use bricks::{Brick, INSTANCE_IDENTITY, Instance, Object};
use glam::{DAffine3, DMat3, DVec3};

/// By how much of their size and place turned boxes grow, for roundings.
const MARGIN: f64 = 1e-9;
/// By how much of their place boxes grow, for the rounding of a sum.
const SUM_ULPS: f64 = 2.0 * f64::EPSILON;

/// Boxes that together hold the triangles of a brick, in units of its object.
pub fn boxes(object: &Object, brick: &Brick) -> impl Iterator<Item = [DVec3; 2]> {
    let (unit, step) = (f64::from(object.unit_log2).exp2(), f64::from(object.step_log2).exp2());
    let root = brick.root;
    let origin = DVec3::from_array(brick.origin.map(|x| x as f64)) * step;
    (0..8).filter(move |&child| root.meta[child] != 0).map(move |child| {
        // Exact but for the sum, of numbers of unlike sizes.
        let side = |steps: &[[u8; 8]; 3], outward: f64| {
            let along = |k: usize| {
                let grid = f64::from(i32::from(root.exponent[k]) - 127).exp2();
                let x = origin[k] + (f64::from(root.origin[k]) + f64::from(steps[k][child]) * grid) * unit;
                x + outward * SUM_ULPS * x.abs()
            };
            DVec3::new(along(0), along(1), along(2))
        };
        [side(&root.lo, -1.0), side(&root.hi, 1.0)]
    })
}

/// The cells of a map that a box of an object meets, where an instance has it.
pub fn region(map: &Bom, instance: &Instance, [low, high]: [DVec3; 2]) -> Option<Region> {
    let side = f64::from(map.cell_log2).exp2();
    let [low, high] = if instance.flags & INSTANCE_IDENTITY != 0 {
        [low, high]
    } else {
        let DAffine3 { matrix3: linear, translation } = affine(&instance.world_from_object);
        let size = DMat3::from_cols(linear.x_axis.abs(), linear.y_axis.abs(), linear.z_axis.abs());
        let middle = linear * ((low + high) / 2.0) + translation;
        let half = size * ((high - low) / 2.0);
        let half = half + (half + middle.abs() + translation.abs()) * MARGIN;
        [middle - half, middle + half]
    };
    let cell = |x: f64| (x / side).floor() as i64;
    Region::within(map, low.to_array().map(cell), high.to_array().map(|x| cell(x).saturating_add(1)))
}
