//! The records of a scene file, as they lie on disk and, where a kernel reads them, on the device.
//!
//! Every record is `#[repr(C)]`, little-endian, without implicit padding and valid for every bit pattern; what its
//! values must satisfy is checked by [`crate::validate`] before anything indexes with them.

use crate::layers::{MATERIAL_ANISOTROPIC, MATERIAL_LAYERS, MATERIAL_MORE};
use bytemuck::{Pod, Zeroable};
use std::ops::Range;

/// "No such thing", in every index field that may be absent.
pub const NONE: u32 = u32::MAX;

/// Children of a wide node.
pub const NODE_WIDTH: usize = 8;

/// Most triangles of one leaf child of a wide node.
pub const LEAF_TRIANGLES: u32 = 3;

/// Most levels of wide nodes in one brick, the root counted. Kernels reserve a stack of this depth.
pub const MAX_BRICK_HEIGHT: u32 = 24;

/// Most levels of wide nodes of the top-level tree, the root counted.
pub const MAX_TOP_HEIGHT: u32 = 24;

/// Most levels of the binary top-level tree, the root counted.
pub const MAX_TOP2_HEIGHT: u32 = 96;

/// Largest grid exponent of the 8-wide top-level tree: 255 grid steps stay within [`LATTICE_LIMIT`].
pub const MAX_TOP_EXPONENT: u8 = 53;

/// Largest magnitude of a lattice coordinate, so that differences and sums of two fit an i64.
pub const LATTICE_LIMIT: i64 = 1 << 61;

/// Largest magnitude of [`Object::step_log2`] and [`Object::unit_log2`].
pub const MAX_LATTICE_LOG2: u32 = 256;

/// log2 of the lattice steps allowed, in device units: coordinates of wide vertices and of nodes are normal f32.
pub const STEP_UNIT_LOG2: std::ops::RangeInclusive<i32> = -64..=32;

/// Most triangle ids of a scene; [`NONE`] and the id before it are never given.
pub const MAX_TRIANGLE_IDS: u64 = u32::MAX as u64 - 1;

/// Most texels of a texture each way. Level 0 is then 1 GiB, all levels less than [`crate::layout::MAX_PAYLOAD_BYTES`].
pub const MAX_TEXTURE_SIZE: u32 = 1 << 14;

/// Brick origins and frame reference points are multiples of this many lattice steps (docs/methods/exact.md).
pub const ORIGIN_STEPS: i64 = 1 << 20;

/// Largest magnitude, in lattice steps, of a vertex coordinate relative to the origin of a *near* brick.
pub const NEAR_STEPS: i64 = 1 << 24;

/// The high part of a *wide* vertex coordinate is a multiple of this many lattice steps.
pub const WIDE_HIGH_STEPS: i64 = 1 << 23;

/// Largest magnitude, in lattice steps, of a vertex coordinate relative to the origin of a *wide* brick.
pub const WIDE_STEPS: i64 = 1 << 46;

/// An 8-wide node with quantised child boxes (CWBVH: Ylitie, Karras, Laine 2017), 80 bytes.
///
/// Child `i` spans `origin[k] + lo[k][i] * 2^exponent[k] ..= origin[k] + hi[k][i] * 2^exponent[k]` on axis `k`, in
/// device units of the object and relative to the brick's origin. Origin and scale lie on the object's lattice, so the
/// expressions are exact but for the rounding of `origin` in wide bricks, which is outward.
///
/// `meta[i]` is 0 for an absent child; `0b001_00000 | (24 + i)` for an inner child, whose node index is `child_base` +
/// the number of inner children in slots below `i`; otherwise a leaf: the three high bits are the unary count of
/// its triangles (1, 3 or 7), the five low bits the first triangle relative to `triangle_base`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Node {
    /// Lower corner of the quantisation grid, device units of the object, relative to the brick's origin.
    pub origin: [f32; 3],
    /// log2 of the grid step per axis, in device units, biased by 127: the exponent field of an f32.
    pub exponent: [u8; 3],
    /// Bit `i` is set when child `i` is an inner node.
    pub inner_mask: u8,
    /// Index of the first inner child within the brick's nodes.
    pub child_base: u32,
    /// Index of the first triangle of the leaf children within the brick.
    pub triangle_base: u32,
    /// What each child is.
    pub meta: [u8; 8],
    /// Lower child bounds per axis, in grid steps.
    pub lo: [[u8; 8]; 3],
    /// Upper child bounds per axis, in grid steps.
    pub hi: [[u8; 8]; 3],
}

