// Finds the variance of the averages of a layer: of lamps by a pixel's samples, as soon as there are two; of sparse
// light by the samples of a neighbourhood. Where these are too few to tell it, by how the averages differ around the
// pixel.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "denoise/denoise.wgsl"

const FEW: f32 = 2.0;              // with fewer samples the variance of a lamp's light is that of the neighbourhood
const LEAST_FOUND: f32 = 10.0;     // fewer samples that found light do not tell the variance of sparse light
const DOUBTFUL: f32 = 30.0;        // of so many it may be twice what they tell: the rare and bright ones may be missing

// Variance of the long averages around a pixel, about their mean.
fn variance_around(place: vec2<i32>, surface: DenoiseSeen) -> f32 {
    let first = least_around(place, own.radius);
    let last = most_around(place, own.radius);
    var count = 0u;
    var mean = vec3<f32>(0.0);
    var squares = 0.0;
    for (var y = first.y; y <= last.y; y++) {
        for (var x = first.x; x <= last.x; x++) {
            let other = index_of(vec2<i32>(x, y));
            let at = own.layer * pixels() + other;
            if !is_as(surface, other) || !(known[at].length > 0.0) {
                continue;
            }
            count += 1u;
            let share = divide(1.0, f32(count));
            let off = known[at].long - mean;
            mean = mixed(mean, known[at].long, share);
            // The square of the distance from the mean before times its share that the new mean leaves.
            squares += barrier(squared(off) * (1.0 - share));
        }
    }
    if count < 2u {
        return 0.0;
    }
    return divide(max(squares, 0.0), f32(count - 1u));
}

// Variance of the mean of a pixel whose single samples have the variance that those around it have, each about its own
// mean: a pixel that has seen nothing yet among others that have is not certain to be black. Below 0 where too few
// found light: a share p of samples that find the same have the relative variance 1/p - 1, so that n of them have
// found n / (1 + variance / mean²) times.
fn variance_pooled(place: vec2<i32>, surface: DenoiseSeen, squares: f32) -> f32 {
    let first = least_around(place, own.radius);
    let last = most_around(place, own.radius);
    var sum = 0.0;
    var mean = vec3<f32>(0.0);
    var freedom = 0.0;
    for (var y = first.y; y <= last.y; y++) {
        for (var x = first.x; x <= last.x; x++) {
            let other = index_of(vec2<i32>(x, y));
            let at = own.layer * pixels() + other;
            let count = known[at].count;
            if !(count > 1.0) || !is_as(surface, other) {
                continue;
            }
            // Of n samples alike n - 1 are free, and their variance is n / (n - 1) of the spread.
            let free = count - 1.0;
            sum += barrier(count * known[at].spread);
            mean += barrier3(free * known[at].mean);
            freedom += free;
        }
    }
    if !(freedom > 0.0) {
        return -1.0;
    }
    let of_mean = squared(divided(mean, freedom));
    let of_one = divide(sum, freedom);
    let found = divide(barrier(freedom * of_mean), max(of_mean + of_one, LEAST_NORMAL_NUMBER));
    let doubt = barrier(of_one * divide(DOUBTFUL, max(found, LEAST_FOUND)));
    return select(-1.0, barrier((of_one + doubt) * squares), found >= LEAST_FOUND);
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
    let surface = seen[pixel];
    let p = known[at];
    var variance = -1.0;
    if own.sparse != 0u {
        variance = variance_pooled(place, surface, p.squares);
    } else if p.count >= FEW {
        variance = divide(barrier(p.spread * p.squares), 1.0 - p.squares);
    }
    let is_untold = variance < 0.0;
    if is_untold {
        variance = variance_around(place, surface);
    }
    known[at].young = u32(is_untold && own.sparse != 0u);
    lit[2u * pixels() + at] = DenoiseLit(p.long, variance);
}
