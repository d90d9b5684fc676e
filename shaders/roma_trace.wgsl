// Answers the pass's rays by ray-aligned occupancy maps (Zeng et al., Algorithm 2): in the finest level that holds the start, then in the
// next where the ray leaves one. Rays start off their surface by the level's lift, so that no level meets what they leave. What is
// met is written as a hit of no triangle; where the closest is asked for, with the point, against the direction travelled as its normal, and the
// level's lift as its area: such a hit is known to a cell.
#include "shared/types.wgsl"
#include "shared/bindings.wgsl"
#include "shared/shading.wgsl"
#include "shared/exact.wgsl"
#include "shared/random.wgsl"
#include "shared/roma.wgsl"

// A level ends before its sides, ray by ray, by up to this share of them, so that no edge between levels shows.
const BLEND: f32 = 1.0 / 16.0;
// Columns that a ray passes at most which would be snapped to below its surface and is not.
const GRAZING_STEPS: u32 = 64u;
// Slower than this, in cells a unit of t, a ray stays where it is.
const LEAST_SPEED: f32 = 0x1p-60;

// What a ray finds in a level.
struct Found {
    t: f32,          // where it meets something; below 0: nothing
    is_capped: bool, // it passed as many columns as it may, and was finished snapped
}

// The part of the range of t in which a coordinate lies between `low` and `high`.
fn clipped(range: vec2<f32>, at: f32, speed: f32, low: f32, high: f32) -> vec2<f32> {
    if abs(speed) < LEAST_SPEED {
        return select(vec2<f32>(1.0, 0.0), range, at >= low && at <= high);
    }
    let inverse = divide(1.0, speed);
    let a = barrier(barrier(low - at) * inverse);
    let b = barrier(barrier(high - at) * inverse);
    return vec2<f32>(max(range.x, min(a, b)), min(range.y, max(a, b)));
}

// Position at t.
fn along(at: f32, speed: f32, t: f32) -> f32 {
    return barrier(at + barrier(t * speed));
}

// t at which a ray meets the next border of cell `cell`.
fn border(at: f32, speed: f32, cell: i32) -> f32 {
    if abs(speed) < LEAST_SPEED {
        return T_INFINITE;
    }
    let side = f32(cell + select(0, 1, speed > 0.0));
    return barrier(barrier(side - at) * divide(1.0, speed));
}

// The first cell of a column that a ray at height `at` with vertical `speed` meets from t = range.x to range.y; below 0: none.
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

// Through a map: `at` and `speed` in its cells, `range` within it. With no `steps` the ray is along the columns.
fn through(map: u32, at: vec3<f32>, speed: vec3<f32>, range: vec2<f32>, steps: u32) -> Found {
    let last = i32(params.roma_size) - 1;
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

// Answers a ray; whether it was capped in some level.
fn trace(index: u32, ray: Ray) -> bool {
    let normal = seen_surfaces[index].normal;
    let maps = params.roma_k * params.roma_k;
    let stratum = stratum_of(ray.direction);
    var direction = ray.direction;
    var steps = params.roma_steps;
    if steps == 0u {
        let d = ray.direction;
        let length = square_root(barrier(barrier(barrier(d.x * d.x) + barrier(d.y * d.y)) + barrier(d.z * d.z)));
        let snapped = barrier3(select(-length, length, d.z >= 0.0) * roma_maps[stratum].direction.xyz);
        let above = barrier(barrier(snapped.x * normal.x) + barrier(snapped.y * normal.y)) + barrier(snapped.z * normal.z);
        if above >= 0.0 {
            direction = snapped;
        } else {
            steps = GRAZING_STEPS;
        }
    }
    let side = f32(params.roma_cells);
    let margin = barrier(BLEND * barrier(side * random2(index, ~params.stream, params.seed).x));
    var start_level = params.roma_levels - 1u;
    for (var l = 0u; l < params.roma_levels; l++) {
        let level = roma_levels[l];
        let start = barrier3(ray.origin + barrier3(level.lift * normal));
        let at = barrier3(barrier3(start * level.scale) + level.first);
        if all(at >= vec3<f32>(margin)) && all(at <= vec3<f32>(side - margin)) {
            start_level = l;
            break;
        }
    }
    var t = ray.t_min;
    var is_capped = false;
    for (var l = start_level; l < params.roma_levels; l++) {
        let level = roma_levels[l];
        let start = barrier3(ray.origin + barrier3(level.lift * normal));
        let at = barrier3(barrier3(start * level.scale) + level.first);
        let speed = barrier3(direction * level.scale);
        let low = select(margin, 0.0, l + 1u == params.roma_levels);
        let high = side - low;
        var range = vec2<f32>(t, ray.t_max);
        range = clipped(range, at.x, speed.x, low, high);
        range = clipped(range, at.y, speed.y, low, high);
        range = clipped(range, at.z, speed.z, low, high);
        if range.x <= range.y {
            let map = l * maps + stratum;
            let rows = roma_maps[map].cell_from_point;
            let cell = vec3<f32>(affine(rows[0], start), affine(rows[1], start), affine(rows[2], start));
            let cells = vec3<f32>(linear(rows[0], direction), linear(rows[1], direction), linear(rows[2], direction));
            let found = through(map, cell, cells, range, steps);
            is_capped = is_capped || found.is_capped;
            if found.t >= 0.0 {
                hits[index] = Hit(found.t, ROMA_HIT, 0.0, 0.0);
                if (params.flags & PARAM_ANY_HIT) == 0u {
                    surfaces[index].point = barrier3(start + barrier3(found.t * direction));
                    surfaces[index].normal = -direction;
                    surfaces[index].area = level.lift;
                }
                return is_capped;
            }
            if range.y >= ray.t_max {
                return is_capped;
            }
            t = range.y;
        }
    }
    return is_capped;
}

var<workgroup> counted: atomic<u32>; // rays, and in the upper half those that were capped

// One thread a ray.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    if global.x < params.width && global.y < params.height {
        let index = global.y * params.width + global.x;
        let ray = rays[index];
        if ray.t_min <= ray.t_max {
            atomicAdd(&counted, select(1u, 65537u, trace(index, ray)));
        }
    }
    workgroupBarrier();
    if lane == 0u {
        let sum = atomicLoad(&counted);
        atomicAdd(&counters[COUNTER_RAYS], sum & 0xffffu);
        atomicAdd(&counters[COUNTER_ROMA_CAPPED], sum >> 16u);
    }
}
