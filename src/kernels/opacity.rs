//! What kernels read of materials and textures to tell which rays pass through a triangle: one table, resident
//! throughout.

use super::layout::{NONE, Opacity};
use bricks::{BRICK_OPACITY, Error, MATERIAL_BLEND, MATERIAL_REFRACTS, Payload, Resident, SceneFile};

/// Whether rays may pass through some triangle.
pub fn is_needed(resident: &Resident) -> bool {
    resident.bricks.iter().any(|brick| brick.flags & BRICK_OPACITY != 0)
}

/// [`Opacity`] of each material in two vectors of words, then the texels of the maps, each from a vector of its own.
/// One vector of zeros where no ray passes through anything.
///
/// # Errors
/// A map that cannot be read or verified.
pub fn table(scene: &SceneFile) -> Result<Vec<[u32; 4]>, Error> {
    let resident = scene.resident();
    if !is_needed(resident) {
        return Ok(vec![[0; 4]]);
    }
    let mut table = vec![[0u32; 4]; 2 * resident.materials.len()];
    let mut starts = Vec::with_capacity(resident.opacity_maps.len());
    scene.announce((0..resident.opacity_maps.len() as u32).map(Payload::Opacity));
    for (index, map) in (0u32..).zip(&resident.opacity_maps) {
        let start = table.len();
        table.resize(start + map.texels.bytes as usize / 16, [0; 4]);
        scene.copy(Payload::Opacity(index), bytemuck::cast_slice_mut(&mut table[start..]))?;
        starts.push(start as u32);
    }
    for (index, material) in resident.materials.iter().enumerate() {
        let map = resident.opacity_maps.get(material.opacity_map as usize);
        let record = Opacity {
            factor: material.base_color[3],
            cutoff: material.alpha_cutoff,
            blends: u32::from(material.flags & MATERIAL_BLEND != 0)
                | u32::from(material.flags & MATERIAL_REFRACTS != 0) << 1,
            texels: map.map_or(NONE, |_| starts[material.opacity_map as usize]),
            width: map.map_or(1, |map| map.width),
            height: map.map_or(1, |map| map.height),
            wrap: map.map_or(0, |map| map.wrap),
            padding: 0,
        };
        let words: [[u32; 4]; 2] = bytemuck::cast(record);
        table[2 * index..2 * index + 2].copy_from_slice(&words);
    }
    Ok(table)
}
