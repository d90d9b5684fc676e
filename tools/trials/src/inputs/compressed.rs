//! glTF whose geometry is compressed by meshoptimizer's codecs.

use super::gltf::{Asset, NAMES};
use super::{Files, Format, Verdict, imported};
use crate::kind::Fault;
use crate::mutate::{Harm, chunks};
use crate::random::Random;
use meshopt::EncodeExpMode as Mode;
use serde_json::json;
use std::path::Path;

/// A byte of compressed geometry may stand for far more triangles than a plain one.
const TRIANGLES_A_BYTE: u64 = 4096;

/// A grid of `side` x `side` vertices, three numbers each, and its triangles.
pub fn grid(side: u32, random: &mut Random) -> (Vec<[f32; 3]>, Vec<u32>) {
    let height = |random: &mut Random| random.below(16) as f32 / 8.0;
    let place = |at: u32, random: &mut Random| [(at % side) as f32, height(random), (at / side) as f32];
    let vertices = (0..side * side).map(|at| place(at, random)).collect();
    let square = |at: u32| [at, at + side, at + 1, at + 1, at + side, at + side + 1];
    let squares = (0..side * (side - 1)).filter(|at| at % side + 1 < side);
    (vertices, squares.flat_map(square).collect())
}

/// What a view says of its compressed bytes: bytes a record, records, mode, filter.
type Codec<'a> = (usize, usize, &'a str, &'a str);

/// A view whose compressed bytes are `codes`.
fn compressed(asset: &mut Asset, codes: &[u8], (stride, count, mode, filter): Codec) -> usize {
    let view = asset.view(codes);
    let views = &mut asset.root["bufferViews"];
    let source = views[view].take();
    let extension = json!({"buffer": 0, "byteOffset": source["byteOffset"], "byteLength": codes.len(),
        "byteStride": stride, "count": count, "mode": mode, "filter": filter});
    views[view] = json!({"buffer": 1, "byteOffset": 0, "byteLength": stride * count,
        "extensions": {"EXT_meshopt_compression": extension}});
    if mode == "ATTRIBUTES" {
        views[view]["byteStride"] = json!(stride);
    }
    view
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
        let is_filtered = random.chance(50);
        let mut codes = match is_filtered {
            true => meshopt::encode_vertex_buffer(&meshopt::encode_filter_exp(&vertices, 15, Mode::Separate)),
            false => meshopt::encode_vertex_buffer(&vertices),
        }
        .unwrap_or_default();
        harm.bytes(random, &mut codes, 50);
        let filter = if is_filtered { "EXPONENTIAL" } else { "NONE" };
        let mut views = vec![compressed(&mut asset, &codes, (12, vertices.len(), "ATTRIBUTES", filter))];
        let up = vec![[0.0, 1.0, 0.0, 1.0]; vertices.len()];
        let mut codes = meshopt::encode_vertex_buffer(&meshopt::encode_filter_oct::<i8>(&up, 8)).unwrap_or_default();
        harm.bytes(random, &mut codes, 20);
        views.push(compressed(&mut asset, &codes, (4, vertices.len(), "ATTRIBUTES", "OCTAHEDRAL")));
        let mut codes = meshopt::encode_vertex_buffer(&meshopt::encode_filter_color::<u8>(&up, 8)).unwrap_or_default();
        harm.bytes(random, &mut codes, 20);
        views.push(compressed(&mut asset, &codes, (4, vertices.len(), "ATTRIBUTES", "COLOR")));
        let mut codes = meshopt::encode_vertex_buffer(&meshopt::encode_filter_quat(&up[..2], 16)).unwrap_or_default();
        harm.bytes(random, &mut codes, 20);
        views.push(compressed(&mut asset, &codes, (8, 2, "ATTRIBUTES", "QUATERNION")));
        let is_list = random.chance(70);
        let (codes, mode) = match is_list {
            true => (meshopt::encode_index_buffer(&indices, vertices.len()), "TRIANGLES"),
            false => (meshopt::encode_index_sequence(&indices, vertices.len()), "INDICES"),
        };
        let mut codes = codes.unwrap_or_default();
        harm.bytes(random, &mut codes, 50);
        let stride = random.pick([2, 4]);
        views.push(compressed(&mut asset, &codes, (stride, indices.len(), mode, "NONE")));
        let index = if stride == 2 { 5123 } else { 5125 };
        asset.root["accessors"] = json!([
            {"bufferView": views[0], "componentType": 5126, "type": "VEC3", "count": vertices.len()},
            {"bufferView": views[1], "componentType": 5120, "type": "VEC3", "count": vertices.len(),
                "normalized": true},
            {"bufferView": views[2], "componentType": 5121, "type": "VEC4", "count": vertices.len(),
                "normalized": true},
            {"bufferView": views[3], "componentType": 5122, "type": "VEC4", "count": 2, "normalized": true},
            {"bufferView": views[4], "componentType": index, "type": "SCALAR", "count": indices.len()},
        ]);
        let lengths = [12 * vertices.len(), 4 * vertices.len(), 4 * vertices.len(), 16, stride * indices.len()];
        let plain: usize = lengths.iter().sum();
        asset.root["buffers"] = json!([{"byteLength": asset.binary.len()}, {"byteLength": plain,
            "extensions": {"EXT_meshopt_compression": {"fallback": true}}}]);
        asset.root["meshes"] = json!([{"primitives": [{"attributes": {"POSITION": 0}, "indices": 4}]}]);
        if random.chance(50) {
            let attributes = json!({"POSITION": 0, "NORMAL": 1, "COLOR_0": 2});
            asset.root["meshes"][0]["primitives"][0]["attributes"] = attributes;
        }
        asset.root["nodes"] = json!([{"mesh": 0}]);
        if random.chance(30) {
            let instances = json!({"attributes": {"ROTATION": 3}});
            asset.root["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"] = instances;
        }
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
