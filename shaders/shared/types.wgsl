// Structures shared by all kernels. Each mirrors a #[repr(C)] struct of src/kernel/layout.rs; the build compares the two.

struct Params {
    zero: u32,            // 0; what barrier() ors in, unknown to the compiler
    width: u32,           // rays per row
    height: u32,          // rows
    tile: u32,            // edge of a tile in rays
    tiles_x: u32,         // tiles per row
    tiles: u32,           // number of tiles
    flags: u32,           // PARAM_* bits
    list_capacity: u32,   // entries of the tile lists
    select_mask: u32,     // tile_select takes leaves with (state & select_mask) == select_want
    select_want: u32,
    threshold: u32,       // a (tile, leaf) query with at most so many rays is not visible; 0 = exact
    top_count: u32,       // nodes of the binary top-level tree
    sample: u32,          // index of the sample of this frame
    seed: u32,
    instance_pad: f32,    // relative padding of top-level boxes for the rounding of instance rays
    sun_radius: f32,      // tangent of the sun's angular radius
    origin: vec4<f32>,    // camera position in the frame, device units
    base: vec4<f32>,      // direction of pixel coordinate (0, 0)
    step_x: vec4<f32>,    // change of direction per pixel in x
    step_y: vec4<f32>,    // change of direction per pixel in y; w: pixel angle in radians
    sun: vec4<f32>,       // unit vector to the sun; w: cosine-weighted irradiance scale
    sun_color: vec4<f32>,
    sky_color: vec4<f32>,
    ground_color: vec4<f32>,
    jitter: vec4<f32>,    // x, y: offset within the pixel, in pixels
    around: vec4<f32>,    // direction of the pass's rays in the frame of the normal, z along it; w: greatest turn about it, radians
    share: f32,           // of the light that the pass's direction stands for
    surface_share: f32,   // of its own light that a primary hit shows, the rest being mirrored
    length: f32,          // of the pass's rays where that is limited, device units
    stream: u32,          // which random numbers the pass takes
    pair_count: u32,      // pairs to be queried
    run_first: u32,       // of a tile's selected leaves, the first that intersect_list takes
    run_count: u32,       // and how many it takes at most
    list_most: u32,       // leaves of the longest list that rays are intersected with
    emitter_count: u32,
    direction: u32,       // number of the pass's direction
    environment_width: u32,  // texels of a row of the environment; 0: the sky is the background
    environment_height: u32,
    emitter_density: f32, // of points of surfaces that shine, by the luminance of their radiance, an area of 1: how rays to them are drawn
    diffuse_count: f32,   // diffuse rays of a hit; 0 where they bring nothing of the environment that rays to it bring
    roma_k: u32,          // square root of the number of maps of a level
    roma_size: u32,       // texels of a map on both axes, and cells of a column
    roma_cells: u32,      // cells of a base map on each axis
    roma_levels: u32,     // base maps
    roma_samples: u32,    // look-ups of the base map a cell
    roma_steps: u32,      // columns that a ray passes before it is finished snapped; 0: it is snapped
    roma_near: u32,       // cells of the base map that holds a ray's start, up to where it is traced; NONE: to its end. roma_measure: in one of a map
    roma_part: u32,       // which part of rays roma_trace answers, ROMA_*
    roma_is_part: u32,    // 1: rays that leave the coarsest base map are not answered, 0: it holds the scene
    roma_one_in: u32,     // of rays that roma_trace sifts and does not find free one in so many is traced
    field_cells: u32,     // cells of a distance field's base map on each axis
    field_levels: u32,    // distance fields, one a base map
    field_level: u32,     // which of them is made
    field_mip: u32,       // and which of its levels: cells are 2^mip of the base map's
    field_step: u32,      // cells on each axis that jump flooding looks away
    field_half: u32,      // which half of the nearest cells is read
    field_steps: u32,     // look-ups of a ray at most
    field_hit: f32,       // a ray meets what it is no farther from, cells
    rsm_maps: u32,        // reflective shadow maps of all lamps
    rsm_map: u32,         // rsm_write: the one that is written,
    rsm_x: u32,           // and its texel that ray 0 of the pass is for
    rsm_y: u32,
    dvf_first: u32,       // dvf_rays: number of the first ray of the block; sweeps: first element of the level
    dvf_next: u32,        // sweeps: first element of the level above
    dvf_count: u32,       // sweeps: elements of the level
    dvf_turn: u32,        // dvf_rays: which of its directions every lane takes
    roma_pilots: u32,     // of rays that are sifted one in so many is traced to its end all the same; 0: none
    padding_0: u32,
    padding_1: u32,
    padding_2: u32,
    environment_turn: vec4<f32>, // x, y: cosine and sine of its turn about +Y
    ambient: array<vec4<f32>, 9>, // of the environment: what a white surface reflects of it, by terms of its normal (light.wgsl)
}

