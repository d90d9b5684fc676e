//! The triangles of a scene that shine, as emitters.

use super::triangles::{Triangles, placed, triangles, words};
use crate::kernels::lamps::{Emitter, Shape};
use bricks::{
    AttributeLayout, INSTANCE_MIRRORED, Instance, MATERIAL_DOUBLE_SIDED, Payload, Resident, SURFACE_MATERIAL, SceneFile,
};
use glam::DVec3;

/// Most triangles of a scene that are lights: with their groups 128 MiB on the device.
pub const MOST_TRIANGLES: u64 = 1 << 20;

/// The triangles of a scene that shine, of every object.
#[derive(Clone, Debug, Default)]
pub struct ShiningTriangles {
    /// Objects that have some, in their order.
    objects: Vec<(u32, Vec<Shining>)>,
}

/// A triangle of an object that shines.
#[derive(Clone, Debug)]
struct Shining {
    /// Mesh-local index, the same in all bricks that hold a part of it.
    local_id: u32,
    material: u32,
    /// Object units.
    vertices: [DVec3; 3],
}

/// All triangles with emission, each instance's apart; they shine by their materials' factors, to the front, or to both
/// sides of materials that are double-sided. `Err` has their number where there are more than `most`.
///
/// # Errors
/// A brick that cannot be read.
pub fn emissive_triangles(file: &SceneFile, most: u64) -> Result<Result<ShiningTriangles, u64>, bricks::Error> {
    let resident = file.resident();
    let mut all = ShiningTriangles::default();
    let mut count = 0;
    for (number, object) in (0..).zip(&resident.objects) {
        let bricks = object.first_brick..object.first_brick + object.brick_count;
        let shines = |brick: &u32| resident.bricks[*brick as usize].mean_emission.iter().any(|&c| c > 0.0);
        let mut triangles: Vec<Shining> = Vec::new();
        for brick in bricks.filter(shines) {
            append(file, brick, &mut triangles)?;
        }
        // Parts of a triangle that was split are the whole one.
        triangles.sort_by_key(|triangle| triangle.local_id);
        triangles.dedup_by_key(|triangle| triangle.local_id);
        let places = resident.instances.iter().filter(|instance| instance.object == number).count() as u64;
        count += triangles.len() as u64 * places;
        if count > most {
            all.objects.clear();
        } else if !triangles.is_empty() {
            all.objects.push((number, triangles));
        }
    }
    Ok(if count > most { Err(count) } else { Ok(all) })
}

impl ShiningTriangles {
    /// Whether an object has some.
    pub fn shines(&self, object: u32) -> bool {
        self.objects.binary_search_by_key(&object, |(number, _)| *number).is_ok()
    }

    /// They as emitters, where the instances of `resident` place them.
    pub fn emitters(&self, resident: &Resident) -> Vec<Emitter> {
        let mut emitters = Vec::new();
        for (number, triangles) in &self.objects {
            for place in resident.instances.iter().filter(|instance| instance.object == *number) {
                emitters.extend(triangles.iter().map(|triangle| emitter(resident, triangle, place)));
            }
        }
        emitters
    }
}

fn emitter(resident: &Resident, triangle: &Shining, place: &Instance) -> Emitter {
    let [corner, b, c] = placed(place, &triangle.vertices);
    let material = &resident.materials[triangle.material as usize];
    // A mirrored instance turns triangles over; their front stays their front (glTF 2.0, "Instantiation").
    let (b, c) = if place.flags & INSTANCE_MIRRORED != 0 { (c, b) } else { (b, c) };
    Emitter {
        shape: Shape::Triangle { corner, edges: [b - corner, c - corner] },
        two_sided: material.flags & MATERIAL_DOUBLE_SIDED != 0,
        radiance: material.emission,
    }
}

/// Appends the triangles of a brick that shine.
fn append(file: &SceneFile, index: u32, out: &mut Vec<Shining>) -> Result<(), bricks::Error> {
    let brick = &file.resident().bricks[index as usize];
    let attributes = words(file, Payload::Attributes(index))?;
    let surfaces = &attributes[AttributeLayout::of(brick).surfaces as usize / 4..];
    let Triangles { corners, local_ids } = triangles(file, index)?;
    for ((vertices, local_id), surface) in corners.into_iter().zip(local_ids).zip(surfaces) {
        let material = surface & SURFACE_MATERIAL;
        if file.resident().materials[material as usize].emission.iter().any(|&c| c > 0.0) {
            out.push(Shining { local_id, material, vertices });
        }
    }
    Ok(())
}
