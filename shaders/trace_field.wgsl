// Sphere tracing through a distance field (Hart 1996): twin of DistanceField::trace_local. Lengths are in cells of the finest level, positions
// from its first cell.

struct Params {
    cells: u32,                                                             // of the finest level, on each axis
    rays: u32,
    iterations: u32,
    zero: u32,                                                              // 0, which no compiler knows
    hit: f32,
    least_step: f32,
    has_seed: u32,
    unused: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> finest: array<u32>;                // two f16 a word, the first lowest
@group(0) @binding(2) var<storage, read> halved: array<u32>;
@group(0) @binding(3) var<storage, read> quartered: array<u32>;
@group(0) @binding(4) var<storage, read> rays: array<vec4<f32>>;            // two a ray: origin and t_min, direction and t_max
@group(0) @binding(5) var<storage, read_write> results: array<vec2<u32>>;   // bits of t, all ones for none; look-ups, and 2^31 if they were all

const COARSEST = 2u;

// Keeps a product from being fused with a sum.
fn rounded(x: f32) -> f32 {
    return bitcast<f32>(bitcast<u32>(x) | params.zero);
}

fn stored(level: u32, index: u32) -> f32 {
    var word = 0u;
    switch level {
        case 0u: { word = finest[index / 2u]; }
        case 1u: { word = halved[index / 2u]; }
        default: { word = quartered[index / 2u]; }
    }
    // 0, or from 1 to 2^9: from the exponent's bias of 15 to that of 127.
    let bits = word >> (16u * (index & 1u)) & 0xffffu;
    return select(bitcast<f32>((bits << 13u) + (112u << 23u)), 0.0, bits == 0u);
}

fn between(a: f32, b: f32, t: f32) -> f32 {
    return a + rounded((b - a) * t);
}

// The distance at a point of a level.
fn distance_at(level: u32, point: vec3<f32>) -> f32 {
    let count = params.cells >> level;
    let width = f32(1u << level);
    let at = clamp(point / width - 0.5, vec3<f32>(0.0), vec3<f32>(f32(count - 1u)));
    let low = min(vec3<u32>(at), vec3<u32>(count - 2u));
    let weight = at - vec3<f32>(low);
    var faces: array<f32, 2>;
    for (var x = 0u; x < 2u; x++) {
        let index = ((low.x + x) * count + low.y) * count + low.z;
        let near = between(stored(level, index), stored(level, index + 1u), weight.z);
        let far = between(stored(level, index + count), stored(level, index + count + 1u), weight.z);
        faces[x] = between(near, far, weight.y);
    }
    return between(faces[0], faces[1], weight.x);
}

// One thread a ray.
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.rays {
        return;
    }
    let origin = rays[2u * id.x];
    let direction = rays[2u * id.x + 1u];
    let size = f32(params.cells);
    var t = origin.w;
    var end = direction.w;
    var is_in = params.has_seed != 0u;
    for (var k = 0u; k < 3u; k++) {
        if direction[k] == 0.0 {
            is_in &= origin[k] >= 0.0 && origin[k] <= size;
        } else {
            let a = -origin[k] / direction[k];
            let b = (size - origin[k]) / direction[k];
            t = max(t, min(a, b));
            end = min(end, max(a, b));
        }
    }
    var level = COARSEST;
    var found = 0xffffffffu;
    var iteration = 0u;
    while is_in && iteration < params.iterations && t <= end {
        let way = vec3<f32>(rounded(t * direction.x), rounded(t * direction.y), rounded(t * direction.z));
        let distance = distance_at(level, origin.xyz + way);
        iteration++;
        let width = f32(1u << level);
        if level > 0u && distance < 2.0 * width {
            level--;
            continue;
        }
        if distance <= params.hit {
            found = bitcast<u32>(t);
            break;
        }
        t += max(distance, params.least_step);
        if level < COARSEST && distance >= 4.0 * width {
            level++;
        }
    }
    let is_capped = is_in && found == 0xffffffffu && iteration == params.iterations && t <= end;
    results[id.x] = vec2<u32>(found, iteration | select(0u, 0x80000000u, is_capped));
}