/// Bytes of one kind of payload of a brick within the file. All zero when the brick has none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Span {
    /// Offset in the file, a multiple of 4096.
    pub offset: u64,
    /// Length in bytes, a multiple of 16.
    pub bytes: u64,
    /// xxh3-64 of the bytes.
    pub checksum: u64,
}

impl Span {
    /// The bytes that it takes in the file.
    pub fn range(&self) -> Range<u64> {
        self.offset..self.offset.saturating_add(self.bytes)
    }
}

/// [`Brick::flags`]: vertices have a high and a low part (24 bytes).
pub const BRICK_WIDE: u32 = 1;
/// [`Brick::flags`]: indices are u32, not u16.
pub const BRICK_INDEX32: u32 = 2;
/// [`Brick::flags`]: rays may pass through some of its triangles, see [`OpacityTriangle`].
pub const BRICK_OPACITY: u32 = 4;

/// [`Brick::flags`]: attribute vertices have an [`AttributeDetail`] each.
pub const BRICK_DETAIL: u32 = 8;

/// A brick: the always-resident facts about one BVH subtree and where its payloads lie.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Brick {
    /// The object it is part of.
    pub object: u32,
    /// `BRICK_*` bits.
    pub flags: u32,
    /// Number of nodes; node 0 is the root.
    pub node_count: u32,
    /// Number of triangles.
    pub triangle_count: u32,
    /// Number of positions.
    pub vertex_count: u32,
    /// Number of attribute vertices (distinct normal, UV and colour).
    pub attribute_vertex_count: u32,
    /// Levels of wide nodes, the root counted.
    pub height: u32,
    /// Zero.
    pub _reserved0: u32,
    /// Origin in steps of the object's lattice; each a multiple of [`ORIGIN_STEPS`].
    pub origin: [i64; 3],
    /// Least vertex coordinates in steps of the object's lattice.
    pub min: [i64; 3],
    /// Greatest vertex coordinates in steps of the object's lattice.
    pub max: [i64; 3],
    /// What traversal reads: see [`GeometryLayout`].
    pub geometry: Span,
    /// What shading of hits reads, encoded: see [`crate::attributes`].
    pub attributes: Span,
    /// The packed [`crate::OccupancyMap`]; all zero in a scene without proxies.
    pub proxies: Span,
    /// Area-weighted mean linear base colour.
    pub mean_albedo: [f32; 3],
    /// Area-weighted mean linear emission.
    pub mean_emission: [f32; 3],
    /// Copy of node 0.
    pub root: Node,
    /// Number of [`OpacityTriangle`]s; with [`BRICK_OPACITY`] at least one.
    pub opacity_count: u32,
    /// Zero.
    pub _reserved1: [u32; 3],
}

/// An object: triangles on one lattice, placed by one or more instances. Object 0 is the world: everything baked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Object {
    /// log2 of the lattice step in object units.
    pub step_log2: i32,
    /// log2 of the device unit in object units: device length = object length / 2^unit_log2.
    pub unit_log2: i32,
    /// First brick; an object's bricks are contiguous.
    pub first_brick: u32,
    /// Number of bricks.
    pub brick_count: u32,
    /// Triangles of the source, dropped ones counted: ids of one instance span `base .. base + triangle_ids`.
    pub triangle_ids: u32,
    /// Triangles stored (a triangle split over bricks counts once).
    pub triangle_count: u32,
    /// Zero.
    pub _reserved: [u32; 2],
}

/// [`Instance::flags`]: the matrix is the identity and object units are world units (always instance 0).
pub const INSTANCE_IDENTITY: u32 = 1;
/// [`Instance::flags`]: the determinant of the matrix is negative.
pub const INSTANCE_MIRRORED: u32 = 2;

