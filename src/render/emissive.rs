//! The triangles of a scene that shine, as emitters.

use crate::kernel::lamps::{Emitter, Shape};
use bricks::{
    AttributeLayout, BRICK_INDEX32, BRICK_WIDE, Brick, GeometryLayout, INSTANCE_MIRRORED, MATERIAL_DOUBLE_SIDED,
    Object, Payload, SURFACE_MATERIAL, SceneFile,
};
use glam::DVec3;

/// Most triangles of a scene that are lights: 64 MiB on the device.
pub const MOST_TRIANGLES: u64 = 1 << 20;

/// A triangle of an object that shines.
struct Shining {
    /// Mesh-local index, the same in all bricks that hold a part of it.
    local_id: u32,
    material: u32,
    /// Object units.
    vertices: [DVec3; 3],
}

/// All triangles with emission, each instance's apart; they shine by their materials' factors, to the front, or to both sides of materials
/// that are double-sided. `Err` has their number where there are more than `most`.
///
/// # Errors
/// A brick that cannot be read.
pub fn emissive_triangles(file: &SceneFile, most: u64) -> Result<Result<Vec<Emitter>, u64>, bricks::Error> {
    let resident = file.resident();
    let mut emitters = Vec::new();
    let mut count = 0;
    for (number, object) in (0..).zip(&resident.objects) {
        let bricks = object.first_brick..object.first_brick + object.brick_count;
        let shines = |brick: &u32| resident.bricks[*brick as usize].mean_emission.iter().any(|&c| c > 0.0);
        let places: Vec<&bricks::Instance> = resident.instances.iter().filter(|i| i.object == number).collect();
        let mut triangles: Vec<Shining> = Vec::new();
        for brick in bricks.filter(shines) {
            append(file, object, brick, &mut triangles)?;
        }
        // Parts of a triangle that was split are the whole one.
        triangles.sort_by_key(|triangle| triangle.local_id);
        triangles.dedup_by_key(|triangle| triangle.local_id);
        count += triangles.len() as u64 * places.len() as u64;
        if count > most {
            emitters.clear();
            continue;
        }
        for place in places {
            emitters.extend(triangles.iter().map(|triangle| emitter(file, triangle, place)));
        }
    }
    Ok(if count > most { Err(count) } else { Ok(emitters) })
}

fn emitter(file: &SceneFile, triangle: &Shining, place: &bricks::Instance) -> Emitter {
    let m = &place.world_from_object;
    let row = |k: usize| DVec3::new(m[4 * k], m[4 * k + 1], m[4 * k + 2]);
    let world = |p: DVec3| DVec3::from_array([0, 1, 2].map(|k| row(k).dot(p) + m[4 * k + 3]));
    let [corner, b, c] = triangle.vertices.map(world);
    let material = &file.resident().materials[triangle.material as usize];
    // A mirrored instance turns triangles over; their front stays their front (glTF 2.0, "Instantiation").
    let (b, c) = if place.flags & INSTANCE_MIRRORED != 0 { (c, b) } else { (b, c) };
    Emitter {
        shape: Shape::Triangle { corner, edges: [b - corner, c - corner] },
        two_sided: material.flags & MATERIAL_DOUBLE_SIDED != 0,
        radiance: material.emission,
    }
}

/// Words of a payload, checked by the file as they are copied.
pub(super) fn words(file: &SceneFile, payload: Payload) -> Result<Vec<u32>, bricks::Error> {
    let mut words = vec![0u32; file.loaded_bytes(payload) as usize / 4];
    file.copy(payload, bytemuck::cast_slice_mut(&mut words))?;
    Ok(words)
}

/// Appends the triangles of a brick that shine.
fn append(file: &SceneFile, object: &Object, index: u32, out: &mut Vec<Shining>) -> Result<(), bricks::Error> {
    let brick = &file.resident().bricks[index as usize];
    let attributes = words(file, Payload::Attributes(index))?;
    let surfaces = &attributes[AttributeLayout::of(brick).surfaces as usize / 4..];
    let geometry = words(file, Payload::Geometry(index))?;
    let layout = GeometryLayout::of(brick);
    let [vertices, ids, indices] = [layout.vertices, layout.ids, layout.indices].map(|at| &geometry[at as usize / 4..]);
    let corner = |at: usize| match brick.flags & BRICK_INDEX32 != 0 {
        true => indices[at] as usize,
        // Two to a word, the first in the low half.
        false => (indices[at / 2] >> (16 * (at % 2)) & 0xffff) as usize,
    };
    for i in 0..brick.triangle_count as usize {
        let material = surfaces[i] & SURFACE_MATERIAL;
        if file.resident().materials[material as usize].emission.iter().any(|&c| c > 0.0) {
            let vertices = [0, 1, 2].map(|k| vertex(object, brick, vertices, corner(3 * i + k)));
            out.push(Shining { local_id: ids[i], material, vertices });
        }
    }
    Ok(())
}

/// A vertex in object units.
pub(super) fn vertex(object: &Object, brick: &Brick, words: &[u32], index: usize) -> DVec3 {
    let (step, unit) = (f64::from(object.step_log2).exp2(), f64::from(object.unit_log2).exp2());
    let is_wide = brick.flags & BRICK_WIDE != 0;
    let first = index * if is_wide { 6 } else { 3 };
    let value = |at: usize| f64::from(f32::from_bits(words[first + at]));
    let low = |k: usize| if is_wide { value(k + 3) } else { 0.0 };
    DVec3::from_array([0, 1, 2].map(|k| brick.origin[k] as f64 * step + (value(k) + low(k)) * unit))
}
