//! The scene files of BRICKWALK_SCENES.

use super::writer::import_one;
use crate::skip::shared_scenes;
use brickwalk_convert::source::SourceScene;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// All glTF files in and below `folder`, sorted.
pub fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display())) {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files(&path));
        } else if path.extension().is_some_and(|e| e == "gltf" || e == "glb") {
            found.push(path);
        }
    }
    found.sort();
    found
}

fn scene_of(path: &Path) -> SourceScene {
    import_one(path).unwrap_or_else(|e| panic!("{e}"))
}

/// Triangles with every placement multiplied out.
fn triangles(scene: &SourceScene) -> u64 {
    scene.placements.iter().map(|p| scene.meshes[p.mesh as usize].triangle_count()).sum()
}

#[test]
fn sponza() {
    let Some(folder) = shared_scenes() else { return };
    let scene = scene_of(&folder.join("sponza/Sponza.gltf"));
    assert_eq!(triangles(&scene), 262_267);
    assert_eq!(scene.meshes.iter().map(|m| m.primitives.len()).sum::<usize>(), 103);
    assert_eq!(scene.materials.len(), 25);
    assert!(scene.materials.iter().all(|m| m.base_color_texture != bricks::NONE), "{:?}", scene.warnings);
    assert_eq!(scene.materials.iter().filter(|m| m.flags & bricks::MATERIAL_MASK != 0).count(), 3);
    assert!(scene.textures.iter().all(|t| t.rgba.len() as u64 == 4 * t.width as u64 * t.height as u64));
    for primitive in scene.meshes.iter().flat_map(|m| &m.primitives) {
        assert!(primitive.normals.is_some() && primitive.uvs.is_some());
    }
    println!("{:?}", scene.warnings);
}

#[test]
fn asset_generator() {
    let Some(folder) = shared_scenes() else { return };
    let mut total = 0;
    let mut files = files(&folder.join("stress/asset-generator"));
    // Two that a reader of glTF 2.0 must refuse.
    let refused =
        files.extract_if(.., |f| f.ends_with("Compatibility_04.gltf") || f.ends_with("Compatibility_05.gltf"));
    let refused: Vec<_> = refused.collect();
    assert_eq!((files.len(), refused.len()), (45, 2));
    for path in &refused {
        let error = import_one(path).expect_err("it must be refused").to_string();
        assert!(error.contains("2.1") || error.contains("FAKE_materials_quantumRendering"), "{error}");
    }
    for path in &files {
        let scene = scene_of(path);
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        let expected = match name.rsplit_once('_').unwrap() {
            ("Mesh_PrimitiveMode", "00" | "01" | "02" | "03" | "07" | "08" | "09" | "10") => 0,
            ("Mesh_PrimitiveMode" | "Mesh_PrimitiveVertexColor" | "Mesh_Primitives" | "Buffer_Interleaved", _) => 2,
            ("Compatibility", _) => 2,
            ("Node_NegativeScale", _) => 54,
            other => panic!("{other:?}"),
        };
        assert_eq!(triangles(&scene), expected, "{name}: {:?}", scene.warnings);
        total += triangles(&scene);
        if name.starts_with("Mesh_PrimitiveVertexColor") {
            assert!(scene.meshes[0].primitives[0].colors.is_some());
        }
    }
    assert_eq!(total, 750);
}

/// A mirrored node: the determinant's sign is that of the product of its scales.
#[test]
fn negative_scales() {
    let Some(folder) = shared_scenes() else { return };
    let folder = folder.join("stress/asset-generator/Node_NegativeScale");
    for (file, mirrored) in
        [("00", false), ("01", true), ("02", false), ("03", true), ("04", true), ("05", false), ("06", true)]
    {
        let scene = scene_of(&folder.join(format!("Node_NegativeScale_{file}.gltf")));
        let m = scene.placements.last().unwrap().world_from_mesh;
        let determinant = m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8])
            + m[2] * (m[4] * m[9] - m[5] * m[8]);
        assert_eq!(determinant < 0.0, mirrored, "{file}: {m:?}");
    }
}

#[test]
fn stress_files() {
    let Some(folder) = shared_scenes() else { return };
    let counts = [
        ("stress/TriangleWithoutIndices/glTF-Embedded/TriangleWithoutIndices.gltf", 1),
        ("stress/TriangleWithPaddingInGlbBin/TriangleWithPaddingInGlbBin.glb", 1),
        ("stress/SimpleSparseAccessor/glTF/SimpleSparseAccessor.gltf", 12),
        ("stress/BoxTexturedWebp/BoxTexturedWebp.gltf", 12),
        ("stress/CesiumBalloon/CesiumBalloonKTX2.glb", 13_224),
    ];
    for (file, expected) in counts {
        let scene = scene_of(&folder.join(file));
        assert_eq!(triangles(&scene), expected, "{file}: {:?}", scene.warnings);
    }
    let modes = scene_of(&folder.join("stress/MeshPrimitiveModes/MeshPrimitiveModes.gltf"));
    assert_eq!(triangles(&modes), 16);
    assert_eq!(modes.warnings.len(), 1, "{:?}", modes.warnings);
    let teapots = files(&folder.join("teapots_instanced"));
    let scene = scene_of(&teapots[0]);
    assert_eq!(triangles(&scene), 7_656_770, "{:?}", scene.warnings);
    for (file, expected) in [
        ("stress/bunny_meshopt.glb", 144_046),
        ("stress/DracoCompressed/CesiumMilkTruck.gltf", 2_856 + 768),
        ("sponza_draco/sponza_cd.glb", 262_267),
    ] {
        let scene = scene_of(&folder.join(file));
        println!("{file}: {:?}", scene.warnings);
        assert_eq!(triangles(&scene), expected, "{file}");
    }
}

#[test]
fn bad_files_do_no_harm() {
    let Some(folder) = shared_scenes() else { return };
    let (mut imported, mut refused) = (0, 0);
    for path in files(&folder.join("bad")) {
        let start = Instant::now();
        let name = path.strip_prefix(&folder).unwrap().display();
        match import_one(&path) {
            Ok(scene) => {
                imported += 1;
                println!("{name}: {} triangles; {:?}", triangles(&scene), scene.warnings);
            }
            Err(e) => {
                refused += 1;
                let text = e.to_string();
                assert!(!text.contains('\n') && text.starts_with(&*path.to_string_lossy()), "{text}");
                println!("{name}: {}", &text[path.to_string_lossy().len()..]);
            }
        }
        assert!(start.elapsed() < Duration::from_secs(10), "{name} took {:?}", start.elapsed());
    }
    println!("{imported} imported, {refused} refused");
    assert!(refused > 50, "a good part of the files is bad beyond doubt");
}