const PARAM_ANY_HIT: u32 = 1u;
const PARAM_NEEDED: u32 = 2u;     // queries ask what a pass needed, from its final hits, whatever was resident
const PARAM_SUN: u32 = 4u;        // shade: with the sun, unshadowed
const PARAM_SKY: u32 = 8u;        // shade: with the sky's light, unshadowed
const PARAM_BOUNCE: u32 = 16u;    // the hits that are shaded are those of set 1
const PARAM_EMITTER: u32 = 32u;   // the pass's lamp is one of the emitters
const PARAM_ENVIRONMENT: u32 = 64u; // the pass's lamp is the environment
const PARAM_SCATTER: u32 = 4096u;    // every pixel has a direction of its own around the normal
const PARAM_TIGHTER: u32 = 128u;  // pairs are queried by the boxes of the node's children
const PARAM_NEXT: u32 = 256u;     // a ray asks up to the first brick that it enters of those it asks for, not for all
const PARAM_CULLED: u32 = 512u;   // pairs of a tile and a leaf that no more rays see than the threshold are left out
const PARAM_EMISSION: u32 = 1024u; // shade: with the hits' emission
const PARAM_MISS: u32 = 2048u;    // shade: with the background, where rays missed

const PARAM_COARSER: u32 = 16384u; // coarser levels of textures stand for what is not resident
const PARAM_GLOSSY: u32 = 8192u;   // what surfaces reflect otherwise than diffusely comes by rays of its own, too

const BATCH_SAMPLES: u32 = 64u;   // samples that are summed before the radiance is emptied

struct Ray {
    origin: vec3<f32>,    // in the frame, device units
    t_min: f32,
    direction: vec3<f32>, // not normalised
    t_max: f32,           // below t_min: the ray is not traced; T_INFINITE: unbounded
}

struct Hit {
    t: f32,               // distance in units of the direction; t_max while there is no hit
    id: u32,              // global triangle id, NONE while there is no hit
    u: f32,               // weight of stored vertex 1
    v: f32,               // weight of stored vertex 2
}

struct Surface {
    point: vec3<f32>,     // origin for secondary rays, offset toward the ray's side, in the frame
    leaf: u32,            // leaf of the hit, NONE without one
    normal: vec3<f32>,    // geometric unit normal toward the ray's side, world space
    triangle: u32,        // triangle within the brick
    area: f32,            // twice the triangle's area in the world, device units
    source: u32,          // id of the triangle that the ray starts from, which it does not meet; NONE: of none
    pending: u32,         // 0: the ray has asked from the root, for nothing: it wants nothing else in its pass
    padding: u32,
}

struct TileBounds {       // over the traced rays of a tile
    origin_min: vec3<f32>,
    t_min: f32,
    origin_max: vec3<f32>,
    t_max: f32,
    direction_min: vec3<f32>,
    rays: u32,
    direction_max: vec3<f32>,
    padding: u32,
}

struct TileList {         // where a tile's entries lie in the lists
    first: u32,
    count: u32,
    selected: u32,        // entries of the selection, from `first` on
    from_root: u32,       // 1: the list was too long, the tile's rays walk from the root
    chosen: u32,          // of place i, not of tile i: the i-th tile that has a selection,
    rooted: u32,          // and the i-th whose rays walk from the root
}

