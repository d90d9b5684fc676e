//! glTF whose geometry is compressed by meshoptimizer's codecs.

use super::gltf::{Asset, NAMES};
use super::{Files, Format, Verdict, imported};
use crate::kind::Fault;
use crate::mutate::{Harm, chunks};
use crate::random::Random;
use serde_json::json;
use std::path::Path;

/// A byte of compressed geometry may stand for far more triangles than a plain one.
const TRIANGLES_A_BYTE: u64 = 4096;

/// A grid of `side` x `side` vertices, three numbers each, and its triangles.
fn grid(side: u32, random: &mut Random) -> (Vec<[f32; 3]>, Vec<u32>) {
    let height = |random: &mut Random| random.below(16) as f32 / 8.0;
    let place = |at: u32, random: &mut Random| [(at % side) as f32, height(random), (at / side) as f32];
    let vertices = (0..side * side).map(|at| place(at, random)).collect();
    let square = |at: u32| [at, at + side, at + 1, at + 1, at + side, at + side + 1];
    let squares = (0..side * (side - 1)).filter(|at| at % side + 1 < side);
    (vertices, squares.flat_map(square).collect())
}

/// GLB with compressed buffer views.
pub struct Compressed;

impl Format for Compressed {
    const NAME: &'static str = "inputs/meshopt";
    const ABOUT: &'static str = "GLB with geometry in meshoptimizer's codecs: its records and the compressed bytes";

    fn make(&self, random: &mut Random, harm: Harm) -> Files {
        let side = random.within(2, 9) as u32;
        let (vertices, indices) = grid(side, random);
        let mut asset = Asset { root: json!({"asset": {"version": "2.0"}}), binary: Vec::new() };
        // Encoding fails only for want of memory; nothing is refused by who reads it.
        let mut codes = meshopt::encode_vertex_buffer(&vertices).unwrap_or_default();
        harm.bytes(random, &mut codes, 50);
        let mut compress = |codes: &[u8], stride: usize, count: usize, mode: &str| {
            let view = asset.view(codes);
            let source = asset.root["bufferViews"][view].take();
            let extension = json!({"buffer": 0, "byteOffset": source["byteOffset"], "byteLength": codes.len(),
                "byteStride": stride, "count": count, "mode": mode});
            asset.root["bufferViews"][view] = json!({"buffer": 1, "byteOffset": 0, "byteLength": stride * count,
                "extensions": {"EXT_meshopt_compression": extension}});
            if mode == "ATTRIBUTES" {
                asset.root["bufferViews"][view]["byteStride"] = json!(stride);
            }
            view
        };
        let positions = compress(&codes, 12, vertices.len(), "ATTRIBUTES");
        let mut codes = meshopt::encode_index_buffer(&indices, vertices.len()).unwrap_or_default();
        harm.bytes(random, &mut codes, 50);
        let triangles = compress(&codes, 4, indices.len(), "TRIANGLES");
        let places = 12 * vertices.len();
        asset.root["accessors"] = json!([
            {"bufferView": positions, "componentType": 5126, "type": "VEC3", "count": vertices.len()},
            {"bufferView": triangles, "componentType": 5125, "type": "SCALAR", "count": indices.len()},
        ]);
        asset.root["buffers"] = json!([{"byteLength": asset.binary.len()}, {"byteLength": places + 4 * indices.len(),
            "extensions": {"EXT_meshopt_compression": {"fallback": true}}}]);
        asset.root["meshes"] = json!([{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}]);
        asset.root["nodes"] = json!([{"mesh": 0}]);
        asset.root["scenes"] = json!([{"nodes": [0]}]);
        asset.root["extensionsRequired"] = json!(["EXT_meshopt_compression"]);
        asset.root["extensionsUsed"] = json!(["EXT_meshopt_compression"]);
        harm.json(random, &mut asset.root, NAMES, 50);
        Files::one("a.glb", chunks::glb(asset.root.to_string().as_bytes(), &asset.binary))
    }

    fn read(&self, random: &mut Random, files: &Files, folder: &Path) -> Result<Verdict, Fault> {
        imported::read(random, files, folder, TRIANGLES_A_BYTE)
    }
}
