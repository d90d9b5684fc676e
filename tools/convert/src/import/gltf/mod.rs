//! glTF 2.0, as JSON or GLB.
//!
//! The node hierarchy of the default scene becomes placements, in depth-first order; each mesh in use is stored once.
//! Geometry is taken at rest. The `gltf` crate's validation is not used: its list of extensions is too short, and its
//! readers trust what they are given. Instead everything that is followed is checked here, where it is followed.

mod accessor;
mod document;
mod file;
mod glb;
mod materials;
mod meshes;
mod nodes;
mod transform;
mod uri;

use super::TriangleBudget;
use super::error::{ImportError, one_line};
use super::warnings::Warnings;
use crate::progress::Progress;
use crate::source::{Mesh, Placement, Primitive, SourceScene};
use file::{File, Problem};
use rayon::prelude::*;
use std::path::Path;

/// Most triangles stored for a byte of input. A triangle of its own takes several bytes; many meshes may share accessors
/// (to differ in material, say), but without a bound a small file could demand any amount of memory.
const MAX_SHARING: u64 = 64;

/// Imports one .gltf or .glb file.
pub(super) fn load(path: &Path, budget: &mut TriangleBudget, progress: &Progress) -> Result<SourceScene, ImportError> {
    let mut warnings = Warnings::new(super::error::show(path));
    let file = File::open(path, &mut warnings)?;
    let document = &file.document;
    meshes::check_references(document).map_err(|(mesh, primitive, problem)| {
        file.fault(meshes::primitive_place(document, mesh, primitive), problem)
    })?;
    let has_animation = !document.animations.is_empty();
    if has_animation {
        warnings.add("animations are ignored; geometry is taken at rest", String::new);
    }

    let uses = nodes::uses(&file, &mut warnings)?;
    let checked = check_meshes(&file, &uses, &mut warnings)?;
    let mut instanced = 0u64;
    for one in &uses {
        let instances = one.instances.as_ref().map_or(1, |i| i.count as u64);
        // Instances have attributes of their own but for a few nodes that share them; the buffers bound what that may
        // multiply to.
        instanced = instanced.saturating_add(one.instances.as_ref().map_or(0, |_| instances));
        if instanced > file.input_bytes {
            let what = format!("brings the instances to {instanced}, more than the file and its buffers can hold");
            return Err(file.fault(nodes::node_place(document, one.node), Problem::new(what)));
        }
        let triangles = checked[one.mesh].iter().flatten().map(|p| p.triangles()).sum();
        budget.add(&file.label, instances, triangles)?;
    }

    let stored: u64 = checked.iter().flatten().flatten().map(|p| p.triangles()).sum();
    if stored / MAX_SHARING > file.input_bytes {
        let what = format!("its meshes repeat the same accessors to {stored} triangles");
        let remedy = "use one mesh for several nodes instead of copies of it";
        return Err(file.fault("meshes".into(), Problem { what, remedy }));
    }

    let (meshes, numbers, needs_default) = read_meshes(&file, &checked, &mut warnings, progress)?;
    let placements = place(&file, &uses, &numbers)?;

    let mut is_used = vec![false; document.materials.len()];
    for material in checked.iter().flatten().flatten().filter_map(|p| p.material()) {
        is_used[material] = true;
    }
    let (mut materials, textures) = materials::load(&file, &is_used, &mut warnings, progress)?;
    if needs_default {
        materials.push(materials::default_material());
    }
    drop(checked);
    drop(uses);
    let sources = vec![file.source];
    Ok(SourceScene { meshes, placements, materials, textures, sources, warnings: warnings.into_lines(), has_animation })
}

