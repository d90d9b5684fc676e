//! The glTF JSON (glTF 2.0, section 5) in the structures of [`gltf::json`], and what they lack.
//!
//! - [`Document`] and [`Mesh`] skip cameras and animations, whose defects must not spoil the geometry. [`Lenient`] does
//!   the same for materials and textures, and keeps what is wrong with them.
//! - [`Object`] drops bounds and extras, so that memory does not grow with them. It accepts integers written as 3.0.
//!   The crate truncates indices to 32 bits, so that 4294967296 would pass for 0; here it becomes [`BEYOND`].
//! - [`Node`] has its matrix in f64. A [`Scene`] need not list nodes, as the specification allows.
//! - Extensions, and factors that they multiply, are read in f64.
//!
//! Nothing here is checked beyond its type.

use crate::import::error::one_line;
use gltf::json::{self, Index};
use serde::de::{DeserializeOwned, Error, IgnoredAny};
use serde::{Deserialize, Deserializer};
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use std::ops::Deref;

/// Stands for every index from this one on: no list is as long. The crate takes the one behind it for an absent image.
pub(super) const BEYOND: u32 = u32::MAX - 1;

/// Fields that are not read: they must not take memory, nor spoil what is read where they are malformed.
const UNREAD: [&str; 8] = ["copyright", "extras", "generator", "max", "mimeType", "min", "minFilter", "target"];

/// A structure of the crate, and what it lacks of the same object.
#[derive(Debug)]
pub(super) struct Object<T, More = IgnoredAny> {
    pub json: T,
    pub more: More,
}

impl<T, More> Deref for Object<T, More> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.json
    }
}

impl<'de, T: DeserializeOwned, More: DeserializeOwned> Deserialize<'de> for Object<T, More> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut value = Value::deserialize(deserializer)?;
        tidy(&mut value, Number::Index);
        let more = More::deserialize(&value).map_err(D::Error::custom)?;
        Ok(Self { json: T::deserialize(value).map_err(D::Error::custom)?, more })
    }
}

/// What a number is, by the name of its field.
#[derive(Clone, Copy, PartialEq)]
enum Number {
    /// An index or a code of at most 32 bits.
    Index,
    /// An integer of at most 64 bits.
    Length,
    Float,
}

impl Number {
    fn of(field: &str) -> Self {
        match field {
            "buffer" | "bufferView" | "children" | "index" | "indices" | "light" | "material" | "mesh" | "nodes"
            | "sampler" | "skin" | "source" => Self::Index,
            "componentType" | "magFilter" | "mode" | "texCoord" | "wrapS" | "wrapT" => Self::Index,
            "byteLength" | "byteOffset" | "byteStride" | "count" => Self::Length,
            _ => Self::Float,
        }
    }
}

/// Makes integers integers, and leaves out what is not read, also nulls, which stand for absent fields.
fn tidy(value: &mut Value, kind: Number) {
    match value {
        Value::Array(values) => values.iter_mut().for_each(|value| tidy(value, kind)),
        Value::Object(fields) => {
            fields.retain(|name, value| !UNREAD.contains(&name.as_str()) && !value.is_null());
            for (name, value) in fields {
                match (name.as_str(), value) {
                    ("attributes", Value::Object(indices)) => {
                        indices.values_mut().for_each(|index| tidy(index, Number::Index));
                    }
                    // They are counted, not followed.
                    ("targets", Value::Array(targets)) => targets.fill(Value::Object(Map::new())),
                    (name, value) => tidy(value, Number::of(name)),
                }
            }
        }
        Value::Number(number) if kind != Number::Float => {
            // Beyond 2^53 a float is no exact integer any more.
            let is_exact = |x: &f64| (0.0..=9007199254740992.0).contains(x) && x.fract() == 0.0;
            let integer = number.as_u64().or_else(|| number.as_f64().filter(is_exact).map(|x| x as u64));
            if let Some(integer) = integer {
                let most = if kind == Number::Index { BEYOND.into() } else { u64::MAX };
                *number = integer.min(most).into();
            }
        }
        _ => {}
    }
}

/// Something that leaves geometry alone: malformed, it is not there, and the reason is kept.
#[derive(Debug)]
pub(super) struct Lenient<T>(pub Result<T, String>);

impl<'de, T: DeserializeOwned> Deserialize<'de> for Lenient<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = Value::deserialize(deserializer)?;
        Ok(Self(T::deserialize(value).map_err(|e| one_line(&e.to_string()))))
    }
}

