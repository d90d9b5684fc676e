// Where rays that leave a triangle start: twin of src/math/exact.rs.

#include "trace/triangle.wgsl"

const LEAST_COORDINATE: f32 = 0x1p-60;
const OFFSET_ULPS: f32 = 0x1p-19;           // K u, K = 32

// A point on a triangle from which rays can start, in the frame of the vertices.
struct SurfacePoint {
    p: vec3<f32>,       // on the triangle, inset from its edges by more than the offset's error
    delta: f32,         // distance along n that clears the surface
    n: vec3<f32>,       // unit geometric normal on the side that the ray came from
    // Bit k: component k of the origin moves down (n[k] < 0; if n[k] is 0, away from where d points).
    down: u32,
    area: f32,          // twice the triangle's area
}

// Length of x, whose squares stay within the normal range.
fn length_of(x: vec3<f32>) -> f32 {
    return square_root(barrier(barrier(barrier(x.x * x.x) + barrier(x.y * x.y)) + barrier(x.z * x.z)));
}

// x / 2^e with the largest component in 1..2, and 2^e; components too small to matter become 0. x != 0.
struct Scaled {
    x: vec3<f32>,
    scale: f32,
}

fn scaled(x: vec3<f32>) -> Scaled {
    let m = abs(x);
    let exponent = clamp(bitcast<u32>(max(m.x, max(m.y, m.z))) >> 23u, 1u, 253u);
    let y = barrier3(x * bitcast<f32>((254u - exponent) << 23u));
    return Scaled(select(y, vec3<f32>(0.0), abs(y) < vec3<f32>(LEAST_SHEAR)), bitcast<f32>(exponent << 23u));
}

fn weighted(weights: vec3<f32>, a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> vec3<f32> {
    return barrier3(barrier3(barrier3(weights.x * a) + barrier3(weights.y * b)) + barrier3(weights.z * c));
}

// a, b, c relative to the frame's reference point (not to the ray), u, v, w, det of the hit, d the ray's direction in
// that frame.
fn surface_point(
    a: vec3<f32>,
    b: vec3<f32>,
    c: vec3<f32>,
    u: f32,
    v: f32,
    w: f32,
    det: f32,
    d: vec3<f32>,
) -> SurfacePoint {
    let ab = barrier3(b - a);
    let bc = barrier3(c - b);
    let ca = barrier3(a - c);
    let s = scaled(vec3<f32>(
        diffprod(ab.z, ca.y, ab.y, ca.z),
        diffprod(ab.x, ca.z, ab.z, ca.x),
        diffprod(ab.y, ca.x, ab.x, ca.y),
    ));
    let size = length_of(s.x);
    var n = vec3<f32>(divide(s.x.x, size), divide(s.x.y, size), divide(s.x.z, size));
    if size == 0.0 {
        // The vertices, rounded to this frame, lie on a line: any side toward the ray will do.
        let kz = ray_frame(d).kz;
        n = select(vec3<f32>(0.0), vec3<f32>(1.0), vec3<u32>(0u, 1u, 2u) == vec3<u32>(kz));
    }
    let toward = barrier(barrier(barrier(n.x * d.x) + barrier(n.y * d.y)) + barrier(n.z * d.z));
    if toward > 0.0 {
        n = -n;
    }
    let against = select(vec3<u32>(0u), vec3<u32>(1u), d > vec3<f32>(0.0));
    let below = select(select(vec3<u32>(0u), vec3<u32>(1u), n < vec3<f32>(0.0)), against, n == vec3<f32>(0.0));

    var weights = abs(vec3<f32>(divide(u, det), divide(v, det), divide(w, det)));
    let reach = weighted(weights, abs(a), abs(b), abs(c));
    let margin = barrier(4.0 * OFFSET_ULPS * barrier(barrier(reach.x + reach.y) + reach.z));
    let area = barrier(size * s.scale);
    let least = vec3<f32>(
        divide(barrier(margin * length_of(bc)), area),
        divide(barrier(margin * length_of(ca)), area),
        divide(barrier(margin * length_of(ab)), area),
    );
    weights = max(weights, min(least, vec3<f32>(0x1.555554p-2)));
    let total = barrier(barrier(weights.x + weights.y) + weights.z);
    weights = vec3<f32>(divide(weights.x, total), divide(weights.y, total), divide(weights.z, total));

    let near = weighted(weights, abs(a), abs(b), abs(c));
    let m = abs(n);
    let across = barrier(barrier(barrier(m.x * near.x) + barrier(m.y * near.y)) + barrier(m.z * near.z));
    let down = below.x | below.y << 1u | below.z << 2u;
    return SurfacePoint(weighted(weights, a, b, c), barrier(OFFSET_ULPS * across), n, down, area);
}

// p + step, at least one ulp from p toward the side of `down`.
fn offset_component(p: f32, step: f32, down: bool) -> f32 {
    let moved = barrier(p + step);
    let bits = bitcast<u32>(p);
    let away = (bits >= SIGN) == down;
    let neighbour = bitcast<f32>(select(bits - 1u, bits + 1u, away));
    let least = select(neighbour, select(LEAST_COORDINATE, -LEAST_COORDINATE, down), abs(p) < LEAST_COORDINATE);
    return select(max(moved, least), min(moved, least), down);
}

// Where rays that leave s start: p + delta n, every component moved by at least one ulp to its side.
fn offset_origin(s: SurfacePoint) -> vec3<f32> {
    let step = barrier3(s.delta * s.n);
    return vec3<f32>(
        offset_component(s.p.x, step.x, (s.down & 1u) != 0u),
        offset_component(s.p.y, step.y, (s.down & 2u) != 0u),
        offset_component(s.p.z, step.z, (s.down & 4u) != 0u),
    );
}
