//! Mutated bytes: importing may fail, but neither panics nor allocates out of proportion.

use crate::writer::*;
use proptest::prelude::*;
use serde_json::json;

/// A small file with most of what importing follows.
fn rich() -> Writer {
    let mut file = Writer::triangle();
    let indices = file.view(&le16(&[0, 2]));
    let values = file.view(&le32(&[0.5; 6]));
    file.root["accessors"][0]["sparse"] = json!({
        "count": 2, "indices": {"bufferView": indices, "componentType": U16}, "values": {"bufferView": values}
    });
    let uvs = file.floats("VEC2", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    let colors = file.accessor(&[9; 12], U8, "VEC4", 3);
    let image = file.view(&png(2, 1, &[255, 0, 0, 255, 0, 128, 255, 64]));
    file.push("images", json!({"bufferView": image}));
    file.push("samplers", json!({"wrapS": 33071, "wrapT": 33648}));
    file.push("textures", json!({"source": 0, "sampler": 0}));
    file.push("materials", json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}, "alphaMode": "MASK"}));
    let primitive = &mut file.root["meshes"][0]["primitives"][0];
    primitive["mode"] = json!(5);
    primitive["material"] = json!(0);
    primitive["attributes"] = json!({"POSITION": 0, "TEXCOORD_0": uvs, "COLOR_0": colors});
    let translation = file.floats("VEC3", &[1.0; 6]);
    let extension = json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": translation}}});
    file.push("nodes", json!({"mesh": 0, "rotation": [0, 1, 0, 1], "extensions": extension}));
    file.push("nodes", json!({"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1]}));
    file.root["nodes"][0]["children"] = json!([1, 2]);
    file
}

/// Replacements that change the structure rather than break the JSON.
const TOKENS: [&str; 12] =
    ["0", "1", "2", "3", "7", "-1", "4294967295", "4294967296", "18446744073709551615", "1e308", "null", "[]"];

/// What importing costs must not depend on what counts claim.
fn assert_harmless(name: &str, bytes: &[u8]) {
    match import_bytes(name, bytes) {
        Ok(scene) => {
            let triangles: u64 = scene.meshes.iter().map(|m| m.triangle_count()).sum();
            assert!(triangles <= 64 * bytes.len() as u64, "{triangles} triangles of {} bytes", bytes.len());
            assert!(scene.placements.len() <= bytes.len());
            for primitive in scene.meshes.iter().flat_map(|m| &m.primitives) {
                let vertices = primitive.positions.len();
                assert!(primitive.indices.iter().all(|&i| (i as usize) < vertices));
                assert!(primitive.uvs.as_ref().is_none_or(|uvs| uvs.len() == vertices));
                assert!(primitive.colors.as_ref().is_none_or(|colors| colors.len() == vertices));
                assert!((primitive.material as usize) < scene.materials.len());
            }
            assert!(scene.placements.iter().all(|p| (p.mesh as usize) < scene.meshes.len()));
        }
        Err(e) => assert!(!e.to_string().contains('\n'), "{e}"),
    }
}

#[test]
fn the_unmutated_file_imports() {
    let scene = rich().scene();
    assert_eq!((scene.placements.len(), scene.textures.len()), (4, 1));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn mutated_bytes_do_no_harm(edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8)) {
        let mut bytes = rich().glb();
        for (at, value) in edits {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        assert_harmless("test.glb", &bytes);
    }

    #[test]
    fn truncated_and_swollen_files_do_no_harm(at in any::<prop::sample::Index>(), inserted in prop::collection::vec(any::<u8>(), 0..40)) {
        let bytes = rich().glb();
        let at = at.index(bytes.len());
        assert_harmless("test.glb", &bytes[..at]);
        assert_harmless("test.glb", &[&bytes[..at], &inserted, &bytes[at..]].concat());
    }

    #[test]
    fn replaced_numbers_do_no_harm(edits in prop::collection::vec((any::<prop::sample::Index>(), 0..TOKENS.len()), 1..4)) {
        let file = rich();
        let bin: String = file.bytes.iter().map(|b| format!("%{b:02x}")).collect();
        let mut root = file.root.clone();
        root["buffers"] = json!([{"byteLength": file.bytes.len(), "uri": "BIN"}]);
        for (at, token) in edits {
            let mut numbers = Vec::new();
            collect_numbers(&root, String::new(), &mut numbers);
            let pointer = &numbers[at.index(numbers.len())];
            *root.pointer_mut(pointer).unwrap() = serde_json::from_str(TOKENS[token]).unwrap();
        }
        let json = root.to_string().replace("BIN", &format!("data:,{bin}"));
        assert_harmless("test.gltf", json.as_bytes());
    }
}

/// JSON pointers to all numbers.
fn collect_numbers(value: &serde_json::Value, path: String, found: &mut Vec<String>) {
    match value {
        serde_json::Value::Number(_) => found.push(path),
        serde_json::Value::Array(list) => {
            list.iter().enumerate().for_each(|(i, v)| collect_numbers(v, format!("{path}/{i}"), found));
        }
        serde_json::Value::Object(map) => {
            map.iter().for_each(|(k, v)| collect_numbers(v, format!("{path}/{k}"), found))
        }
        _ => {}
    }
}