/// An object placed in the world.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Instance {
    /// The object.
    pub object: u32,
    /// Global id of the object's triangle 0 in this instance.
    pub base: u32,
    /// `INSTANCE_*` bits.
    pub flags: u32,
    /// Zero.
    pub _reserved: u32,
    /// world_from_object, row-major 3x4, world units from object units.
    pub world_from_object: [f64; 12],
}

impl Instance {
    /// The identity as a row-major 3x4 matrix.
    pub const IDENTITY: [f64; 12] = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];

    /// Determinant of the linear part of [`Self::world_from_object`]. Its sign decides [`INSTANCE_MIRRORED`].
    pub fn determinant(&self) -> f64 {
        let m = &self.world_from_object;
        m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8]) + m[2] * (m[4] * m[9] - m[5] * m[8])
    }
}

/// A leaf of the top-level tree: one brick of one instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Leaf {
    /// The instance.
    pub instance: u32,
    /// The brick.
    pub brick: u32,
}

/// [`TopNode2::right`]: the node is a leaf and [`TopNode2::left`] the index of a [`Leaf`].
pub const TOP_LEAF: u32 = NONE;

/// A node of the binary top-level tree, in steps of the world's lattice, bounds outward. Node 0 is the root;
/// children follow their parent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct TopNode2 {
    /// Least coordinates, world lattice steps.
    pub min: [i64; 3],
    /// Greatest coordinates, world lattice steps.
    pub max: [i64; 3],
    /// Left child, or the leaf.
    pub left: u32,
    /// Right child, or [`TOP_LEAF`].
    pub right: u32,
}

/// A node of the 8-wide top-level tree: like [`Node`], with an exact origin and scales in steps of the world's lattice;
/// each leaf child holds exactly one [`Leaf`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct TopNode8 {
    /// Lower corner of the quantisation grid, world lattice steps.
    pub origin: [i64; 3],
    /// log2 of the grid step per axis, in world lattice steps, ≥ 0.
    pub exponent: [u8; 3],
    /// Bit `i` is set when child `i` is an inner node.
    pub inner_mask: u8,
    /// Index of the first inner child.
    pub child_base: u32,
    /// Index of the first leaf.
    pub leaf_base: u32,
    /// As [`Node::meta`], leaves in place of triangles.
    pub meta: [u8; 8],
    /// Lower child bounds per axis, in grid steps.
    pub lo: [[u8; 8]; 3],
    /// Upper child bounds per axis, in grid steps.
    pub hi: [[u8; 8]; 3],
    /// Zero.
    pub _reserved: u32,
}

/// [`Material::flags`]: alpha MASK with [`Material::alpha_cutoff`].
pub const MATERIAL_MASK: u32 = 1;
/// [`Material::flags`]: alpha BLEND.
pub const MATERIAL_BLEND: u32 = 2;
/// [`Material::flags`]: both sides are drawn.
pub const MATERIAL_DOUBLE_SIDED: u32 = 4;
/// [`Material::flags`]: KHR_materials_unlit.
pub const MATERIAL_UNLIT: u32 = 8;
/// [`Material::flags`]: the surface of a closed body that bends light (KHR_materials_volume); together with BLEND.
/// Where paths do not follow light through it, rays pass as through thin walls.
pub const MATERIAL_REFRACTS: u32 = 16;

/// Textures of a material, each with its place in [`Material::uv_from_set`] and [`Material::uv_sets`].
pub const MATERIAL_TEXTURES: usize = 5;
/// Place of the base colour texture.
pub const BASE_COLOR: usize = 0;
/// Place of the normal texture.
pub const NORMAL: usize = 1;
/// Place of the metallic-roughness texture.
pub const METALLIC_ROUGHNESS: usize = 2;
/// Place of the occlusion texture.
pub const OCCLUSION: usize = 3;
/// Place of the emissive texture.
pub const EMISSIVE: usize = 4;

