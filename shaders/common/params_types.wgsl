// Parameters of a dispatch, their flags, and constants of all kernels.

struct Params {           // What every kernel is told.
    zero: u32,            // 0; what barrier() ors in, unknown to the compiler
    width: u32,           // rays per row
    height: u32,          // rows, of a picture or of a band of it
    tile: u32,            // edge of a tile in rays
    tiles_x: u32,         // tiles per row
    tiles: u32,           // number of tiles
    flags: u32,           // PARAM_* bits
    list_capacity: u32,   // entries of the tile lists
    select_mask: u32,     // tile_select takes leaves with (state & select_mask) == select_want
    select_want: u32,     // the bits of select_mask that must be set
    threshold: u32,       // a (tile, leaf) query with at most so many rays is not visible; 0 = exact
    top_count: u32,       // nodes of the binary top-level tree
    sample: u32,          // index of the sample of this frame
    seed: u32,            // of all random numbers
    instance_pad: f32,    // relative padding of top-level boxes for the rounding of instance rays
    sun_radius: f32,      // tangent of the sun's angular radius
    origin: vec4<f32>,    // camera position in the frame, device units; w: world units of a device unit
    base: vec4<f32>,      // direction of pixel coordinate (0, 0)
    step_x: vec4<f32>,    // change of direction per pixel in x
    step_y: vec4<f32>,    // change of direction per pixel in y; w: angle that a sample stands for, radians
    sun: vec4<f32>,       // unit vector to the sun; w: cosine-weighted irradiance scale
    sun_color: vec4<f32>, // irradiance of a surface that faces the sun
    sky_color: vec4<f32>, // of the zenith
    ground_color: vec4<f32>, // below the horizon
    jitter: vec4<f32>,    // x, y: offset within the pixel, in pixels
    // direction of the pass's rays in the frame of the normal, z along it; w: greatest turn about it, radians
    around: vec4<f32>,
    share: f32,           // of the light that the pass's direction stands for
    length: f32,          // of the pass's rays where that is limited, device units
    stream: u32,          // which random numbers the pass takes
    pair_count: u32,      // pairs to be queried
    run_first: u32,       // of a tile's selected leaves, the first that intersect_list takes
    run_count: u32,       // how many of them intersect_list takes at most
    list_most: u32,       // leaves of the longest list that rays are intersected with
    emitter_count: u32,   // emitters of the scene
    direction: u32,       // number of the pass's direction
    environment_width: u32,  // texels of a row of the environment; 0: the sky is the background
    environment_height: u32, // rows of the environment
    // density of points of emitters by power: of an area of 1, by the luminance of its radiance
    emitter_density: f32,
    diffuse_count: f32,   // diffuse rays of a hit; 0 where they bring nothing of the environment that rays to it bring
    first_row: u32,       // of the picture, that the first row of rays belongs to
    picture_rows: u32,    // rows of the picture; camera rays of rows beyond them are not traced
    traced_one_in: u32,   // of so many blocks of 8 x 8 camera rays one is traced (src/frame/correct.rs); 0: all are
    // levels of detail, squared: the tolerance times the angle of a pixel, the same times the angle that the pass's
    // rays spread by at least; z: the tolerance; w: share of a squared width that blending may take off
    levels: vec4<f32>,
    environment_turn: vec4<f32>, // x, y: cosine and sine of its turn about +Y
    clip: vec4<f32>,      // unit normal of the plane that the scene is cut at; w: its product with points of the plane
    // what a white surface reflects of the environment, by terms of its normal (light.wgsl)
    ambient: array<vec4<f32>, 9>,
}

const PARAM_ANY_HIT: u32 = 1u;     // the pass asks whether rays hit anything, not what
const PARAM_NEEDED: u32 = 2u;     // queries ask what a pass needed, from its final hits, whatever was resident
const PARAM_SUN: u32 = 4u;        // shade: with the sun, unshadowed
const PARAM_SKY: u32 = 8u;        // shade: with the sky's light, unshadowed
const PARAM_BOUNCE: u32 = 16u;    // the hits that are shaded are those of set 1
const PARAM_EMITTER: u32 = 32u;   // the pass's lamp is one of the emitters
const PARAM_ENVIRONMENT: u32 = 64u; // the pass's lamp is the environment
const PARAM_PATH: u32 = 32768u;  // the paths of the hits that are shaded go on: rays of theirs may meet the lamps
const PARAM_REFRACT: u32 = 65536u; // light is bent by bodies that refract; no ray passes straight through them
const PARAM_SCATTER: u32 = 4096u;    // every pixel has a direction of its own around the normal
const PARAM_TIGHTER: u32 = 128u;  // pairs are queried by the boxes of the node's children
const PARAM_NEXT: u32 = 256u;     // a ray asks up to the first brick that it enters of those it asks for, not for all
const PARAM_CULLED: u32 = 512u;   // pairs of a tile and a leaf that no more rays see than the threshold are left out
const PARAM_EMISSION: u32 = 1024u; // shade: with the hits' emission
const PARAM_MISS: u32 = 2048u;    // shade: with the background, where rays missed
const PARAM_COARSER: u32 = 16384u; // coarser levels of textures stand for what is not resident
const PARAM_GLOSSY: u32 = 8192u;   // what surfaces reflect otherwise than diffusely comes by rays of its own, too
const LEVEL_OFFSET: f32 = 0.25;    // errors of the level at a hit that rays start off by: most of a level is nearer
const BATCH_SAMPLES: u32 = 64u;   // samples that are summed before the radiance is emptied
const NONE: u32 = 0xffffffffu;     // "no such thing", in every index that may be absent
const T_INFINITE: f32 = 3.4028234e38; // t_max of an unbounded ray: the greatest f32
