//! What the formats without a scene graph (OBJ, PLY, STL) have in common: one placement a mesh, plain materials, rows
//! of numbers.

use super::bytes::{Bytes, Spool};
use super::error::{EXPORT_AGAIN, ImportError, show};
use super::table::Table;
use super::warnings::Warnings;
use crate::source::{MeshOutline, Outline, PART_TRIANGLES, PartOutline, Placement, Primitive};
use bricks::{MATERIAL_DOUBLE_SIDED, Material};
use std::io;
use std::path::Path;
use xxhash_rust::xxh3::Xxh3;

/// A file at the beginning of its import.
pub(super) struct Start {
    /// The path as messages show it.
    pub label: String,
    /// The file.
    pub bytes: Bytes,
    /// What is wrong without being an error.
    pub warnings: Warnings,
}

/// Finds the file at `path`.
pub(super) fn start(path: &Path, spool: &Spool) -> Result<Start, ImportError> {
    let label = show(path);
    let bytes = spool.file(path).map_err(|reason| ImportError::Read { file: label.clone(), reason })?;
    let warnings = Warnings::new(label.clone());
    Ok(Start { label, bytes, warnings })
}

/// The outline of `meshes` of the file at `path`, which has `hash`: each placed once, of [`bare`] material.
pub(super) fn outline(
    path: &Path,
    Start { bytes, warnings, .. }: Start,
    hash: &Xxh3,
    axes: &[f64; 12],
    meshes: Vec<MeshOutline>,
    has_colors: bool,
) -> Outline {
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    Outline {
        placements: meshes.iter().enumerate().map(|(m, mesh)| placement(m, &mesh.name, axes)).collect(),
        meshes,
        materials: vec![bare(has_colors)],
        sources: vec![bricks::Source { name, bytes: bytes.len(), hash: format!("{:016x}", hash.digest()) }],
        warnings: warnings.into_lines(),
        ..Outline::default()
    }
}

/// White and matt, seen from both sides: scans and exported surfaces do not promise a winding.
pub(super) fn material() -> Material {
    Material { flags: MATERIAL_DOUBLE_SIDED, ..Material::DIFFUSE }
}

/// The same where the file names no material: grey, unless vertices have colours.
pub(super) fn bare(has_colors: bool) -> Material {
    let base_color = if has_colors { Material::DIFFUSE } else { Material::GREY }.base_color;
    Material { base_color, ..material() }
}

/// The name of a mesh that has none: that of its file without the extension.
pub(super) fn stem(path: &Path) -> String {
    super::error::one_line(&path.file_stem().map(|stem| stem.to_string_lossy()).unwrap_or_default())
}

/// Mesh `index`, placed once where it is; `axes` says where that is in metres with Y up.
fn placement(index: usize, name: &str, axes: &[f64; 12]) -> Placement {
    Placement { name: name.to_owned(), under: Vec::new(), mesh: index as u32, source: 0, world_from_mesh: *axes }
}

/// Parts of at most [`PART_TRIANGLES`] of one primitive of `triangles`.
pub(super) fn parts(primitive: u32, triangles: u64) -> impl Iterator<Item = PartOutline> {
    let most = u64::from(PART_TRIANGLES);
    (0..triangles.div_ceil(most)).map(move |part| {
        // In range: at most `PART_TRIANGLES`.
        PartOutline { primitive, triangles: (triangles - part * most).min(most) as u32 }
    })
}

/// A mesh of one primitive.
pub(super) fn one_primitive(name: String, triangles: u64) -> MeshOutline {
    MeshOutline { name, parts: parts(0, triangles).collect(), shines_to_front: false }
}

/// The first triangle of part `part` of a mesh of one primitive, and the one behind its last.
pub(super) fn range(part: usize, triangles: u64) -> (u64, u64) {
    let first = part as u64 * u64::from(PART_TRIANGLES);
    (first, triangles.min(first + u64::from(PART_TRIANGLES)))
}

/// The error for `problem` at `place` of the file at `path`.
pub(super) fn fault(path: &Path, place: impl Into<String>, problem: impl Into<String>) -> ImportError {
    ImportError::Content { file: show(path), place: place.into(), problem: problem.into(), remedy: EXPORT_AGAIN }
}

/// The error for a file that cannot be read any further.
pub(super) fn unreadable(path: &Path, error: &io::Error) -> ImportError {
    ImportError::Read { file: show(path), reason: error.to_string() }
}

/// The error for a temporary file that cannot be written.
pub(super) fn no_room(path: &Path, problem: String) -> ImportError {
    ImportError::Content { file: show(path), place: "decoding".into(), problem, remedy: "make room there" }
}

/// The floats of the rows `wanted` of `table`, which ascend.
pub(super) fn floats<const N: usize>(table: &Table, wanted: &[u64]) -> io::Result<Vec<[f32; N]>> {
    let mut values = vec![[0.0; N]; wanted.len()];
    table.gather(wanted, |i, row| {
        for (value, bytes) in values[i].iter_mut().zip(row.as_chunks::<4>().0) {
            *value = f32::from_le_bytes(*bytes);
        }
    })?;
    Ok(values)
}

/// The doubles of the rows `wanted` of `table`, which ascend.
pub(super) fn doubles<const N: usize>(table: &Table, wanted: &[u64]) -> io::Result<Vec<[f64; N]>> {
    let mut values = vec![[0.0; N]; wanted.len()];
    table.gather(wanted, |i, row| {
        for (value, bytes) in values[i].iter_mut().zip(row.as_chunks::<8>().0) {
            *value = f64::from_le_bytes(*bytes);
        }
    })?;
    Ok(values)
}

/// The linear intensity of a colour component in 0..=1 of sRGB (IEC 61966-2-1), in which these formats are written by
/// custom; other values are clamped, what is no number is 1.
pub(super) fn linear(component: f64) -> f32 {
    if component.is_nan() {
        return 1.0;
    }
    let c = component.clamp(0.0, 1.0);
    (if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }) as f32
}

/// Replaces normals and texture coordinates that are not finite, and tells what it did. Colours are clamped where they
/// are read; positions are for the builder to judge.
pub(super) fn repair(primitive: &mut Primitive, mut tell: impl FnMut(&'static str)) {
    let is_bad = |values: &[f32]| values.iter().any(|value| !value.is_finite());
    for normal in primitive.normals.iter_mut().flatten().filter(|normal| is_bad(&normal[..])) {
        *normal = [0.0; 3];
        tell("non-finite normals set to zero");
    }
    for uv in primitive.uvs.iter_mut().flatten().filter(|uv| is_bad(&uv[..])) {
        *uv = [0.0; 2];
        tell("non-finite texture coordinates set to zero");
    }
}
