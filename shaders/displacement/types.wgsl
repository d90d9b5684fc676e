// Displacement fields.

struct DisplacementOwn {  // what the kernel is told
    fields: u32,          // fields that can be asked
    nodes: u32,           // nodes over what they stand for; 0: there is nothing
    look: u32,            // DISPLACEMENT_* bits
    near: f32,            // cells of a field's positions around a ray's start within which it is traced
}

struct DisplacementPosition { // Where rays of a field start, and the frame of their directions.
    at: vec4<f32>,        // unit vector from the middle of the sphere
    x: vec4<f32>,         // a tangent
    y: vec4<f32>,         // and the other one
}

struct DisplacementField { // A field that can be asked.
    codes: u32,           // first word of its samples; NONE: it is not there
    table: u32,           // first of its positions
    rings: u32,           // of a hemisphere around its pole
    directions: u32,      // of a position on each axis of their square
    bits: u32,            // of a sample, 8 or 1
    mean: f32,            // of 1 bit: how far along the chord what is met lies
    padding0: u32,
    padding1: u32,
}

struct DisplacementCarrier { // What stands in the scene with a field, or without: then rays through it are traced.
    unit_from_point: array<vec4<f32>, 3>, // rows: of the field's unit sphere, from points of the frame
    field: u32,           // NONE: it has none
    brick: u32,           // its only brick; NONE: it is placed more than once, or of several bricks
    padding0: u32,
    padding1: u32,
}

struct DisplacementNode { // A box over carriers, in the frame.
    min: vec3<f32>,       // device units
    first: u32,           // first of its two children; of a leaf the carrier
    max: vec3<f32>,       // device units
    is_leaf: u32,         // 1: it is a leaf
}

const DISPLACEMENT_POSITIONS: u32 = 1u;  // samples of the positions around are weighed
const DISPLACEMENT_DIRECTIONS: u32 = 2u; // samples of the directions around are weighed
const DISPLACEMENT_ABSENT: u32 = 4u;     // rays are answered that would meet a brick that is not resident, or a copy
const DISPLACEMENT_AIMED: u32 = 8u;      // the stored ray meets the asked one where it passes the middle
const DISPLACEMENT_MISS: u32 = 255u;     // code of a ray that meets nothing
