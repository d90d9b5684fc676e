//! The triangles of a brick, read on the host.

use bricks::{BRICK_INDEX32, BRICK_WIDE, Brick, GeometryLayout, Instance, Object, Payload, SceneFile};
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

/// Those of brick `index` of `object`.
///
/// # Errors
/// A brick that cannot be read.
pub(crate) fn triangles(file: &SceneFile, object: &Object, index: u32) -> Result<Triangles, bricks::Error> {
    let brick = &file.resident().bricks[index as usize];
    let geometry = words(file, Payload::Geometry(index))?;
    let layout = GeometryLayout::of(brick);
    let [vertices, ids, indices] = [layout.vertices, layout.ids, layout.indices].map(|at| &geometry[at as usize / 4..]);
    let corner = |at: usize| match brick.flags & BRICK_INDEX32 != 0 {
        true => indices[at] as usize,
        // Two to a word, the first in the low half.
        false => (indices[at / 2] >> (16 * (at % 2)) & 0xffff) as usize,
    };
    let count = brick.triangle_count as usize;
    let corners = |i: usize| [0, 1, 2].map(|k| vertex(object, brick, vertices, corner(3 * i + k)));
    Ok(Triangles { corners: (0..count).map(corners).collect(), local_ids: ids[..count].to_vec() })
}

/// A vertex in object units.
fn vertex(object: &Object, brick: &Brick, words: &[u32], index: usize) -> DVec3 {
    let (step, unit) = (f64::from(object.step_log2).exp2(), f64::from(object.unit_log2).exp2());
    let is_wide = brick.flags & BRICK_WIDE != 0;
    let first = index * if is_wide { 6 } else { 3 };
    let value = |at: usize| f64::from(f32::from_bits(words[first + at]));
    let low = |k: usize| if is_wide { value(k + 3) } else { 0.0 };
    DVec3::from_array([0, 1, 2].map(|k| brick.origin[k] as f64 * step + (value(k) + low(k)) * unit))
}

/// A triangle where an instance of its object stands, world units.
pub(crate) fn placed(place: &Instance, corners: &[DVec3; 3]) -> [DVec3; 3] {
    let m = &place.world_from_object;
    let row = |k: usize| DVec3::new(m[4 * k], m[4 * k + 1], m[4 * k + 2]);
    corners.map(|p| DVec3::from_array([0, 1, 2].map(|k| row(k).dot(p) + m[4 * k + 3])))
}
