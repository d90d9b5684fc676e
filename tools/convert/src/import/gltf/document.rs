//! The parts of the glTF JSON that importing reads (glTF 2.0, section 5).
//!
//! These are our own structures rather than those of `gltf-json` because that crate keeps node matrices in f32 and
//! truncates indices to 32 bits, so that index 4294967296 would pass for 0. What is not listed here is skipped without
//! being kept, so that a defect of a camera or an animation cannot spoil the geometry.

use crate::import::error::one_line;
use serde::de::{DeserializeOwned, Error, IgnoredAny, Unexpected, Visitor};
use serde::{Deserialize, Deserializer};
use std::collections::BTreeMap;
use std::fmt;

/// An index into one of the lists of [`Document`]; not yet checked.
pub(super) type Index = Uint;

/// An unsigned integer, which JSON may also write as 3.0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Uint(pub u64);

impl<'de> Deserialize<'de> for Uint {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Digits;
        impl Visitor<'_> for Digits {
            type Value = Uint;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a non-negative integer")
            }

            fn visit_u64<E: Error>(self, value: u64) -> Result<Uint, E> {
                Ok(Uint(value))
            }

            fn visit_f64<E: Error>(self, value: f64) -> Result<Uint, E> {
                // Beyond 2^53 a float is no exact integer any more.
                if (0.0..=9007199254740992.0).contains(&value) && value.fract() == 0.0 {
                    Ok(Uint(value as u64))
                } else {
                    Err(E::invalid_value(Unexpected::Float(value), &self))
                }
            }
        }
        deserializer.deserialize_u64(Digits)
    }
}

impl fmt::Display for Uint {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// Something that leaves geometry alone: malformed, it is not there, and the reason is kept.
#[derive(Debug)]
pub(super) struct Lenient<T>(pub Result<T, String>);

impl<'de, T: DeserializeOwned> Deserialize<'de> for Lenient<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = serde_json::Value::deserialize(deserializer)?;
        Ok(Self(T::deserialize(value).map_err(|e| one_line(&e.to_string()))))
    }
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Document {
    pub asset: Asset,
    pub scene: Option<Index>,
    #[serde(default)]
    pub scenes: Vec<Scene>,
    #[serde(default)]
    pub nodes: Vec<Node>,
    #[serde(default)]
    pub meshes: Vec<Mesh>,
    #[serde(default)]
    pub accessors: Vec<Accessor>,
    #[serde(default)]
    pub buffer_views: Vec<BufferView>,
    #[serde(default)]
    pub buffers: Vec<Buffer>,
    #[serde(default)]
    pub materials: Vec<Lenient<Material>>,
    #[serde(default)]
    pub textures: Vec<Lenient<Texture>>,
    #[serde(default)]
    pub images: Vec<Lenient<Image>>,
    #[serde(default)]
    pub samplers: Vec<Lenient<Sampler>>,
    #[serde(default)]
    pub animations: Vec<IgnoredAny>,
    #[serde(default)]
    pub extensions: DocumentExtensions,
    #[serde(default)]
    pub extensions_used: Vec<String>,
    #[serde(default)]
    pub extensions_required: Vec<String>,
}

#[derive(Debug, Default, Deserialize)]
pub(super) struct DocumentExtensions {
    #[serde(rename = "CESIUM_RTC")]
    pub rtc: Option<Rtc>,
    #[serde(rename = "KHR_lights_punctual", default)]
    pub lights: Lights,
}

/// KHR_lights_punctual.
#[derive(Debug, Default, Deserialize)]
pub(super) struct Lights {
    #[serde(default)]
    pub lights: Vec<Lenient<Light>>,
}

/// A light of KHR_lights_punctual.
#[derive(Debug, Deserialize)]
pub(super) struct Light {
    #[serde(rename = "type")]
    pub kind: String,
    pub color: Option<[f64; 3]>,
    pub intensity: Option<f64>,
    pub range: Option<f64>,
    #[serde(default)]
    pub spot: Spot,
}

/// The cone of a spot.
#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Spot {
    pub inner_cone_angle: Option<f64>,
    pub outer_cone_angle: Option<f64>,
}

/// CESIUM_RTC: the point that all coordinates are relative to.
#[derive(Debug, Deserialize)]
pub(super) struct Rtc {
    pub center: [f64; 3],
}

