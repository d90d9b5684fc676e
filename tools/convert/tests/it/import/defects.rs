//! What is refused: the error names the file, the thing and the remedy in one line.

use super::writer::*;
use serde_json::{Value, json};

/// The error after `value` was put at `pointer` of a sound file, which itself must import.
fn with(pointer: &str, value: Value) -> String {
    let mut file = sound();
    file.scene();
    *file.root.pointer_mut(pointer).unwrap_or_else(|| panic!("{pointer}")) = value;
    file.error()
}

/// A file in which every kind of reference occurs.
fn sound() -> Writer {
    let mut file = Writer::triangle();
    let sparse_indices = file.view(&le16(&[0, 2]));
    let sparse_values = file.view(&le32(&[0.0; 6]));
    file.root["accessors"][0]["sparse"] = json!({
        "count": 2,
        "indices": {"bufferView": sparse_indices, "componentType": U16},
        "values": {"bufferView": sparse_values}
    });
    file.push("accessors", json!({"componentType": F32, "type": "VEC3", "count": 3}));
    file.push("images", json!({"uri": "data:,"}));
    file.push("samplers", json!({}));
    file.push("textures", json!({"source": 0, "sampler": 0}));
    file.push("materials", json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}));
    file.root["meshes"][0]["name"] = json!("door");
    file.root["meshes"][0]["primitives"][0]["material"] = json!(0);
    file.root["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(2);
    file.root["nodes"][0]["children"] = json!([]);
    file.root["nodes"][0]["matrix"] = json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
    file.push("nodes", json!({"name": "hinge", "children": []}));
    file
}

#[test]
fn every_reference_is_checked() {
    // Those beyond 32 bits, which no list reaches, are not told apart.
    let shown = |index: u64| if index < 1 << 32 { index.to_string() } else { "4294967294 or more".into() };
    // The place that the error must name, for each reference.
    let references = [
        ("/scene", "default scene"),
        ("/scenes/0/nodes/0", "scene 0"),
        ("/nodes/0/mesh", "node 0"),
        ("/meshes/0/primitives/0/indices", "mesh 0 \"door\" primitive 0"),
        ("/meshes/0/primitives/0/attributes/POSITION", "mesh 0 \"door\" primitive 0"),
        ("/accessors/0/bufferView", "mesh 0 \"door\" primitive 0: POSITION: accessor 0"),
        ("/accessors/0/sparse/indices/bufferView", "accessor 0"),
        ("/accessors/0/sparse/values/bufferView", "accessor 0"),
        ("/bufferViews/0/buffer", "accessor 0"),
    ];
    // What these lead to leaves geometry intact, so they are warnings.
    let looks = [
        ("/meshes/0/primitives/0/material", "mesh 0 \"door\" primitive 0"),
        ("/materials/0/pbrMetallicRoughness/baseColorTexture/index", "material 0"),
        ("/textures/0/source", "material 0"),
        ("/textures/0/sampler", "material 0"),
    ];
    for (pointer, place) in looks {
        for index in [100u64, 1 << 32, u64::MAX] {
            let mut file = sound();
            *file.root.pointer_mut(pointer).unwrap() = json!(index);
            let scene = file.scene();
            assert!(scene.materials.iter().all(|material| material.base_color_texture == bricks::NONE));
            let told = |line: &String| line.contains(place) && line.contains(&shown(index));
            assert!(scene.warnings.iter().any(told), "{pointer}: {:?}", scene.warnings);
        }
    }
    for (pointer, place) in references {
        // The second would be index 0 in 32 bits.
        for index in [100u64, 1 << 32, u64::MAX] {
            let error = with(pointer, json!(index));
            assert!(error.contains(place) && error.contains(&shown(index)), "{pointer}: {error}");
        }
        for wrong in [json!(-1), json!(0.5), json!("0"), json!([]), json!(1e19), json!(1e300)] {
            let error = with(pointer, wrong);
            assert!(error.contains("line 1 column"), "{pointer}: {error}");
        }
    }
    let error = with("/nodes/0/children", json!([5]));
    assert!(error.contains("node 0: refers to node 5, but the file has 2"), "{error}");
}

#[test]
fn an_unused_mesh_is_checked_for_references() {
    let mut file = Writer::triangle();
    file.mesh(json!({"attributes": {"POSITION": 77}}));
    assert!(file.error().contains("mesh 1 primitive 0: refers to accessor 77"));
}