/// What is read of a file.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Document {
    pub asset: Object<json::Asset>,
    pub scene: Option<Object<Index<json::Scene>>>,
    #[serde(default)]
    pub scenes: Vec<Object<Scene>>,
    #[serde(default)]
    pub nodes: Vec<Object<Node>>,
    #[serde(default)]
    pub meshes: Vec<Mesh>,
    #[serde(default)]
    pub accessors: Vec<Object<json::Accessor>>,
    #[serde(default)]
    pub buffer_views: Vec<View>,
    #[serde(default)]
    pub buffers: Vec<Object<json::Buffer, BufferMore>>,
    #[serde(default)]
    pub materials: Vec<Lenient<Material>>,
    #[serde(default)]
    pub textures: Vec<Lenient<Object<json::Texture, Extended<TextureExtensions>>>>,
    #[serde(default)]
    pub images: Vec<Lenient<Object<json::Image, Named>>>,
    #[serde(default)]
    pub samplers: Vec<Lenient<Object<json::texture::Sampler>>>,
    #[serde(default)]
    pub animations: Vec<IgnoredAny>,
    #[serde(default)]
    pub extensions: DocumentExtensions,
    #[serde(default)]
    pub extensions_used: Vec<String>,
    #[serde(default)]
    pub extensions_required: Vec<String>,
}

/// A view of a buffer.
pub(super) type View = Object<json::buffer::View, Extended<ViewExtensions>>;

/// A part of a mesh.
pub(super) type Primitive = Object<json::mesh::Primitive, Extended<PrimitiveExtensions>>;

/// A material.
pub(super) type Material = Object<json::Material, MaterialMore>;

/// The extensions of an object.
#[derive(Debug, Deserialize)]
#[serde(bound = "E: Default + DeserializeOwned")]
pub(super) struct Extended<E> {
    #[serde(default)]
    pub extensions: E,
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

/// CESIUM_RTC: the point that all coordinates are relative to.
#[derive(Debug, Deserialize)]
pub(super) struct Rtc {
    pub center: [f64; 3],
}

/// The version alone, for files of other versions, whose other parts have other types.
#[derive(Debug, Deserialize)]
pub(super) struct VersionOnly {
    pub asset: Object<json::Asset>,
}

/// The root nodes of a scene.
#[derive(Debug, Deserialize)]
pub(super) struct Scene {
    pub name: Option<String>,
    #[serde(default)]
    pub nodes: Vec<Index<json::Node>>,
}

/// A node.
#[derive(Debug, Deserialize)]
pub(super) struct Node {
    pub name: Option<String>,
    pub mesh: Option<Index<json::Mesh>>,
    pub skin: Option<IgnoredAny>,
    #[serde(default)]
    pub children: Vec<Index<json::Node>>,
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
    pub light: Index<Light>,
}

/// EXT_mesh_gpu_instancing: accessors of one transformation an instance.
#[derive(Debug, Deserialize)]
pub(super) struct Instancing {
    #[serde(default)]
    pub attributes: BTreeMap<String, Index<json::Accessor>>,
}

/// A mesh.
#[derive(Debug, Deserialize)]
pub(super) struct Mesh {
    pub name: Option<String>,
    pub primitives: Vec<Primitive>,
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
    pub buffer_view: Index<json::buffer::View>,
    /// Unique ids of attributes in the compressed mesh.
    pub attributes: BTreeMap<String, u32>,
}

/// The length of a buffer, which the crate does not ask for.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct BufferMore {
    pub byte_length: u64,
}

#[derive(Debug, Default, Deserialize)]
pub(super) struct ViewExtensions {
    #[serde(rename = "EXT_meshopt_compression")]
    pub meshopt: Option<Box<Meshopt>>,
    #[serde(rename = "KHR_meshopt_compression")]
    pub khr_meshopt: Option<Box<Meshopt>>,
}

impl View {
    /// The compression, by either name.
    pub fn compression(&self) -> Option<&Meshopt> {
        let extensions = &self.more.extensions;
        extensions.meshopt.as_deref().or(extensions.khr_meshopt.as_deref())
    }
}

/// EXT_meshopt_compression, and KHR_meshopt_compression, which adds a filter and a version of the codec.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Meshopt {
    pub buffer: Index<json::Buffer>,
    #[serde(default)]
    pub byte_offset: u64,
    pub byte_length: u64,
    pub byte_stride: u64,
    pub count: u64,
    pub mode: String,
    #[serde(default)]
    pub filter: Option<String>,
}

