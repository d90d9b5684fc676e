//! Scenes written as glTF, read again by the importer: the same meshes, triangles, materials and places.

use brickwalk_convert::import::{ImportSettings, Input, import};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{IDENTITY, Primitive, Source};
use brickwalk_scenes::{GltfForm, Kind, Scene, Settings, generate, write_gltf};
use glam::{DAffine3, DMat3, DVec3};
use std::path::Path;

fn scene(kind: Kind, triangles: u64, seed: u64, instanced: bool) -> Scene {
    generate(&Settings { kind, triangles, seed, instanced, ..Settings::default() }, &Progress::hidden())
        .expect("a count in range")
}

fn written(scene: &Scene, file: &Path) -> impl Source + use<> {
    write_gltf(scene, file, GltfForm::of(file).expect("a form of glTF"), &Progress::hidden()).expect("written");
    import(&[Input::from(file.to_path_buf())], &ImportSettings::default(), &Progress::hidden()).expect("imported")
}

fn affine(m: &[f64; 12]) -> DAffine3 {
    let column = |c: usize| DVec3::new(m[c], m[4 + c], m[8 + c]);
    DAffine3 { matrix3: DMat3::from_cols(column(0), column(1), column(2)), translation: column(3) }
}

/// Position in world space, normal, colour and material.
type Corner = (DVec3, Option<[f32; 3]>, Option<[f32; 4]>, u32);

/// Adds corners in the order of triangle ids.
fn corners(part: &Primitive, world: &DAffine3, out: &mut Vec<Corner>) {
    let normal = |k: usize| part.normals.as_ref().map(|all| all[k]);
    let color = |k: usize| part.colors.as_ref().map(|all| all[k]);
    out.extend(
        part.indices.iter().map(|&k| k as usize).map(|k| {
            (world.transform_point3(DVec3::from_array(part.positions[k])), normal(k), color(k), part.material)
        }),
    );
}

/// What differs between two scenes, `None`: nothing.
fn difference(a: &dyn Source, b: &dyn Source) -> Option<String> {
    let (of_a, of_b) = (a.outline(), b.outline());
    if of_a.materials[..] != of_b.materials[..of_a.materials.len().min(of_b.materials.len())] {
        return Some("materials".into());
    }
    if of_a.placements.len() != of_b.placements.len() {
        return Some("placements".into());
    }
    for (p, q) in of_a.placements.iter().zip(&of_b.placements) {
        let (m, n) = (p.mesh as usize, q.mesh as usize);
        if p.name != q.name || of_a.meshes[m] != of_b.meshes[n] {
            return Some(format!("{} or its parts", p.name));
        }
        let (mut all, mut others) = (Vec::new(), Vec::new());
        for part in 0..of_a.meshes[m].parts.len() {
            corners(&a.part(m, part).expect("a part"), &affine(&p.world_from_mesh), &mut all);
            corners(&b.part(n, part).expect("a part"), &affine(&q.world_from_mesh), &mut others);
        }
        let low = all.iter().fold(DVec3::INFINITY, |low, c| low.min(c.0));
        let high = all.iter().fold(DVec3::NEG_INFINITY, |high, c| high.max(c.0));
        // A coordinate relative to the anchor is at most the extent and half a unit, and is rounded by 2^-24 of it;
        // turning and scaling (by less than 2) mix three of them. f64 adds nothing of this size.
        let tolerance = 2.0 * 3.0 * ((high - low).max_element() + 0.5) * (0.5f64).powi(24);
        for (k, (c, d)) in all.iter().zip(&others).enumerate() {
            if (c.1, c.2, c.3) != (d.1, d.2, d.3) {
                return Some(format!("{}: normal, colour or material of triangle {}", p.name, k / 3));
            }
            if (c.0 - d.0).abs().max_element() > tolerance {
                return Some(format!("{}: triangle {} is {} off", p.name, k / 3, (c.0 - d.0).length()));
            }
        }
    }
    None
}

#[test]
fn what_is_written_is_read_again() {
    let folder = tempfile::tempdir().expect("a folder");
    for (k, (kind, triangles, instanced)) in [
        (Kind::City, 100_000, false),
        (Kind::City, 100_000, true),
        (Kind::Pipes, 20_000, false),
        (Kind::Terrain, 60_000, false),
    ]
    .into_iter()
    .enumerate()
    {
        let scene = scene(kind, triangles, 4, instanced);
        for extension in ["glb", "gltf"] {
            // A name that a URI cannot hold as it is.
            let read = written(&scene, &folder.path().join(format!("a b%20 {k}.{extension}")));
            assert_eq!(difference(&scene, &read), None, "{kind} {extension}");
            assert_eq!(read.outline().warnings, Vec::<String>::new());
            let moved = read.outline().placements.iter().filter(|p| p.world_from_mesh != IDENTITY).count();
            assert!(moved > 0, "anchors are the middles of meshes, not the origin");
        }
    }
}

#[test]
fn other_scenes_differ() {
    let folder = tempfile::tempdir().expect("a folder");
    let read = written(&scene(Kind::City, 100_000, 4, false), &folder.path().join("a.glb"));
    assert!(difference(&scene(Kind::City, 100_000, 5, false), &read).is_some());
    assert!(difference(&scene(Kind::City, 100_000, 4, true), &read).is_some());
    assert!(difference(&scene(Kind::City, 90_000, 4, false), &read).is_some());
}
