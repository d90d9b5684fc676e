// Lamps.

// A lamp in the frame, device units. One of all is drawn by an alias table over their power.
struct Emitter {
    corner: vec3<f32>,    // a corner, or where the light is
    kind: u32,            // EMITTER_*, with EMITTER_TWO_SIDED
    // an edge that starts at the corner; of spots and distant lights the unit vector along the light
    u: vec3<f32>,
    probability: f32,     // of being drawn
    // the other edge: it shines to the side of cross(u, v); of spots: scale and offset of the cosine, x and y; of
    // spots and points z: 1 / range, 0 without one
    v: vec3<f32>,
    threshold: u32,       // a random number of 32 bits below it stays with this entry of the table
    radiance: vec3<f32>,  // of surfaces; of points and spots radiant intensity, of distant lights irradiance
    other: u32,           // the entry that other numbers go to
}

const EMITTER_PARALLELOGRAM: u32 = 0u; // kind: a parallelogram
const EMITTER_TRIANGLE: u32 = 1u;  // kind: a triangle, half a parallelogram
const EMITTER_POINT: u32 = 2u;     // kind: it shines to all sides
const EMITTER_SPOT: u32 = 3u;      // kind: a cone from a point
const EMITTER_DISTANT: u32 = 4u;   // kind: parallel light
const EMITTER_KIND: u32 = 7u;      // bits of the kind
const EMITTER_TWO_SIDED: u32 = 8u; // it shines to both sides
