// Where a ray starts in base maps, which overlap. Twin: src/secondary/roma/twin.rs.

// Cells before its sides at which a level ends for ray `index`.
fn margin_of(index: u32) -> f32 {
    let side = f32(own.cells);
    return barrier(BLEND * barrier(side * random2(index, ~params.stream, params.seed).x));
}

// What is missing to a level's lift of a ray that is `height` off its surface.
fn lift_of(lift: f32, height: f32) -> f32 {
    return clamp(lift - height, 0.0, lift);
}

// t at which a ray is so many cells of the base map that holds its start from there; T_INFINITE where none holds it.
fn near_end(index: u32, ray: Ray, cells: u32) -> f32 {
    let d = ray.direction;
    let length = square_root(barrier(barrier(barrier(d.x * d.x) + barrier(d.y * d.y)) + barrier(d.z * d.z)));
    let l = start_level_of(ray.origin, seen_surfaces[index].normal, margin_of(index));
    if l >= own.levels {
        return T_INFINITE;
    }
    return divide(f32(cells), barrier(roma_levels[l].scale * length));
}

fn lifted(origin: vec3<f32>, normal: vec3<f32>, lift: f32) -> vec3<f32> {
    return barrier3(origin + barrier3(lift * normal));
}

// The finest level that holds the start; the number of levels where none does.
fn start_level_of(origin: vec3<f32>, normal: vec3<f32>, margin: f32) -> u32 {
    let side = f32(own.cells);
    for (var l = 0u; l < own.levels; l++) {
        let level = roma_levels[l];
        let at = barrier3(barrier3(lifted(origin, normal, level.lift) * level.scale) + level.first);
        if all(at >= vec3<f32>(margin)) && all(at <= vec3<f32>(side - margin)) {
            return l;
        }
    }
    return own.levels - select(1u, 0u, own.is_part != 0u);
}
