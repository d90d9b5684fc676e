//! Meshes ten thousand kilometres from the origin keep their millimetres, whatever file they come from.

use crate::common::{folder, succeed};
use brickwalk::reference::Truth;
use brickwalk::session::open_scene;
use std::fmt::Write;
use std::path::Path;

/// Where the mesh lies.
const BASE: [f64; 3] = [10_000_000.123, 512.25, -9_999_999.376];

/// Squares along a side of the mesh.
const SIDE: usize = 16;

/// Local positions in metres: a sheet whose heights differ by whole millimetres. They are sums of f32 values as they
/// stand.
fn local() -> Vec<[f32; 3]> {
    let point = |at: usize| {
        let (i, j) = (at % (SIDE + 1), at / (SIDE + 1));
        [0.0625 * i as f32, 0.001 * ((i * 7 + j * 3) % 10) as f32, 0.0625 * j as f32]
    };
    (0..(SIDE + 1) * (SIDE + 1)).map(point).collect()
}

fn triangles() -> Vec<[usize; 3]> {
    let corner = |i: usize, j: usize| j * (SIDE + 1) + i;
    let square = |at: usize| {
        let (i, j) = (at % SIDE, at / SIDE);
        let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i, j + 1), corner(i + 1, j + 1)];
        [[a, c, b], [b, c, d]]
    };
    (0..SIDE * SIDE).flat_map(square).collect()
}

/// The truth: local position and base, added in f64.
fn world() -> Vec<[f64; 3]> {
    local().into_iter().map(|p| std::array::from_fn(|k| BASE[k] + f64::from(p[k]))).collect()
}

/// The mesh as glTF, its node moved by `translation`.
fn gltf(path: &Path, translation: [f64; 3]) {
    let positions = local();
    let bytes: Vec<u8> = positions.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
    let indices: Vec<u8> = triangles().iter().flatten().flat_map(|&i| (i as u32).to_le_bytes()).collect();
    let json = serde_json::json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "translation": translation}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": positions.len()},
            {"bufferView": 1, "componentType": 5125, "type": "SCALAR", "count": indices.len() / 4}
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": bytes.len()},
            {"buffer": 0, "byteOffset": bytes.len(), "byteLength": indices.len()}
        ],
        "buffers": [{"byteLength": bytes.len() + indices.len(), "uri": "sheet.bin"}]
    });
    std::fs::write(path.with_file_name("sheet.bin"), [bytes, indices].concat()).expect("a buffer");
    std::fs::write(path, json.to_string()).expect("a file");
}

fn obj(path: &Path) {
    let mut text = String::new();
    // As many digits as f64 has.
    world().iter().for_each(|[x, y, z]| writeln!(text, "v {x} {y} {z}").expect("text"));
    triangles().iter().for_each(|[a, b, c]| writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1).expect("text"));
    std::fs::write(path, text).expect("a file");
}

fn ply(path: &Path, is_binary: bool) {
    let (points, faces) = (world(), triangles());
    let encoding = if is_binary { "binary_little_endian" } else { "ascii" };
    let mut bytes = format!(
        "ply\nformat {encoding} 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        points.len(),
        faces.len()
    )
    .into_bytes();
    for [x, y, z] in &points {
        match is_binary {
            true => [x, y, z].iter().for_each(|x| bytes.extend(x.to_le_bytes())),
            false => bytes.extend(format!("{x} {y} {z}\n").bytes()),
        }
    }
    for face in &faces {
        match is_binary {
            true => {
                bytes.push(3);
                face.iter().for_each(|&i| bytes.extend((i as i32).to_le_bytes()));
            }
            false => bytes.extend(format!("3 {} {} {}\n", face[0], face[1], face[2]).bytes()),
        }
    }
    std::fs::write(path, bytes).expect("a file");
}

/// The largest distance on an axis between the stored vertices and `truth`, the vertices of all triangles.
fn error(stored: &Truth, truth: &[[f64; 3]]) -> f64 {
    let mut worst = 0.0f64;
    for (id, triangle) in (0u32..).zip(triangles()) {
        let found = stored.vertices(id).expect("a triangle");
        // Stored vertices may begin with another one of the three.
        let distance = |turn: usize| {
            let pairs = (0..3).flat_map(|k| (0..3).map(move |axis| (k, axis)));
            pairs.map(|(k, axis)| (found[k][axis] - truth[triangle[(k + turn) % 3]][axis]).abs()).fold(0.0, f64::max)
        };
        worst = worst.max((0..3).map(distance).fold(f64::INFINITY, f64::min));
    }
    worst
}

