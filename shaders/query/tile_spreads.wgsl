// Bounds of what the cones of a tile's rays spread by, for tile_bounds.wgsl: of one workgroup, by lanes.

var<workgroup> spreads: array<vec2<f32>, 64>;

fn start_spreads(lane: u32) {
    spreads[lane] = vec2<f32>(T_INFINITE, 0.0);
}

// Adds a ray's to a lane.
fn bound_spread(lane: u32, ray: u32) {
    let own = bitcast<f32>(surfaces[ray].pending >> 1u);
    spreads[lane] = vec2<f32>(min(spreads[lane].x, own), max(spreads[lane].y, own));
}

// Adds the bounds of another lane to those of a lane.
fn join_spreads(lane: u32, other: u32) {
    spreads[lane] = vec2<f32>(min(spreads[lane].x, spreads[other].x), max(spreads[lane].y, spreads[other].y));
}

// Those of lane 0, as TileBounds has them; 0 without rays.
fn tile_spreads() -> u32 {
    if spreads[0].x > spreads[0].y {
        return 0u;
    }
    let bits = bitcast<vec2<u32>>(spreads[0]);
    return (bits.x & 0xffff0000u) | ((bits.y + 0xffffu) >> 16u);
}