/// A glTF metallic-roughness material. Texture fields are indices of [`Texture`], or [`NONE`].
///
/// Its dielectric part reflects `specular` along the normal and `specular_weight` at grazing angles: 0.04 and 1 by
/// default (KHR_materials_ior, KHR_materials_specular), and both 0 make it Lambertian.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Material {
    /// Linear RGBA factor.
    pub base_color: [f32; 4],
    /// Linear emission factor, strength included.
    pub emission: [f32; 3],
    /// Metallic factor, 0..=1.
    pub metallic: f32,
    /// Roughness factor, 0..=1.
    pub roughness: f32,
    /// Cutoff of MASK.
    pub alpha_cutoff: f32,
    /// `MATERIAL_*` bits.
    pub flags: u32,
    /// Base colour texture (sRGB).
    pub base_color_texture: u32,
    /// [`OpacityMap`] of the base colour texture, where alpha is of MASK or BLEND and not 1 throughout.
    pub opacity_map: u32,
    /// Normal texture (linear): the normal in tangent space is 2 rgb - 1.
    pub normal_texture: u32,
    /// Metallic-roughness texture (linear): roughness in green, metallic in blue.
    pub metallic_roughness_texture: u32,
    /// Occlusion texture (linear), in red.
    pub occlusion_texture: u32,
    /// Emissive texture (sRGB).
    pub emissive_texture: u32,
    /// Of x and y of the normal texture; any finite number.
    pub normal_scale: f32,
    /// Of the occlusion texture, 0..=1: 0 is none of it.
    pub occlusion_strength: f32,
    /// Share of the surface that a clear coat covers (KHR_materials_clearcoat), 0..=1.
    pub clearcoat: f32,
    /// What the dielectric part reflects along the normal, linear RGB, 0..=1. Of a body that refracts the red one
    /// stands for its index of refraction, (1 + sqrt r) / (1 - sqrt r), and is less than 1.
    pub specular: [f32; 3],
    /// What it reflects at grazing angles, 0..=1.
    pub specular_weight: f32,
    /// Roughness of the clear coat, 0..=1.
    pub clearcoat_roughness: f32,
    /// Share of the light that thin walls or a body let through (KHR_materials_transmission), 0..=1.
    pub transmission: f32,
    /// Bit i: texture i takes the second set of texture coordinates ([`AttributeDetail::uv`]).
    pub uv_sets: u32,
    /// What a body that refracts takes from light (KHR_materials_volume), as [`pack_absorption`] has it; else zero.
    pub absorption: u32,
    /// Two rows a texture: of the set's coordinates (s, t) the coordinate is a s + b t + c by a row (a, b, c, d). The
    /// fourth of the first row is the absolute determinant, by which areas grow. Those of the second rows are words of
    /// [`crate::Layers`], zero without [`crate::MATERIAL_LAYERS`].
    pub uv_from_set: [[f32; 4]; 2 * MATERIAL_TEXTURES],
}

impl Material {
    /// [`Self::uv_from_set`] that leaves coordinates as they are.
    pub const SAME_UV: [[f32; 4]; 2 * MATERIAL_TEXTURES] = {
        let (u, v) = ([1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 0.0]);
        [u, v, u, v, u, v, u, v, u, v]
    };

    /// What stands for a material where a source has neither one nor vertex colours: grey, opaque and Lambertian.
    pub const GREY: Self = Self { base_color: [0.7, 0.7, 0.7, 1.0], ..Self::DIFFUSE };

    /// White, opaque and Lambertian, without textures.
    pub const DIFFUSE: Self = Self {
        base_color: [1.0; 4],
        emission: [0.0; 3],
        metallic: 0.0,
        roughness: 1.0,
        alpha_cutoff: 0.5,
        flags: 0,
        base_color_texture: NONE,
        opacity_map: NONE,
        normal_texture: NONE,
        metallic_roughness_texture: NONE,
        occlusion_texture: NONE,
        emissive_texture: NONE,
        normal_scale: 1.0,
        occlusion_strength: 1.0,
        clearcoat: 0.0,
        specular: [0.0; 3],
        specular_weight: 0.0,
        clearcoat_roughness: 0.0,
        transmission: 0.0,
        uv_sets: 0,
        absorption: 0,
        uv_from_set: Self::SAME_UV,
    };

