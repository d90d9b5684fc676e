// Discrete visibility fields.

struct DvfOwn {           // what a kernel is told
    first: u32,           // dvf_rays: number of the first ray of the block; dvf_points: first side of a point; sweeps: first element of the level
    next: u32,            // sweeps: first element of the level above; dvf_rays, dvf_write: first word of the block's bits of waiting rays,
                          // NONE: none may wait
    count: u32,           // sweeps: elements of the level; dvf_points: sides of points; dvf_write: 0: nothing is entered into masks
    turn: u32,            // dvf_rays: which of its directions every lane takes
    around: vec4<f32>,    // dvf_cosine: direction of the pass's rays in the frame of the normal, z along it
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

const DVF_HAMMERSLEY: u32 = 1u;    // points are those of Hammersley, else hashed
const DVF_ROUND: u32 = 2u;         // numbers of points are rounded, else raised to whole ones
const DVF_BOTH: u32 = 4u;          // rays start from both sides of triangles, else from their front
const DVF_DOUBT: u32 = 8u;         // rays are traced where a mask says both or neither, else by the label
const DVF_PAPER: u32 = 16u;        // what the masks do not know is not traced, and the label is noted with the hit's attributes
const DVF_RENEW: u32 = 32u;        // cells are made anew: masks are those of their entries, and rays are those of some points and texels
const DVF_WALK: u32 = 512u;        // elements of a sweep that a workgroup has
