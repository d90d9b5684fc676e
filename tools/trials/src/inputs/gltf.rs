//! glTF: JSON with a buffer beside it or within it, and GLB.

use super::{Files, Format, Verdict, harmed_image, imported, ktx2, le16, le32};
use crate::kind::Fault;
use crate::mutate::{Harm, chunks};
use crate::random::Random;
use serde_json::{Value, json};
use std::path::Path;

const U8: u32 = 5121;
const U16: u32 = 5123;
const U32: u32 = 5125;
const F32: u32 = 5126;

/// Keys and texts of glTF.
pub const NAMES: &[&str] = &[
    "accessors",
    "bufferViews",
    "buffers",
    "byteOffset",
    "byteLength",
    "byteStride",
    "bufferView",
    "buffer",
    "count",
    "componentType",
    "type",
    "normalized",
    "sparse",
    "indices",
    "values",
    "POSITION",
    "NORMAL",
    "TANGENT",
    "TEXCOORD_0",
    "TEXCOORD_1",
    "COLOR_0",
    "SCALAR",
    "VEC2",
    "VEC3",
    "VEC4",
    "MAT4",
    "mode",
    "material",
    "meshes",
    "mesh",
    "nodes",
    "children",
    "matrix",
    "translation",
    "rotation",
    "scale",
    "scene",
    "scenes",
    "uri",
    "images",
    "mimeType",
    "image/png",
    "image/jpeg",
    "image/webp",
    "image/ktx2",
    "textures",
    "source",
    "sampler",
    "extensions",
    "extensionsRequired",
    "extensionsUsed",
    "KHR_draco_mesh_compression",
    "EXT_meshopt_compression",
    "KHR_mesh_quantization",
    "EXT_mesh_gpu_instancing",
    "KHR_texture_basisu",
    "EXT_texture_webp",
    "KHR_texture_transform",
    "KHR_lights_punctual",
    "KHR_materials_unlit",
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_emissive_strength",
    "KHR_materials_transmission",
    "KHR_materials_volume",
    "KHR_materials_iridescence",
    "KHR_materials_anisotropy",
    "asset",
    "version",
    "2.0",
    "alphaMode",
    "MASK",
    "BLEND",
    "alphaCutoff",
    "doubleSided",
    "texCoord",
    "skin",
    "weights",
    "targets",
    "attributes",
    "ATTRIBUTES",
    "TRIANGLES",
    "INDICES",
    "filter",
    "OCTAHEDRAL",
    "QUATERNION",
    "EXPONENTIAL",
    "fallback",
];

/// An asset in the making: JSON, and one buffer.
pub struct Asset {
    /// The JSON.
    pub root: Value,
    /// The buffer.
    pub binary: Vec<u8>,
}

