// Lamps.

struct Emitter {          // in the frame, device units; one of them is drawn by an alias table over their power
    corner: vec3<f32>,    // a corner, or where the light is
    kind: u32,            // EMITTER_*, with EMITTER_TWO_SIDED
    u: vec3<f32>,         // an edge that starts at the corner; of spots and distant lights the unit vector along the light
    probability: f32,     // of being drawn
    v: vec3<f32>,         // the other edge: it shines to the side of cross(u, v); of spots: scale and offset of the cosine, x and y; of
                          // spots and points z: 1 / range, 0 without one
    threshold: u32,       // below it a random number of 32 bits stays with this entry of the table,
    radiance: vec3<f32>,  // or of points and spots radiant intensity, of distant lights irradiance
    other: u32,           // else it goes to this one
}

const EMITTER_PARALLELOGRAM: u32 = 0u;
const EMITTER_TRIANGLE: u32 = 1u;
const EMITTER_POINT: u32 = 2u;
const EMITTER_SPOT: u32 = 3u;
const EMITTER_DISTANT: u32 = 4u;
const EMITTER_KIND: u32 = 7u;      // the bits of the above
const EMITTER_TWO_SIDED: u32 = 8u;