struct Entry {            // of a tile's list
    leaf: u32,
    near: f32,            // no ray of the tile enters the leaf's box before this distance
}

struct TopNode2 {
    min: vec3<f32>,
    left: u32,
    max: vec3<f32>,
    right: u32,           // NONE: `left` is a leaf
}

struct BinaryNode {       // of a brick's binary tree, relative to the brick's origin
    min: vec3<f32>,
    what: u32,            // inner: index of its first child within the brick's nodes, the other follows; leaf: BINARY_LEAF
                          // with the number of its triangles, 0 to 3, in bits 29 and 30, and the first in the bits below
    max: vec3<f32>,
    padding: u32,
}

struct Leaf {
    offset_high: vec3<f32>, // brick origin - reference point, in the object's device units: high part
    instance: u32,
    offset_low: vec3<f32>,  // low part; zero for near bricks
    brick: u32,
}

struct Instance {
    object_from_world: array<vec4<f32>, 3>, // rows; w: translation in the frame
    world_from_object: array<vec4<f32>, 3>, // rows; w: translation in the frame
    base: u32,            // global id of triangle 0
    flags: u32,           // INSTANCE_* bits
    scale: f32,           // bound of the ratio of scales
    volume: f32,          // volume in the world of a unit cube of the object's, in device units
}

struct Brick {
    vertices: u32,        // word offsets within the geometry payload
    ids: u32,
    indices: u32,
    flags: u32,           // BRICK_* bits
    surfaces: u32,        // word offsets within the attribute payload
    attribute_indices: u32,
    opacity_of: u32,      // word offsets within the geometry payload, with BRICK_OPACITY
    opacities: u32,
    details: u32,         // word offset within the attribute payload, with BRICK_DETAIL
    padding0: u32,
    padding1: u32,
    padding2: u32,
}

struct Opacity {          // of a material
    factor: f32,          // alpha of the base colour factor
    cutoff: f32,          // of MASK
    blends: u32,          // 1: BLEND
    texels: u32,          // first vector of the texels in the table; NONE without a map
    width: u32,
    height: u32,
    wrap: u32,            // WRAP_* of s in the low half, of t in the high half
    padding: u32,
}

struct Slot {             // where a brick lies in the cache, and its part in the pass
    geometry_page: u32,
    geometry_offset: u32, // in 16-byte units
    attributes_page: u32,
    attributes_offset: u32,
    state: u32,           // STATE_* bits
    padding0: u32,
    padding1: u32,
    padding2: u32,
}

struct Pair {             // query pairs: a rectangle of rays and nodes of the binary top-level tree
    x0: u32,
    y0: u32,
    x1: u32,              // exclusive
    y1: u32,
    first: u32,           // of its nodes in `pair_nodes`
    count: u32,           // of its nodes, 1 to MOST_NODES
    padding0: u32,
    padding1: u32,
}

struct Demand {           // what rays still ask of a brick
    rays: atomic<u32>,
    nearest: atomic<u32>, // bits of the least entry distance, a non-negative f32
    next: atomic<u32>,    // rays that enter it before any other that they ask for
}

struct PairDemand {       // what the rays of a tile still ask of a leaf
    rays: atomic<u32>,
    nearest: atomic<u32>, // as above
}

struct Material {
    base_color: vec4<f32>,
    emission: vec3<f32>,
    metallic: f32,
    roughness: f32,
    alpha_cutoff: f32,
    flags: u32,           // MATERIAL_* bits
    base_color_texture: u32, // NONE: it has none; so with the others
    opacity_map: u32,
    normal_texture: u32,
    metallic_roughness_texture: u32,
    occlusion_texture: u32,
    emissive_texture: u32,
    normal_scale: f32,
    occlusion_strength: f32,
    clearcoat: f32,       // share that it covers
    specular: vec3<f32>,  // what its dielectric part reflects along the normal
    specular_weight: f32, // and at grazing angles
    clearcoat_roughness: f32,
    transmission: f32,
    uv_sets: u32,         // bit i: texture i takes the second set of coordinates
    padding: u32,
    uv_from_set: array<vec4<f32>, 10>, // two rows a texture; w of the first: by what areas grow
}