    /// The textures in their places; [`NONE`] for those that it has not.
    pub fn textures(&self) -> [u32; MATERIAL_TEXTURES] {
        [
            self.base_color_texture,
            self.normal_texture,
            self.metallic_roughness_texture,
            self.occlusion_texture,
            self.emissive_texture,
        ]
    }

    /// The fields that hold them.
    pub fn textures_mut(&mut self) -> [&mut u32; MATERIAL_TEXTURES] {
        [
            &mut self.base_color_texture,
            &mut self.normal_texture,
            &mut self.metallic_roughness_texture,
            &mut self.occlusion_texture,
            &mut self.emissive_texture,
        ]
    }

    /// Whether it reflects in another way than a Lambertian surface.
    pub fn is_glossy(&self) -> bool {
        let is_unlit = self.flags & MATERIAL_UNLIT != 0;
        !is_unlit
            && (self.metallic > 0.0
                || self.specular_weight > 0.0
                || self.clearcoat > 0.0
                || self.flags & MATERIAL_LAYERS != 0)
    }

    /// Whether its triangles need [`AttributeDetail`]s.
    pub fn needs_details(&self) -> bool {
        let wants_tangents = MATERIAL_ANISOTROPIC | MATERIAL_MORE;
        self.normal_texture != NONE || self.uv_sets != 0 || self.flags & wants_tangents != 0
    }
}

/// [`Material::absorption`] of these, linear RGB, per world unit: of light that goes d units through the body
/// exp(-absorption d) is left. Three mantissas of 9 bits from the low bits up, then an exponent of 5 that they share: a
/// component is its mantissa times 2^(exponent - 24). What is more than 65,408 becomes that, what is no number zero.
pub fn pack_absorption(absorption: [f64; 3]) -> u32 {
    let held = absorption.map(|c| if c > 0.0 { c.min(65_408.0) } else { 0.0 });
    let greatest = held.into_iter().fold(0.0, f64::max);
    if greatest == 0.0 {
        return 0;
    }
    // The least exponent with which the greatest mantissa, rounded, has 9 bits.
    let fits = |exponent: &u32| (greatest * f64::exp2(24.0 - f64::from(*exponent))).round() < 512.0;
    let exponent = (0..=31).find(fits).unwrap_or(31);
    let mantissa = |c: f64| (c * f64::exp2(24.0 - f64::from(exponent))).round() as u32;
    mantissa(held[0]) | mantissa(held[1]) << 9 | mantissa(held[2]) << 18 | exponent << 27
}

/// What [`pack_absorption`] packed.
pub fn unpack_absorption(word: u32) -> [f32; 3] {
    let scale = f32::exp2((word >> 27) as f32 - 24.0);
    [0, 9, 18].map(|shift| (word >> shift & 511) as f32 * scale)
}

/// [`Texture::wrap`]: repeat.
pub const WRAP_REPEAT: u32 = 0;
/// [`Texture::wrap`]: clamp to edge.
pub const WRAP_CLAMP: u32 = 1;
/// [`Texture::wrap`]: mirrored repeat.
pub const WRAP_MIRROR: u32 = 2;

/// [`Texture::encoding`]: RGBA8, a texel after the other.
pub const TEXTURE_RGBA8: u32 = 0;
/// [`Texture::encoding`]: BC7 blocks of 4 x 4 texels, 16 bytes each.
pub const TEXTURE_BC7: u32 = 1;
/// [`Texture::encoding`]: BC5 blocks of 4 x 4 texels, 16 bytes each: x and y of unit vectors whose z is not negative.
pub const TEXTURE_BC5: u32 = 2;

/// [`Texture::flags`]: red, green and blue are sRGB; else they are linear. Alpha always is.
pub const TEXTURE_SRGB: u32 = 1;

