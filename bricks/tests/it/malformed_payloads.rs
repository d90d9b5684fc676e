//! Payloads that break a rule of the format are refused even where every checksum is right.

use crate::common::{self, Image, scene, written};
use bricks::*;
use std::fs;
use std::mem::offset_of;

/// A payload whose checksum is right is refused when copied.
#[track_caller]
fn payload_refused(payload: Payload, found: &str, spoil: impl FnOnce(&mut [u8])) {
    let (_folder, path, mut scene) = written();
    if let Payload::Attributes(_) = payload {
        spoil(scene.payloads.get_mut(&payload).unwrap());
        scene.write(&path);
    } else {
        let mut image = Image::read(&path);
        image.edit_payload(payload, spoil);
        fs::write(&path, &image.bytes).unwrap();
    }
    let file = SceneFile::open(&path).unwrap();
    for (other, expected) in &scene.payloads {
        let mut out = vec![0; expected.len()];
        let result = file.copy(*other, &mut out);
        assert_eq!(result.is_err(), *other == payload, "{other}: {result:?}");
        if let Err(error) = result {
            assert!(matches!(error, Error::Invalid { .. }), "{error}");
            assert!(error.to_string().contains(&format!("{payload} is not valid")), "{error}");
            assert!(error.to_string().contains(found), "{error} does not say {found}");
            assert_eq!(common::problems(&path), format!("{error}\n"));
        }
    }
}

fn put<const N: usize>(bytes: &mut [u8], at: u64, value: [u8; N]) {
    bytes[at as usize..at as usize + N].copy_from_slice(&value);
}

#[test]
fn geometry() {
    let scene = scene();
    let bricks = &scene.resident.bricks;
    let [near, wide] = [0, 1].map(|brick| GeometryLayout::of(&bricks[brick]));
    let node = |index: u64, field: usize| index * 80 + field as u64;
    let (base, meta) = (offset_of!(Node, triangle_base), offset_of!(Node, meta));

    payload_refused(Payload::Geometry(0), "node 1 with triangles up to 28", |b| put(b, node(1, base), [4, 0, 0, 0]));
    payload_refused(Payload::Geometry(0), "node 1 with triangles up to", |b| put(b, node(1, base), [255; 4]));
    payload_refused(Payload::Geometry(0), "node 1 with children", |b| put(b, node(1, meta), [0xa0]));
    payload_refused(Payload::Geometry(0), "node 1 with children", |b| put(b, node(1, meta), [0x40]));
    payload_refused(Payload::Geometry(0), "node 1 with children", |b| put(b, node(1, meta), [0x38]));
    payload_refused(Payload::Geometry(0), "node 1 with 1 inner children from 0", |b| {
        put(b, node(1, meta), [0x38]);
        put(b, node(1, offset_of!(Node, inner_mask)), [1]);
    });
    payload_refused(Payload::Geometry(0), "node 1 without a parent", |b| {
        put(b, node(0, meta), [0]);
        put(b, node(0, offset_of!(Node, inner_mask)), [0]);
    });
    payload_refused(Payload::Geometry(0), "triangle id 52", |b| put(b, near.ids + 8, 52u32.to_le_bytes()));
    payload_refused(Payload::Geometry(1), "triangle id 4294967295", |b| put(b, wide.ids + 16, [255; 4]));
    let vertices = bricks[0].vertex_count;
    payload_refused(Payload::Geometry(0), &format!("index {vertices} of a vertex"), |b| {
        put(b, near.indices + 2 * 80, (vertices as u16).to_le_bytes());
    });
    payload_refused(Payload::Geometry(0), "index 65535 of a vertex", |b| put(b, near.indices, [255; 2]));
    payload_refused(Payload::Geometry(1), "index 15 of a vertex", |b| put(b, wide.indices + 4 * 14, [15, 0, 0, 0]));
    payload_refused(Payload::Geometry(1), "index 4294967295 of a vertex", |b| put(b, wide.indices, [255; 4]));
    for (payload, at) in [
        (Payload::Geometry(0), near.ids - 1),
        (Payload::Geometry(0), near.indices - 1),
        (Payload::Geometry(0), near.bytes - 1),
        (Payload::Geometry(1), wide.bytes - 4),
    ] {
        payload_refused(payload, &format!("0x01 at its byte {at}"), |b| put(b, at, [1]));
    }
}

