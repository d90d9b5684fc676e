// Lamps, and what answers rays to them and to each other without a brick.

struct RomaLevel {        // a base map in the frame: point p lies at scale * p + first, in its cells
    first: vec3<f32>,
    scale: f32,
    lift: f32,            // by which rays start off their surface, device units: 1.5 cells of a map
    padding0: u32,
    padding1: u32,
    padding2: u32,
}

struct RomaMap {          // a ray-aligned map; columns run along its z
    cell_from_point: array<vec4<f32>, 3>, // rows: cells of the map from points of the frame
    base_from_cell: array<vec4<f32>, 3>,  // rows: cells of the base map from those of the map
    direction: vec4<f32>, // unit vector along the columns, world space
}

struct RsmMap {           // what a lamp lights, as it sees it
    texel_from_point: array<vec4<f32>, 3>, // rows: place in texels, and depth, from points of the frame; in perspective the place is to be
                          // divided by the depth
    first: u32,           // its first texel among those of all
    width: u32,           // texels of a row
    height: u32,          // rows
    lamp: u32,            // number of the emitter, NONE: the sun; maps of one lamp follow each other, the finest first
    flags: u32,           // RSM_PERSPECTIVE: seen from a point, else along one direction
    padding0: u32,
    padding1: u32,
    padding2: u32,
}

struct RsmTexel {
    flux: vec3<f32>,      // radiance that the surface reflects of the lamp to all sides, its diffuse part
    depth: f32,           // t of the texel's ray, device units; below 0: it met nothing
    normal: vec3<f32>,    // geometric unit normal toward the lamp, world space
    facing: f32,          // minus the cosine between it and the texel's ray, times the ray's length: of a unit of depth, the part across the surface
}

struct DvfGrid {          // a discrete visibility field in the frame: point p lies at scale * p + first, in cells
    first: vec3<f32>,
    scale: f32,
    size: vec3<u32>,      // cells on each axis
    octahedral: u32,      // texels of a mask on both axes: 8, 16 or 32
    flags: u32,           // DVF_* bits
    points: f32,          // that are to lie on all triangles
    total: f32,           // twice the area of all triangles, device units
    area_scale: f32,      // steps in which areas are summed, a device unit of area
    rays: u32,            // of a point, on each side
    lanes: u32,           // over which the rays of a point are shared out
    triangles: u32,       // of the group at hand
    point_count: u32,     // on these
    seed: u32,
    listed: u32,          // words of dvf_tally; where cells are made anew and rays are made: points that these are
    padding0: u32,
    padding1: u32,
}

struct DvfTriangle {      // in the frame, device units
    a: vec3<f32>,
    id: u32,              // global id
    b: vec3<f32>,
    flags: u32,           // INSTANCE_MIRRORED: its front is where a, b, c go clockwise
    c: vec3<f32>,
    padding: u32,
}

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
const RSM_PERSPECTIVE: u32 = 1u;
const ROMA_HIT: u32 = 0xfffffffeu;   // id of what ROMA meets, which is no triangle
const ROMA_WHOLE: u32 = 0u; // all of them
const ROMA_FAR: u32 = 1u;   // from where they have been traced to
const ROMA_SIFT: u32 = 2u;  // those alone that meet nothing
const ROMA_CORRECT: u32 = 3u; // all of them, and pilots, which have been traced, count for what maps get wrong
const HANDOVERS: u32 = 6u;    // distances up to which rays may be traced, roma_measure
const FIELD_HIT: u32 = 0xfffffffdu;  // id of what is met in a distance field, which is no triangle
const DVF_HIT: u32 = 0xfffffffcu;    // id of what a discrete visibility field says is met, which is no triangle
const DVF_HAMMERSLEY: u32 = 1u;    // points are those of Hammersley, else hashed
const DVF_ROUND: u32 = 2u;         // numbers of points are rounded, else raised to whole ones
const DVF_BOTH: u32 = 4u;          // rays start from both sides of triangles, else from their front
const DVF_DOUBT: u32 = 8u;         // rays are traced where a mask says both or neither, else by the label
const DVF_PAPER: u32 = 16u;        // what the masks do not know is not traced, and the label is noted with the hit's attributes
const DVF_RENEW: u32 = 32u;        // cells are made anew: masks are those of their entries, and rays are those of some points and texels
const DVF_WALK: u32 = 512u;        // elements of a sweep that a workgroup has