/// A texture: an image with a full chain of mip levels, rows top to bottom, cut into tiles and a tail; see
/// [`crate::texture`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Texture {
    /// Width of level 0 in texels.
    pub width: u32,
    /// Height of level 0 in texels.
    pub height: u32,
    /// Number of levels; level l is max(1, width >> l) by max(1, height >> l).
    pub levels: u32,
    /// `WRAP_*` of s in the low half, of t in the high half.
    pub wrap: u32,
    /// `TEXTURE_RGBA8`, `TEXTURE_BC7` or `TEXTURE_BC5`.
    pub encoding: u32,
    /// `TEXTURE_SRGB` or 0; 0 with `TEXTURE_BC5`.
    pub flags: u32,
    /// First tile of level 0; the tiles of a texture are contiguous.
    pub first_tile: u32,
    /// Number of tiles.
    pub tile_count: u32,
    /// The levels that fit into a tile, one after the other.
    pub tail: Span,
}

/// The alpha of a base colour texture, where rays ask for it: 8 bits a texel (255 is 1), rows top to bottom, tightly
/// packed, in full resolution. It is resident throughout, so that what a ray meets does not depend on what is loaded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct OpacityMap {
    /// Width in texels.
    pub width: u32,
    /// Height in texels.
    pub height: u32,
    /// `WRAP_*` of s in the low half, of t in the high half.
    pub wrap: u32,
    /// Zero.
    pub _reserved: u32,
    /// The texels.
    pub texels: Span,
}

impl OpacityMap {
    /// Bytes of the texels, without the padding of the payload to 16.
    pub fn texel_bytes(&self) -> u64 {
        u64::from(self.width) * u64::from(self.height)
    }
}

/// What decides whether a ray passes through a triangle: the alpha of its material there, which is that of its base
/// colour factor times [`OpacityMap`] times vertex colour. With MASK a ray passes below the cutoff, with BLEND with a
/// probability of 1 - alpha.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct OpacityTriangle {
    /// Coordinates of the vertices in the base colour texture, in stored order: [`Material::uv_from_set`] is applied.
    pub uv: [[f32; 2]; 3],
    /// The material.
    pub material: u32,
    /// Alpha of the vertices, unorm8, in stored order, the first lowest; the high byte is zero.
    pub alphas: u32,
}

/// [`PunctualLight::kind`]: shines from a point to all sides.
pub const LIGHT_POINT: u32 = 0;
/// [`PunctualLight::kind`]: shines from a point into a cone.
pub const LIGHT_SPOT: u32 = 1;
/// [`PunctualLight::kind`]: shines from infinity.
pub const LIGHT_DISTANT: u32 = 2;

/// A light without extent (KHR_lights_punctual), placed in the world.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct PunctualLight {
    /// `LIGHT_*`.
    pub kind: u32,
    /// Distance at which it ends, world units; 0: nowhere.
    pub range: f32,
    /// Where it is, world units; of no meaning for distant lights.
    pub position: [f64; 3],
    /// Unit vector along the light, world space; of no meaning for points.
    pub direction: [f64; 3],
    /// Linear RGB: luminous intensity in candela (lm/sr) of points and spots, illuminance in lux (lm/m²) of distant
    /// lights.
    pub color: [f32; 3],
    /// Angles from the axis where a spot begins to fall off, and where it ends, radians, in order, 0..=π/2.
    pub cone: [f32; 2],
    /// Zero.
    pub _reserved: u32,
}

/// [`AttributeVertex::normal`]: the source has no usable normal, and shading takes the geometric one. No unit vector is
/// encoded so, since a snorm16 is never -32768.
pub const NO_NORMAL: u32 = 0x8000_8000;

/// A vertex of the attributes of a brick, 16 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct AttributeVertex {
    /// Unit normal in object space, octahedral, two snorm16: x in the low half; or [`NO_NORMAL`].
    pub normal: u32,
    /// Texture coordinates of set 0.
    pub uv: [f32; 2],
    /// Linear RGBA vertex colour, unorm8, red lowest; all ones when the source has none.
    pub color: u32,
}

/// What a vertex of the attributes has besides, 16 bytes, in bricks with [`BRICK_DETAIL`]: where a normal texture or a
/// second set of texture coordinates is looked up.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct AttributeDetail {
    /// Unit tangent in object space, encoded as normals are; or [`NO_NORMAL`].
    pub tangent: u32,
    /// The bitangent is this times cross(normal, tangent): 1 or -1; 0 without a tangent.
    pub handedness: f32,
    /// Texture coordinates of set 1.
    pub uv: [f32; 2],
}