/// Boxes and vertices are finite before anything is made of them, whatever made the checksums right.
#[test]
fn what_is_not_finite() {
    let scene = scene();
    let [near, wide] = [0, 1].map(|brick| GeometryLayout::of(&scene.resident.bricks[brick]));
    for value in [f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, -f32::MAX] {
        for (brick, at) in [
            (0, near.vertices),
            (0, near.vertices + 12 * u64::from(scene.resident.bricks[0].vertex_count) - 4),
            (1, wide.vertices + 24),
            (1, wide.vertices + 36),
        ] {
            payload_refused(Payload::Geometry(brick), "a vertex at", |b| put(b, at, value.to_le_bytes()));
        }
    }
    let reach = |steps: i64| {
        steps as f32 * 2f32.powi(scene.resident.objects[0].step_log2 - scene.resident.objects[0].unit_log2)
    };
    for (brick, at, steps) in [(0, near.vertices, NEAR_STEPS), (1, wide.vertices, WIDE_STEPS)] {
        let beyond = reach(steps).next_up().to_le_bytes();
        payload_refused(Payload::Geometry(brick), "a vertex at", |b| put(b, at, beyond));
    }
    for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for axis in 0..3 {
            let finite = "node 1 with a box that is not finite";
            payload_refused(Payload::Geometry(0), finite, |b| put(b, 80 + 4 * axis, value.to_le_bytes()));
        }
    }
    for exponent in [0, 255] {
        let at = 80 + offset_of!(Node, exponent) as u64 + 2;
        payload_refused(Payload::Geometry(0), "exponents from 1 to 254", |b| put(b, at, [exponent]));
    }
}

#[test]
fn a_root_that_differs() {
    let (_folder, path, _) = written();
    let mut image = Image::read(&path);
    image.edit::<Brick>(Section::Bricks, 0, |brick| brick.root.hi[0][1] ^= 1);
    fs::write(&path, &image.bytes).unwrap();
    let file = SceneFile::open(&path).unwrap();
    let error =
        file.copy(Payload::Geometry(0), &mut vec![0; file.span(Payload::Geometry(0)).bytes as usize]).unwrap_err();
    assert!(error.to_string().contains("the brick's root"), "{error}");
}

#[test]
fn attributes() {
    let scene = scene();
    let [near, wide] = [0, 1].map(|brick| AttributeLayout::of(&scene.resident.bricks[brick]));
    let surface = |rotation: u32, material: u32| (rotation << SURFACE_ROTATION_SHIFT | material).to_le_bytes();
    payload_refused(Payload::Attributes(0), "material 2", |b| put(b, near.surfaces + 4 * 26, surface(0, 2)));
    payload_refused(Payload::Attributes(0), "material 1073741823", |b| {
        put(b, near.surfaces, surface(1, SURFACE_MATERIAL))
    });
    payload_refused(Payload::Attributes(1), "rotation 3", |b| put(b, wide.surfaces, surface(3, 0)));
    payload_refused(Payload::Attributes(0), "index 81 of a vertex", |b| put(b, near.indices + 2 * 80, [81, 0]));
    payload_refused(Payload::Attributes(1), "index 15 of a vertex", |b| put(b, wide.indices, [15, 0, 0, 0]));
    payload_refused(Payload::Attributes(1), "index 4294967295 of a vertex", |b| put(b, wide.indices + 56, [255; 4]));
    payload_refused(Payload::Opacity(0), "0x01 at its byte 15", |b| put(b, 15, [1]));
    let opacity = GeometryLayout::of(&common::scene().resident.bricks[2]);
    let (of, opacities) = (opacity.opacity_of, opacity.opacities);
    for (at, value, what) in [
        (of, 5u32, "number 5"),
        (of + 40, 1, "0x01 at its byte"),
        (opacities, f32::NAN.to_bits(), "NaN"),
        (opacities + 24, 2, "material: 2"),
        (opacities + 28, 1 << 24, "alphas: 16777216"),
    ] {
        payload_refused(Payload::Geometry(2), what, |b| put(b, at, value.to_le_bytes()));
    }
}

