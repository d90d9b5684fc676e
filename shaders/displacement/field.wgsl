// What displacement fields say of rays through their spheres. Twins: src/secondary/displacement/shape.rs and field.rs.

#include "common/angles.wgsl"
#include "displacement/types.wgsl"

@group(1) @binding(6) var<uniform> own: DisplacementOwn;
@group(2) @binding(0) var<storage, read> nodes: array<DisplacementNode>;
@group(2) @binding(1) var<storage, read> carriers: array<DisplacementCarrier>;
@group(2) @binding(2) var<storage, read> fields: array<DisplacementField>;
// Of all shapes, one after another.
@group(2) @binding(3) var<storage, read> table: array<DisplacementPosition>;
// Samples of all fields: four codes a word, or 32 bits.
@group(2) @binding(4) var<storage, read> codes: array<u32>;
// Per field, how many rays have asked it.
@group(2) @binding(5) var<storage, read_write> asked: array<atomic<u32>>;

// Codes of 8 bits that say where: 0 to 254, of 254 the whole chord.
const STEPS: f32 = 254.0;

// The way of a ray through the unit sphere.
struct Chord {
    direction: vec3<f32>, // unit vector along the ray
    at: f32,              // from the origin to the middle, below 0 behind it
    middle: vec3<f32>,    // the point of its line that is nearest to the middle of the sphere
    half: f32,            // of its length; below 0: it misses the sphere
}

// Where stored rays go.
struct Aim {
    to: vec3<f32>,        // a point, or a direction
    is_point: f32,        // 1: it is a point, 0: a direction
}

// Weighed samples.
struct Sum {
    met: f32,
    free: f32,
    shares: f32,
}

fn product(a: vec3<f32>, b: vec3<f32>) -> f32 {
    return barrier(barrier(barrier(a.x * b.x) + barrier(a.y * b.y)) + barrier(a.z * b.z));
}

fn chord_of(origin: vec3<f32>, direction: vec3<f32>) -> Chord {
    let at = -product(origin, direction);
    let middle = barrier3(origin + barrier3(at * direction));
    let past = barrier(1.0 - product(middle, middle));
    return Chord(direction, at, middle, select(-1.0, square_root(max(past, 0.0)), past > 0.0));
}

// From the middle of a chord to a share of it.
fn from_middle(chord: Chord, share: f32) -> f32 {
    return barrier(barrier(barrier(2.0 * share) - 1.0) * chord.half);
}

fn of_hemisphere(rings: u32) -> u32 {
    return 2u * rings * rings + 2u * rings + 1u;
}

// How far from the pole a point of the unit sphere lies, in rings, and how far around, in points of a ring of one.
fn ring_place(rings: u32, at: vec3<f32>) -> vec2<f32> {
    let across = barrier(barrier(at.x * at.x) + barrier(at.y * at.y));
    let ring = barrier(f32(rings) * square_root(divide(across, 1.0 + abs(at.z))));
    return vec2<f32>(ring, 0.5 * eighths_around(at.x, at.y));
}

// The position of a ring that is nearest around.
fn on_ring(rings: u32, ring: u32, around: f32, is_lower: bool) -> u32 {
    let first = select(0u, of_hemisphere(rings), is_lower);
    if ring == 0u {
        return first;
    }
    return first + 1u + 2u * ring * (ring - 1u) + u32(barrier(around * f32(ring)) + 0.5) % (4u * ring);
}

// The position that is nearest to a point of the unit sphere, along its ring and across.
fn position_of(rings: u32, at: vec3<f32>) -> u32 {
    let place = ring_place(rings, at);
    return on_ring(rings, min(u32(place.x + 0.5), rings), place.y, at.z < 0.0);
}

// Where in the unit square a direction of any length lies whose z, along the inward normal, is not below 0.
fn square_place(d: vec3<f32>) -> vec2<f32> {
    let across = barrier(barrier(d.x * d.x) + barrier(d.y * d.y));
    let radius = square_root(divide(across, barrier(across + barrier(d.z * d.z))));
    return square_of_disc(d.xy, radius);
}