/// Name, textures and extensions of a material, and what its extensions multiply.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct MaterialMore {
    pub name: Option<String>,
    #[serde(default)]
    pub pbr_metallic_roughness: MetallicRoughness,
    pub normal_texture: Option<TextureInfo>,
    pub occlusion_texture: Option<TextureInfo>,
    pub emissive_texture: Option<TextureInfo>,
    #[serde(default)]
    pub emissive_factor: [f64; 3],
    #[serde(default)]
    pub extensions: MaterialExtensions,
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
    #[serde(rename = "KHR_materials_sheen")]
    pub sheen: Option<Sheen>,
    #[serde(rename = "KHR_materials_anisotropy")]
    pub anisotropy: Option<Anisotropy>,
    #[serde(rename = "KHR_materials_iridescence")]
    pub iridescence: Option<Iridescence>,
    #[serde(rename = "KHR_materials_transmission")]
    pub transmission: Option<Transmission>,
    #[serde(rename = "KHR_materials_volume")]
    pub volume: Option<Volume>,
    #[serde(rename = "KHR_materials_pbrSpecularGlossiness")]
    pub specular_glossiness: Option<SpecularGlossiness>,
}

/// A texture of a material; the crate has its transformation in f32, and not for all.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct TextureInfo {
    pub index: Index<json::Texture>,
    #[serde(default)]
    pub tex_coord: u32,
    /// Of the normals of a clear coat.
    #[serde(default)]
    pub scale: Option<f64>,
    #[serde(default)]
    pub extensions: TextureInfoExtensions,
}

#[derive(Debug, Default, Deserialize)]
pub(super) struct TextureInfoExtensions {
    #[serde(rename = "KHR_texture_transform")]
    pub transform: Option<TextureTransform>,
}

#[derive(Debug, Default, Deserialize)]
pub(super) struct TextureExtensions {
    #[serde(rename = "KHR_texture_basisu")]
    pub basisu: Option<ImageSource>,
    #[serde(rename = "EXT_texture_webp")]
    pub webp: Option<ImageSource>,
}

/// Structures whose every field may be absent.
macro_rules! optional {
    ($($(#[$doc:meta])* $name:ident { $($field:ident: $kind:ty,)* })*) => { $(
        $(#[$doc])*
        #[derive(Debug, Default, Deserialize)]
        #[serde(rename_all = "camelCase")]
        pub(super) struct $name {
            $(pub $field: Option<$kind>,)*
        }
    )* };
}

optional! {
    /// A name. Few are read; those of all structures would take memory.
    Named {
        name: String,
    }
    /// The cone of a spot.
    Spot {
        inner_cone_angle: f64,
        outer_cone_angle: f64,
    }
    MetallicRoughness {
        base_color_texture: TextureInfo,
        metallic_roughness_texture: TextureInfo,
    }
    EmissiveStrength {
        emissive_strength: f64,
    }
    /// KHR_materials_ior.
    Ior {
        ior: f64,
    }
    /// KHR_materials_specular.
    Specular {
        specular_factor: f64,
        specular_texture: TextureInfo,
        specular_color_factor: [f64; 3],
        specular_color_texture: TextureInfo,
    }
    /// KHR_materials_clearcoat.
    Clearcoat {
        clearcoat_factor: f64,
        clearcoat_texture: TextureInfo,
        clearcoat_roughness_factor: f64,
        clearcoat_roughness_texture: TextureInfo,
        clearcoat_normal_texture: TextureInfo,
    }
    /// KHR_materials_sheen.
    Sheen {
        sheen_color_factor: [f64; 3],
        sheen_color_texture: TextureInfo,
        sheen_roughness_factor: f64,
        sheen_roughness_texture: TextureInfo,
    }
    /// KHR_materials_anisotropy.
    Anisotropy {
        anisotropy_strength: f64,
        anisotropy_rotation: f64,
        anisotropy_texture: TextureInfo,
    }
    /// KHR_materials_iridescence.
    Iridescence {
        iridescence_factor: f64,
        iridescence_texture: TextureInfo,
        iridescence_ior: f64,
        iridescence_thickness_minimum: f64,
        iridescence_thickness_maximum: f64,
        iridescence_thickness_texture: TextureInfo,
    }
    /// KHR_materials_transmission.
    Transmission {
        transmission_factor: f64,
        transmission_texture: TextureInfo,
    }
    /// KHR_materials_volume.
    Volume {
        thickness_factor: f64,
        attenuation_distance: f64,
        attenuation_color: [f64; 3],
    }
    /// KHR_materials_pbrSpecularGlossiness.
    SpecularGlossiness {
        diffuse_factor: [f64; 4],
        diffuse_texture: TextureInfo,
        specular_factor: [f64; 3],
        glossiness_factor: f64,
        specular_glossiness_texture: IgnoredAny,
    }
    /// KHR_texture_transform.
    TextureTransform {
        offset: [f64; 2],
        rotation: f64,
        scale: [f64; 2],
        tex_coord: u32,
    }
    /// The image of a texture in another format.
    ImageSource {
        source: Index<json::Image>,
    }
}