/// Attributes that cannot be decoded, in a file whose checksums are right.
#[test]
fn encoded_attributes() {
    let (_folder, path, scene) = written();
    let whole = fs::read(&path).unwrap();
    let payload = Payload::Attributes(0);
    let refused = |spoil: &dyn Fn(&mut [u8]), found: &str| {
        let mut image = Image { bytes: whole.clone() };
        image.edit_payload(payload, |bytes| {
            // There is padding to spoil.
            assert!(u32::from_le_bytes(bytes[..4].try_into().unwrap()) as usize + 4 < bytes.len());
            spoil(bytes);
        });
        fs::write(&path, &image.bytes).unwrap();
        let file = SceneFile::open(&path).unwrap();
        let error = file.copy(payload, &mut vec![0; scene.payloads[&payload].len()]).unwrap_err();
        assert!(matches!(error, Error::Invalid { .. }) && error.to_string().contains(found), "{error}");
        assert_eq!(common::problems(&path), format!("{error}\n"));
        file.copy_stored(payload, &mut vec![0; file.span(payload).bytes as usize]).unwrap();
    };
    refused(&|bytes| bytes[..4].fill(255), "a block of 4294967295 bytes");
    refused(&|bytes| bytes[0] ^= 16, "packed bytes");
    refused(&|bytes| *bytes.last_mut().unwrap() = 1, "0x01 after the block");
    refused(&|bytes| bytes[4] = 0, "an LZ4 block");
}

/// Contents that no index depends on: copied, but found by verifying.
#[track_caller]
fn contents_refused(payload: Payload, found: &str, spoil: impl FnOnce(&mut [u8])) {
    let (_folder, path, _) = written();
    let mut image = Image::read(&path);
    image.edit_payload(payload, spoil);
    fs::write(&path, &image.bytes).unwrap();
    let file = SceneFile::open(&path).unwrap();
    file.copy(payload, &mut vec![0; file.span(payload).bytes as usize]).unwrap();
    let problems = common::problems(&path);
    assert!(problems.contains(found) && problems.contains(&payload.to_string()), "{problems} does not say {found}");
    assert_eq!(problems.lines().count(), 1, "{problems}");
}

#[test]
fn contents() {
    let scene = scene();
    let [near, wide] = [0, 1].map(|brick| GeometryLayout::of(&scene.resident.bricks[brick]));
    let triangle_base = 80 + offset_of!(Node, triangle_base) as u64;
    contents_refused(Payload::Geometry(0), "triangle 24 in two leaves", |b| put(b, triangle_base, [3, 0, 0, 0]));
    contents_refused(Payload::Geometry(0), "triangle 0 in no leaf", |b| {
        put(b, 80 + offset_of!(Node, meta) as u64, [0x61])
    });
    contents_refused(Payload::Geometry(0), "bounds of child 0", |b| {
        put(b, 80 + offset_of!(Node, lo) as u64, [255]);
        put(b, 80 + offset_of!(Node, hi) as u64, [254]);
    });
    let step = scene.resident.objects[0].step_log2 - scene.resident.objects[0].unit_log2;
    // Beside the lattice; beyond the bounds, or what the low part of a wide vertex holds.
    for value in [2f32.powi(step) * 0.5, 2f32.powi(step) * 5e6] {
        contents_refused(Payload::Geometry(0), "vertex 1 at", |b| put(b, near.vertices + 12, value.to_le_bytes()));
        contents_refused(Payload::Geometry(1), "vertex 1 at", |b| put(b, wide.vertices + 24, value.to_le_bytes()));
        contents_refused(Payload::Geometry(1), "vertex 1 at", |b| put(b, wide.vertices + 36, value.to_le_bytes()));
    }
    contents_refused(Payload::Geometry(0), "its smallest vertex first", |b| {
        let at = near.indices as usize;
        b[at..at + 6].rotate_left(2);
    });
    contents_refused(Payload::Geometry(1), "its smallest vertex first", |b| {
        let at = wide.indices as usize;
        b[at..at + 12].rotate_left(4);
    });
}

