// Base occupancy maps.

struct Level {            // A base map in the frame: point p lies at scale * p + first, in its cells.
    first: vec3<f32>,     // where the origin of the frame lies
    scale: f32,           // cells of a device unit
    lift: f32,            // by which rays start off their surface, device units: 1.5 cells of a map
    padding0: u32,
    padding1: u32,
    padding2: u32,
}