/// The version alone, for files of other versions, whose other parts have other types.
#[derive(Debug, Deserialize)]
pub(super) struct VersionOnly {
    pub asset: Asset,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Asset {
    pub version: String,
    pub min_version: Option<String>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Scene {
    pub name: Option<String>,
    #[serde(default)]
    pub nodes: Vec<Index>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Node {
    pub name: Option<String>,
    pub mesh: Option<Index>,
    pub skin: Option<Index>,
    #[serde(default)]
    pub children: Vec<Index>,
    /// Column-major; boxed because few nodes have one.
    pub matrix: Option<Box<[f64; 16]>>,
    pub translation: Option<[f64; 3]>,
    /// Quaternion x, y, z, w.
    pub rotation: Option<[f64; 4]>,
    pub scale: Option<[f64; 3]>,
    #[serde(default)]
    pub extensions: NodeExtensions,
}

#[derive(Debug, Default, Deserialize)]
pub(super) struct NodeExtensions {
    #[serde(rename = "EXT_mesh_gpu_instancing")]
    pub instancing: Option<Instancing>,
    #[serde(rename = "KHR_lights_punctual")]
    pub light: Option<Lenient<LightOfNode>>,
}

/// The light of a node.
#[derive(Debug, Deserialize)]
pub(super) struct LightOfNode {
    pub light: Index,
}

/// EXT_mesh_gpu_instancing: accessors of one transformation an instance.
#[derive(Debug, Deserialize)]
pub(super) struct Instancing {
    #[serde(default)]
    pub attributes: BTreeMap<String, Index>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Mesh {
    pub name: Option<String>,
    pub primitives: Vec<Primitive>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Primitive {
    pub attributes: BTreeMap<String, Index>,
    pub indices: Option<Index>,
    pub material: Option<Index>,
    pub mode: Option<Uint>,
    #[serde(default)]
    pub targets: Vec<IgnoredAny>,
    #[serde(default)]
    pub extensions: PrimitiveExtensions,
}

#[derive(Debug, Default, Deserialize)]
pub(super) struct PrimitiveExtensions {
    #[serde(rename = "KHR_draco_mesh_compression")]
    pub draco: Option<Draco>,
}

/// KHR_draco_mesh_compression.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Draco {
    pub buffer_view: Index,
    /// Unique ids of attributes in the compressed mesh.
    pub attributes: BTreeMap<String, Uint>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Accessor {
    pub buffer_view: Option<Index>,
    #[serde(default)]
    pub byte_offset: Uint,
    pub component_type: Uint,
    #[serde(default)]
    pub normalized: bool,
    pub count: Uint,
    #[serde(rename = "type")]
    pub kind: String,
    pub sparse: Option<Box<Sparse>>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Sparse {
    pub count: Uint,
    pub indices: SparseIndices,
    pub values: SparseValues,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SparseIndices {
    pub buffer_view: Index,
    #[serde(default)]
    pub byte_offset: Uint,
    pub component_type: Uint,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SparseValues {
    pub buffer_view: Index,
    #[serde(default)]
    pub byte_offset: Uint,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct BufferView {
    pub buffer: Index,
    #[serde(default)]
    pub byte_offset: Uint,
    pub byte_length: Uint,
    pub byte_stride: Option<Uint>,
    #[serde(default)]
    pub extensions: BufferViewExtensions,
}

#[derive(Debug, Default, Deserialize)]
pub(super) struct BufferViewExtensions {
    #[serde(rename = "EXT_meshopt_compression")]
    pub meshopt: Option<Box<Meshopt>>,
    #[serde(rename = "KHR_meshopt_compression")]
    pub khr_meshopt: Option<Box<Meshopt>>,
}

impl BufferViewExtensions {
    /// The compression, by either name.
    pub fn compression(&self) -> Option<&Meshopt> {
        self.meshopt.as_deref().or(self.khr_meshopt.as_deref())
    }
}

/// EXT_meshopt_compression, and KHR_meshopt_compression, which adds a filter and a version of the codec.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Meshopt {
    pub buffer: Index,
    #[serde(default)]
    pub byte_offset: Uint,
    pub byte_length: Uint,
    pub byte_stride: Uint,
    pub count: Uint,
    pub mode: String,
    #[serde(default)]
    pub filter: Option<String>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Buffer {
    pub uri: Option<String>,
    pub byte_length: Uint,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Material {
    pub name: Option<String>,
    #[serde(default)]
    pub pbr_metallic_roughness: MetallicRoughness,
    #[serde(default)]
    pub emissive_factor: [f64; 3],
    pub normal_texture: Option<TextureInfo>,
    pub occlusion_texture: Option<TextureInfo>,
    pub emissive_texture: Option<TextureInfo>,
    pub alpha_mode: Option<String>,
    pub alpha_cutoff: Option<f64>,
    #[serde(default)]
    pub double_sided: bool,
    #[serde(default)]
    pub extensions: MaterialExtensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct MetallicRoughness {
    pub base_color_factor: Option<[f64; 4]>,
    pub base_color_texture: Option<TextureInfo>,
    pub metallic_factor: Option<f64>,
    pub roughness_factor: Option<f64>,
    pub metallic_roughness_texture: Option<TextureInfo>,
}

#[derive(Debug, Default, Deserialize)]
pub(super) struct MaterialExtensions {
    #[serde(rename = "KHR_materials_unlit")]
    pub unlit: Option<IgnoredAny>,
    #[serde(rename = "KHR_materials_emissive_strength")]
    pub emissive_strength: Option<EmissiveStrength>,
    #[serde(rename = "KHR_materials_ior")]
    pub ior: Option<Ior>,
    #[serde(rename = "KHR_materials_specular")]
    pub specular: Option<Specular>,
    #[serde(rename = "KHR_materials_clearcoat")]
    pub clearcoat: Option<Clearcoat>,
    #[serde(rename = "KHR_materials_transmission")]
    pub transmission: Option<Transmission>,
    #[serde(rename = "KHR_materials_pbrSpecularGlossiness")]
    pub specular_glossiness: Option<SpecularGlossiness>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct EmissiveStrength {
    pub emissive_strength: Option<f64>,
}

/// KHR_materials_ior.
#[derive(Debug, Deserialize)]
pub(super) struct Ior {
    pub ior: Option<f64>,
}

/// KHR_materials_specular.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Specular {
    pub specular_factor: Option<f64>,
    pub specular_texture: Option<IgnoredAny>,
    pub specular_color_factor: Option<[f64; 3]>,
    pub specular_color_texture: Option<IgnoredAny>,
}

/// KHR_materials_clearcoat.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Clearcoat {
    pub clearcoat_factor: Option<f64>,
    pub clearcoat_texture: Option<IgnoredAny>,
    pub clearcoat_roughness_factor: Option<f64>,
    pub clearcoat_roughness_texture: Option<IgnoredAny>,
    pub clearcoat_normal_texture: Option<IgnoredAny>,
}

/// KHR_materials_transmission.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Transmission {
    pub transmission_factor: Option<f64>,
    pub transmission_texture: Option<IgnoredAny>,
}

/// KHR_materials_pbrSpecularGlossiness.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SpecularGlossiness {
    pub diffuse_factor: Option<[f64; 4]>,
    pub diffuse_texture: Option<TextureInfo>,
    pub specular_factor: Option<[f64; 3]>,
    pub glossiness_factor: Option<f64>,
    pub specular_glossiness_texture: Option<IgnoredAny>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct TextureInfo {
    pub index: Index,
    #[serde(default)]
    pub tex_coord: Uint,
    /// Of a normal texture.
    pub scale: Option<f64>,
    /// Of an occlusion texture.
    pub strength: Option<f64>,
    #[serde(default)]
    pub extensions: TextureInfoExtensions,
}

#[derive(Debug, Default, Deserialize)]
pub(super) struct TextureInfoExtensions {
    #[serde(rename = "KHR_texture_transform")]
    pub transform: Option<TextureTransform>,
}

/// KHR_texture_transform.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct TextureTransform {
    pub offset: Option<[f64; 2]>,
    pub rotation: Option<f64>,
    pub scale: Option<[f64; 2]>,
    pub tex_coord: Option<Uint>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Texture {
    pub source: Option<Index>,
    pub sampler: Option<Index>,
    #[serde(default)]
    pub extensions: TextureExtensions,
}

#[derive(Debug, Default, Deserialize)]
pub(super) struct TextureExtensions {
    #[serde(rename = "KHR_texture_basisu")]
    pub basisu: Option<ImageSource>,
    #[serde(rename = "EXT_texture_webp")]
    pub webp: Option<ImageSource>,
}

/// The image of a texture in another format.
#[derive(Debug, Deserialize)]
pub(super) struct ImageSource {
    pub source: Option<Index>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Image {
    pub name: Option<String>,
    pub uri: Option<String>,
    pub buffer_view: Option<Index>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Sampler {
    pub wrap_s: Option<Uint>,
    pub wrap_t: Option<Uint>,
    pub mag_filter: Option<Uint>,
}
