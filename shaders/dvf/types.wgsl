// Discrete visibility fields.

struct DvfOwn {           // what a kernel is told
    // dvf_rays: number of the first ray of the block; dvf_points: first side of a point; sweeps: first element of the
    // level
    first: u32,
    // sweeps: first element of the level above; dvf_rays, dvf_write: first word of the block's bits of waiting rays,
    // NONE: none may wait
    next: u32,
    // sweeps: elements of the level; dvf_points: sides of points; dvf_write: 0: nothing is entered into masks
    count: u32,
    turn: u32,            // dvf_rays: which of its directions every lane takes
    around: vec4<f32>,    // dvf_cosine: direction of the pass's rays in the frame of the normal, z along it
}

struct DvfGrid {          // A discrete visibility field in the frame: point p lies at scale * p + first, in cells.
    first: vec3<f32>,     // where the origin of the frame lies
    scale: f32,           // cells of a device unit
    size: vec3<u32>,      // cells on each axis
    octahedral: u32,      // texels of a mask on both axes: 8, 16 or 32
    flags: u32,           // DVF_* bits
    points: f32,          // points that are to lie on all triangles
    total: f32,           // twice the area of all triangles, device units
    area_scale: f32,      // a device unit of area in the steps in which areas are summed
    rays: u32,            // rays of a point, on each side
    lanes: u32,           // over which the rays of a point are shared out
    triangles: u32,       // triangles of the group at hand
    point_count: u32,     // points on these triangles
    seed: u32,            // of the random numbers
    // words of dvf_tally; where cells are made anew and rays are made: number of points that make them
    listed: u32,
    padding0: u32,
    padding1: u32,
}

struct DvfTriangle {      // A triangle in the frame, device units.
    a: vec3<f32>,         // first corner
    id: u32,              // global id
    b: vec3<f32>,         // second corner
    flags: u32,           // INSTANCE_MIRRORED: its front is where a, b, c go clockwise
    c: vec3<f32>,         // third corner
    padding: u32,
}

const DVF_HAMMERSLEY: u32 = 1u;    // points are those of Hammersley, else hashed
const DVF_ROUND: u32 = 2u;         // numbers of points are rounded, else raised to whole ones
const DVF_BOTH: u32 = 4u;          // rays start from both sides of triangles, else from their front
const DVF_DOUBT: u32 = 8u;         // rays are traced where a mask says both or neither, else by the label
// what masks do not know is not traced; the label is noted with the hit's attributes
const DVF_PAPER: u32 = 16u;
// cells are made anew: masks are those of their entries, rays are those of some points and texels
const DVF_RENEW: u32 = 32u;
const DVF_WALK: u32 = 512u;        // elements of a sweep that a workgroup has
