//! Scenes that have what kernels treat apart.

use crate::secondary::displacement;
use crate::secondary::displacement::make::{Making, add_fields};
use crate::session::trace::for_rays;
use crate::session::{Opened, Settings};
use crate::settings::Adapter;
use bricks::SceneFile;
use brickwalk_convert::build::{BuildSettings, build};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{IDENTITY, Mesh, Placement, Primitive, SourceScene, SourceTexture};
use std::sync::Arc;

/// Triangles in all directions with normals, colours and textures of every way to wrap, most of which let rays pass;
/// turned and mirrored copies of them. With `tiled` textures of many tiles, of which each triangle shows a small part.
pub fn textured(tiled: bool) -> Arc<SceneFile> {
    let mut state = 7u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f64 / f64::from(1 << 24)
    };
    let mut primitive = |material: u32, count: u32| {
        // Further textures lie behind materials that have them.
        let place = [0, 1, 3, 5][material as usize];
        let mut part = Primitive { material: place, ..Primitive::default() };
        let (mut normals, mut uvs, mut colors) = (Vec::new(), Vec::new(), Vec::new());
        let (mut uvs1, mut tangents) = (Vec::new(), Vec::new());
        for corner in 0..3 * count {
            let near = if corner % 3 == 0 { 0.0 } else { 1.0 };
            let around = *part.positions.last().filter(|_| near > 0.0).unwrap_or(&[
                8.0 * random(),
                3.0 * random(),
                8.0 * random(),
            ]);
            part.positions.push(around.map(|x: f64| x + near * (random() - 0.5)));
            normals.push([0; 3].map(|_| random() as f32 - 0.5));
            let anywhere = [0; 2].map(|_| 5.0 * random() as f32 - 2.0);
            let beside = uvs.last().filter(|_| tiled && near > 0.0);
            uvs.push(beside.map_or(anywhere, |uv: &[f32; 2]| [0, 1].map(|k| uv[k] + 0.001 * anywhere[k])));
            colors.push([0; 4].map(|_| random() as f32));
            let beside = uvs1.last().filter(|_| tiled && near > 0.0);
            uvs1.push(beside.map_or(anywhere, |uv: &[f32; 2]| [0, 1].map(|k| uv[k] + 0.002 * anywhere[k])));
            let sign = if corner / 3 % 2 == 0 { 1.0 } else { -1.0 };
            tangents.push([random() as f32 - 0.5, random() as f32 - 0.5, random() as f32, sign]);
        }
        part.indices = (0..3 * count).collect();
        (part.normals, part.uvs, part.colors) = (Some(normals), Some(uvs), Some(colors));
        (part.uvs1, part.tangents) = (Some(uvs1), Some(tangents));
        part
    };
    let texture = |i: u32| SourceTexture {
        name: format!("texture {i}"),
        width: if tiled { [700, 257, 500][i as usize] } else { 8 << i },
        height: if tiled { [300, 640, 500][i as usize] } else { 16 >> i },
        wrap: [bricks::WRAP_REPEAT, bricks::WRAP_CLAMP, bricks::WRAP_MIRROR][i as usize] * 0x0001_0001,
        rgba: (0..if tiled { 4 * [210_000, 164_480, 250_000][i as usize] } else { 4 * (8 << i) * (16 >> i) })
            .map(|k: u32| (k * 37 + k / 7 * 11) as u8)
            .collect(),
    };
    let bare = |i: u32| bricks::Material {
        base_color: [0.9, 0.8, 0.7, 1.0 - 0.1 * i as f32],
        emission: [0.25 * i as f32; 3],
        alpha_cutoff: 0.25,
        flags: [0, bricks::MATERIAL_MASK, bricks::MATERIAL_BLEND, bricks::MATERIAL_BLEND | bricks::MATERIAL_REFRACTS]
            [i as usize],
        base_color_texture: if i < 3 { i } else { bricks::NONE },
        // Metal, polished and coated things; one Lambertian.
        metallic: [0.0, 0.8, 0.3, 0.0][i as usize],
        roughness: [1.0, 0.5, 0.9, 0.4][i as usize],
        specular: [0.0, 0.04, 0.08, 0.04].map(|f0: f32| [f0, f0, 0.5 * f0])[i as usize],
        specular_weight: [0.0, 1.0, 0.7, 1.0][i as usize],
        clearcoat: [0.0, 0.0, 0.6, 0.5][i as usize],
        transmission: [0.0, 0.0, 0.0, 0.8][i as usize],
        absorption: if i == 3 { bricks::pack_absorption([0.5, 1.0, 0.25]) } else { 0 },
        clearcoat_roughness: 0.4,
        metallic_roughness_texture: [bricks::NONE, 2, bricks::NONE, 1][i as usize],
        occlusion_texture: [2, bricks::NONE, 0, 1][i as usize],
        emissive_texture: [bricks::NONE, 0, 1, bricks::NONE][i as usize],
        occlusion_strength: 0.7,
        normal_texture: [bricks::NONE, 1, 2, 0][i as usize],
        normal_scale: 0.8,
        // The second set for occlusion, and for the normals of some; base colours, which have maps of opacity, by the
        // first.
        uv_sets: [8, 2, 0, 10][i as usize],
        uv_from_set: {
            let mut rows = bricks::Material::SAME_UV;
            (rows[2], rows[3]) = ([0.8, 0.6, 0.25, 2.0], [-1.2, 1.6, 0.5, 0.0]);
            (rows[6], rows[7]) = ([0.5, 0.0, 0.25, 0.25], [0.0, 0.5, -0.25, 0.0]);
            rows
        },
        ..bricks::Material::DIFFUSE
    };
    // A film on brushed metal, all of them under a coat, and a film on a body that refracts.
    let material = |i: u32| {
        let mut material = bare(i);
        material.set_layers(&bricks::Layers {
            sheen: if i == 2 { [0.8, 0.5, 0.3] } else { [0.0; 3] },
            sheen_roughness: 0.6,
            anisotropy: [0.0, 0.8, 0.5, 0.6][i as usize],
            rotation: 0.15 * i as f32,
            film: [0.0, 0.9, 0.5, 0.7][i as usize],
            film_index: 1.3 + 0.1 * i as f32,
            film_thickness: 200.0 * i as f32,
            film_least: 50.0,
        });
        material.flags |= if i > 0 { bricks::MATERIAL_MORE } else { 0 };
        material
    };
    // Some wait for textures that the material has as well, some for tiles of their own.
    let further = |i: u32| bricks::Material {
        base_color_texture: [bricks::NONE, 2, bricks::NONE, 1][i as usize],
        normal_texture: [bricks::NONE, bricks::NONE, 1, 2][i as usize],
        metallic_roughness_texture: [bricks::NONE, 0, 1, 2][i as usize],
        occlusion_texture: [bricks::NONE, 2, 0, bricks::NONE][i as usize],
        emissive_texture: [bricks::NONE, bricks::NONE, 1, bricks::NONE][i as usize],
        normal_scale: 0.6,
        uv_sets: [0, 4, 2, 8][i as usize],
        ..bricks::Material::further()
    };
    let with_further = |i: u32| [material(i)].into_iter().chain((i > 0).then(|| further(i)));
    let mesh = |name: &str, primitives| Mesh { name: name.into(), primitives };
    let place = |mesh, world_from_mesh| Placement {
        name: "p".into(),
        mesh,
        source: 0,
        world_from_mesh,
        ..Placement::default()
    };
    let source = SourceScene {
        meshes: vec![
            mesh("world", (0..4).map(|i| primitive(i, 150)).collect()),
            mesh("thing", vec![primitive(1, 200)]),
        ],
        placements: vec![
            place(0, IDENTITY),
            place(1, [0.75, 0.0, 1.0, 0.75, 0.0, 1.25, 0.0, 0.5, -1.0, 0.0, 0.75, -0.25]),
            place(1, [-0.5, 0.0, 0.0, -1.0, 0.0, 0.8, 0.1, 0.25, 0.2, 0.0, 0.7, 1.0]),
        ],
        materials: (0..4).flat_map(with_further).collect(),
        textures: (0..3).map(texture).collect(),
        sources: vec![bricks::Source { name: "t".into(), bytes: 0, hash: "2d06800538d394c2".into() }],
        ..SourceScene::default()
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.bricks");
    let settings = BuildSettings { brick_triangles: 40, instance_min_triangles: 1, ..BuildSettings::default() };
    build(source, &settings, &path, &Progress::hidden()).unwrap();
    let scene = SceneFile::from_bytes("the textured scene", std::fs::read(&path).unwrap()).unwrap();
    assert!(scene.resident().manifest.has_textures && scene.resident().instances.len() == 3);
    assert_eq!(scene.resident().opacity_maps.len(), 2);
    assert_eq!(scene.resident().tiles.len() > 50, tiled);
    let has = |encoding| scene.resident().textures.iter().any(|texture| texture.encoding == encoding);
    assert!(has(bricks::TEXTURE_BC5) && has(bricks::TEXTURE_BC7));
    Arc::new(scene)
}