/// Rounds `bytes` up to a multiple of 16.
const fn pad16(bytes: u64) -> u64 {
    bytes.next_multiple_of(16)
}

/// Byte offsets of the arrays in a brick's geometry payload, each 16-aligned, in this order: [`Node`]s; vertices (f32
/// x y z in device units of the object relative to the brick's origin; wide: high x y z, low x y z); mesh-local
/// triangle ids (u32); indices (three u16 or u32 a triangle, lexicographically smallest position first, winding kept).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GeometryLayout {
    /// Offset of the vertices.
    pub vertices: u64,
    /// Offset of the mesh-local ids.
    pub ids: u64,
    /// Offset of the indices.
    pub indices: u64,
    /// Offset of the number of each triangle's [`OpacityTriangle`], u32, [`NONE`] where no ray passes; with
    /// [`BRICK_OPACITY`].
    pub opacity_of: u64,
    /// Offset of the [`OpacityTriangle`]s; with [`BRICK_OPACITY`].
    pub opacities: u64,
    /// Length of the payload.
    pub bytes: u64,
}

impl GeometryLayout {
    /// The layout that the counts and flags of `brick` imply.
    pub fn of(brick: &Brick) -> Self {
        let vertex_bytes = if brick.flags & BRICK_WIDE != 0 { 24 } else { 12 };
        let index_bytes = if brick.flags & BRICK_INDEX32 != 0 { 12 } else { 6 };
        let vertices = brick.node_count as u64 * size_of::<Node>() as u64;
        let ids = vertices + pad16(brick.vertex_count as u64 * vertex_bytes);
        let indices = ids + pad16(brick.triangle_count as u64 * 4);
        let opacity_of = indices + pad16(brick.triangle_count as u64 * index_bytes);
        let has_opacity = u64::from(brick.flags & BRICK_OPACITY != 0);
        let opacities = opacity_of + has_opacity * pad16(brick.triangle_count as u64 * 4);
        let bytes = opacities + has_opacity * u64::from(brick.opacity_count) * size_of::<OpacityTriangle>() as u64;
        Self { vertices, ids, indices, opacity_of, opacities, bytes }
    }
}

/// Bits of a triangle's surface word that hold its material.
pub const SURFACE_MATERIAL: u32 = (1 << 30) - 1;
/// Shift of the rotation in a triangle's surface word.
pub const SURFACE_ROTATION_SHIFT: u32 = 30;

/// Byte offsets of the arrays in a brick's attributes as they are loaded, each 16-aligned, in this order:
/// [`AttributeVertex`]s; surface words (u32 a triangle: the material in the low 30 bits, above it the rotation r, such
/// that stored vertex i is source vertex (i + r) mod 3); indices of attribute vertices (three u16 or u32 a triangle, in
/// stored, rotated order; u32 under the same flag as the geometry's indices); with [`BRICK_DETAIL`]
/// [`AttributeDetail`]s.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AttributeLayout {
    /// Offset of the surface words.
    pub surfaces: u64,
    /// Offset of the indices.
    pub indices: u64,
    /// Offset of the [`AttributeDetail`]s; with [`BRICK_DETAIL`].
    pub details: u64,
    /// Length of the attributes as they are loaded; in the file they are encoded.
    pub bytes: u64,
}

impl AttributeLayout {
    /// The layout that the counts and flags of `brick` imply.
    pub fn of(brick: &Brick) -> Self {
        let index_bytes = if brick.flags & BRICK_INDEX32 != 0 { 12 } else { 6 };
        let surfaces = brick.attribute_vertex_count as u64 * size_of::<AttributeVertex>() as u64;
        let indices = surfaces + pad16(brick.triangle_count as u64 * 4);
        let details = indices + pad16(brick.triangle_count as u64 * index_bytes);
        let has_details = u64::from(brick.flags & BRICK_DETAIL != 0);
        let bytes = details + has_details * brick.attribute_vertex_count as u64 * size_of::<AttributeDetail>() as u64;
        Self { surfaces, indices, details, bytes }
    }
}
