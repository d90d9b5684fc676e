// Answers the pass's rays by distance fields (Zeng et al., ROMA, §6, their baseline): sphere tracing (Hart 1996) in the
// finest level that holds the start, then in the next where the ray leaves one. Rays start off their surface by the
// level's lift, so that no level meets what they leave. What is met is written as a hit of no triangle.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "shade/shading.wgsl"
#include "common/exact.wgsl"
#include "common/random.wgsl"
#include "df/field.wgsl"
#include "occupancy/levels.wgsl"

const COARSEST: u32 = 2u;
// Least way between two look-ups, cells.
const LEAST_STEP: f32 = 0.5;

// What a ray finds.
struct Found {
    t: f32,          // where it meets something; below 0: nothing
    is_capped: bool, // it made as many look-ups as it may, and was not at its end
}

// How a ray goes on from one look-up to the next.
struct Way {
    mip: u32,        // the level of the field that it reads
    look_ups: u32,   // that it made
}

// Distance `index` of the level that begins with word `first`, cells; of a field with occupied cells.
fn stored(first: u32, index: u32) -> f32 {
    // 0, or from 1 to 2^9: from the exponent's bias of 15 to that of 127.
    let bits = distances[first + index / 2u] >> (16u * (index & 1u)) & 0xffffu;
    return select(bitcast<f32>((bits << 13u) + (112u << 23u)), 0.0, bits == 0u);
}

fn between(a: f32, b: f32, t: f32) -> f32 {
    return barrier(a + barrier(barrier(b - a) * t));
}

// The distance at a point, cells of the finest level: of the eight cells whose middles are around it, by their
// nearness.
fn distance_at(level: u32, mip: u32, point: vec3<f32>) -> f32 {
    let count = own.cells >> mip;
    let first = first_distance(level, mip);
    let per_cell = 1.0 / f32(1u << mip);
    let at = clamp(barrier3(point * per_cell) - 0.5, vec3<f32>(0.0), vec3<f32>(f32(count - 1u)));
    let low = min(vec3<u32>(at), vec3<u32>(count - 2u));
    let weight = at - vec3<f32>(low);
    var faces: array<f32, 2>;
    for (var x = 0u; x < 2u; x++) {
        let index = ((low.x + x) * count + low.y) * count + low.z;
        let near = between(stored(first, index), stored(first, index + 1u), weight.z);
        let far = between(stored(first, index + count), stored(first, index + count + 1u), weight.z);
        faces[x] = between(near, far, weight.y);
    }
    return between(faces[0], faces[1], weight.x);
}

// Through field `level`: `at` and `speed` in its cells, `range` within it.
fn through(level: u32, at: vec3<f32>, speed: vec3<f32>, range: vec2<f32>, way: ptr<function, Way>) -> Found {
    // Without an occupied cell all distances are infinite.
    if (distances[first_distance(level, 0u)] & 0xffffu) == INFINITE {
        return Found(-1.0, false);
    }
    let squares = barrier(barrier(speed.x * speed.x) + barrier(speed.y * speed.y)) + barrier(speed.z * speed.z);
    let per_cell = divide(1.0, square_root(barrier(squares)));
    var t = range.x;
    while (*way).look_ups < own.steps && t <= range.y {
        let point = vec3<f32>(along(at.x, speed.x, t), along(at.y, speed.y, t), along(at.z, speed.z, t));
        let distance = distance_at(level, (*way).mip, point);
        (*way).look_ups += 1u;
        // Within two of its cells a level says little.
        let width = f32(1u << (*way).mip);
        if (*way).mip > 0u && distance < 2.0 * width {
            (*way).mip -= 1u;
            continue;
        }
        if distance <= own.hit {
            return Found(t, false);
        }
        t = barrier(t + barrier(max(distance, LEAST_STEP) * per_cell));
        if (*way).mip < COARSEST && distance >= 4.0 * width {
            (*way).mip += 1u;
        }
    }
    return Found(-1.0, t <= range.y);
}

// Answers a ray; whether it was capped.
fn trace(index: u32, ray: Ray) -> bool {
    let normal = seen_surfaces[index].normal;
    let side = f32(own.cells);
    let margin = barrier(BLEND * barrier(side * random2(index, ~params.stream, params.seed).x));
    var start_level = own.levels - 1u;
    for (var l = 0u; l < own.levels; l++) {
        let level = field_levels[l];
        let start = barrier3(ray.origin + barrier3(level.lift * normal));
        let at = barrier3(barrier3(start * level.scale) + level.first);
        if all(at >= vec3<f32>(margin)) && all(at <= vec3<f32>(side - margin)) {
            start_level = l;
            break;
        }
    }
    let d = ray.direction;
    let squares = barrier(barrier(barrier(d.x * d.x) + barrier(d.y * d.y)) + barrier(d.z * d.z));
    let rise = barrier(barrier(barrier(d.x * normal.x) + barrier(d.y * normal.y)) + barrier(d.z * normal.z));
    // A ray starts near a surface.
    var way = Way(0u, 0u);
    var t = ray.t_min;
    for (var l = start_level; l < own.levels; l++) {
        let level = field_levels[l];
        let start = barrier3(ray.origin + barrier3(level.lift * normal));
        let at = barrier3(barrier3(start * level.scale) + level.first);
        let speed = barrier3(ray.direction * level.scale);
        let low = select(margin, 0.0, l + 1u == own.levels);
        let high = side - low;
        let end = end_of(ray.t_max, level.lift, squares, rise);
        var range = vec2<f32>(t, end);
        range = clipped(range, at.x, speed.x, low, high);
        range = clipped(range, at.y, speed.y, low, high);
        range = clipped(range, at.z, speed.z, low, high);
        if range.x <= range.y {
            let found = through(l, at, speed, range, &way);
            if found.t >= 0.0 {
                hits[index] = Hit(found.t, MET, 0.0, 0.0);
            }
            if found.t >= 0.0 || found.is_capped || range.y >= end {
                return found.is_capped;
            }
            // The distances of a level are those to what it holds: the ray goes on where it left it, however far it
            // saw.
            t = range.y;
        }
    }
    return false;
}

var<workgroup> counted: atomic<u32>; // rays answered, and in the upper half those that were capped

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
        atomicAdd(&counters[COUNTER_RAYS_ANSWERED], sum & 0xffffu);
        atomicAdd(&counters[COUNTER_RAYS_CAPPED], sum >> 16u);
    }
}
