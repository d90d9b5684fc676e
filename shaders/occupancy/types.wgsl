// Base occupancy maps.

struct Level {        // a base map in the frame: point p lies at scale * p + first, in its cells
    first: vec3<f32>,
    scale: f32,
    lift: f32,            // by which rays start off their surface, device units: 1.5 cells of a map
    padding0: u32,
    padding1: u32,
    padding2: u32,
}
