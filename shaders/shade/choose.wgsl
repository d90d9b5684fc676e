// Draws a lamp for a surface: one of the emitters, or a direction to the environment. Emitters are drawn by what they
// may send to a surface: down a tree of groups, by bounds of both halves (Conty Estevez, Kulla, "Importance Sampling of
// Many Lights with Adaptive Tree Splitting", HPG 2018). Bounds are linear in place of angles. Every operation is
// rounded as it stands, so that all pipelines draw the same.

// Squared distances below it count as it.
const LEAST_SQUARED: f32 = 1.0e-12;
// Sums of bounds above it tell nothing, and below its inverse there is no light.
const GREATEST_SUM: f32 = 1.0e30;

struct Chosen {
    emitter: u32,         // NONE: none sends anything; of directions the number of the candidate
    probability: f32,     // of being drawn here; of directions over that by the environment alone, 0: none has light
}

fn sum_of_products(a: vec3<f32>, b: vec3<f32>) -> f32 {
    return barrier(barrier(barrier(a.x * b.x) + barrier(a.y * b.y)) + barrier(a.z * b.z));
}

fn over_fourth_power(x: f32, squared: f32) -> f32 {
    return divide(x, barrier(squared * squared));
}

// A bound of how much light of an area reaches a surface at p that is turned to n: to within a constant factor its
// radiance times both cosines times its area over the squared distance. It is 0 where the area lies behind the surface,
// or shines away from it.
fn bound_of_area(e: Emitter, p: vec3<f32>, n: vec3<f32>) -> f32 {
    let is_triangle = (e.kind & EMITTER_KIND) == EMITTER_TRIANGLE;
    let to_corner = barrier3(e.corner - p);
    let d = barrier3(to_corner + barrier3(select(0.5, 0.33333334, is_triangle) * barrier3(e.u + e.v)));
    let across = vec3<f32>(
        barrier(barrier(e.u.y * e.v.z) - barrier(e.u.z * e.v.y)),
        barrier(barrier(e.u.z * e.v.x) - barrier(e.u.x * e.v.z)),
        barrier(barrier(e.u.x * e.v.y) - barrier(e.u.y * e.v.x)),
    );
    var front = -sum_of_products(across, d);
    if (e.kind & EMITTER_TWO_SIDED) != 0u {
        front = abs(front);
    }
    let rise_u = sum_of_products(n, e.u);
    let rise_v = sum_of_products(n, e.v);
    let rise = max(max(rise_u, rise_v), select(barrier(rise_u + rise_v), 0.0, is_triangle));
    let above = barrier(sum_of_products(n, to_corner) + max(rise, 0.0));
    if front <= 0.0 || above <= 0.0 {
        return 0.0;
    }
    let size = barrier(0.25 * max(sum_of_products(e.u, e.u), sum_of_products(e.v, e.v)));
    let squared = max(max(sum_of_products(d, d), size), LEAST_SQUARED);
    let sent = barrier(luminance_of(e.radiance) * barrier(select(1.0, 0.5, is_triangle) * front));
    return over_fourth_power(barrier(sent * above), squared);
}

// The same of a group: its axis, v the radius around its middle, how far normals of emitters are from the axis, and how
// far emitters lie behind the middle along their normals.
fn bound_of_group(e: Emitter, p: vec3<f32>, n: vec3<f32>) -> f32 {
    let d = barrier3(e.corner - p);
    let squared = sum_of_products(d, d);
    let held = max(max(squared, barrier(e.v.x * e.v.x)), LEAST_SQUARED);
    let size = square_root(held);
    let above = min(barrier(sum_of_products(n, d) + e.v.x), size);
    let spread = barrier(barrier(e.v.y * square_root(squared)) + e.v.z);
    let front = min(barrier(spread - sum_of_products(e.u, d)), size);
    if front <= 0.0 || above <= 0.0 {
        return 0.0;
    }
    return over_fourth_power(barrier(barrier(e.radiance.x * front) * above), held);
}

fn luminance_of(c: vec3<f32>) -> f32 {
    return sum_of_products(c, vec3<f32>(0.2126, 0.7152, 0.0722));
}

fn bound_of(e: Emitter, p: vec3<f32>, n: vec3<f32>) -> f32 {
    let kind = e.kind & EMITTER_KIND;
    if kind <= EMITTER_TRIANGLE {
        return bound_of_area(e, p, n);
    }
    if kind == EMITTER_GROUP {
        return bound_of_group(e, p, n);
    }
    if kind == EMITTER_DISTANT_GROUP {
        return e.radiance.x;
    }
    if kind == EMITTER_DISTANT {
        return barrier(luminance_of(e.radiance) * max(-sum_of_products(n, e.u), 0.0));
    }
    let d = barrier3(e.corner - p);
    let squared = max(sum_of_products(d, d), LEAST_SQUARED);
    let above = max(sum_of_products(n, d), 0.0);
    return over_fourth_power(barrier(barrier(luminance_of(e.radiance) * above) * square_root(squared)), squared);
}

// One of the emitters for a surface at p that is turned to n, by a random word.
fn choose_emitter(random: u32, p: vec3<f32>, n: vec3<f32>) -> Chosen {
    if params.emitter_count == 1u {
        return Chosen(0u, 1.0);
    }
    // The group of all is the first one.
    var chosen = Chosen(params.emitter_count, 1.0);
    var word = random;
    while chosen.emitter >= params.emitter_count {
        let first = emitters[chosen.emitter].first;
        let second = emitters[chosen.emitter].second;
        let bound = bound_of(emitters[first], p, n);
        let sum = barrier(bound + bound_of(emitters[second], p, n));
        if !(sum > 1.0 / GREATEST_SUM) {
            return Chosen(NONE, 0.0);
        }
        var share = 0.5;
        if sum < GREATEST_SUM {
            share = divide(bound, sum);
        }
        let is_first = unit(word) < share;
        chosen.emitter = select(second, first, is_first);
        chosen.probability = barrier(chosen.probability * select(barrier(1.0 - share), share, is_first));
        word = pcg(word);
    }
    return chosen;
}

// Directions to the environment from which one is drawn.
const CANDIDATES: u32 = 4u;
// What a grazing direction counts for beside one along the normal: the normal that is shaded may be another.
const GRAZING: f32 = 0.2;

// One of a few directions to the environment, by its light and the cosine at a surface that is turned to n (resampled
// importance sampling: Talbot, Cline, Egbert, "Importance Resampling for Global Illumination", EGSR 2005): many of the
// environment's own lie behind the surface.
fn choose_direction(index: u32, n: vec3<f32>) -> Chosen {
    var number = 0u;
    var weight = 0.0;
    var sum = 0.0;
    for (var k = 0u; k < CANDIDATES; k++) {
        let words = lamp_words(index, k);
        let drawn = environment_sample(words);
        let cosine = dot(n, drawn.direction);
        // What lies behind is not looked up.
        if !(cosine > 0.0) {
            continue;
        }
        let own = luminance_of(drawn_light(drawn)) * mix(GRAZING, 1.0, cosine);
        sum += own;
        if unit(pcg(words.w)) * sum < own {
            number = k;
            weight = own;
        }
    }
    if !(weight > 0.0) {
        return Chosen(0u, 0.0);
    }
    return Chosen(number, f32(CANDIDATES) * weight / sum);
}