/// An extension of a material: its name, and what it says.
fn extension(random: &mut Random, is_textured: bool) -> (&'static str, Value) {
    let (name, mut value, textures): (_, _, &[&str]) = match random.below(11) {
        0 => ("KHR_materials_ior", json!({"ior": random.pick([0.0, 0.5, 1.0, 1.5, 9.0])}), &[]),
        1 => ("KHR_materials_emissive_strength", json!({"emissiveStrength": 4}), &[]),
        2 => ("KHR_materials_transmission", json!({"transmissionFactor": 0.5}), &["transmissionTexture"]),
        3 => (
            "KHR_materials_specular",
            json!({"specularFactor": 0.5, "specularColorFactor": [1, 0.5, 2]}),
            &["specularTexture", "specularColorTexture"],
        ),
        4 => (
            "KHR_materials_clearcoat",
            json!({"clearcoatFactor": 1, "clearcoatRoughnessFactor": 0.25}),
            &["clearcoatTexture", "clearcoatRoughnessTexture", "clearcoatNormalTexture"],
        ),
        5 => (
            "KHR_materials_pbrSpecularGlossiness",
            json!({"glossinessFactor": 0.5, "specularFactor": [1, 0, 0.5], "diffuseFactor": [1, 0.5, 0.25, 1]}),
            &["diffuseTexture", "specularGlossinessTexture"],
        ),
        6 => (
            "KHR_materials_volume",
            json!({"thicknessFactor": random.pick([0.0, 0.5]), "attenuationDistance": 2,
                "attenuationColor": [1, 0.5, 0.25]}),
            &["thicknessTexture"],
        ),
        7 => (
            "KHR_materials_sheen",
            json!({"sheenColorFactor": [1, 0.5, 0], "sheenRoughnessFactor": 0.5}),
            &["sheenColorTexture", "sheenRoughnessTexture"],
        ),
        8 => (
            "KHR_materials_anisotropy",
            json!({"anisotropyStrength": 0.5, "anisotropyRotation": random.pick([0.0, 1.0, 1e300])}),
            &["anisotropyTexture"],
        ),
        9 => (
            "KHR_materials_iridescence",
            json!({"iridescenceFactor": 1, "iridescenceIor": 1.3, "iridescenceThicknessMinimum": 100}),
            &["iridescenceTexture", "iridescenceThicknessTexture"],
        ),
        _ => ("KHR_materials_unlit", json!({}), &[]),
    };
    if is_textured {
        for texture in textures {
            if random.chance(50) {
                value[*texture] = json!({"index": 0, "texCoord": random.pick([0, 0, 0, 1, 2])});
            }
        }
    }
    (name, value)
}

impl Asset {
    fn push(&mut self, list: &str, value: Value) -> usize {
        match self.root[list].as_array_mut() {
            Some(list) => {
                list.push(value);
                list.len() - 1
            }
            None => {
                self.root[list] = json!([value]);
                0
            }
        }
    }

