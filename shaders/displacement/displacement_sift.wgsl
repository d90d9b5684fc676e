// Answers the rays of the pass that displacement fields tell, before rays are traced: of each carrier that a ray meets
// the field says whether and where it meets something. What lies near the ray's start, what a field leaves unknown and
// what has no field is traced, up to where the last of it ends.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "common/exact.wgsl"
#include "displacement/field.wgsl"

// A quarter of a turn: positions of m rings are about this over m apart.
const QUARTER_TURN: f32 = 1.5707964;
// Slower than this, in device units a unit of t, a ray stays where it is on an axis.
const LEAST_SPEED: f32 = 0x1p-60;
const STACK: u32 = 40u; // more than the height of a tree over 2^32 carriers

// What is known of a ray.
struct Known {
    met: f32,             // where it meets something for sure; below 0: nothing is known of
    traced: f32,          // up to where it must be traced; below 0: nowhere
    is_worth: bool,       // tracing would bring in a brick, or meets a copy
}

// The interval of t in which a ray is in a box.
fn box_range(node: DisplacementNode, origin: vec3<f32>, inverse: vec3<f32>) -> vec2<f32> {
    let a = barrier3(barrier3(node.min - origin) * inverse);
    let b = barrier3(barrier3(node.max - origin) * inverse);
    let low = min(a, b);
    let high = max(a, b);
    return vec2<f32>(max(max(low.x, low.y), low.z), min(min(high.x, high.y), high.z));
}

fn row_of(row: vec4<f32>, v: vec3<f32>) -> f32 {
    return product(row.xyz, v);
}

// Asks a carrier about the interval up to `end`; `leaves` is where the ray leaves its box.
fn ask(carrier: DisplacementCarrier, ray: Ray, end: f32, leaves: f32, known: ptr<function, Known>) {
    if carrier.field == NONE {
        (*known).traced = max((*known).traced, leaves);
        return;
    }
    if carrier.brick == NONE || (slots[carrier.brick].state & STATE_GEOMETRY) == 0u {
        (*known).is_worth = true;
    }
    atomicAdd(&asked[carrier.field], 1u);
    let field = fields[carrier.field];
    if field.codes == NONE {
        (*known).traced = max((*known).traced, leaves);
        return;
    }
    let m = carrier.unit_from_point;
    let way = vec3<f32>(row_of(m[0], ray.direction), row_of(m[1], ray.direction), row_of(m[2], ray.direction));
    let start = barrier3(
        vec3<f32>(row_of(m[0], ray.origin), row_of(m[1], ray.origin), row_of(m[2], ray.origin))
            + vec3<f32>(m[0].w, m[1].w, m[2].w)
    );
    let per_unit = divide(1.0, square_root(product(way, way)));
    let chord = chord_of(start, barrier3(way * per_unit));
    if chord.half < 0.0 {
        return;
    }
    let enter = barrier(barrier(chord.at - chord.half) * per_unit);
    let leave = barrier(barrier(chord.at + chord.half) * per_unit);
    if leave < ray.t_min || enter > end {
        return;
    }
    let near = barrier(barrier(own.near * divide(QUARTER_TURN, f32(field.rings))) * per_unit);
    let share = share_of(field, chord);
    let t = barrier(barrier(chord.at + from_middle(chord, share)) * per_unit);
    if share < 0.0 || t > end {
        if enter < near && near > ray.t_min {
            (*known).traced = max((*known).traced, min(near, leave));
        }
    } else if t <= near {
        (*known).traced = max((*known).traced, leave);
    } else if (*known).met < 0.0 || t < (*known).met {
        (*known).met = t;
    }
}

// Answers a ray, or a part of it; 1: all of it, 2: a part.
fn sift(index: u32, ray: Ray) -> u32 {
    let is_any = (params.flags & PARAM_ANY_HIT) != 0u;
    let end = hits[index].t;
    var inverse: vec3<f32>;
    for (var k = 0u; k < 3u; k++) {
        let speed = ray.direction[k];
        let least = select(LEAST_SPEED, -LEAST_SPEED, speed < 0.0);
        inverse[k] = divide(1.0, select(speed, least, abs(speed) < LEAST_SPEED));
    }
    var known = Known(-1.0, -1.0, (own.look & DISPLACEMENT_ABSENT) == 0u);
    var stack: array<u32, STACK>;
    var count = 1u;
    while count > 0u {
        count -= 1u;
        let node = nodes[stack[count]];
        let range = box_range(node, ray.origin, inverse);
        if !(max(range.x, ray.t_min) <= min(range.y, end)) {
            continue;
        }
        if node.is_leaf == 0u {
            stack[count] = node.first + 1u;
            stack[count + 1u] = node.first;
            count += 2u;
            continue;
        }
        ask(carriers[node.first], ray, end, range.y, &known);
        // What a ray meets first is not known of the closest hit; any is enough.
        if select(known.traced >= end || known.met >= 0.0, known.met >= 0.0 && known.is_worth, is_any) {
            break;
        }
    }
    if !known.is_worth || (!is_any && known.met >= 0.0) {
        return 0u;
    }
    if known.met >= 0.0 {
        hits[index] = Hit(-1.0, MET, 0.0, 0.0);
        return 1u;
    }
    if known.traced < ray.t_min {
        hits[index].t = -1.0;
        return 1u;
    }
    if known.traced < end {
        hits[index].t = known.traced;
        return 2u;
    }
    return 0u;
}

var<workgroup> counted: atomic<u32>; // rays answered, and in the upper half those of which a part is traced

// One thread a ray.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    if global.x < params.width && global.y < params.height && own.nodes > 0u {
        let index = global.y * params.width + global.x;
        let ray = rays[index];
        if is_traced(index, ray) {
            let answered = sift(index, ray);
            atomicAdd(&counted, select(0u, select(1u, 65536u, answered == 2u), answered != 0u));
        }
    }
    workgroupBarrier();
    if lane == 0u {
        let sum = atomicLoad(&counted);
        atomicAdd(&counters[COUNTER_RAYS_ANSWERED], sum & 0xffffu);
        atomicAdd(&counters[COUNTER_RAYS_SHORTENED], sum >> 16u);
    }
}