/// A scene with displacement fields of few samples, of so many bits.
pub fn with_fields(scene: Arc<SceneFile>, bits: u32) -> Arc<SceneFile> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("fields.bricks");
    let settings = for_rays(&Settings { adapter: Adapter::Cpu, ..Settings::exact() });
    let mut opened = Opened::open(scene, &path, &settings).unwrap();
    let making = Making { objects: Some(displacement::Shape { rings: 4, directions: 8 }), bricks: true, bits };
    let made = add_fields(&mut opened.bench(), &path, &making, 0, 1 << 30, &mut ()).unwrap();
    assert!(made.fields.iter().sum::<usize>() > 0, "{made:?}");
    Arc::new(SceneFile::from_bytes("fields", std::fs::read(&path).unwrap()).unwrap())
}

/// A hilly plain with copies of a part of it, and levels of detail of all. It glows and reflects.
pub fn with_levels() -> Arc<SceneFile> {
    let hills = |side: u32, size: f64| {
        let mut part = Primitive::default();
        for i in 0..side * side {
            let [x, z] = [i % side, i / side].map(|k| f64::from(k) * size / f64::from(side - 1));
            let bumps = (3.0 * x).sin() * (2.3 * z).cos() + 0.1 * f64::from(i * 37 % 11);
            part.positions.push([x, 0.3 * bumps, z]);
        }
        for i in (0..side * (side - 1)).filter(|i| i % side != side - 1) {
            part.indices.extend([i, i + side, i + 1, i + 1, i + side, i + side + 1]);
        }
        Mesh { name: "hills".into(), primitives: vec![part] }
    };
    let place = |mesh, x: f64, scale: f64| {
        let mut matrix = IDENTITY;
        (matrix[0], matrix[5], matrix[10], matrix[3], matrix[7]) = (scale, scale, scale, x, 2.0);
        Placement { mesh, world_from_mesh: matrix, ..Placement::default() }
    };
    let source = SourceScene {
        meshes: vec![hills(40, 12.0), hills(24, 2.0)],
        placements: vec![place(0, 0.0, 1.0), place(1, 1.0, 1.0), place(1, 5.0, -1.5)],
        sources: vec![bricks::Source { name: "t".into(), bytes: 0, hash: "2d06800538d394c2".into() }],
        materials: vec![bricks::Material {
            base_color: [0.7, 0.6, 0.5, 1.0],
            metallic: 0.8,
            roughness: 0.6,
            emission: [0.3, 0.2, 0.1],
            clearcoat: 0.5,
            clearcoat_roughness: 0.3,
            ..bricks::Material::DIFFUSE
        }],
        ..SourceScene::default()
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("levels.bricks");
    let settings = BuildSettings { brick_triangles: 64, instance_min_triangles: 1, lod: true, ..Default::default() };
    build(source, &settings, &path, &Progress::hidden()).unwrap();
    let mut scene = SceneFile::from_bytes("levels", std::fs::read(&path).unwrap()).unwrap();
    assert!(scene.resident().levels.len() > 10 && scene.resident().instances.len() > 2);
    scene.use_levels();
    Arc::new(scene)
}