struct Texture {
    width: u32,
    height: u32,
    levels: u32,
    wrap: u32,            // WRAP_* of s in the low half, of t in the high half
    encoding: u32,        // TEXTURE_RGBA8, TEXTURE_BC7 or TEXTURE_BC5
    flags: u32,           // TEXTURE_SRGB
    first_tile: u32,      // of level 0; the tiles of a level follow each other row by row, and so do levels
    tail_level: u32,      // the first of the levels that are resident throughout
    tail_page: u32,       // where these lie
    tail_offset: u32,     // words within the page
    padding0: u32,
    padding1: u32,
}

struct TileSlot {         // where a tile of a texture lies in the cache
    page: u32,            // NONE: nowhere
    offset: u32,          // in 16-byte units
}

struct TileDemand {       // what texture lookups ask of a tile
    rays: atomic<u32>,    // hits that wait for some tile and need this one
    first: atomic<u32>,   // the least number of a ray among them
    used: atomic<u32>,    // 1: a lookup has read it
}

struct GBuffer {          // what shading reads of a primary hit
    albedo: vec3<f32>,    // linear base colour
    state: u32,           // 0: attributes not read yet; else GBUFFER_*
    normal: vec3<f32>,    // unit normal, world space: interpolated on the side of the geometric one, then by its texture
    material: u32,
    emission: vec3<f32>,
    footprint: f32,       // what the pixel covers of the first coordinates' unit square, an area; 0 without textures
    weights: vec2<f32>,   // barycentric weights of source vertices 1 and 2
    uv: vec2<f32>,
    tangent: vec3<f32>,   // of the normal texture, world space, not unit
    handedness: f32,      // the bitangent is this times cross(normal, tangent); 0 without a tangent
    uv1: vec2<f32>,       // second coordinates
    footprint1: f32,      // of these
    occlusion: f32,       // share of unshadowed light that the occlusion texture leaves
    metallic: f32,
    roughness: f32,
    padding0: u32,        // with DVF_PAPER: 1 where its cell is mostly occluded
    padding1: u32,
}

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
    padding0: u32,
    padding1: u32,
    padding2: u32,
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