#[test]
fn accessors_stay_within_their_buffers() {
    let cases = [
        ("/accessors/0/count", json!(4)),
        ("/accessors/0/count", json!(1u64 << 40)),
        ("/accessors/0/count", json!(u64::MAX)),
        ("/accessors/1/count", json!(u64::MAX)),
        ("/accessors/2/count", json!(1u64 << 40)),
        ("/accessors/2/count", json!(u64::MAX)),
        ("/accessors/2/count", json!(4)),
        ("/accessors/0/sparse/count", json!(3)),
        ("/accessors/0/sparse/count", json!(4)),
        ("/accessors/0/sparse/count", json!(u64::MAX)),
        ("/accessors/0/componentType", json!(U32)),
        ("/accessors/0/componentType", json!(5124)),
        ("/accessors/0/type", json!("VEC2")),
        ("/accessors/0/type", json!("MAT4")),
        ("/accessors/0/type", json!("vec3\n")),
        ("/accessors/1/componentType", json!(F32)),
        ("/accessors/1/componentType", json!(U32)),
        ("/accessors/1/type", json!("VEC2")),
        ("/accessors/0/sparse/indices/componentType", json!(F32)),
        ("/accessors/0/sparse/indices/componentType", json!(U32)),
        ("/bufferViews/0/byteLength", json!(35)),
        ("/bufferViews/0/byteLength", json!(u64::MAX)),
        ("/bufferViews/0/byteOffset", json!(u64::MAX)),
        ("/bufferViews/0/byteOffset", json!(1_000_000)),
    ];
    for (pointer, value) in cases {
        let error = with(pointer, value.clone());
        assert!(error.contains("mesh 0 \"door\" primitive 0"), "{pointer} {value}: {error}");
    }
    for (name, value) in [("byteOffset", json!(1)), ("byteOffset", json!(u64::MAX))] {
        let mut file = sound();
        file.root["accessors"][0][name] = value;
        assert!(file.error().contains("do not fit buffer view 0"));
    }
    for stride in [13u64, 11, u64::MAX, 1 << 63] {
        let mut file = sound();
        file.root["bufferViews"][0]["byteStride"] = json!(stride);
        assert!(file.error().contains("accessor 0"), "{stride}");
    }
    let mut file = sound();
    file.root["bufferViews"][0]["byteStride"] = json!(12);
    file.scene();
}

#[test]
fn sparse_indices_ascend_within_range() {
    for indices in [[0, 3], [2, 0], [1, 1], [65535, 65535]] {
        let mut file = Writer::triangle();
        let view = file.view(&le16(&indices));
        let values = file.view(&le32(&[0.0; 6]));
        file.root["accessors"][0]["sparse"] = json!({
            "count": 2, "indices": {"bufferView": view, "componentType": U16}, "values": {"bufferView": values}
        });
        assert!(file.error().contains("sparse index"), "{indices:?}");
    }
}

#[test]
fn triangle_indices_stay_below_the_vertices() {
    let mut file = Writer::triangle();
    let indices = file.accessor(&le16(&[0, 1, 2, 2, 1, 3]), U16, "SCALAR", 6);
    file.root["meshes"][0]["primitives"][0]["indices"] = json!(indices);
    let error = file.error();
    assert!(error.contains("mesh 0 primitive 0: index 5 is 3, but there are 3 vertices"), "{error}");
}

#[test]
fn counts_of_attributes_agree() {
    let mut file = Writer::triangle();
    for (name, kind) in [("NORMAL", "VEC3"), ("TEXCOORD_0", "VEC2"), ("COLOR_0", "VEC4")] {
        let width = kind.as_bytes()[3] as usize - b'0' as usize;
        let two = file.floats(kind, &vec![0.0; 2 * width]);
        file.root["meshes"][0]["primitives"][0]["attributes"] = json!({"POSITION": 0, name: two});
        assert!(file.error().contains("has 2 elements, POSITION 3"), "{name}");
    }
}

#[test]
fn the_node_graph_is_a_forest() {
    let graph = |nodes: Value, roots: Value| {
        let mut file = Writer::triangle();
        file.root["nodes"] = nodes;
        file.root["scenes"][0]["nodes"] = roots;
        file
    };
    let cases = [
        (json!([{"children": [0]}]), json!([0]), "its own ancestor"),
        (json!([{"children": [1]}, {"children": [2]}, {"children": [1]}]), json!([0]), "already a child"),
        (json!([{}, {"children": [2]}, {"children": [3]}, {"children": [1]}]), json!([0]), "its own ancestor"),
        (json!([{"children": [2]}, {"children": [2]}, {}]), json!([0, 1]), "node 1: node 2 is its child"),
        (json!([{"children": [1, 1]}, {}]), json!([0]), "already a child"),
        (json!([{"children": [1]}, {}]), json!([0, 1]), "scene 0: lists node 1, which is a child of node 0"),
        (json!([{}]), json!([0, 0]), "lists node 0 twice"),
    ];
    for (nodes, roots, expected) in cases {
        let error = graph(nodes.clone(), roots).error();
        assert!(error.contains(expected), "{nodes}: {error}");
    }
    // Without a scene every root is walked; a cycle has none, and is found all the same.
    let mut file = graph(json!([{}, {"children": [2]}, {"children": [1]}]), json!([]));
    file.root.as_object_mut().unwrap().remove("scenes");
    file.root.as_object_mut().unwrap().remove("scene");
    assert!(file.error().contains("its own ancestor"));
    graph(json!([{"children": [2, 1]}, {"children": [3]}, {}, {}]), json!([0])).scene();
}

