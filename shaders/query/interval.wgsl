// The interval test of a whole tile against a box: can any ray of the tile meet it within its range? At least as
// conservative as the ray's own padded test (node.wgsl), because every bound holds for every ray of the tile.

const INTERVAL_UNIT: f32 = 5.9604645e-8; // 2^-24

struct IntervalHit {
    near: f32,            // no ray of the tile enters the box before this distance
    hit: bool,
}

// Range of distances on one axis: slab [lo, hi] relative to nothing, origins [o0, o1], directions [d0, d1].
fn axis_range(lo: f32, hi: f32, o0: f32, o1: f32, d0: f32, d1: f32) -> vec2<f32> {
    let below = lo - o1;  // least signed distance to the lower plane
    let above = hi - o0;  // greatest signed distance to the upper plane
    if d0 > 0.0 {
        // near: the lower plane; it is nearest for the fastest direction where ahead, for the slowest where behind.
        let near = select(below / d0, below / d1, below > 0.0);
        let far = select(above / d1, above / d0, above > 0.0);
        return vec2<f32>(near, far);
    }
    if d1 < 0.0 {
        let near = select(above / d1, above / d0, above < 0.0);
        let far = select(below / d0, below / d1, below < 0.0);
        return vec2<f32>(near, far);
    }
    // Some ray runs parallel: only a slab strictly ahead on one side bounds the near distance.
    var near = -T_INFINITE;
    if below > 0.0 {
        if d1 <= 0.0 { return vec2<f32>(T_INFINITE, -T_INFINITE); }
        near = below / d1;
    }
    if above < 0.0 {
        if d0 >= 0.0 { return vec2<f32>(T_INFINITE, -T_INFINITE); }
        near = above / d0;
    }
    return vec2<f32>(near, T_INFINITE);
}

fn tile_meets_box(tile: TileBounds, box_min: vec3<f32>, box_max: vec3<f32>, slack: f32) -> IntervalHit {
    let ends = max(abs(box_min - tile.origin_min), abs(box_max - tile.origin_max));
    let reach = max(abs(box_min - tile.origin_max), max(abs(box_max - tile.origin_min), ends));
    let m = max(reach.x, max(reach.y, reach.z));
    let o = max(abs(tile.origin_min), abs(tile.origin_max));
    let delta = vec3<f32>(64.0 * INTERVAL_UNIT * m + slack * (m + max(o.x, max(o.y, o.z))))
        + 8.0 * INTERVAL_UNIT * max(abs(box_min), abs(box_max));
    let lo = box_min - delta;
    let hi = box_max + delta;
    let x = axis_range(lo.x, hi.x, tile.origin_min.x, tile.origin_max.x, tile.direction_min.x, tile.direction_max.x);
    let y = axis_range(lo.y, hi.y, tile.origin_min.y, tile.origin_max.y, tile.direction_min.y, tile.direction_max.y);
    let z = axis_range(lo.z, hi.z, tile.origin_min.z, tile.origin_max.z, tile.direction_min.z, tile.direction_max.z);
    let near = max(max(x.x, y.x), z.x);
    let far = min(min(x.y, y.y), z.y);
    // Quotients err by 2.5 ulp each; eight units of the last place on both sides cover the comparison.
    let widened_near = near - abs(near) * 16.0 * INTERVAL_UNIT;
    let widened_far = min(far, T_INFINITE) + min(abs(far), 1.0e30) * 16.0 * INTERVAL_UNIT;
    let start = max(widened_near, max(tile.t_min, 0.0));
    return IntervalHit(start, tile.rays > 0u && start <= min(widened_far, tile.t_max));
}