    /// A buffer view of its own for `bytes`.
    pub fn view(&mut self, bytes: &[u8]) -> usize {
        self.binary.resize(self.binary.len().next_multiple_of(4), 0xcd);
        let offset = self.binary.len();
        self.binary.extend_from_slice(bytes);
        self.push("bufferViews", json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()}))
    }

    fn accessor(&mut self, bytes: &[u8], component: u32, kind: &str, count: usize) -> usize {
        let view = self.view(bytes);
        self.push("accessors", json!({"bufferView": view, "componentType": component, "type": kind, "count": count}))
    }

    fn floats(&mut self, kind: &str, values: &[f32], width: usize) -> usize {
        self.accessor(&le32(values), F32, kind, values.len() / width)
    }

    /// A small asset with some of what importing follows.
    pub fn random(random: &mut Random, harm: Harm) -> Self {
        let root = json!({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}]});
        let mut asset = Self { root, binary: Vec::new() };
        let vertices = random.within(3, 12);
        let mut number = || (random.below(2001) as f32 - 1000.0) / 64.0;
        let positions: Vec<f32> = (0..3 * vertices).map(|_| number()).collect();
        let unit: Vec<f32> = (0..vertices).flat_map(|_| [0.0, 0.0, 1.0]).collect();
        let uvs: Vec<f32> = (0..2 * vertices).map(|_| number()).collect();
        let position = asset.floats("VEC3", &positions, 3);
        let mut attributes = json!({"POSITION": position});
        if random.chance(60) {
            attributes["NORMAL"] = json!(asset.floats("VEC3", &unit, 3));
        }
        if random.chance(60) {
            attributes["TEXCOORD_0"] = json!(asset.floats("VEC2", &uvs, 2));
        }
        if random.chance(20) {
            attributes["TEXCOORD_1"] = json!(asset.floats("VEC2", &uvs, 2));
        }
        if random.chance(30) {
            attributes["COLOR_0"] = json!(asset.accessor(&vec![9; 4 * vertices], U8, "VEC4", vertices));
        }
        if random.chance(20) {
            let tangents: Vec<f32> = (0..vertices).flat_map(|_| [1.0, 0.0, 0.0, 1.0]).collect();
            attributes["TANGENT"] = json!(asset.floats("VEC4", &tangents, 4));
        }
        let mut primitive = json!({"attributes": attributes, "mode": random.pick([4, 4, 4, 5, 6])});
        if random.chance(70) {
            let count = 3 * random.within(1, 8);
            let indices: Vec<u16> = (0..count).map(|_| random.below(vertices) as u16).collect();
            let wide: Vec<u8> = indices.iter().flat_map(|index| u32::from(*index).to_le_bytes()).collect();
            let narrow: Vec<u8> = indices.iter().map(|index| *index as u8).collect();
            primitive["indices"] = json!(match random.below(3) {
                0 => asset.accessor(&narrow, U8, "SCALAR", count),
                1 => asset.accessor(&le16(&indices), U16, "SCALAR", count),
                _ => asset.accessor(&wide, U32, "SCALAR", count),
            });
        }
        if random.chance(20) {
            let (indices, values) = (asset.view(&le16(&[0, 2])), asset.view(&le32(&[0.5; 6])));
            asset.root["accessors"][0]["sparse"] = json!({"count": 2,
                "indices": {"bufferView": indices, "componentType": U16}, "values": {"bufferView": values}});
        }
        if random.chance(60) {
            primitive["material"] = json!(0);
            asset.material(random, harm);
        }
        asset.push("meshes", json!({"primitives": [primitive]}));
        asset.nodes(random);
        asset
    }

    fn material(&mut self, random: &mut Random, harm: Harm) {
        let mut material = json!({"pbrMetallicRoughness": {"baseColorFactor": [1, 0.5, 0.25, 0.5]},
            "alphaMode": random.pick(["OPAQUE", "MASK", "BLEND"])});
        if random.chance(50) {
            let bytes = harmed_image(random, harm, 20);
            let image = self.view(&bytes);
            let mime = random.pick(["image/png", "image/jpeg", "image/webp"]);
            self.push("images", json!({"bufferView": image, "mimeType": mime}));
            self.push("samplers", json!({"wrapS": 33071, "wrapT": 33648}));
            self.push("textures", json!({"source": 0, "sampler": 0}));
            if random.chance(20) {
                let bytes = ktx2(random, harm);
                let image = self.view(&bytes);
                let image = self.push("images", json!({"bufferView": image, "mimeType": "image/ktx2"}));
                self.root["textures"][0]["extensions"]["KHR_texture_basisu"] = json!({"source": image});
            }
            let mut texture = json!({"index": 0});
            if random.chance(30) {
                texture["extensions"]["KHR_texture_transform"] = json!({"offset": [0.5, 1], "rotation": 1, "scale": 2});
                texture["extensions"]["KHR_texture_transform"]["scale"] = json!([2, 0.5]);
            }
            let slot = random.pick(["normalTexture", "emissiveTexture", "occlusionTexture"]);
            material[slot] = texture.clone();
            material["emissiveFactor"] = json!([1, 0.5, 0.25]);
            if slot == "normalTexture" {
                material[slot]["scale"] = json!(random.pick([1.0, 0.5, -1.0, 1e30]));
            }
            if random.chance(30) {
                material["pbrMetallicRoughness"]["metallicRoughnessTexture"] = texture.clone();
            }
            material["pbrMetallicRoughness"]["baseColorTexture"] = texture;
        }
        let is_textured = !self.root["textures"].is_null();
        for _ in 0..random.pick([0, 0, 1, 1, 2, 4]) {
            let (name, extension) = extension(random, is_textured);
            material["extensions"][name] = extension;
        }
        self.push("materials", material);
    }

    fn nodes(&mut self, random: &mut Random) {
        self.push("nodes", json!({"mesh": 0, "rotation": [0, 1, 0, 0], "name": "a"}));
        if random.chance(40) {
            let matrix = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1];
            let child = self.push("nodes", json!({"mesh": 0, "matrix": matrix, "name": "b"}));
            self.root["nodes"][0]["children"] = json!([child]);
        }
        if random.chance(25) {
            let translation = self.floats("VEC3", &[1.0; 6], 3);
            let instances = json!({"attributes": {"TRANSLATION": translation}});
            self.root["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"] = instances;
        }
        if random.chance(10) {
            self.root["scenes"] = json!([{"nodes": [0], "name": "first"}, {"nodes": [0, 0]}]);
        }
        if random.chance(20) {
            let light = json!({"type": random.pick(["point", "spot", "directional"]), "intensity": 3});
            self.root["extensions"]["KHR_lights_punctual"] = json!({"lights": [light]});
            self.root["nodes"][0]["extensions"]["KHR_lights_punctual"] = json!({"light": 0});
        }
    }

    /// States the buffer, as `uri` where it is not the chunk of a GLB.
    pub fn with_buffer(&mut self, uri: Option<&str>) {
        let mut buffer = json!({"byteLength": self.binary.len()});
        if let Some(uri) = uri {
            buffer["uri"] = json!(uri);
        }
        self.root["buffers"] = json!([buffer]);
    }
}

