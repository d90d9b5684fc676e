//! Scenes written as PLY, read again by the importer: the same triangles in the same places.

use brickwalk_convert::import::{ImportSettings, Input, import};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{IDENTITY, Source};
use brickwalk_scenes::{Kind, Scene, Settings, generate, write_ply};
use glam::{DAffine3, DMat3, DVec3};
use std::path::Path;

fn city(seed: u64) -> Scene {
    let settings = Settings { kind: Kind::City, triangles: 100_000, seed, instanced: true, ..Settings::default() };
    generate(&settings, &Progress::hidden()).expect("a count in range")
}

/// All corners in the world, as f32.
fn corners(source: &dyn Source) -> Vec<[f32; 3]> {
    let mut all = Vec::new();
    for p in &source.outline().placements {
        let m = &p.world_from_mesh;
        let column = |c: usize| DVec3::new(m[c], m[4 + c], m[8 + c]);
        let world = DAffine3 { matrix3: DMat3::from_cols(column(0), column(1), column(2)), translation: column(3) };
        for part in 0..source.outline().meshes[p.mesh as usize].parts.len() {
            let part = source.part(p.mesh as usize, part).expect("a part");
            let corner = |&k: &u32| world.transform_point3(DVec3::from_array(part.positions[k as usize]));
            all.extend(part.indices.iter().map(corner).map(|c| c.as_vec3().to_array()));
        }
    }
    all
}

fn written(scene: &Scene, file: &Path) -> Vec<[f32; 3]> {
    write_ply(scene, file, &Progress::hidden()).expect("written");
    let settings = ImportSettings::default();
    let read = import(&[Input::from(file.to_path_buf())], &settings, &Progress::hidden()).expect("imported");
    assert!(read.outline().placements.iter().all(|p| p.world_from_mesh == IDENTITY));
    corners(&read)
}

#[test]
fn triangles_are_read_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = city(0);
    assert!(scene.outline().placements.iter().any(|p| p.world_from_mesh != IDENTITY), "some are placed");
    let (read, own) = (written(&scene, &folder.path().join("a.ply")), corners(&scene));
    assert_eq!(read.len(), own.len());
    let apart = |a: &[[f32; 3]], b: &[[f32; 3]]| {
        let differences = a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| (a - b).abs());
        differences.fold(0.0, f32::max)
    };
    // Both round once, but sum in another order.
    assert!(apart(&read, &own) < 1e-4, "{}", apart(&read, &own));
    // Control: another city.
    assert!(apart(&written(&city(1), &folder.path().join("b.ply")), &own) > 1.0);
    assert_eq!(std::fs::read_dir(folder.path()).expect("the folder").count(), 2, "nothing else is left");
}
