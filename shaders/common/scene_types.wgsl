// The scene, its bricks, and the cache that holds them.

struct TopNode2 {
    min: vec3<f32>,
    left: u32,
    max: vec3<f32>,
    right: u32,           // NONE: `left` is a leaf
}

struct BinaryNode {       // of a brick's binary tree, relative to the brick's origin
    min: vec3<f32>,
    what: u32,            // inner: index of its first child within the brick's nodes, the other follows; leaf: BINARY_LEAF
                          // with the number of its triangles, 0 to 3, in bits 29 and 30, and the first in the bits
                          // below
    max: vec3<f32>,
    padding: u32,
}

struct Leaf {
    offset_high: vec3<f32>, // brick origin - reference point, in the object's device units: high part
    instance: u32,
    offset_low: vec3<f32>,  // low part; zero for near bricks
    brick: u32,
}

struct Instance {
    object_from_world: array<vec4<f32>, 3>, // rows; w: translation in the frame
    world_from_object: array<vec4<f32>, 3>, // rows; w: translation in the frame
    base: u32,            // global id of triangle 0
    flags: u32,           // INSTANCE_* bits
    scale: f32,           // bound of the ratio of scales
    volume: f32,          // volume in the world of a unit cube of the object's, in device units
}

struct Brick {
    vertices: u32,        // word offsets within the geometry payload
    ids: u32,
    indices: u32,
    flags: u32,           // BRICK_* bits
    surfaces: u32,        // word offsets within the attribute payload
    attribute_indices: u32,
    opacity_of: u32,      // word offsets within the geometry payload, with BRICK_OPACITY
    opacities: u32,
    details: u32,         // word offset within the attribute payload, with BRICK_DETAIL
    padding0: u32,
    padding1: u32,
    padding2: u32,
}

struct Opacity {          // of a material
    factor: f32,          // alpha of the base colour factor
    cutoff: f32,          // of MASK
    blends: u32,          // 1: BLEND
    texels: u32,          // first vector of the texels in the table; NONE without a map
    width: u32,
    height: u32,
    wrap: u32,            // WRAP_* of s in the low half, of t in the high half
    padding: u32,
}

struct Slot {             // where a brick lies in the cache, and its part in the pass
    geometry_page: u32,
    geometry_offset: u32, // in 16-byte units
    attributes_page: u32,
    attributes_offset: u32,
    state: u32,           // STATE_* bits
    padding0: u32,
    padding1: u32,
    padding2: u32,
}

const INSTANCE_IDENTITY: u32 = 1u;
const INSTANCE_MIRRORED: u32 = 2u;
const BRICK_WIDE: u32 = 1u;
const BRICK_INDEX32: u32 = 2u;
const BRICK_OPACITY: u32 = 4u;
const NO_NORMAL: u32 = 0x80008000u;  // normal word of an attribute vertex without one
const BRICK_DETAIL: u32 = 8u;
const BINARY_LEAF: u32 = 0x80000000u;
