//! A source read whole, for what needs all of a small scene in memory.

use crate::source::{Mesh, Primitive, Source, SourceError, SourceScene};
use bricks::NONE;
use rayon::prelude::*;

/// Reads every part and texture of `source`. Parts of a primitive are joined; textures that cannot be read are left
/// out, with a warning.
///
/// # Errors
/// The first part, in their order, that cannot be read.
pub fn load_all(source: &dyn Source) -> Result<SourceScene, SourceError> {
    let outline = source.outline();
    let meshes = outline.meshes.par_iter().enumerate().map(|(m, mesh)| {
        let mut primitives: Vec<Primitive> = Vec::new();
        let mut last = None;
        for (p, part) in mesh.parts.iter().enumerate() {
            let read = source.part(m, p)?.into_owned();
            match primitives.last_mut() {
                Some(primitive) if last == Some(part.primitive) => join(primitive, read),
                _ => primitives.push(read),
            }
            last = Some(part.primitive);
        }
        Ok(Mesh { name: mesh.name.clone(), primitives })
    });
    // In order, so that the error does not depend on the threads.
    let meshes: Vec<Result<Mesh, SourceError>> = meshes.collect();
    let meshes = meshes.into_iter().collect::<Result<Vec<_>, _>>()?;

    let mut warnings = outline.warnings.clone();
    warnings.extend(source.repairs());
    let read: Vec<_> = (0..outline.textures.len()).into_par_iter().map(|t| source.texture(t)).collect();
    let mut textures = Vec::new();
    let mut renumbered = Vec::with_capacity(read.len());
    for texture in read {
        match texture {
            Ok(texture) => {
                renumbered.push(textures.len() as u32);
                textures.push(texture.into_owned());
            }
            Err(problem) => {
                renumbered.push(NONE);
                warnings.push(format!("{problem}; skipped"));
            }
        }
    }
    let mut materials = outline.materials.clone();
    for material in &mut materials {
        for texture in material.textures_mut() {
            if let Some(&renumbered) = renumbered.get(*texture as usize) {
                *texture = renumbered;
            }
        }
    }
    let (placements, sources) = (outline.placements.clone(), outline.sources.clone());
    let (lights, has_animation) = (outline.lights.clone(), outline.has_animation);
    Ok(SourceScene { meshes, placements, materials, textures, lights, sources, warnings, has_animation })
}

/// Appends `next`, a part of the same primitive and so with the same attributes.
fn join(primitive: &mut Primitive, next: Primitive) {
    let shift = primitive.positions.len() as u32;
    primitive.positions.extend(next.positions);
    primitive.indices.extend(next.indices.into_iter().map(|index| index + shift));
    if let (Some(all), Some(next)) = (&mut primitive.normals, next.normals) {
        all.extend(next);
    }
    if let (Some(all), Some(next)) = (&mut primitive.uvs, next.uvs) {
        all.extend(next);
    }
    if let (Some(all), Some(next)) = (&mut primitive.uvs1, next.uvs1) {
        all.extend(next);
    }
    if let (Some(all), Some(next)) = (&mut primitive.tangents, next.tangents) {
        all.extend(next);
    }
    if let (Some(all), Some(next)) = (&mut primitive.colors, next.colors) {
        all.extend(next);
    }
}
