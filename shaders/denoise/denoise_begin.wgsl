// Takes a frame apart into light of lamps, other light and what goes around the filter, and recalls what histories have
// of each pixel's surface.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "denoise/denoise.wgsl"

fn is_sound_past(p: DenoisePast) -> bool {
    return is_sound3(p.long) && is_sound3(p.short) && is_sound3(p.mean)
        && is_sound(p.length) && is_sound(p.brightest) && is_sound(p.spread) && is_sound(p.squares);
}

// The history of a layer where the pixel's surface was before. What is not finite there is left out.
fn recalled(layer: u32, g: DenoiseGiven) -> DenoisePast {
    var sum = DenoisePast();
    if g.before == NONE {
        return sum;
    }
    var weights = 0.0;
    for (var k = 0u; k < 4u; k++) {
        let weight = g.shares[k];
        if !(weight > 0.0) {
            continue;
        }
        let column = (g.before & 0xffffu) + (k & 1u) - 1u;
        let row = (g.before >> 16u) + (k >> 1u) - 1u;
        let old = past[layer * pixels() + row * own.width + column];
        if !is_sound_past(old) || !(old.length > 0.0) {
            continue;
        }
        weights += weight;
        let share = divide(weight, weights);
        sum.long = mixed(sum.long, old.long, share);
        sum.short = mixed(sum.short, old.short, share);
        sum.mean = mixed(sum.mean, old.mean, share);
        sum.length = mixed_number(sum.length, old.length, share);
        sum.spread = mixed_number(sum.spread, old.spread, share);
        sum.squares = mixed_number(sum.squares, old.squares, share);
        sum.brightest = max(sum.brightest, old.brightest);
    }
    return sum;
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
    let g = given[pixel];
    for (var layer = 0u; layer < 2u; layer++) {
        let at = layer * pixels() + pixel;
        if own.remembers != 0u && !is_sound_past(past[at]) {
            atomicAdd(&tally[DENOISE_LOST], 1u);
        }
        known[at] = recalled(layer, g);
    }
    let radiance = picture[pixel].xyz;
    var around = vec3<f32>(0.0);
    var lamps = vec3<f32>(0.0);
    var other = vec3<f32>(0.0);
    for (var k = 0u; k < 3u; k++) {
        if g.albedo[k] < LEAST_ALBEDO {
            around[k] = radiance[k];
            continue;
        }
        // Lamps' light comes out negative by rounding, at most: that goes around, too. Other light is negative where
        // traced rays take back what maps gave, and only the mean of neighbours is right.
        around[k] = g.around[k] + min(g.direct[k], 0.0);
        lamps[k] = max(g.direct[k], 0.0);
        other[k] = radiance[k] - g.around[k] - g.direct[k];
    }
    // What is not finite is told before it is calculated with: kernels need not have it.
    let is_known = is_sound3(g.around) && is_sound3(g.direct);
    let sound = vec2<bool>(is_sound3(g.direct), is_known && is_sound3(radiance));
    let passes = is_known && is_sound3(around);
    if !(passes && sound.x && sound.y) {
        atomicAdd(&tally[DENOISE_UNSOUND], 1u);
    }
    let by = max(g.albedo, vec3<f32>(LEAST_ALBEDO));
    let of_lamps = vec3<f32>(divide(lamps.x, by.x), divide(lamps.y, by.y), divide(lamps.z, by.z));
    let of_others = vec3<f32>(divide(other.x, by.x), divide(other.y, by.y), divide(other.z, by.z));
    lit[pixel] = DenoiseLit(select(vec3<f32>(0.0), of_lamps, sound.x), select(0.0, 1.0, sound.x));
    lit[pixels() + pixel] = DenoiseLit(select(vec3<f32>(0.0), of_others, sound.y), select(0.0, 1.0, sound.y));
    picture[pixel] = vec4<f32>(select(vec3<f32>(0.0), around, passes), 0.0);
}
