//! Where things of a scene's resident part are, in f64.

use bricks::{Leaf, Resident};
use glam::{DAffine3, DVec3};

/// What a row-major 3x4 matrix does, such as an instance's world_from_object.
pub fn affine(m: &[f64; 12]) -> DAffine3 {
    let column = |k: usize| DVec3::new(m[k], m[4 + k], m[8 + k]);
    DAffine3::from_cols(column(0), column(1), column(2), column(3))
}

/// A box of the scene's lattice in world units.
pub fn world_box(resident: &Resident, bounds: [[i64; 3]; 2]) -> [DVec3; 2] {
    let step = f64::from(resident.objects[0].step_log2).exp2();
    bounds.map(|corner| DVec3::from_array(corner.map(|x| x as f64)) * step)
}

/// The box of a leaf of the top level, world units.
pub fn leaf_box(resident: &Resident, leaf: &Leaf) -> [DVec3; 2] {
    world_box(resident, resident.leaf_box(leaf))
}