/// A brick whose nodes are a chain as long as asked for, in a file whose checksums are right.
#[test]
fn heights_of_bricks() {
    for (nodes, height, right) in [(2, 2, true), (24, 24, true), (3, 2, false), (25, 24, false)] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.bricks");
        let mut scene = scene();
        let brick = &mut scene.resident.bricks[2];
        let bytes = scene.payloads.get_mut(&Payload::Geometry(2)).unwrap();
        let leaf = brick.root;
        brick.root.meta = [0x38, 0, 0, 0, 0, 0, 0, 0];
        (brick.root.inner_mask, brick.root.child_base) = (1, 1);
        let mut chain: Vec<Node> = (1..nodes).map(|child_base| Node { child_base, ..brick.root }).collect();
        chain.push(leaf);
        bytes.splice(..80, bytemuck::cast_slice(&chain).iter().copied());
        (brick.node_count, brick.height) = (nodes, height);
        scene.write(&path);
        let file = SceneFile::open(&path).unwrap();
        let mut out = vec![0; file.span(Payload::Geometry(2)).bytes as usize];
        let result = file.copy(Payload::Geometry(2), &mut out);
        assert_eq!(result.is_ok(), right, "{nodes} nodes, height {height}: {result:?}");
        if right {
            assert_eq!(common::problems(&path), "");
        } else {
            assert!(result.unwrap_err().to_string().contains("levels"), "the height is named");
        }
    }
}

/// Two parents that share a child would let a traversal take exponential time; it is refused.
#[test]
fn shared_children_and_understated_heights() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.bricks");
    for (metas, masks, bases, found) in [
        // Node 0 has children 1 and 2; both claim node 3.
        ([[0x38, 0x39], [0x38, 0], [0x38, 0]], [3, 1, 1], [1, 3, 3], Some("another node's child")),
        ([[0x38, 0x39], [0x38, 0], [0, 0]], [3, 1, 0], [1, 3, 0], None),
    ] {
        let mut scene = scene();
        let brick = &mut scene.resident.bricks[2];
        let bytes = scene.payloads.get_mut(&Payload::Geometry(2)).unwrap();
        let leaf = brick.root;
        let mut nodes: Vec<Node> = (0..3)
            .map(|i| {
                let meta = [metas[i][0], metas[i][1], 0, 0, 0, 0, 0, 0];
                Node { meta, inner_mask: masks[i], child_base: bases[i], ..leaf }
            })
            .collect();
        nodes.push(leaf);
        brick.root = nodes[0];
        (brick.node_count, brick.height) = (4, 3);
        bytes.splice(..80, bytemuck::cast_slice(&nodes).iter().copied());
        scene.write(&path);
        let file = SceneFile::open(&path).unwrap();
        let mut out = vec![0; file.span(Payload::Geometry(2)).bytes as usize];
        match (file.copy(Payload::Geometry(2), &mut out), found) {
            (Err(error), Some(found)) => assert!(error.to_string().contains(found), "{error}"),
            (Ok(()), None) => assert_eq!(common::problems(&path), ""),
            (result, _) => panic!("{result:?}, expected {found:?}"),
        }
    }
    // A brick that states more levels than it has is found by verifying.
    let mut scene = scene();
    scene.resident.bricks[0].height = 3;
    scene.write(&path);
    assert!(common::problems(&path).contains("2 levels of nodes"));
}
