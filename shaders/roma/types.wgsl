// Ray-aligned occupancy maps.

struct RomaOwn {          // what a kernel is told
    k: u32,               // square root of the number of maps of a level
    size: u32,            // texels of a map on both axes, and cells of a column
    cells: u32,           // cells of a base map on each axis
    levels: u32,          // base maps
    samples: u32,         // look-ups of the base map a cell
    steps: u32,           // columns that a ray passes before it is finished snapped; 0: it is snapped
    // cells of the base map that holds a ray's start, up to where it is traced; NONE: to its end. roma_measure: in
    // one of a map
    near: u32,
    part: u32,            // which part of rays roma_trace answers, ROMA_*
    is_part: u32,         // 1: rays that leave the coarsest base map are not answered, 0: it holds the scene
    pilots: u32,          // of rays that maps answer one in so many is traced to its end; 0: none
}

struct RomaMap {          // A ray-aligned map. Columns run along its z.
    cell_from_point: array<vec4<f32>, 3>, // rows: cells of the map from points of the frame
    base_from_cell: array<vec4<f32>, 3>,  // rows: cells of the base map from those of the map
    direction: vec4<f32>, // unit vector along the columns, world space
}

const ROMA_WHOLE: u32 = 0u;        // maps answer whole rays
const ROMA_FAR: u32 = 1u;          // maps answer rays from where they have been traced to
const ROMA_SIFT: u32 = 2u;         // maps answer those rays alone that meet nothing
// maps answer whole rays; pilots, which have been traced, count for what maps get wrong
const ROMA_CORRECT: u32 = 3u;
const HANDOVERS: u32 = 6u;    // distances up to which rays may be traced, roma_measure
