// Rays, what they meet, tiles of them, and what they ask for.

struct Ray {              // The interval from t_min to t_max is closed.
    origin: vec3<f32>,    // in the frame, device units
    t_min: f32,           // in units of the direction, as t_max is
    direction: vec3<f32>, // not normalised
    t_max: f32,           // below t_min: the ray is not traced; T_INFINITE: unbounded
}

struct Hit {              // The closest hit of a ray so far.
    t: f32,               // distance in units of the direction; t_max while there is no hit
    id: u32,              // global triangle id, NONE while there is no hit
    u: f32,               // weight of stored vertex 1
    v: f32,               // weight of stored vertex 2
}

struct Surface {          // Where a hit lies, for the rays that start from it.
    point: vec3<f32>,     // origin for secondary rays, offset toward the ray's side, in the frame
    leaf: u32,            // leaf of the hit, NONE without one
    normal: vec3<f32>,    // geometric unit normal toward the ray's side, world space
    triangle: u32,        // triangle within the brick
    // twice the triangle's area in the world, device units; of rays to lamps without a hit by what probability theirs
    // was drawn (Chosen)
    area: f32,
    source: u32,          // id of the triangle that the ray starts from, which it does not meet; NONE: of none
    // bit 0 is 0 where the ray has asked from the root, for nothing: it wants nothing else in its pass; the other bits
    // are those of an f32 below 2, without its sign: the square of what its cone spreads by beyond its pass's
    // (levels.wgsl); bit 31 is PENDING_MISSING
    pending: u32,
    // of rays to emitters: theirs; of rays to the environment: the number of their candidate; of what is reflected:
    // bits of the curvature of the surface that it starts from (GBuffer)
    emitter: u32,
}

struct Origin {           // Where the path of a ray of set 1 comes from.
    pixel: u32,           // its pixel's number in the band
    direction: u32,       // number of the direction that it began with
}

struct TileBounds {       // Bounds of the traced rays of a tile.
    origin_min: vec3<f32>, // least coordinates of the origins
    t_min: f32,           // least t_min
    origin_max: vec3<f32>, // greatest coordinates of the origins
    t_max: f32,           // greatest t_max
    direction_min: vec3<f32>, // least components of the directions
    rays: u32,            // traced rays of the tile
    direction_max: vec3<f32>, // greatest components of the directions
    // what their cones spread by beyond their pass's, squared: the upper half of an f32, of the least in the high half,
    // rounded down, of the greatest in the low half, rounded up
    spreads: u32,
}

struct TileList {         // where a tile's entries lie in the lists
    first: u32,           // first entry of the tile
    count: u32,           // entries of the tile
    selected: u32,        // entries of the selection, from `first` on
    from_root: u32,       // 1: the list was too long, the tile's rays walk from the root
    chosen: u32,          // of place i, not of tile i: the i-th tile that has a selection
    rooted: u32,          // of place i: the i-th tile whose rays walk from the root
}

struct Entry {            // An entry of a tile's list.
    node: u32,            // of the binary top-level tree, a leaf
    near: f32,            // no ray of the tile enters the node's box before this distance
}

struct Pair {             // A query pair: a rectangle of rays and nodes of the binary top-level tree.
    x0: u32,              // first column of rays
    y0: u32,              // first row of rays
    x1: u32,              // column behind the last
    y1: u32,              // row behind the last
    first: u32,           // the first of its nodes in `pair_nodes`
    count: u32,           // number of its nodes, 1 to MOST_NODES
    padding0: u32,
    padding1: u32,
}

struct Demand {           // what rays still ask of a brick
    rays: atomic<u32>,    // that ask for the brick
    nearest: atomic<u32>, // bits of the least entry distance, a non-negative f32
    next: atomic<u32>,    // rays that enter it before any other that they ask for
}

struct PairDemand {       // what the rays of a tile still ask of a leaf
    rays: atomic<u32>,    // that ask for the leaf's brick
    nearest: atomic<u32>, // bits of the least entry distance
}

// Bit of pending, after rays have asked for what stands in: some of what they would enter is missing, and nothing
// stands in for it. No cone spreads so much that it needs the bit.
const PENDING_MISSING: u32 = 0x80000000u;

const STATE_GEOMETRY: u32 = 1u;    // geometry is resident
const STATE_DONE: u32 = 2u;        // every ray that wanted it has been intersected with it in this pass
const STATE_BATCH: u32 = 4u;       // geometry arrived with the current batch
const STATE_ATTRIBUTES: u32 = 8u;  // attributes are resident

// Index of a counter.
const COUNTER_PAIRS_TESTED: u32 = 0u;
const COUNTER_PAIRS_CULLED: u32 = 1u;
const COUNTER_PAIRS_VISIBLE: u32 = 2u;
const COUNTER_PAIRS_INVISIBLE: u32 = 3u;
const COUNTER_PAIRS_INTERSECTED: u32 = 4u;
const COUNTER_LIST_ENTRIES: u32 = 5u;
const COUNTER_STACK_OVERFLOW: u32 = 6u;
const COUNTER_NON_FINITE: u32 = 7u;
const COUNTER_RAYS_TRACED: u32 = 8u;
const COUNTER_NODES: u32 = 9u;
const COUNTER_TRIANGLES: u32 = 10u;
const COUNTER_MOST_SELECTED: u32 = 12u;
const COUNTER_FRONT_TO_BACK: u32 = 13u;
const COUNTER_TILE_BATCHES: u32 = 14u;
const COUNTER_TILE_BATCH_LEAVES: u32 = 15u;
const COUNTER_TIGHTENED: u32 = 16u;
const COUNTER_TILES_FROM_ROOT: u32 = 17u;
const COUNTER_TILES_CHOSEN: u32 = 18u;
const COUNTER_RAYS_CAPPED: u32 = 19u;
const COUNTER_UNRESOLVED: u32 = 20u;
const COUNTER_RAYS_ANSWERED: u32 = 21u;
const COUNTER_PILOTS: u32 = 22u;    // rays sifted and yet traced; then those wrongly free, wrongly met by HANDOVERS
const COUNTER_RAYS_SHORTENED: u32 = 30u; // rays of which a part is answered and the rest traced
const COUNTER_PATHS: u32 = 31u;    // paths that go on
const WORK_CHOSEN: u32 = 32u;      // the workgroups over chosen tiles: in x, y and z, and how many of them have work
const WORK_ROOTED: u32 = 36u;      // the same over tiles whose rays walk from the root
const MET: u32 = 0xfffffffeu;         // id of a hit that a method of secondary visibility gives, which is no triangle
