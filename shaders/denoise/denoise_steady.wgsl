// Has the long average of a layer give way to the short one as far as their difference over a neighbourhood is more
// than chance. Differences are taken pixel by pixel: what both averages show there falls out.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "denoise/denoise.wgsl"

const SHORT: f32 = 4.0;            // frames of the short average: with no more there is nothing to tell
const TEST_RADIUS: i32 = 5;        // neighbourhood of the test for change, pixels to each side
const BOUND_RADIUS: i32 = 2;       // neighbourhood that bounds the long average
const CHANCE: f32 = 1.5;           // standard errors that a difference may have by chance
const DEVIATIONS: f32 = 2.0;       // about the mean of the short average within which the long one is held

// How much of the difference of the averages around a pixel is more than chance, 0 to 1.
fn change(place: vec2<i32>, surface: DenoiseSeen) -> f32 {
    let first = least_around(place, TEST_RADIUS);
    let last = most_around(place, TEST_RADIUS);
    var count = 0u;
    var mean = 0.0;
    var squares = 0.0;
    for (var y = first.y; y <= last.y; y++) {
        for (var x = first.x; x <= last.x; x++) {
            let other = index_of(vec2<i32>(x, y));
            if !is_as(surface, other) {
                continue;
            }
            let at = own.layer * pixels() + other;
            let d = luminance(past[at].short) - luminance(past[at].long);
            count += 1u;
            let delta = d - mean;
            mean += barrier(delta * divide(1.0, f32(count)));
            squares += barrier(delta * (d - mean));
        }
    }
    if count < FEWEST || mean == 0.0 {
        return 0.0;
    }
    let variance = divide(max(squares, 0.0), f32(count - 1u));
    let chance = barrier(CHANCE * square_root(divide(variance, f32(count))));
    return clamp(1.0 - divide(chance, abs(mean)), 0.0, 1.0);
}

// The long average, moved to the short one by the share `changed` and held near the short ones around it.
fn held(place: vec2<i32>, surface: DenoiseSeen, p: DenoisePast, changed: f32) -> vec3<f32> {
    let first = least_around(place, BOUND_RADIUS);
    let last = most_around(place, BOUND_RADIUS);
    var count = 0u;
    var mean = vec3<f32>(0.0);
    var squares = vec3<f32>(0.0);
    for (var y = first.y; y <= last.y; y++) {
        for (var x = first.x; x <= last.x; x++) {
            let other = index_of(vec2<i32>(x, y));
            if !is_as(surface, other) {
                continue;
            }
            let color = past[own.layer * pixels() + other].short;
            count += 1u;
            let delta = color - mean;
            mean += barrier3(delta * divide(1.0, f32(count)));
            squares += barrier3(delta * (color - mean));
        }
    }
    let moved = mixed(p.long, p.short, changed);
    if count < FEWEST {
        return moved;
    }
    var bounded = moved;
    for (var k = 0u; k < 3u; k++) {
        let reach = barrier(DEVIATIONS * square_root(divide(max(squares[k], 0.0), f32(count - 1u))));
        bounded[k] = min(max(moved[k], mean[k] - reach), mean[k] + reach);
    }
    return bounded;
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
    var p = past[at];
    if p.length > SHORT {
        let surface = seen[pixel];
        let changed = change(place, surface);
        p.long = held(place, surface, p, changed);
        // The more has changed, the sooner new frames outweigh both averages; at 1 they begin anew.
        p.length = min(p.length, divide(1.0 - changed, max(changed, LEAST_NORMAL_NUMBER)));
    }
    known[at] = p;
}