// Share of the chord at which a stored ray meets something; below 0: it meets nothing.
fn stored(field: DisplacementField, position: u32, square: u32) -> f32 {
    let index = position * field.directions * field.directions + square;
    if field.bits == 1u {
        let is_met = (codes[field.codes + (index >> 5u)] >> (index & 31u) & 1u) != 0u;
        return select(-1.0, field.mean, is_met);
    }
    let code = codes[field.codes + (index >> 2u)] >> (8u * (index & 3u)) & 255u;
    return select(divide(f32(code), STEPS), -1.0, code == DISPLACEMENT_MISS);
}

fn add(sum: ptr<function, Sum>, share: f32, weight: f32) {
    if share < 0.0 {
        (*sum).free = barrier((*sum).free + weight);
    } else {
        (*sum).met = barrier((*sum).met + weight);
        (*sum).shares = barrier((*sum).shares + barrier(weight * share));
    }
}

// Adds what the stored rays of a position say.
fn look_around(field: DisplacementField, position: u32, aim: Aim, weight: f32, sum: ptr<function, Sum>) {
    let row = table[field.table + position];
    let way = barrier3(aim.to - barrier3(aim.is_point * row.at.xyz));
    let local = vec3<f32>(product(way, row.x.xyz), product(way, row.y.xyz), max(-product(way, row.at.xyz), 0.0));
    let place = square_place(local);
    let n = field.directions;
    let last = n - 1u;
    if (own.look & DISPLACEMENT_DIRECTIONS) == 0u {
        let square = min(vec2<u32>(u32(barrier(place.x * f32(n))), u32(barrier(place.y * f32(n)))), vec2<u32>(last));
        add(sum, stored(field, position, square.x + n * square.y), weight);
        return;
    }
    let x = clamp(barrier(place.x * f32(n)) - 0.5, 0.0, f32(last));
    let y = clamp(barrier(place.y * f32(n)) - 0.5, 0.0, f32(last));
    let low = min(vec2<u32>(u32(x), u32(y)), vec2<u32>(n - 2u));
    let u = x - f32(low.x);
    let v = y - f32(low.y);
    for (var corner = 0u; corner < 4u; corner++) {
        let i = corner & 1u;
        let j = corner >> 1u;
        let share = barrier(select(u, 1.0 - u, i == 0u) * select(v, 1.0 - v, j == 0u));
        add(sum, stored(field, position, low.x + i + n * (low.y + j)), barrier(weight * share));
    }
}

// Their mean where most of the weight meets something; below 0 elsewhere.
fn look_toward(field: DisplacementField, entry: vec3<f32>, aim: Aim) -> f32 {
    var sum = Sum(0.0, 0.0, 0.0);
    let rings = field.rings;
    if (own.look & DISPLACEMENT_POSITIONS) == 0u {
        look_around(field, position_of(rings, entry), aim, 1.0, &sum);
    } else {
        let place = ring_place(rings, entry);
        let low = min(u32(place.x), rings - 1u);
        let out = min(place.x - f32(low), 1.0);
        for (var k = 0u; k < 2u; k++) {
            let ring = low + k;
            let of_ring = select(out, 1.0 - out, k == 0u);
            let at = barrier(place.y * f32(ring));
            let whole = f32(u32(at));
            let past = at - whole;
            for (var j = 0u; j < 2u; j++) {
                let weight = barrier(of_ring * select(past, 1.0 - past, j == 0u));
                var near = 0.0;
                if ring != 0u {
                    near = divide(whole + f32(j), f32(ring));
                }
                look_around(field, on_ring(rings, ring, near, entry.z < 0.0), aim, weight, &sum);
            }
        }
    }
    if sum.met > sum.free {
        return divide(sum.shares, sum.met);
    }
    return -1.0;
}

// Share of the chord at which a ray meets something; below 0: it meets nothing.
fn share_of(field: DisplacementField, chord: Chord) -> f32 {
    let entry = barrier3(chord.middle - barrier3(chord.half * chord.direction));
    if (own.look & DISPLACEMENT_AIMED) == 0u {
        return look_toward(field, entry, Aim(chord.direction, 0.0));
    }
    return look_toward(field, entry, Aim(chord.middle, 1.0));
}