const NONE: u32 = 0xffffffffu;
const EMITTER_PARALLELOGRAM: u32 = 0u;
const EMITTER_TRIANGLE: u32 = 1u;
const EMITTER_POINT: u32 = 2u;
const EMITTER_SPOT: u32 = 3u;
const EMITTER_DISTANT: u32 = 4u;
const EMITTER_KIND: u32 = 7u;      // the bits of the above
const EMITTER_TWO_SIDED: u32 = 8u;
const T_INFINITE: f32 = 3.4028234e38;
const INSTANCE_IDENTITY: u32 = 1u;
const INSTANCE_MIRRORED: u32 = 2u;
const BRICK_WIDE: u32 = 1u;
const BRICK_INDEX32: u32 = 2u;
const BRICK_OPACITY: u32 = 4u;
const NO_NORMAL: u32 = 0x80008000u;  // normal word of an attribute vertex without one
const BRICK_DETAIL: u32 = 8u;
const MATERIAL_DOUBLE_SIDED: u32 = 4u;
const MATERIAL_UNLIT: u32 = 8u;
const RSM_PERSPECTIVE: u32 = 1u;
const GBUFFER_READ: u32 = 1u;      // attributes are read
const GBUFFER_WAITS: u32 = 62u;    // bits of textures that have still to be looked up, the first is that of texture 0
const GBUFFER_FIRST: u32 = 1u;     // its place
const BASE_COLOR: u32 = 0u;        // textures of a material
const NORMAL: u32 = 1u;
const METALLIC_ROUGHNESS: u32 = 2u;
const OCCLUSION: u32 = 3u;
const EMISSIVE: u32 = 4u;
const MATERIAL_TEXTURES: u32 = 5u;
const REFLECTANCE_SIZE: u32 = 32u; // rows and columns of the table of reflectances
const TEXTURE_RGBA8: u32 = 0u;     // encoding: texels; else blocks
const TEXTURE_BC7: u32 = 1u;
const TEXTURE_BC5: u32 = 2u;       // x and y of directions
const TEXTURE_SRGB: u32 = 1u;      // flags: red, green and blue are sRGB, else linear
const TILE_TEXELS: u32 = 128u;     // side of a tile
const ROMA_HIT: u32 = 0xfffffffeu;   // id of what ROMA meets, which is no triangle
const ROMA_WHOLE: u32 = 0u; // all of them
const ROMA_FAR: u32 = 1u;   // from where they have been traced to
const HANDOVERS: u32 = 6u;       // distances up to which rays may be traced, roma_measure
const ROMA_SIFT: u32 = 2u;  // those alone that meet nothing
const FIELD_HIT: u32 = 0xfffffffdu;  // id of what is met in a distance field, which is no triangle
const DVF_HIT: u32 = 0xfffffffcu;    // id of what a discrete visibility field says is met, which is no triangle
const DVF_HAMMERSLEY: u32 = 1u;    // points are those of Hammersley, else hashed
const DVF_ROUND: u32 = 2u;         // numbers of points are rounded, else raised to whole ones
const DVF_BOTH: u32 = 4u;          // rays start from both sides of triangles, else from their front
const DVF_DOUBT: u32 = 8u;         // rays are traced where a mask says both or neither, else by the label
const DVF_PAPER: u32 = 16u;        // what the masks do not know is not traced, and the label is noted with the hit's attributes
const DVF_WALK: u32 = 512u;        // elements of a sweep that a workgroup has
const BINARY_LEAF: u32 = 0x80000000u;
const STATE_GEOMETRY: u32 = 1u;    // geometry is resident
const STATE_DONE: u32 = 2u;        // every ray that wanted it has been intersected with it in this pass
const STATE_BATCH: u32 = 4u;       // geometry arrived with the current batch
const STATE_ATTRIBUTES: u32 = 8u;  // attributes are resident
const COUNTER_PAIRS_TESTED: u32 = 0u;
const COUNTER_PAIRS_CULLED: u32 = 1u;
const COUNTER_PAIRS_VISIBLE: u32 = 2u;
const COUNTER_PAIRS_INVISIBLE: u32 = 3u;
const COUNTER_PAIRS_INTERSECTED: u32 = 4u;
const COUNTER_LIST_ENTRIES: u32 = 5u;
const COUNTER_STACK_OVERFLOW: u32 = 6u;
const COUNTER_NON_FINITE: u32 = 7u;
const COUNTER_RAYS: u32 = 8u;
const COUNTER_NODES: u32 = 9u;
const COUNTER_TRIANGLES: u32 = 10u;
const COUNTER_HITS: u32 = 11u;
const COUNTER_MOST_SELECTED: u32 = 12u;
const COUNTER_FRONT_TO_BACK: u32 = 13u;
const COUNTER_TILE_BATCHES: u32 = 14u;
const COUNTER_TILE_BATCH_LEAVES: u32 = 15u;
const COUNTER_LEAF_GROUPS: u32 = 16u;
const COUNTER_TIGHTENED: u32 = 17u;
const COUNTER_TILES_FROM_ROOT: u32 = 18u;
const COUNTER_TILES_CHOSEN: u32 = 19u;
const COUNTER_ROMA_CAPPED: u32 = 20u;
const COUNTER_UNRESOLVED: u32 = 21u;
const COUNTER_DVF_ANSWERED: u32 = 22u;
const COUNTER_FIELD_CAPPED: u32 = 23u;
const COUNTER_PILOTS: u32 = 24u;    // rays that were sifted and traced all the same; then those wrongly free, and those wrongly met by HANDOVERS
const WORK_CHOSEN: u32 = 32u;      // the workgroups over chosen tiles: in x, y and z, and how many of them have work
const WORK_ROOTED: u32 = 36u;      // the same over tiles whose rays walk from the root