#[test]
fn transformations_are_affine_and_finite() {
    let error = with("/nodes/0/matrix/3", json!(0.5));
    assert!(error.contains("node 0") && error.contains("last row"), "{error}");
    let error = with("/nodes/0/matrix", json!([1, 2, 3]));
    assert!(error.contains("line 1 column"), "{error}");
    let mut file = Writer::triangle();
    file.root["nodes"][0]["rotation"] = json!([0, 0, 0, 0]);
    assert!(file.error().contains("quaternion"));
    let mut file = Writer::triangle();
    file.root["nodes"] = json!([{"children": [1], "scale": [1e200, 1, 1]}, {"mesh": 0, "scale": [1e200, 1, 1]}]);
    assert!(file.error().contains("node 1: its transformation is too large"));
}

#[test]
fn buffers_must_be_there_and_long_enough() {
    let file = Writer::triangle();
    let length = file.bytes.len();
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "short.bin", &file.bytes[..length - 1]);
    std::fs::create_dir(folder.path().join("folder.bin")).unwrap();
    let cases = [
        ("missing.bin", "cannot read missing.bin"),
        ("folder.bin", "not a regular file"),
        ("short.bin", "byteLength states"),
        ("/dev/zero", "path is absolute"),
        ("http://example.com/a.bin", "not a relative path"),
        ("../a.bin", "out of the folder"),
        ("%2e%2e/a.bin", "out of the folder"),
        ("%%", "percent-encoding"),
        ("data:;base64,AAAA", "byteLength states"),
        ("data:;base64,A", "base64"),
        ("", "names no file"),
    ];
    for (uri, expected) in cases {
        let path = write(folder.path(), "test.gltf", &file.json(Some(uri)));
        let error = error_text(import_one(&path));
        assert!(error.contains("buffer 0: ") && error.contains(expected), "{uri}: {error}");
    }
    // Without a URI only a GLB has a buffer.
    let path = write(folder.path(), "test.gltf", &file.json(None));
    let error = error_text(import_one(&path));
    assert!(error.contains("buffer view 0: buffer 0: has no data"), "{error}");
}

#[test]
fn required_extensions_are_named_in_one_error() {
    let mut file = Writer::triangle();
    file.root["extensionsRequired"] =
        json!(["KHR_draco_mesh_compression", "EXT_other", "KHR_lights_punctual", "MPEG_media", "A\nB"]);
    let error = file.error();
    assert!(error.contains("requires EXT_other, MPEG_media, A B, which"), "{error}");
}

