//! Truth of files that the converter writes: every source triangle is there, within half a lattice step, under its id,
//! whatever the size of the bricks.

use crate::reference::*;
use bricks::SceneFile;
use brickwalk_convert::build::{BuildSettings, LatticeStep, build};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{Mesh, Placement, Primitive, SourceScene};

const IDENTITY: [f64; 12] = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];

/// A wavy sheet of 2 n² triangles over 0..size, every vertex shared. The first vertex of a triangle is any corner.
fn sheet(n: u32, size: f64, lift: f64) -> Mesh {
    let point = |i: u32| {
        let (x, z) = (f64::from(i % (n + 1)), f64::from(i / (n + 1)));
        [x * size / f64::from(n), lift + 0.1 * size * (x * 1.7 + z * 0.9).sin(), z * size / f64::from(n)]
    };
    let mut indices = Vec::new();
    for (k, corner) in (0..n * n).map(|i| (i as usize, i / n * (n + 1) + i % n)) {
        let mut pair = [[corner, corner + 1, corner + n + 1], [corner + 1, corner + n + 2, corner + n + 1]];
        pair[0].rotate_left(k % 3);
        pair[1].rotate_left(k / 3 % 3);
        indices.extend(pair.into_iter().flatten());
    }
    let positions = (0..(n + 1) * (n + 1)).map(point).collect();
    let primitive = Primitive { material: 0, positions, indices, ..Primitive::default() };
    Mesh { name: "sheet".into(), primitives: vec![primitive] }
}

/// One sheet baked into the world, another placed three times: turned and scaled, mirrored, and far away.
fn source() -> SourceScene {
    let place = |mesh, matrix: [f64; 12]| Placement { mesh, world_from_mesh: matrix, ..Placement::default() };
    let material =
        bricks::Material { base_color: [1.0; 4], base_color_texture: bricks::NONE, ..bricks::Material::DIFFUSE };
    SourceScene {
        meshes: vec![sheet(9, 7.0, 0.0), sheet(6, 2.0, 1.5)],
        placements: vec![
            place(1, [0.6, 0.0, 0.8, 1.0, 0.0, 1.5, 0.0, 0.5, -0.8, 0.0, 0.6, 2.0]),
            place(0, IDENTITY),
            place(1, [1.0, 0.0, 0.0, 3.0, 0.0, 1.0, 0.0, 0.25, 0.0, 0.0, -1.0, 4.0]),
            place(1, [1.0, 0.25, 0.0, 1000.0, 0.0, 2.0, 0.0, -300.0, 0.5, 0.0, 1.0, 20.0]),
        ],
        materials: vec![material],
        sources: vec![bricks::Source { name: "sheets".into(), bytes: 0, hash: "2d06800538d394c2".into() }],
        ..SourceScene::default()
    }
}

/// The source's triangles in world space in the order of their ids.
fn source_triangles(scene: &SourceScene) -> Vec<[[f64; 3]; 3]> {
    let mut triangles = Vec::new();
    for placement in &scene.placements {
        let m = placement.world_from_mesh;
        let world =
            |p: [f64; 3]| std::array::from_fn(|k| (0..3).map(|j| m[4 * k + j] * p[j]).sum::<f64>() + m[4 * k + 3]);
        for primitive in &scene.meshes[placement.mesh as usize].primitives {
            let corners = primitive.indices.chunks_exact(3);
            triangles.extend(corners.map(|i| [0, 1, 2].map(|k| world(primitive.positions[i[k] as usize]))));
        }
    }
    triangles
}

/// Converts the scene; small meshes become objects too.
fn convert(brick_triangles: u32) -> (tempfile::TempDir, SceneFile) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.bricks");
    let settings = BuildSettings {
        brick_triangles,
        threads: Some(1),
        lattice: Some(LatticeStep::Log2(-16)),
        instance_min_triangles: 1,
        ..BuildSettings::default()
    };
    build(source(), &settings, &path, &Progress::hidden()).unwrap();
    let file = SceneFile::open(path).unwrap();
    (folder, file)
}

#[test]
fn every_source_triangle_is_there() {
    let scene = source();
    let expected = source_triangles(&scene);
    let (_folder, file) = convert(16);
    assert!(file.resident().instances.len() == 4 && file.resident().bricks.len() > 8, "instances and several bricks");
    let truth = Truth::load(&file).unwrap();
    assert!(truth.ids().eq(0..expected.len() as u32), "every id once");
    // Half a step of 2^-16 an axis, in object space; the matrices here stretch by less than 4.
    let close = |a: [f64; 3], b: [f64; 3]| (0..3).all(|k| (a[k] - b[k]).abs() <= 4.0 * 0.5 / 65_536.0);
    let is = |id: u32, triangle: &[[f64; 3]; 3]| {
        let index = truth.find(id).unwrap();
        let stored = truth.world_vertices(index);
        let rotation = truth.stored(index).2.rotation as usize;
        (0..3).all(|i| close(stored[i], triangle[(i + rotation) % 3]))
    };
    for (id, triangle) in (0u32..).zip(&expected) {
        assert!(is(id, triangle), "triangle {id} is not the source's");
    }
    assert!(!is(1, &expected[0]), "control: a neighbour is told apart");
    // Rays at a point of known weights give the source's weights back.
    for (id, [a, b, c]) in (0u32..).zip(&expected) {
        let aim: [f64; 3] = std::array::from_fn(|k| 0.5 * a[k] + 0.3 * b[k] + 0.2 * c[k]);
        let (e, f): ([f64; 3], [f64; 3]) = (std::array::from_fn(|k| b[k] - a[k]), std::array::from_fn(|k| c[k] - a[k]));
        let n = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]];
        let ray = TruthRay::new(std::array::from_fn(|k| aim[k] + 1e-3 * n[k]), n.map(|x| -x), 0.0, 2e-3);
        let hit = truth.closest(&ray).unwrap();
        assert!(hit.id == id && (hit.u - 0.3).abs() < 1e-3 && (hit.v - 0.2).abs() < 1e-3, "{id}: {hit:?}");
    }
}

#[test]
fn bricks_do_not_show() {
    let ((_first, small), (_second, large)) = (convert(5), convert(4096));
    assert!(small.resident().bricks.len() > large.resident().bricks.len());
    let (small, large) = (Truth::load(&small).unwrap(), Truth::load(&large).unwrap());
    assert_eq!(small.objects, large.objects);
    assert_eq!(small.instances, large.instances);
}

#[test]
fn damaged_files_are_errors() {
    let (folder, file) = convert(64);
    let path = folder.path().join("scene.bricks");
    let mut bytes = std::fs::read(&path).unwrap();
    let span = file.span(bricks::Payload::Geometry(0));
    bytes[span.offset as usize + 99] ^= 4;
    let damaged = folder.path().join("damaged.bricks");
    std::fs::write(&damaged, bytes).unwrap();
    let Err(error) = Truth::load(&SceneFile::open(&damaged).unwrap()) else { panic!("the damage was not seen") };
    assert!(matches!(error, DecodeError::File(_)) && error.to_string().contains("brick 0"), "{error}");
}
