// Cuts fireflies of a layer's light, single pixels far brighter than their neighbours, and takes the light into the
// averages.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "denoise/denoise.wgsl"

const LONG: f32 = 12.0;            // frames that the long average weighs alike; after them a new one weighs 1/12
const SHORT_SHARE: f32 = 0.25;     // what a new frame weighs in the short average, at least
const FADE: f32 = 0.8;             // what a frame leaves of the size that counted as brightest before it
// Neighbours are looked for so far away, pixels: where one ray in thirty finds light, nine of ten that do have another
// among 80.
const RADIUS: i32 = 4;
const LEAST_NEIGHBOURS: u32 = 4u;  // fewer on the same surface say nothing
const DEVIATIONS: f32 = 4.0;       // of the neighbours above their mean that a pixel may have

// The greatest size that the neighbours of a pixel allow it, and 1; 0 where they say nothing. It is at least that of
// the brightest of them, and the brightest that each of them had before: what is rare but comes again is light.
fn limit(place: vec2<i32>, pixel: u32) -> vec2<f32> {
    let surface = seen[pixel];
    let first = least_around(place, RADIUS);
    let last = most_around(place, RADIUS);
    var count = 0u;
    var mean = 0.0;
    var squares = 0.0;
    var most = 0.0;
    for (var y = first.y; y <= last.y; y++) {
        for (var x = first.x; x <= last.x; x++) {
            let other = index_of(vec2<i32>(x, y));
            let at = own.layer * pixels() + other;
            if other == pixel || lit[at].variance == 0.0 || !is_as(surface, other) {
                continue;
            }
            let l = size(lit[at].color);
            count += 1u;
            let delta = l - mean;
            mean += barrier(delta * divide(1.0, f32(count)));
            squares += barrier(delta * (l - mean));
            most = max(max(most, l), known[at].brightest);
        }
    }
    if count < LEAST_NEIGHBOURS {
        return vec2<f32>(0.0);
    }
    let deviation = square_root(max(divide(squares, f32(count - 1u)), 0.0));
    return vec2<f32>(max(mean + barrier(DEVIATIONS * deviation), most), 1.0);
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
    if seen[pixel].id == NONE {
        past[at] = DenoisePast();
        return;
    }
    var p = known[at];
    var light = lit[at].color;
    let is_sound_light = lit[at].variance != 0.0;
    var spread = given[pixel].spreads[own.layer];
    let l = size(light);
    p.brightest = max(barrier(FADE * p.brightest), select(0.0, l, is_sound_light));
    if own.sparse != 0u && is_sound_light {
        let allowed = limit(place, pixel);
        if allowed.y != 0.0 && l > allowed.x {
            let share = divide(allowed.x, l);
            let kept = light * share;
            picture[pixel].w = luminance(given[pixel].albedo * (light - barrier3(kept)));
            light = barrier3(kept);
            spread = barrier(spread * barrier(share * share));
            atomicAdd(&tally[DENOISE_FIREFLIES], 1u);
        }
    }
    if is_sound_light {
        // Mean and spread of samples by weights: West, "Updating Mean and Variance Estimates", CACM 1979.
        p.length = min(p.length + 1.0, LONG);
        let alpha = divide(1.0, p.length);
        let rest = 1.0 - alpha;
        p.long = mixed(p.long, light, alpha);
        p.short = mixed(p.short, light, max(alpha, SHORT_SHARE));
        let delta = light - p.mean;
        p.mean = mixed(p.mean, light, alpha);
        p.spread = barrier(rest * (p.spread + barrier(alpha * squared(delta)))) + barrier(alpha * spread);
        p.squares =
            barrier(barrier(rest * rest) * p.squares) + divide(barrier(alpha * alpha), max(given[pixel].samples, 1.0));
    }
    p.count = 0.0;
    if p.squares > 0.0 {
        p.count = divide(1.0, p.squares);
    }
    past[at] = p;
}
