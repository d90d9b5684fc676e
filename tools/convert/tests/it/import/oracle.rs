//! Our reading of geometry against that of the `gltf` crate, on files that both accept.

use super::scenes::files;
use super::writer::import_one;
use crate::skip::shared_scenes;
use brickwalk_convert::source::{Primitive, SourceScene};
use std::path::Path;

/// The primitives of all meshes of a file, as the `gltf` crate reads them; `None` for modes other than triangles.
fn read(path: &Path) -> Vec<Option<Primitive>> {
    let gltf = gltf::Gltf::from_slice(&std::fs::read(path).unwrap()).unwrap();
    let buffers: Vec<Vec<u8>> = gltf
        .buffers()
        .map(|buffer| match buffer.source() {
            gltf::buffer::Source::Bin => gltf.blob.clone().unwrap(),
            gltf::buffer::Source::Uri(uri) => std::fs::read(path.with_file_name(uri)).unwrap(),
        })
        .collect();
    let mut primitives = Vec::new();
    for primitive in gltf.meshes().flat_map(|mesh| mesh.primitives()) {
        let reader = primitive.reader(|buffer| buffers.get(buffer.index()).map(Vec::as_slice));
        let positions: Vec<_> = reader.read_positions().unwrap().map(|p| p.map(f64::from)).collect();
        let indices = match reader.read_indices() {
            Some(indices) => indices.into_u32().collect(),
            None => (0..positions.len() as u32).collect(),
        };
        // Behind those of the file come the default one, and grey for what has no colours of vertices either.
        let bare = || gltf.materials().len() + usize::from(reader.read_colors(0).is_none());
        let material = primitive.material().index().unwrap_or_else(bare);
        primitives.push((primitive.mode() == gltf::mesh::Mode::Triangles).then(|| Primitive {
            material: material as u32,
            positions,
            normals: reader.read_normals().map(Iterator::collect),
            uvs: reader.read_tex_coords(0).map(|uvs| uvs.into_f32().collect()),
            colors: reader.read_colors(0).map(|colors| colors.into_rgba_f32().collect()),
            indices,
            ..Primitive::default()
        }));
    }
    primitives
}

/// The first difference, if any.
fn difference(scene: &SourceScene, oracle: &[Option<Primitive>]) -> Option<String> {
    let ours: Vec<_> = scene.meshes.iter().flat_map(|m| &m.primitives).collect();
    if ours.len() != oracle.len() {
        return Some(format!("{} primitives, not {}", ours.len(), oracle.len()));
    }
    ours.into_iter().zip(oracle).enumerate().find_map(|(i, (ours, theirs))| {
        let theirs = theirs.as_ref()?;
        let same = [
            ("materials", ours.material == theirs.material),
            ("triangles", ours.indices.len() == theirs.indices.len()),
            ("positions", corners(ours, Some(&ours.positions)) == corners(theirs, Some(&theirs.positions))),
            ("normals", corners(ours, ours.normals.as_ref()) == corners(theirs, theirs.normals.as_ref())),
            ("texture coordinates", close(corners(ours, ours.uvs.as_ref()), corners(theirs, theirs.uvs.as_ref()))),
            ("colours", close(corners(ours, ours.colors.as_ref()), corners(theirs, theirs.colors.as_ref()))),
        ];
        same.iter().find(|(_, same)| !same).map(|(what, _)| format!("{what} of primitive {i}"))
    })
}

/// The values at the corners of all triangles: which vertices are kept, and where, is ours to choose.
fn corners<T: Copy>(primitive: &Primitive, values: Option<&Vec<T>>) -> Option<Vec<T>> {
    values.map(|values| primitive.indices.iter().map(|&i| values[i as usize]).collect())
}

/// Equal up to the rounding of normalised integers, which the crate divides in f32 and we in f64.
fn close<const N: usize>(a: Option<Vec<[f32; N]>>, b: Option<Vec<[f32; N]>>) -> bool {
    let near = |a: f32, b: f32| (a - b).abs() <= f32::EPSILON * b.abs();
    match (a, b) {
        (Some(a), Some(b)) => {
            a.len() == b.len() && a.iter().flatten().zip(b.iter().flatten()).all(|(&a, &b)| near(a, b))
        }
        (a, b) => a.is_none() && b.is_none(),
    }
}

#[test]
fn geometry_agrees_with_the_gltf_crate() {
    let Some(folder) = shared_scenes() else { return };
    let mut paths = files(&folder.join("stress/asset-generator"));
    paths.retain(|path| !path.ends_with("Compatibility_04.gltf") && !path.ends_with("Compatibility_05.gltf"));
    paths.push(folder.join("stress/SimpleSparseAccessor/glTF/SimpleSparseAccessor.gltf"));
    paths.push(folder.join("sponza/Sponza.gltf"));
    let mut compared = 0;
    for path in &paths {
        let mut scene = import_one(path).unwrap_or_else(|e| panic!("{e}"));
        let oracle = read(path);
        assert_eq!(difference(&scene, &oracle), None, "{}", path.display());
        compared += oracle.iter().flatten().count();
        // The comparison notices one changed bit.
        if let Some(at) = oracle.iter().position(|p| p.as_ref().is_some_and(|p| !p.indices.is_empty())) {
            let primitive = scene.meshes.iter_mut().flat_map(|m| &mut m.primitives).nth(at).unwrap();
            let coordinate = &mut primitive.positions[primitive.indices[1] as usize][2];
            *coordinate = coordinate.next_up();
            assert_eq!(difference(&scene, &oracle), Some(format!("positions of primitive {at}")));
        }
    }
    assert!(compared > 103, "{compared}");
}
