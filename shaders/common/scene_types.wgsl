// The scene, its bricks, and the cache that holds them.

struct TopNode2 {         // A node of the binary top-level tree.
    min: vec3<f32>,       // the box's least coordinates, in the frame
    left: u32,            // first child, or a leaf
    max: vec3<f32>,       // the box's greatest coordinates, in the frame
    right: u32,           // second child; NONE: `left` is a leaf
}

struct BinaryNode {       // A node of a brick's binary tree, relative to the brick's origin.
    min: vec3<f32>,       // the box's least coordinates
    // inner: index of its first child within the brick's nodes, the other follows; leaf: BINARY_LEAF with the number
    // of its triangles, 0 to 3, in bits 29 and 30, and the first in the bits below
    what: u32,
    max: vec3<f32>,       // the box's greatest coordinates
    padding: u32,
}

struct Leaf {             // A leaf of the top-level tree: a brick of an instance.
    offset_high: vec3<f32>, // high part of brick origin - reference point, in the object's device units
    instance: u32,        // index of the instance
    offset_low: vec3<f32>, // its low part; zero for near bricks
    brick: u32,           // index of the brick
}

struct LevelLeaf {        // Of a leaf of the top level, what selection of levels of detail goes by.
    min: vec3<f32>,       // least coordinates of the box of all that it stands for, in the frame
    error_square: f32,    // square of its error, device units; 0 of a brick
    max: vec3<f32>,       // greatest coordinates
    parent: u32,          // the leaf of the level above, NONE without one
}

struct Instance {         // A placed object.
    object_from_world: array<vec4<f32>, 3>, // rows; w: translation in the frame
    world_from_object: array<vec4<f32>, 3>, // rows; w: translation in the frame
    base: u32,            // global id of triangle 0
    flags: u32,           // INSTANCE_* bits
    scale: f32,           // bound of the ratio of scales
    volume: f32,          // volume in the world of a unit cube of the object's, in device units
}

struct Brick {            // Where the parts of a brick lie in its payloads. Offsets are in words.
    vertices: u32,        // in the geometry payload
    ids: u32,             // in the geometry payload
    indices: u32,         // in the geometry payload
    flags: u32,           // BRICK_* bits
    surfaces: u32,        // in the attribute payload
    attribute_indices: u32, // in the attribute payload
    opacity_of: u32,      // in the geometry payload, with BRICK_OPACITY
    opacities: u32,       // in the geometry payload, with BRICK_OPACITY
    details: u32,         // in the attribute payload, with BRICK_DETAIL
    padding0: u32,
    padding1: u32,
    padding2: u32,
}

struct Opacity {          // By what a material lets rays pass.
    factor: f32,          // alpha of the base colour factor
    cutoff: f32,          // of MASK
    blends: u32,          // bit 0: BLEND; bit 1: a body that refracts
    texels: u32,          // first vector of the texels in the table; NONE without a map
    width: u32,           // texels of a row of the map
    height: u32,          // rows of the map
    wrap: u32,            // WRAP_* of s in the low half, of t in the high half
    padding: u32,
}

struct Slot {             // where a brick lies in the cache, and its part in the pass
    geometry_page: u32,   // cache page of the geometry
    geometry_offset: u32, // in 16-byte units
    attributes_page: u32, // cache page of the attributes
    attributes_offset: u32, // in 16-byte units
    state: u32,           // STATE_* bits
    padding0: u32,
    padding1: u32,
    padding2: u32,
}

const INSTANCE_IDENTITY: u32 = 1u; // object units are world units, the matrix is the identity
const INSTANCE_MIRRORED: u32 = 2u; // the determinant of the matrix is negative
const INSTANCE_STRETCHED: u32 = 4u; // the matrix scales directions differently; known for every frame, not in the file
const BRICK_WIDE: u32 = 1u;        // vertices have a high and a low part
const BRICK_INDEX32: u32 = 2u;     // indices are u32, not u16
const BRICK_OPACITY: u32 = 4u;     // rays may pass through some of its triangles
const NO_NORMAL: u32 = 0x80008000u;  // normal word of an attribute vertex without one
const BRICK_DETAIL: u32 = 8u;      // attribute vertices have tangents and second coordinates
const BINARY_LEAF: u32 = 0x80000000u; // see BinaryNode
