//! The triangles of a brick, read on the host.

use crate::scene::placement::affine;
use bricks::{Corners, GeometryLayout, Instance, Payload, SceneFile};
use glam::DVec3;

/// A brick's triangles.
pub(crate) struct Triangles {
    /// Object units.
    pub corners: Vec<[DVec3; 3]>,
    /// Mesh-local indices. All parts of a triangle that was split have the same, and its corners.
    pub local_ids: Vec<u32>,
}

/// Words of a payload, checked by the file as they are copied.
pub(crate) fn words(file: &SceneFile, payload: Payload) -> Result<Vec<u32>, bricks::Error> {
    let mut words = vec![0u32; file.loaded_bytes(payload) as usize / 4];
    file.copy(payload, bytemuck::cast_slice_mut(&mut words))?;
    Ok(words)
}

/// Those of a brick.
///
/// # Errors
/// A brick that cannot be read.
pub(crate) fn triangles(file: &SceneFile, index: u32) -> Result<Triangles, bricks::Error> {
    let brick = &file.resident().bricks[index as usize];
    let object = &file.resident().objects[brick.object as usize];
    let geometry = words(file, Payload::Geometry(index))?;
    let corners = Corners::new(brick, bytemuck::cast_slice(&geometry));
    let [step, unit] = [object.step_log2, object.unit_log2].map(|log2| f64::from(log2).exp2());
    let origin = DVec3::from_array(brick.origin.map(|x| x as f64)) * step;
    let triangle = |i: u32| corners.of(i).map(|p| origin + DVec3::from_array(p) * unit);
    let local_ids = geometry[GeometryLayout::of(brick).ids as usize / 4..][..brick.triangle_count as usize].to_vec();
    Ok(Triangles { corners: (0..brick.triangle_count).map(triangle).collect(), local_ids })
}

/// A triangle where an instance of its object stands, world units.
pub(crate) fn placed(place: &Instance, corners: &[DVec3; 3]) -> [DVec3; 3] {
    let world_from_object = affine(&place.world_from_object);
    corners.map(|p| world_from_object.transform_point3(p))
}
