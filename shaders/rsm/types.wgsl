// Reflective shadow maps.

struct RsmOwn {           // what a kernel is told
    maps: u32,            // maps of all lamps
    map: u32,             // rsm_write: the map that is written
    x: u32,               // rsm_write: column of the texel that ray 0 of the pass is for
    y: u32,               // rsm_write: its row
}

struct RsmMap {           // what a lamp lights, as it sees it
    // rows: place in texels, and depth, from points of the frame; in perspective the place is to be divided by the
    // depth
    texel_from_point: array<vec4<f32>, 3>,
    first: u32,           // its first texel among those of all
    width: u32,           // texels of a row
    height: u32,          // rows
    lamp: u32,            // number of the emitter, NONE: the sun; maps of one lamp follow each other, the finest first
    flags: u32,           // RSM_PERSPECTIVE: seen from a point, else along one direction
    padding0: u32,
    padding1: u32,
    padding2: u32,
}

struct RsmTexel {         // What a ray of a reflective shadow map meets.
    flux: vec3<f32>,      // radiance that the surface reflects of the lamp to all sides, its diffuse part
    depth: f32,           // t of the texel's ray, device units; below 0: it met nothing
    normal: vec3<f32>,    // geometric unit normal toward the lamp, world space
    // minus the cosine between the normal and the texel's ray, times the ray's length: of a unit of depth, the part
    // across the surface
    facing: f32,
}

const RSM_PERSPECTIVE: u32 = 1u;   // the map is seen from a point
