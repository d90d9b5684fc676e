//! glTF whose geometry is compressed by Draco.

use super::compressed::grid;
use super::gltf::{Asset, NAMES};
use super::{Files, Format, Verdict, imported};
use crate::kind::Fault;
use crate::mutate::{Harm, chunks};
use crate::random::Random;
use draco_core::{DataType, EncoderBuffer, EncoderOptions, FaceIndex, GeometryAttributeType, Mesh, MeshEncoder};
use draco_core::{PointAttribute, PointIndex};
use serde_json::json;
use std::path::Path;

/// A byte of compressed geometry may stand for far more triangles than a plain one.
const TRIANGLES_A_BYTE: u64 = 4096;

/// An attribute of `bytes`, so many components of `data` a point.
fn attribute(kind: GeometryAttributeType, width: u8, data: DataType, bytes: &[u8]) -> PointAttribute {
    let mut attribute = PointAttribute::new();
    let points = bytes.len() / (usize::from(width) * data.byte_length());
    attribute.init(kind, width, data, data != DataType::Float32, points);
    attribute.buffer_mut().write(0, bytes);
    attribute
}

/// A mesh with some attributes, their names, and its compressed bytes.
fn compressed(random: &mut Random, harm: Harm) -> (Vec<(&'static str, &'static str)>, [usize; 2], Vec<u8>) {
    let (vertices, indices) = grid(random.within(2, 9) as u32, random);
    let count = vertices.len();
    let mut mesh = Mesh::new();
    let places = bytemuck::cast_slice(&vertices);
    mesh.add_attribute(attribute(GeometryAttributeType::Position, 3, DataType::Float32, places));
    let mut names = vec![("POSITION", "VEC3")];
    if random.chance(50) {
        let normals: Vec<[f32; 3]> = vec![[0.0, 1.0, 0.0]; count];
        let bytes = bytemuck::cast_slice(&normals);
        mesh.add_attribute(attribute(GeometryAttributeType::Normal, 3, DataType::Float32, bytes));
        names.push(("NORMAL", "VEC3"));
    }
    if random.chance(50) {
        let uvs: Vec<[f32; 2]> = vertices.iter().map(|place| [place[0] / 8.0, place[2] / 8.0]).collect();
        let bytes = bytemuck::cast_slice(&uvs);
        mesh.add_attribute(attribute(GeometryAttributeType::TexCoord, 2, DataType::Float32, bytes));
        names.push(("TEXCOORD_0", "VEC2"));
    }
    if random.chance(50) {
        let data = match harm.does(random, 10) {
            // None that colours may have.
            true => DataType::Uint32,
            false => random.pick([DataType::Uint8, DataType::Int8, DataType::Uint16, DataType::Int16]),
        };
        let colours: Vec<u8> = (0..4 * count * data.byte_length()).map(|_| random.below(128) as u8).collect();
        mesh.add_attribute(attribute(GeometryAttributeType::Color, 4, data, &colours));
        names.push(("COLOR_0", "VEC4"));
    }
    mesh.set_num_faces(indices.len() / 3);
    for (number, face) in indices.chunks_exact(3).enumerate() {
        mesh.set_face(FaceIndex(number as u32), [PointIndex(face[0]), PointIndex(face[1]), PointIndex(face[2])]);
    }
    let mut options = EncoderOptions::new();
    let speed = random.pick([0, 3, 5, 7, 10]);
    options.set_global_int("encoding_speed", speed);
    options.set_global_int("decoding_speed", speed);
    for number in 0..names.len() as i32 {
        options.set_attribute_int(number, "quantization_bits", random.within(6, 14) as i32);
    }
    let mut encoder = MeshEncoder::new();
    encoder.set_mesh(mesh);
    let mut bytes = EncoderBuffer::new();
    // What it cannot encode is refused by who reads it.
    let _ = encoder.encode(&options, &mut bytes);
    (names, [count, indices.len()], bytes.data().to_vec())
}

/// GLB with a primitive in Draco.
pub struct Draco;

impl Format for Draco {
    const NAME: &'static str = "inputs/draco";
    const ABOUT: &'static str = "GLB with geometry in Draco: its records and the compressed bytes";
    const MOST_BYTES: u64 = 256 << 20;

    fn make(&self, random: &mut Random, harm: Harm) -> Files {
        let mut asset = Asset { root: json!({"asset": {"version": "2.0"}}), binary: Vec::new() };
        let (names, [points, corners], mut codes) = compressed(random, harm);
        harm.bytes(random, &mut codes, 60);
        let view = asset.view(&codes);
        let mut accessors = vec![json!({"componentType": 5125, "type": "SCALAR", "count": corners})];
        let mut primitive = json!({"indices": 0});
        let mut draco = json!({"bufferView": view});
        for (number, (name, kind)) in names.into_iter().enumerate() {
            primitive["attributes"][name] = json!(accessors.len());
            draco["attributes"][name] = json!(number);
            accessors.push(json!({"componentType": 5126, "type": kind, "count": points}));
        }
        primitive["extensions"]["KHR_draco_mesh_compression"] = draco;
        asset.root["accessors"] = json!(accessors);
        asset.root["meshes"] = json!([{"primitives": [primitive]}]);
        asset.root["nodes"] = json!([{"mesh": 0}]);
        asset.root["scenes"] = json!([{"nodes": [0]}]);
        asset.root["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
        asset.root["extensionsUsed"] = json!(["KHR_draco_mesh_compression"]);
        asset.with_buffer(None);
        harm.json(random, &mut asset.root, NAMES, 30);
        Files::one("a.glb", chunks::glb(asset.root.to_string().as_bytes(), &asset.binary))
    }

    fn read(&self, random: &mut Random, files: &Files, folder: &Path) -> Result<Verdict, Fault> {
        imported::read(random, files, folder, TRIANGLES_A_BYTE)
    }
}
