// Rays through ray-aligned occupancy maps (Zeng et al., Algorithm 2). Twin: src/secondary/roma/twin.rs.

// Share of a level's lift by which rays start that are sifted.
const SIFTED_LIFT: f32 = 0.4;

// Columns that a ray passes at most which would be snapped to below its surface and is not.
const GRAZING_STEPS: u32 = 64u;

// What a ray finds in a level.
struct Found {
    t: f32,          // where it meets something; below 0: nothing
    is_capped: bool, // it passed as many columns as it may, and was finished snapped
}

// t at which a ray meets the next border of cell `cell`.
fn border(at: f32, speed: f32, cell: i32) -> f32 {
    if abs(speed) < LEAST_SPEED {
        return T_INFINITE;
    }
    let side = f32(cell + select(0, 1, speed > 0.0));
    return barrier(barrier(side - at) * divide(1.0, speed));
}

// The first cell of a column that a ray at height `at` with vertical `speed` meets from t = range.x to range.y; below
// 0: none.
fn met(column: u32, at: f32, speed: f32, range: vec2<f32>) -> f32 {
    let depth = first_cell(column, along(at, speed, range.x), along(at, speed, range.y), speed >= 0.0);
    if depth < 0.0 {
        return -1.0;
    }
    if abs(speed) < LEAST_SPEED {
        return range.x;
    }
    return clamp(divide(barrier(depth - at), speed), range.x, range.y);
}

// The part of a range between whose first and last cell the middles lie: half a cell less at the ends that are the
// ray's own, so that on the average over the places of maps it is as long as it is. `speed` in cells a unit of t.
fn trimmed(range: vec2<f32>, speed: vec3<f32>, ends: vec2<bool>) -> vec2<f32> {
    let squares = barrier(barrier(barrier(speed.x * speed.x) + barrier(speed.y * speed.y))
        + barrier(speed.z * speed.z));
    let half = divide(0.5, square_root(squares));
    return select(range, vec2<f32>(barrier(range.x + half), barrier(range.y - half)), ends);
}

// Through a map: `at` and `speed` in its cells, `range` within it. With no `steps` the ray is along the columns.
fn through(map: u32, at: vec3<f32>, speed: vec3<f32>, range: vec2<f32>, steps: u32) -> Found {
    if range.x > range.y {
        return Found(-1.0, false);
    }
    let last = i32(own.size) - 1;
    var x = clamp(i32(floor(along(at.x, speed.x, range.x))), 0, last);
    var y = clamp(i32(floor(along(at.y, speed.y, range.x))), 0, last);
    var t = range.x;
    for (var i = 0u; i < steps; i++) {
        let to_x = border(at.x, speed.x, x);
        let to_y = border(at.y, speed.y, y);
        let end = max(t, min(range.y, min(to_x, to_y)));
        let hit = met(first_word(map, u32(x), u32(y)), at.z, speed.z, vec2<f32>(t, end));
        if hit >= 0.0 || end >= range.y {
            return Found(hit, false);
        }
        if to_x <= to_y {
            x += select(-1, 1, speed.x > 0.0);
        } else {
            y += select(-1, 1, speed.y > 0.0);
        }
        if min(x, y) < 0 || max(x, y) > last {
            return Found(-1.0, false);
        }
        t = end;
    }
    return Found(met(first_word(map, u32(x), u32(y)), at.z, speed.z, vec2<f32>(t, range.y)), steps > 0u);
}

// What the levels answer.
struct Answer {
    t: f32,           // where the ray meets something; below 0: nowhere
    point: vec3<f32>, // that is there
    direction: vec3<f32>, // the one travelled
    lift: f32,        // of the level
    is_capped: bool,  // it was capped in some level
    is_known: bool,   // it meets something, or all of it lies in the levels
}

// The map that a ray takes, among those of a level.
struct Taken {
    map: u32,
    direction: vec3<f32>, // the one travelled
    steps: u32,           // columns that are passed before it is that of the map; 0: it is
}