/// Distances along `count` rays straight down onto vertices from a metre above the base, by `trace`.
fn traced(scene: &Path, folder: &Path, targets: &[[f64; 3]]) -> Vec<f64> {
    let shape = format!("({}, 8)", targets.len());
    let mut header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}");
    header.push_str(&" ".repeat((64 - (header.len() + 11) % 64) % 64));
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.bytes());
    for [x, _, z] in targets {
        let row = [*x, BASE[1] + 1.0, *z, 0.0, -1.0, 0.0, 0.0, f64::INFINITY];
        row.iter().for_each(|x| bytes.extend(x.to_le_bytes()));
    }
    let (rays, hits) = (folder.join("rays.npy"), folder.join("hits.npy"));
    std::fs::write(&rays, bytes).expect("rays");
    let words = ["trace", "--cache", "100%", "--rays"].map(std::ffi::OsStr::new);
    succeed(words.into_iter().chain([rays.as_os_str(), "-o".as_ref(), hits.as_os_str(), scene.as_os_str()]));
    let bytes = std::fs::read(&hits).expect("hits");
    let start = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let rows = bytes[start..].chunks_exact((bytes.len() - start) / targets.len());
    rows.map(|row| f64::from_le_bytes(row[..8].try_into().expect("t"))).collect()
}

#[test]
fn far_meshes_keep_their_millimetres() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    gltf(&at("near.gltf"), [0.0; 3]);
    let move_there = format!("translate {} {} {}", BASE[0], BASE[1], BASE[2]);
    gltf(&at("far.gltf"), BASE);
    obj(&at("far.obj"));
    ply(&at("text.ply"), false);
    ply(&at("binary.ply"), true);
    let truth = world();
    let in_f32: Vec<_> = truth.iter().map(|p| p.map(|x| f64::from(x as f32))).collect();
    let inputs = [
        ("far.gltf", None),
        ("near.gltf", Some(&move_there)),
        ("far.obj", None),
        ("text.ply", None),
        ("binary.ply", None),
    ];
    for (input, transform) in inputs {
        let scene = at("scene.bricks");
        let mut words = vec!["convert".into(), at(input).into_os_string(), "-o".into(), scene.clone().into_os_string()];
        words.extend(transform.into_iter().flat_map(|transform| ["--transform".into(), transform.into()]));
        succeed(words);
        let file = open_scene(&scene).expect("the scene");
        let step = f64::from(file.resident().objects[0].step_log2).exp2();
        assert!(step <= 1e-4, "{input}: a lattice finer than a tenth of a millimetre, not {step}");
        let stored = Truth::load(&file).expect("truth");
        // Half a step, and the rounding of f64 at 1e7: a sum and a number read from text, 2^-30 at most each.
        let bound = 0.5 * step + 2.0f64.powi(-29);
        let worst = error(&stored, &truth);
        assert!(worst <= bound, "{input}: {worst:e} from the truth, more than {bound:e}");
        // Negative control: coordinates that went through f32 are off by up to half a metre.
        assert!(error(&stored, &in_f32) > 0.1, "{input}");

        // A ray onto each vertex of some tells its millimetres. Inner ones, so that none passes by.
        let inner = (1..SIDE).map(|i| truth[5 * (SIDE + 1) + i]);
        let inner: Vec<_> = inner.collect();
        let found = traced(&scene, folder.path(), &inner);
        for (t, [_, y, _]) in found.iter().zip(&inner) {
            let expected = BASE[1] + 1.0 - y;
            // Beside the lattice: the ray is moved by as much sideways, where the sheet rises by 9 mm in 62 at most;
            // f32 rounds distances of a few metres.
            assert!((t - expected).abs() < 2.0 * step + 1e-6, "{input}: {t}, not {expected}");
        }
        let distinct = found.windows(2).filter(|pair| (pair[0] - pair[1]).abs() > 9e-4).count();
        assert!(distinct >= SIDE - 3, "{input}: neighbours differ by millimetres: {found:?}");
    }
}
