//! What a scene has: the facts from which rendering decides what it can leave out.

use serde::{Deserialize, Serialize};

/// The manifest, stored as JSON in the resident part.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Version of the program that converted.
    pub generator: String,
    /// Sources: file name (without folders), byte length, xxh3-64 as 16 hex digits.
    pub sources: Vec<Source>,
    /// Largest number of triangles a brick was allowed.
    pub brick_triangles: u32,
    /// Triangles of all sources, instances multiplied out, dropped ones counted.
    pub triangle_ids: u64,
    /// Triangles stored, instances not multiplied out.
    pub triangles_stored: u64,
    /// Triangles with every instance multiplied out, dropped ones not counted.
    pub triangles_instanced: u64,
    /// Zero-area triangles dropped after rounding.
    pub dropped_zero_area: u64,
    /// Triangles dropped for a non-finite vertex (with the option that allows it).
    pub dropped_non_finite: u64,
    /// World bounds of everything, world units, finite. `min > max` on every axis when the scene is empty.
    pub min: [f64; 3],
    /// See [`Self::min`].
    pub max: [f64; 3],
    /// Any texture, of any kind, of a material in use.
    pub has_textures: bool,
    /// Any normal texture of a material in use.
    pub has_normal_maps: bool,
    /// Any material in use that reflects in another way than a Lambertian surface.
    pub is_glossy: bool,
    /// What the textures are called in the source, for messages.
    pub texture_names: Vec<String>,
    /// Any MASK material in use.
    pub has_alpha_mask: bool,
    /// Any BLEND material in use.
    pub has_alpha_blend: bool,
    /// Any emissive material in use.
    pub has_emission: bool,
    /// It stands in a room of its own, and its emitters are all that lights it: no sun and no sky shines on it.
    #[serde(default, skip_serializing_if = "is_false")]
    pub has_own_light: bool,
    /// Any instance besides the world.
    pub has_instances: bool,
    /// Any animation in the source (ignored, reported).
    pub has_animation: bool,
    /// Any wide brick, levels of detail not counted.
    pub has_wide_bricks: bool,
    /// Proxies: an occupancy map for every brick. Not in a scene without bricks.
    pub has_proxies: bool,
    /// Largest ratio of scales (κ) over the instances' matrices; 1 without instances.
    pub instance_scale_ratio: f64,
    /// Warnings of the conversion, one line each.
    pub warnings: Vec<String>,
    /// Which nodes were kept as instances of their own, as the conversion was asked: names, with * and ? for any
    /// characters and one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub movable: Vec<String>,
    /// Where ranges of global triangle ids come from, ascending, covering all ids; for `info --id`.
    pub provenance: Vec<Provenance>,
}

fn is_false(value: &bool) -> bool {
    !value
}

/// One input file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Source {
    /// File name without folders, or the generator's description.
    pub name: String,
    /// Length in bytes.
    pub bytes: u64,
    /// xxh3-64, 16 hex digits.
    pub hash: String,
}

/// A primitive of a node: the origin of a contiguous range of global triangle ids.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Provenance {
    /// First global id.
    pub first_id: u32,
    /// Number of ids.
    pub count: u32,
    /// Index into the sources.
    pub source: u32,
    /// Node name or index.
    pub node: String,
    /// Mesh name or index.
    pub mesh: String,
    /// Primitive within the mesh.
    pub primitive: u32,
    /// Names of the nodes above that [`Manifest::movable`] names, the outermost first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub under: Vec<String>,
}
