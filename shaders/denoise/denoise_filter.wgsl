// One level of the edge-avoiding à-trous wavelet (Dammertz et al., HPG 2010) over a layer: a 5x5 B-spline with holes.
// Levels read one half of the light and write the other; after the first, its colour is the history's.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "denoise/denoise.wgsl"

// Widths of a pixel that a point may be off a plane, for each pixel between them, and count as on it: of the first
// frame, and the least. The more frames an average has, the less it needs of what lies around, and edges stay sharp.
const PLANE_FIRST: f32 = 0.25;
const PLANE_LEAST: f32 = 0.06;
const LEAST_WEIGHT: f32 = 9.094947e-13; // 2^-40: less counts as nothing
const LOG2_E: f32 = 1.442695;

// The cubic B-spline's weight by distance.
fn spline(distance: i32) -> f32 {
    return select(select(0.0625, 0.25, distance == 1), 0.375, distance == 0);
}

// exp(-x) of x >= 0 within 2^-20 of it, relative; 0 from 28 on and of what is no number.
fn exp_of_minus(x: f32) -> f32 {
    if !(x < 28.0) {
        return 0.0;
    }
    let y = barrier(x * LOG2_E);
    let whole = floor(y + 0.5);
    let g = whole - y;
    // 2^g of -0.5..0.5 by its series: ln(2)^k / k!.
    var p = 0.0001540353;
    p = barrier(p * g) + 0.0013333558;
    p = barrier(p * g) + 0.009618129;
    p = barrier(p * g) + 0.05550411;
    p = barrier(p * g) + 0.2402265;
    p = barrier(p * g) + 0.6931472;
    p = barrier(p * g) + 1.0;
    return bitcast<f32>(bitcast<u32>(p) - (u32(whole) << 23u));
}

// The 32nd power of the cosine between normals.
fn of_normals(a: vec3<f32>, b: vec3<f32>) -> f32 {
    var cosine = max(dot_of(a, b), 0.0);
    for (var k = 0; k < 5; k++) {
        cosine = barrier(cosine * cosine);
    }
    return cosine;
}

// The unit vector along which a surface mirrors the view.
fn mirrored(s: DenoiseSeen) -> vec3<f32> {
    let view = divided(s.point, max(square_root(dot_of(s.point, s.point)), LEAST_NORMAL_NUMBER));
    return view - barrier3(2.0 * barrier(dot_of(view, s.normal)) * s.normal);
}

// The variance over 3x3 pixels by a Gaussian.
fn smooth_variance(place: vec2<i32>, pixel: u32, base: u32, surface: DenoiseSeen) -> f32 {
    let first = least_around(place, 1);
    let last = most_around(place, 1);
    var sum = 0.0;
    var weights = 0.0;
    for (var y = first.y; y <= last.y; y++) {
        for (var x = first.x; x <= last.x; x++) {
            let other = index_of(vec2<i32>(x, y));
            if other != pixel && !is_as(surface, other) {
                continue;
            }
            let weight = select(0.25, 0.5, x == place.x) * select(0.25, 0.5, y == place.y);
            sum += barrier(weight * lit[base + other].variance);
            weights += weight;
        }
    }
    return divide(sum, weights);
}

// One thread a pixel.
@compute @workgroup_size(8, 8)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    let place = place_of(group, groups, local);
    if !is_inside(place) {
        return;
    }
    let pixel = index_of(place);
    let at = own.layer * pixels() + pixel;
    // Level 0 reads the second half.
    let base = own.layer * pixels() + select(0u, 2u * pixels(), (own.level & 1u) == 0u);
    let to = at + select(0u, 2u * pixels(), (own.level & 1u) != 0u);
    let is_first = own.level == 0u;
    if is_first {
        past[at] = known[at];
    }
    let mine = lit[base + pixel];
    let surface = seen[pixel];
    lit[to] = mine;
    if surface.id == NONE {
        return;
    }
    let is_young = known[at].young != 0u;
    let variance = smooth_variance(place, pixel, base, surface);
    // Pixels without variance around them stay as they are, but for young ones.
    if variance <= 0.0 && !is_young {
        return;
    }
    var per_size = 0.0;
    if !is_young {
        per_size = divide(1.0, barrier(own.tolerance * square_root(variance)) + 1e-12);
    }
    let plane = max(divide(PLANE_FIRST, max(known[at].length, 1.0)), PLANE_LEAST);
    let per_length = divide(1.0, max(barrier(plane * surface.footprint), LEAST_NORMAL_NUMBER));
    let polish = given[pixel].polish;
    var way = vec3<f32>(0.0);
    if polish > 0.0 {
        way = mirrored(surface);
    }
    let step = i32(1u << own.level);
    var sum = vec3<f32>(0.0);
    var variances = 0.0;
    var weights = 0.0;
    for (var dy = -2; dy <= 2; dy++) {
        for (var dx = -2; dx <= 2; dx++) {
            let there = place + step * vec2<i32>(dx, dy);
            if !is_inside(there) {
                continue;
            }
            let other = index_of(there);
            if seen[other].id == NONE {
                continue;
            }
            let theirs = lit[base + other];
            var weight = spline(abs(dx)) * spline(abs(dy));
            if other != pixel {
                // Distances are powers of two.
                let doubled = select(0u, 1u, max(abs(dx), abs(dy)) == 2);
                let per_distance = bitcast<f32>((127u - own.level - doubled) << 23u);
                let off = barrier(barrier(off_plane(surface, seen[other].point) * per_length) * per_distance);
                let apart = barrier(size(theirs.color - mine.color) * per_size);
                var turned = 0.0;
                if polish > 0.0 {
                    let by = mirrored(seen[other]) - way;
                    turned = barrier(square_root(dot_of(by, by)) * polish);
                }
                let unlike = off + apart + turned;
                weight = barrier(weight * of_normals(surface.normal, seen[other].normal)) * exp_of_minus(unlike);
            }
            weight = barrier(weight);
            if !(weight >= LEAST_WEIGHT) {
                continue;
            }
            sum += barrier3(weight * theirs.color);
            variances += barrier(barrier(weight * weight) * theirs.variance);
            weights += weight;
        }
    }
    // The pixel itself has a weight of 9/64.
    let color = divided(sum, weights);
    lit[to] = DenoiseLit(color, divide(variances, barrier(weights * weights)));
    if is_first {
        past[at].long = color;
    }
}