/// GLB.
pub struct Glb;

impl Format for Glb {
    const NAME: &'static str = "inputs/glb";
    const ABOUT: &'static str =
        "GLB: its JSON, its buffer, its chunks; one in sixteen that is read is built and verified";

    fn make(&self, random: &mut Random, harm: Harm) -> Files {
        let mut asset = Asset::random(random, harm);
        asset.with_buffer(None);
        harm.json(random, &mut asset.root, NAMES, 65);
        harm.bytes(random, &mut asset.binary, 25);
        let mut bytes = chunks::glb(asset.root.to_string().as_bytes(), &asset.binary);
        if harm.does(random, 8) {
            chunks::change_glb(random, &mut bytes);
        }
        harm.bytes(random, &mut bytes, 12);
        Files::one("a.glb", bytes)
    }

    fn read(&self, random: &mut Random, files: &Files, folder: &Path) -> Result<Verdict, Fault> {
        imported::read(random, files, folder, imported::TRIANGLES_A_BYTE)
    }
}

/// glTF as JSON.
pub struct Gltf;

impl Format for Gltf {
    const NAME: &'static str = "inputs/gltf";
    const ABOUT: &'static str = "glTF as JSON, its buffer and images in files beside it or in data URIs";

    fn make(&self, random: &mut Random, harm: Harm) -> Files {
        let mut asset = Asset::random(random, harm);
        let hex: String = asset.binary.iter().map(|byte| format!("%{byte:02x}")).collect();
        let uri = random.pick(["a.bin", "a%2ebin", "data"]);
        let mut others = Vec::new();
        if uri == "data" {
            asset.with_buffer(Some(&format!("data:application/octet-stream,{hex}")));
        } else {
            asset.with_buffer(Some(uri));
            harm.bytes(random, &mut asset.binary, 20);
            others.push(("a.bin".to_owned(), asset.binary.clone()));
        }
        if !asset.root["images"].is_null() && random.chance(50) {
            asset.root["images"][0] = json!({"uri": "b/c.png"});
            others.push(("b/c.png".to_owned(), harmed_image(random, harm, 40)));
        }
        harm.json(random, &mut asset.root, NAMES, 75);
        let mut text = asset.root.to_string().into_bytes();
        harm.bytes(random, &mut text, 12);
        Files([vec![("a.gltf".to_owned(), text)], others].concat())
    }

    fn read(&self, random: &mut Random, files: &Files, folder: &Path) -> Result<Verdict, Fault> {
        imported::read(random, files, folder, imported::TRIANGLES_A_BYTE)
    }
}
