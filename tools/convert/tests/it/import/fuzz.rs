//! Mutated bytes: importing may fail, but neither panics nor allocates out of proportion.

use super::formats::{ply, stl};
use super::writer::*;
use crate::skip::shared_scenes;
use brickwalk_convert::source::SourceScene;
use proptest::prelude::*;
use serde_json::json;
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// The system's allocator; it remembers the largest request.
struct Largest;

static LARGEST_BYTES: AtomicUsize = AtomicUsize::new(0);

/// More than any test of this binary asks for at once: inputs are small, and so is what is decoded from them.
const MOST_BYTES: usize = 256 << 20;

// SAFETY: every request is passed on to the system's allocator as it is.
unsafe impl GlobalAlloc for Largest {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        LARGEST_BYTES.fetch_max(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller's obligations are those of the system's allocator.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: the memory came from the system's allocator with this layout.
        unsafe { System.dealloc(memory, layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        LARGEST_BYTES.fetch_max(layout.size(), Ordering::Relaxed);
        // SAFETY: as in `alloc`.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        LARGEST_BYTES.fetch_max(size, Ordering::Relaxed);
        // SAFETY: as in `alloc` and `dealloc`.
        unsafe { System.realloc(memory, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Largest = Largest;

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
    let start = Instant::now();
    judge(import_bytes(name, bytes), bytes);
    assert!(start.elapsed() < Duration::from_secs(10));
    let largest = LARGEST_BYTES.load(Ordering::Relaxed);
    assert!(largest < MOST_BYTES, "{largest} bytes were asked for at once");
}

fn judge(result: Result<SourceScene, String>, bytes: &[u8]) {
    match result {
        Ok(scene) => {
            let triangles: u64 = scene.meshes.iter().map(|m| m.triangle_count()).sum();
            assert!(triangles <= 64 * bytes.len() as u64, "{triangles} triangles of {} bytes", bytes.len());
            assert!(scene.placements.len() <= bytes.len());
            for primitive in scene.meshes.iter().flat_map(|m| &m.primitives) {
                let vertices = primitive.positions.len();
                assert!(primitive.indices.iter().all(|&i| (i as usize) < vertices));
                assert!(primitive.uvs.as_ref().is_none_or(|uvs| uvs.len() == vertices));
                assert!(primitive.uvs1.as_ref().is_none_or(|uvs| uvs.len() == vertices));
                let corners = primitive.indices.len();
                assert!(primitive.tangents.as_ref().is_none_or(|tangents| tangents.len() == corners));
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
    fn truncated_and_swollen_files_do_no_harm(
        at in any::<prop::sample::Index>(), inserted in prop::collection::vec(any::<u8>(), 0..40)
    ) {
        let bytes = rich().glb();
        let at = at.index(bytes.len());
        assert_harmless("test.glb", &bytes[..at]);
        assert_harmless("test.glb", &[&bytes[..at], &inserted, &bytes[at..]].concat());
    }

    #[test]
    fn replaced_numbers_do_no_harm(
        edits in prop::collection::vec((any::<prop::sample::Index>(), 0..TOKENS.len()), 1..4)
    ) {
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

/// An OBJ file with most of what importing follows.
const OBJ: &str = "mtllib a.mtl\no one\nv 0 0 0 1 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0.5\nvn 0 0 1\n\
    usemtl red\nf 1/1/1 2/2/1 3/1/1 4/2/1\ng two\nf -4 -3 \\\n -2\nf 1//1 2//1 3//1\nl 1 2\n";

/// Words that stand where others should.
const WORDS: [&str; 14] = [
    "0",
    "-1",
    "4294967295",
    "4294967296",
    "-9223372036854775808",
    "18446744073709551616",
    "1e308",
    "nan",
    "uint",
    "list",
    "double",
    "element",
    "f",
    "",
];

/// `text` with some of its words replaced.
fn with_words(text: &[u8], edits: &[(prop::sample::Index, usize)]) -> Vec<u8> {
    let mut words: Vec<&[u8]> = text.split_inclusive(|&c| c == b' ' || c == b'\n').collect();
    let replaced: Vec<Vec<u8>> = WORDS.iter().map(|word| format!("{word} ").into_bytes()).collect();
    for (at, word) in edits {
        let at = at.index(words.len());
        words[at] = &replaced[*word];
    }
    words.concat()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 500, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn mutated_obj_ply_and_stl_do_no_harm(
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        cut in any::<prop::sample::Index>(),
    ) {
        let files = [
            ("a.obj", OBJ.as_bytes().to_vec()),
            ("a.ply", ply("ascii")),
            ("a.ply", ply("binary_little_endian")),
            ("a.ply", ply("binary_big_endian")),
            ("a.stl", stl()),
            ("a.stl", b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n\
                endloop\n".to_vec()),
        ];
        for (name, mut bytes) in files {
            assert_harmless(name, &bytes[..cut.index(bytes.len())]);
            for (at, value) in &edits {
                let at = at.index(bytes.len());
                bytes[at] = *value;
            }
            assert_harmless(name, &bytes);
        }
    }

    #[test]
    fn replaced_words_do_no_harm(edits in prop::collection::vec((any::<prop::sample::Index>(), 0..WORDS.len()), 1..4)) {
        assert_harmless("a.obj", &with_words(OBJ.as_bytes(), &edits));
        for encoding in ["ascii", "binary_little_endian"] {
            assert_harmless("a.ply", &with_words(&ply(encoding), &edits));
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..ProptestConfig::default() })]

    /// Compressed geometry and images: the decoders are those of others.
    #[test]
    fn mutated_compressed_data_does_no_harm(
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..20),
    ) {
        let Some(folder) = shared_scenes() else { return Ok(()) };
        // A file of bytes, and the file that is imported.
        for (data, scene) in [
            ("stress/DracoCompressed/0.bin", "stress/DracoCompressed/CesiumMilkTruck.gltf"),
            ("stress/DucksMeshopt/Duck-vp-12-vt-12-vn-12.glb", "stress/DucksMeshopt/Duck-vp-12-vt-12-vn-12.glb"),
            ("stress/BoxTexturedWebp/CesiumLogoFlat.webp", "stress/BoxTexturedWebp/BoxTexturedWebp.gltf"),
        ] {
            let (data, scene) = (folder.join(data), folder.join(scene));
            let copies = tempfile::tempdir().unwrap();
            for entry in std::fs::read_dir(scene.parent().unwrap()).unwrap() {
                let path = entry.unwrap().path();
                std::fs::copy(&path, copies.path().join(path.file_name().unwrap())).unwrap();
            }
            let mut bytes = std::fs::read(&data).unwrap();
            for (at, value) in &edits {
                let at = at.index(bytes.len());
                bytes[at] = *value;
            }
            write(copies.path(), &data.file_name().unwrap().to_string_lossy(), &bytes);
            let start = Instant::now();
            judge(import_one(&copies.path().join(scene.file_name().unwrap())), &bytes);
            assert!(start.elapsed() < Duration::from_secs(10));
            assert!(LARGEST_BYTES.load(Ordering::Relaxed) < MOST_BYTES);
        }
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