#[test]
fn compressed_geometry_is_not_taken_for_zeros() {
    let mut file = Writer::triangle();
    file.root["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    file.scene();
    let draco =
        |view: usize| json!({"KHR_draco_mesh_compression": {"bufferView": view, "attributes": {"POSITION": 0}}});
    let last = file.view(b"DRACO\x02\x02\x01\x01\0\0 but cut off");
    for view in [last, 0, last + 1, 1 << 40] {
        file.root["meshes"][0]["primitives"][0]["extensions"] = draco(view);
        let error = file.error();
        assert!(error.contains("mesh 0 primitive 0: Draco") || error.contains("refers to buffer view"), "{error}");
    }
    let mut file = Writer::triangle();
    let sound = json!({
        "buffer": 0, "byteOffset": 0, "byteLength": 36, "byteStride": 12, "count": 3, "mode": "ATTRIBUTES"
    });
    // Plain numbers are not what the codec writes.
    let wrong = [
        ("byteLength", json!(36)),
        ("byteLength", json!(0)),
        ("byteLength", json!(1000)),
        ("byteOffset", json!(u64::MAX)),
        ("byteStride", json!(0)),
        ("byteStride", json!(10)),
        ("byteStride", json!(260)),
        ("count", json!(1u64 << 32)),
        ("count", json!(u64::MAX)),
        ("mode", json!("NOTHING")),
        ("mode", json!("TRIANGLES")),
        ("filter", json!("OCTAHEDRAL")),
        ("filter", json!("NOTHING")),
        ("buffer", json!(1)),
    ];
    for (field, value) in wrong {
        let mut extension = sound.clone();
        extension[field] = value;
        file.root["bufferViews"][0]["extensions"] = json!({"EXT_meshopt_compression": extension});
        let error = file.error();
        assert!(error.contains("buffer view 0: meshopt compression: "), "{field}: {error}");
    }
}

#[test]
fn other_versions_are_told() {
    for (asset, expected) in [
        (json!({"version": "1.0"}), "version 1.0"),
        (json!({"version": "3.0"}), "version 3.0"),
        (json!({"version": "2.1", "minVersion": "2.1"}), "version 2.1"),
    ] {
        // glTF 1.0 has objects where 2.0 has lists; that must not hide the version.
        for meshes in [json!([]), json!({"a": 1})] {
            let json = json!({"asset": asset, "meshes": meshes}).to_string();
            let error = error_text(import_bytes("test.gltf", json.as_bytes()));
            assert!(error.contains(expected), "{error}");
        }
    }
    import_bytes("test.gltf", br#"{"asset": {"version": "2.1"}}"#).unwrap();
}

#[test]
fn bytes_that_are_no_gltf() {
    let deep = "[".repeat(1_000_000);
    let deep_inside = format!(r#"{{"asset": {{"version": "2.0"}}, "extras": {deep}"#);
    let texts: [&[u8]; 9] =
        [b"", b"{", b"[]", b"null", b"\xff\xfe", b"glTF", b"{\"asset\": {}}", deep.as_bytes(), deep_inside.as_bytes()];
    for text in texts {
        let error = error_text(import_bytes("test.gltf", text));
        assert!(error.contains("not a readable glTF 2.0 file"), "{error}");
    }
}

#[test]
fn other_kinds_of_files_are_refused_before_anything_is_read() {
    for name in ["test.gl.objx", "test.gl.usd", "test.gl", "test.gltf.fbx"] {
        let error = error_text(import_bytes(name, b""));
        assert!(error.contains(".gltf, .glb, .obj, .ply, .stl and tileset.json"), "{error}");
    }
    // The second input is at fault, although the first is missing.
    let paths = ["/missing/test.gltf", "/missing/test.gl.objx"].map(|path| std::path::Path::new(path).into());
    assert!(error_text(import_all(&paths)).contains("test.gl.objx"));
    let error = error_text(import_one(std::path::Path::new("/missing/test.gltf")));
    assert!(error.contains("/missing/test.gltf: cannot read the file"), "{error}");
}

#[test]
fn more_triangles_than_ids_are_refused_before_they_are_read() {
    let mut file = Writer::new();
    // A mebibyte of zero indices as a fan, used by 5000 nodes.
    let positions = file.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    let indices = file.accessor(&vec![0; 1 << 20], U8, "SCALAR", 1 << 20);
    let mesh = file.mesh(json!({"attributes": {"POSITION": positions}, "indices": indices, "mode": 6}));
    for _ in 0..5000 {
        file.node(json!({"mesh": mesh}));
    }
    let error = file.error();
    assert!(error.contains("4294967294"), "{error}");
}

#[test]
fn copies_by_sharing_are_bounded() {
    let mut file = Writer::new();
    let positions = file.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    let indices = file.accessor(&vec![0; 1 << 14], U8, "SCALAR", 1 << 14);
    let primitive = json!({"attributes": {"POSITION": positions}, "indices": indices, "mode": 6});
    let mesh = file.mesh(primitive.clone());
    file.node(json!({"mesh": mesh}));
    file.root["meshes"][0]["primitives"] = json!(vec![primitive.clone(); 50]);
    file.scene();
    file.root["meshes"][0]["primitives"] = json!(vec![primitive; 1000]);
    assert!(file.error().contains("repeat the same accessors to 16382000 triangles"));
}

#[test]
fn instances_are_bounded() {
    let mut file = Writer::triangle();
    // As many as the file has bytes, but for the digits of the second node.
    let zeros = file.push("accessors", json!({"componentType": F32, "type": "VEC3", "count": 600}));
    let extension = json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": zeros}}});
    file.root["nodes"][0]["extensions"] = extension.clone();
    assert_eq!(file.scene().placements.len(), 600);
    file.node(json!({"mesh": 0, "extensions": extension.clone()}));
    file.node(json!({"mesh": 0, "extensions": extension}));
    assert!(file.error().contains("brings the instances to"));
}
