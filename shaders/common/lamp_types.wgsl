// Lamps.

// A lamp in the frame, device units, or a group of lamps. Groups follow the lamps, that of all first.
struct Emitter {
    corner: vec3<f32>,    // a corner, or where the light is; of groups their middle
    kind: u32,            // EMITTER_*, with EMITTER_TWO_SIDED
    // an edge that starts at the corner; of spots and distant lights the unit vector along the light; of groups the
    // axis of their normals
    u: vec3<f32>,
    probability: f32,     // its share of the power of all
    // the other edge: it shines to the side of cross(u, v); of spots: scale and offset of the cosine, x and y; of
    // spots and points z: 1 / range, 0 without one; of groups x: radius, y: distance of normals from the axis, z: how
    // far lamps lie behind the middle along their normals
    v: vec3<f32>,
    first: u32,           // of groups: the entry of one half
    // of surfaces; of points and spots radiant intensity, of distant lights irradiance; of groups x: luminance that
    // they send, by area
    radiance: vec3<f32>,
    second: u32,          // of groups: the entry of the other half
}

const EMITTER_PARALLELOGRAM: u32 = 0u; // kind: a parallelogram
const EMITTER_TRIANGLE: u32 = 1u;  // kind: a triangle, half a parallelogram
const EMITTER_POINT: u32 = 2u;     // kind: it shines to all sides
const EMITTER_SPOT: u32 = 3u;      // kind: a cone from a point
const EMITTER_DISTANT: u32 = 4u;   // kind: parallel light
const EMITTER_GROUP: u32 = 5u;     // kind: a group of lamps that have a place
const EMITTER_DISTANT_GROUP: u32 = 6u; // kind: a group of distant ones
const EMITTER_KIND: u32 = 7u;      // bits of the kind
const EMITTER_TWO_SIDED: u32 = 8u; // it shines to both sides