/// The checked primitives of every mesh in use; `None` for the others.
fn check_meshes<'a>(
    file: &'a File,
    uses: &[nodes::Use],
    warnings: &mut Warnings,
) -> Result<Vec<Option<Vec<meshes::Checked<'a>>>>, ImportError> {
    let document = &file.document;
    let mut is_used = vec![false; document.meshes.len()];
    for one in uses {
        is_used[one.mesh] = true;
    }
    let mut checked = Vec::with_capacity(is_used.len());
    for (m, is_used) in is_used.into_iter().enumerate() {
        checked.push(match is_used {
            false => None,
            true => {
                let mut primitives = Vec::with_capacity(document.meshes[m].primitives.len());
                for (p, json) in document.meshes[m].primitives.iter().enumerate() {
                    let place = || meshes::primitive_place(document, m, p);
                    let primitive = meshes::check(file, json, warnings, &place);
                    primitives.push(primitive.map_err(|problem| file.fault(place(), problem))?);
                }
                Some(primitives)
            }
        });
    }
    Ok(checked)
}

/// Reads the meshes in use, in order, primitives in parallel. Also gives the new number of each mesh and whether any
/// primitive uses the default material, which is to follow those of the file.
fn read_meshes(
    file: &File,
    checked: &[Option<Vec<meshes::Checked>>],
    warnings: &mut Warnings,
    progress: &Progress,
) -> Result<(Vec<Mesh>, Vec<u32>, bool), ImportError> {
    let document = &file.document;
    let default_material = document.materials.len();
    let mut numbers = Vec::with_capacity(checked.len());
    let mut meshes = Vec::new();
    let mut jobs = Vec::new();
    for (m, primitives) in checked.iter().enumerate() {
        numbers.push(meshes.len() as u32);
        if let Some(primitives) = primitives {
            let name = display_name(m, document.meshes[m].name.as_deref());
            meshes.push(Mesh { name, primitives: Vec::with_capacity(primitives.len()) });
            jobs.extend(primitives.iter().enumerate().map(|(p, primitive)| (m, p, primitive)));
        }
    }
    progress.phase("geometry", jobs.len() as u64);
    let results: Vec<Result<meshes::Read, Problem>> = jobs
        .par_iter()
        .map(|(_, _, primitive)| {
            let read = primitive.read(primitive.material().unwrap_or(default_material) as u32);
            progress.advance(1);
            read
        })
        .collect();
    // In order, so that the error and the warnings do not depend on the threads.
    let mut needs_default = false;
    for ((m, p, primitive), result) in jobs.into_iter().zip(results) {
        let place = || meshes::primitive_place(document, m, p);
        let read = result.map_err(|problem| file.fault(place(), problem))?;
        for repair in read.repairs {
            warnings.add(repair, place);
        }
        needs_default |= primitive.material().is_none();
        let primitives: &mut Vec<Primitive> = &mut meshes[numbers[m] as usize].primitives;
        primitives.push(read.primitive);
    }
    Ok((meshes, numbers, needs_default))
}

/// The placements of all uses, instances multiplied out.
fn place(file: &File, uses: &[nodes::Use], numbers: &[u32]) -> Result<Vec<Placement>, ImportError> {
    let document = &file.document;
    let mut placements = Vec::with_capacity(uses.len());
    for one in uses {
        let name = display_name(one.node, document.nodes[one.node].name.as_deref());
        let mesh = numbers[one.mesh];
        let Some(instances) = &one.instances else {
            placements.push(Placement { name, mesh, source: 0, world_from_mesh: one.world });
            continue;
        };
        for i in 0..instances.count {
            let fault = |problem: Problem| {
                let problem = Problem { what: format!("instance {i}: {}", problem.what), ..problem };
                file.fault(nodes::node_place(document, one.node), problem)
            };
            let world_from_mesh = transform::multiply(&one.world, &instances.matrix(i).map_err(fault)?);
            if !world_from_mesh.iter().all(|c| c.is_finite()) {
                return Err(fault(Problem::new("its transformation is not finite")));
            }
            placements.push(Placement { name: name.clone(), mesh, source: 0, world_from_mesh });
        }
    }
    Ok(placements)
}

/// "kind 3 \"name\"", on one line.
fn label(kind: &str, index: usize, name: Option<&str>) -> String {
    match name {
        Some(name) if !name.is_empty() => format!("{kind} {index} \"{}\"", one_line(name)),
        _ => format!("{kind} {index}"),
    }
}

/// The name of an object, or its index.
fn display_name(index: usize, name: Option<&str>) -> String {
    match name {
        Some(name) if !name.is_empty() => one_line(name),
        _ => index.to_string(),
    }
}
