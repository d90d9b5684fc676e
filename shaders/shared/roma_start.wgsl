// Where a ray starts in base maps, which overlap. Twin: src/cpu/roma.rs.

// Cells before its sides at which a level ends for ray `index`.
fn margin_of(index: u32) -> f32 {
    let side = f32(params.roma_cells);
    return barrier(BLEND * barrier(side * random2(index, ~params.stream, params.seed).x));
}

// What is missing to the level's lift of a ray that is `height` off its surface.
fn lift_of(level: RomaLevel, height: f32) -> f32 {
    return clamp(level.lift - height, 0.0, level.lift);
}

fn lifted(origin: vec3<f32>, normal: vec3<f32>, lift: f32) -> vec3<f32> {
    return barrier3(origin + barrier3(lift * normal));
}

// The finest level that holds the start; the number of levels where none does.
fn start_level_of(origin: vec3<f32>, normal: vec3<f32>, margin: f32) -> u32 {
    let side = f32(params.roma_cells);
    for (var l = 0u; l < params.roma_levels; l++) {
        let level = roma_levels[l];
        let at = barrier3(barrier3(lifted(origin, normal, level.lift) * level.scale) + level.first);
        if all(at >= vec3<f32>(margin)) && all(at <= vec3<f32>(side - margin)) {
            return l;
        }
    }
    return params.roma_levels - select(1u, 0u, params.roma_is_part != 0u);
}