fn length_of(d: vec3<f32>) -> f32 {
    return square_root(barrier(barrier(barrier(d.x * d.x) + barrier(d.y * d.y)) + barrier(d.z * d.z)));
}

// The map of the stratum that a ray lies in. A snapped ray takes its direction, unless that leads below the surface.
fn nearest(index: u32, ray: Ray) -> Taken {
    let d = ray.direction;
    let map = stratum_of(d);
    if own.steps > 0u {
        return Taken(map, d, own.steps);
    }
    let normal = seen_surfaces[index].normal;
    let length = length_of(d);
    let snapped = barrier3(select(-length, length, d.z >= 0.0) * roma_maps[map].direction.xyz);
    let above = barrier(barrier(snapped.x * normal.x) + barrier(snapped.y * normal.y)) + barrier(snapped.z * normal.z);
    if above >= 0.0 {
        return Taken(map, snapped, 0u);
    }
    return Taken(map, d, GRAZING_STEPS);
}

// Asks for a ray from t = `begin` on: in the finest level that holds its start, then in the next where it leaves one.
// Rays are off their surface by the level's lift where they enter it, so that no level meets what they leave; with
// `is_sifted` by less, and must be free to their own ends.
fn answer(index: u32, ray: Ray, taken: Taken, begin: f32, is_sifted: bool) -> Answer {
    let normal = seen_surfaces[index].normal;
    let maps = own.k * own.k;
    let direction = taken.direction;
    let side = f32(own.cells);
    let margin = margin_of(index);
    let start_level = start_level_of(ray.origin, normal, margin);
    let rise = barrier(barrier(barrier(direction.x * normal.x) + barrier(direction.y * normal.y))
        + barrier(direction.z * normal.z));
    let squares = barrier(barrier(barrier(direction.x * direction.x) + barrier(direction.y * direction.y))
        + barrier(direction.z * direction.z));
    var t = max(ray.t_min, begin);
    var is_capped = false;
    for (var l = start_level; l < own.levels; l++) {
        let level = roma_levels[l];
        let lift = lift_of(select(level.lift, barrier(SIFTED_LIFT * level.lift), is_sifted), barrier(t * rise));
        let start = lifted(ray.origin, normal, lift);
        let end = select(end_of(ray.t_max, lift, squares, rise), ray.t_max, is_sifted);
        let at = barrier3(barrier3(start * level.scale) + level.first);
        let speed = barrier3(direction * level.scale);
        let low = select(margin, 0.0, l + 1u == own.levels && own.is_part == 0u);
        let high = side - low;
        var range = vec2<f32>(t, end);
        range = clipped(range, at.x, speed.x, low, high);
        range = clipped(range, at.y, speed.y, low, high);
        range = clipped(range, at.z, speed.z, low, high);
        if range.x <= range.y {
            let map = l * maps + taken.map;
            let rows = roma_maps[map].cell_from_point;
            let cell = vec3<f32>(affine(rows[0], start), affine(rows[1], start), affine(rows[2], start));
            let cells = vec3<f32>(linear(rows[0], direction), linear(rows[1], direction), linear(rows[2], direction));
            let ends = vec2<bool>(l == start_level, range.y >= end);
            let found = through(map, cell, cells, select(trimmed(range, cells, ends), range, is_sifted), taken.steps);
            is_capped = is_capped || found.is_capped;
            if found.t >= 0.0 {
                let point = barrier3(start + barrier3(found.t * direction));
                return Answer(found.t, point, direction, level.lift, is_capped, true);
            }
            t = range.y;
            if t >= end {
                break;
            }
        }
    }
    // Without levels all of it lies outside.
    let is_known = own.levels > 0u && (own.is_part == 0u || t >= ray.t_max);
    return Answer(-1.0, vec3<f32>(0.0), direction, 0.0, is_capped, is_known);
}
