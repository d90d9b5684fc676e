// Denoising: bindings of group 2, pixels and their neighbours, colours. Every result is the same bit for bit as that of
// its twin: products that feed a sum pass a barrier, divisions and roots are exact.

#include "common/exact.wgsl"
#include "denoise/types.wgsl"

@group(1) @binding(6) var<uniform> own: DenoiseOwn;
@group(2) @binding(0) var<storage, read> seen: array<DenoiseSeen>;
@group(2) @binding(1) var<storage, read> given: array<DenoiseGiven>;
@group(2) @binding(2) var<storage, read> seconds: array<DenoiseSecond>;
@group(2) @binding(3) var<storage, read_write> past: array<DenoisePast>;   // by layer and pixel
@group(2) @binding(4) var<storage, read_write> known: array<DenoisePast>;  // the same while a frame is filtered
@group(2) @binding(5) var<storage, read_write> lit: array<DenoiseLit>;     // two halves, in each by layer and pixel
// radiance; what goes around the filter while that is at work, and w, the luminance that was cut off fireflies
@group(2) @binding(6) var<storage, read_write> picture: array<vec4<f32>>;
@group(2) @binding(7) var<storage, read_write> tally: array<atomic<u32>, 4>;

const LEAST_ALBEDO: f32 = 0.0009765625;     // 1/1024: light on less goes around the filter
const LEAST_NORMAL_NUMBER: f32 = 1.1754944e-38;
const FEWEST: u32 = 5u;                     // pixels of a neighbourhood that tell whether light has changed

fn pixels() -> u32 {
    return own.width * own.height;
}

// The pixel of a thread. Workgroups of 8x8 pixels cover the picture, row by row.
fn place_of(group: vec3<u32>, groups: vec3<u32>, local: vec3<u32>) -> vec2<i32> {
    let across = (own.width + 7u) / 8u;
    let number = group.y * groups.x + group.x;
    return vec2<i32>(8u * vec2<u32>(number % across, number / across) + local.xy);
}

fn is_inside(place: vec2<i32>) -> bool {
    return place.x >= 0 && place.y >= 0 && place.x < i32(own.width) && place.y < i32(own.height);
}

fn index_of(place: vec2<i32>) -> u32 {
    return u32(place.y) * own.width + u32(place.x);
}

fn least_around(place: vec2<i32>, radius: i32) -> vec2<i32> {
    return max(place - radius, vec2<i32>(0));
}

fn most_around(place: vec2<i32>, radius: i32) -> vec2<i32> {
    return min(place + radius, vec2<i32>(i32(own.width), i32(own.height)) - 1);
}

fn dot_of(a: vec3<f32>, b: vec3<f32>) -> f32 {
    return barrier(a.x * b.x) + barrier(a.y * b.y) + barrier(a.z * b.z);
}

fn luminance(c: vec3<f32>) -> f32 {
    return barrier(0.2126 * c.x) + barrier(0.7152 * c.y) + barrier(0.0722 * c.z);
}

// The square of a colour, or of a difference of colours: of greys that of their luminance.
fn squared(c: vec3<f32>) -> f32 {
    let shares = barrier3(vec3<f32>(0.2126, 0.7152, 0.0722) * c);
    return barrier(shares.x * c.x) + barrier(shares.y * c.y) + barrier(shares.z * c.z);
}

fn size(c: vec3<f32>) -> f32 {
    return square_root(squared(c));
}

// a on the way to b by the share t; b at 1.
fn mixed(a: vec3<f32>, b: vec3<f32>, t: f32) -> vec3<f32> {
    return select(a + barrier3(t * (b - a)), b, t >= 1.0);
}

fn mixed_number(a: f32, b: f32, t: f32) -> f32 {
    return select(a + barrier(t * (b - a)), b, t >= 1.0);
}

fn divided(a: vec3<f32>, b: f32) -> vec3<f32> {
    return vec3<f32>(divide(a.x, b), divide(a.y, b), divide(a.z, b));
}

// Whether a number is finite, with room for a square of its own.
fn is_sound(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7fffffffu) < 0x7e800000u;
}

fn is_sound3(c: vec3<f32>) -> bool {
    return is_sound(c.x) && is_sound(c.y) && is_sound(c.z);
}

// Distance of `point` from the plane of `a`, world units.
fn off_plane(a: DenoiseSeen, point: vec3<f32>) -> f32 {
    return abs(dot_of(point - a.point, a.plane));
}

// Whether two pixels show one surface: the same triangle, or normals within 26 degrees and planes within two pixels.
fn is_same_surface(a: DenoiseSeen, id: u32, normal: vec3<f32>, point: vec3<f32>) -> bool {
    if a.id == NONE || id == NONE {
        return false;
    }
    let is_near = off_plane(a, point) <= 2.0 * max(a.footprint, LEAST_NORMAL_NUMBER);
    return a.id == id || (dot_of(a.normal, normal) > 0.9 && is_near);
}

fn is_as(a: DenoiseSeen, other: u32) -> bool {
    return is_same_surface(a, seen[other].id, seen[other].normal, seen[other].point);
}
