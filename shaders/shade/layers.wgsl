// What sheen, anisotropy and thin films add to a surface. Sheen lies between the coat and the facets, which get what it
// does not reflect (KHR_materials_sheen, by the view alone; distribution and masking of Conty Estevez and Kulla 2017).
// Anisotropy makes facets wider along a direction (KHR_materials_anisotropy). A film changes what facets reflect
// (KHR_materials_iridescence). Tables: src/kernels/layer_tables.rs. Twin: src/kernels/shade/layers.rs.
#include "shade/film.wgsl"

// Sheen is not smoother.
const LEAST_SHEEN_ALPHA: f32 = 0.01;

struct Layers {
    choice: f32,          // probability that a direction is drawn by the sheen
    sheen_alpha: f32,     // 0: there is none
    sheen_share: f32,     // of light from everywhere, reflected by white sheen
    sheen_masked: f32,    // of the view, by the fit for sheen
    sheen: vec3<f32>,     // by what white sheen is multiplied
    alpha_along: f32,     // along the direction of anisotropy; 0: there is none
    along: vec3<f32>,     // that direction, a unit vector beside the normal
    strength: f32,        // of the anisotropy
    across: vec3<f32>,    // a unit vector beside both
    film: f32,            // share of the surface that a film covers
    film_index: f32,      // its index of refraction
    film_thickness: f32,  // nm
    metallic: f32,        // of what is below
    dielectric: vec3<f32>, // what is below reflects along the normal
    dielectric_more: vec3<f32>, // by what further bounces between facets make it brighter
    coat_normal: vec3<f32>,
    coat_cos_view: f32,   // of the coat's normal and the view; 0: it has that of what is below
    metal: vec3<f32>,
    metal_more: vec3<f32>,
}

// The two numbers of a word.
fn numbers_of(word: f32) -> vec2<f32> {
    let bits = u32(word);
    return vec2<f32>(f32(bits & LAYER_STEPS), f32(bits >> LAYER_BITS));
}

// The layers of a surface whose normal, view and alpha are known.
fn lay(s: ptr<function, Gloss>, g: GBuffer, m: Material, x: More) {
    var l: Layers;
    // Where it is turned away from the view, the coat has the normal of what is below.
    let coat_cos_view = dot(x.normal, (*s).view);
    if (m.flags & MATERIAL_MORE) != 0u && coat_cos_view > LEAST_COS_VIEW {
        l.coat_normal = x.normal;
        l.coat_cos_view = coat_cos_view;
    }
    if (m.flags & MATERIAL_LAYERS) == 0u {
        (*s).layers = l;
        return;
    }
    let step = 1.0 / f32(LAYER_STEPS);
    let first = numbers_of(m.uv_from_set[1].w) * step;
    let second = numbers_of(m.uv_from_set[3].w) * step;
    l.sheen = vec3<f32>(first, second.x) * x.sheen;
    if max(l.sheen.x, max(l.sheen.y, l.sheen.z)) > 0.0 {
        let roughness = second.y * x.sheen_roughness;
        l.sheen_alpha = max(roughness * roughness, LEAST_SHEEN_ALPHA);
    }
    let n = (*s).normal;
    let stretch = numbers_of(m.uv_from_set[5].w);
    if stretch.x > 0.0 {
        l.strength = stretch.x * step * x.anisotropy;
        l.alpha_along = mix((*s).alpha, 1.0, l.strength * l.strength);
        let beside = g.tangent - n * dot(n, g.tangent);
        let size = dot(beside, beside);
        var t = tangent(n);
        var side = 1.0;
        if g.handedness != 0.0 && size > 1.0e-12 {
            t = beside / sqrt(size);
            side = sign(g.handedness);
        }
        let angle = TURN / f32(LAYER_STEPS + 1u) * stretch.y;
        let length = sqrt(dot(x.along, x.along));
        let a = select(vec2<f32>(1.0, 0.0), x.along / max(length, 1.0e-6), length > 1.0e-6);
        let turned = vec2<f32>(cos(angle) * a.x - sin(angle) * a.y, sin(angle) * a.x + cos(angle) * a.y);
        l.along = normalize(turned.x * t + turned.y * side * cross(n, t));
        l.across = cross(n, l.along);
    }
    // What rays pass straight through reflects for those that pass as well, and its film is left out.
    let passes = (m.flags & MATERIAL_REFRACTS) != 0u && (g.state & GBUFFER_REFRACTS) == 0u;
    let film = numbers_of(m.uv_from_set[7].w);
    if !passes {
        l.film = film.x * step * x.film;
        l.film_index = 1.0 + film.y / f32(LAYER_INDEX_STEPS);
        let thickness = numbers_of(m.uv_from_set[9].w);
        l.film_thickness = mix(thickness.y, thickness.x, x.film_thickness);
    }
    (*s).layers = l;
}

// The normal of the clear coat.
fn coat_frame(s: Gloss) -> Frame {
    if s.layers.coat_cos_view == 0.0 {
        return Frame(s.normal, s.cos_view);
    }
    return Frame(s.layers.coat_normal, s.layers.coat_cos_view);
}

// The cosine of a direction and the coat's normal over that of what is below, by which its light is weighted.
fn coat_cosines(s: Gloss, d: vec3<f32>) -> f32 {
    if s.layers.coat_cos_view == 0.0 {
        return 1.0;
    }
    return max(dot(s.layers.coat_normal, d), 0.0) / max(dot(s.normal, d), 1.0e-20);
}

// As `reflectance`, of facets that may be anisotropic.
fn facets_around(s: Gloss) -> vec2<f32> {
    if s.layers.alpha_along == 0.0 {
        return reflectance(s.cos_view, s.alpha);
    }
    let beside = sqrt(max(1.0 - s.cos_view * s.cos_view, 1.0e-12));
    let azimuth = abs(dot(s.layers.along, s.view)) / beside;
    let counts = vec4<u32>(STRETCHED_COSINES, STRETCHED_ROUGHNESSES, STRETCHED_STRENGTHS, STRETCHED_AZIMUTHS);
    let place = vec4<f32>(sqrt(s.cos_view), sqrt(s.alpha), s.layers.strength, azimuth);
    let x = clamp(place, vec4<f32>(0.0), vec4<f32>(1.0)) * vec4<f32>(counts - vec4<u32>(1u));
    let low = min(vec4<u32>(x), counts - vec4<u32>(2u));
    let right = x - vec4<f32>(low);
    var sum = vec2<f32>(0.0);
    for (var corner = 0u; corner < 16u; corner++) {
        let up = vec4<u32>(corner & 1u, (corner >> 1u) & 1u, (corner >> 2u) & 1u, corner >> 3u);
        let share = select(vec4<f32>(1.0) - right, right, up == vec4<u32>(1u));
        let at = low + up;
        let row = (at.w * STRETCHED_STRENGTHS + at.z) * STRETCHED_ROUGHNESSES + at.y;
        let entry = reflectances[STRETCHED + row * STRETCHED_COSINES + at.x];
        sum += entry * (share.x * share.y * share.z * share.w);
    }
    return sum;
}

// Root of the squares of a direction's parts along and across, by the alphas, and of its cosine.
fn facet_root(s: Gloss, d: vec3<f32>, cosine: f32) -> f32 {
    if s.layers.alpha_along == 0.0 {
        let squared = s.alpha * s.alpha;
        return sqrt(squared + (1.0 - squared) * cosine * cosine);
    }
    let along = s.layers.alpha_along * dot(s.layers.along, d);
    let across = s.alpha * dot(s.layers.across, d);
    return sqrt(along * along + across * across + cosine * cosine);
}

// As `lobe`, of the facets below the coat.
fn facet_lobe(s: Gloss, d: vec3<f32>, half_way: vec3<f32>) -> vec2<f32> {
    if s.layers.alpha_along == 0.0 {
        return lobe(Frame(s.normal, s.cos_view), s.alpha, d, half_way);
    }
    let cosine = max(dot(s.normal, d), 0.0);
    let squared = s.layers.alpha_along * s.alpha;
    let along = s.alpha * dot(s.layers.along, half_way);
    let across = s.layers.alpha_along * dot(s.layers.across, half_way);
    let up = squared * dot(s.normal, half_way);
    let w = squared / (along * along + across * across + up * up);
    let distribution = squared * w * w / PI;
    let by_view = facet_root(s, s.view, s.cos_view);
    let by_light = facet_root(s, d, cosine);
    let masked = 0.5 / max(cosine * by_view + s.cos_view * by_light, 1.0e-20);
    return vec2<f32>(distribution * masked, 0.5 * distribution / (s.cos_view + by_view));
}

// The frame that facets are drawn in, where they are anisotropic.
fn stretch(s: Gloss, x: ptr<function, vec3<f32>>, alphas: ptr<function, vec2<f32>>) {
    if s.layers.alpha_along > 0.0 {
        *x = s.layers.along;
        *alphas = vec2<f32>(s.layers.alpha_along, s.alpha);
    }
}

// How much of a direction by this cosine others of the sheen mask.
fn sheen_masking(cosine: f32, alpha: f32) -> f32 {
    let by = (1.0 - alpha) * (1.0 - alpha);
    let a = mix(21.5473, 25.3245, by);
    let b = mix(3.82987, 3.32435, by);
    let c = mix(0.19823, 0.16801, by);
    let d = mix(-1.97760, -1.27393, by);
    let e = mix(-4.32054, -4.85967, by);
    let is_flat = cosine < 0.5;
    let x = max(select(1.0 - cosine, cosine, is_flat), 1.0e-6);
    let l = a / (1.0 + b * pow(x, c)) + d * x + e;
    let half = a / (1.0 + b * pow(0.5, c)) + d * 0.5 + e;
    return exp(select(2.0 * half - l, l, is_flat));
}

// Puts the sheen between the coat and what is below it.
fn lay_sheen(s: ptr<function, Gloss>) {
    var l = (*s).layers;
    if l.sheen_alpha == 0.0 {
        return;
    }
    l.sheen_share = table_at(SHEENS, (*s).cos_view, l.sheen_alpha).x;
    // The fit would have smooth sheen reflect more than all where it is seen flat.
    let gain = max(l.sheen_share, 1.0);
    let greatest = max(l.sheen.x, max(l.sheen.y, l.sheen.z));
    l.sheen *= (*s).under / gain;
    l.sheen_masked = sheen_masking((*s).cos_view, l.sheen_alpha);
    let left = 1.0 - greatest * (l.sheen_share / gain);
    (*s).under *= left;
    (*s).diffuse *= left;
    (*s).through *= left;
    (*s).layers = l;
}

// Share of light of one radiance from everywhere that the sheen reflects.
fn sheen_around(s: Gloss) -> vec3<f32> {
    return s.layers.sheen * s.layers.sheen_share;
}

// What the sheen reflects of light from d, as `reflected` has it, but for pi.
fn sheen_toward(s: Gloss, d: vec3<f32>, half_way: vec3<f32>) -> vec3<f32> {
    let alpha = s.layers.sheen_alpha;
    if alpha == 0.0 {
        return vec3<f32>(0.0);
    }
    let cosine = max(dot(s.normal, d), 1.0e-6);
    let across = cross(s.normal, half_way);
    let squared = max(dot(across, across), 1.0e-20);
    let distribution = (2.0 + 1.0 / alpha) * pow(squared, 0.5 / alpha) / TURN;
    let masked = 1.0 + s.layers.sheen_masked + sheen_masking(cosine, alpha);
    return s.layers.sheen * (distribution / (masked * 4.0 * s.cos_view * cosine));
}

// Whether a number draws a direction by the sheen, unless it draws one by the coat.
fn draws_sheen(s: Gloss, number: f32) -> bool {
    return number < s.choice + s.layers.choice;
}

// A direction by the sheen: all of the hemisphere are as likely.
fn sheen_direction(s: Gloss, words: vec4<u32>) -> vec3<f32> {
    let around = TURN * unit(words.x);
    let height = unit(words.y);
    let level = sqrt(max(1.0 - height * height, 0.0));
    let x = tangent(s.normal);
    let y = cross(s.normal, x);
    return normalize(level * cos(around) * x + level * sin(around) * y + height * s.normal);
}

// Square of the roughness of the widest lobe that layers make.
fn layers_alpha(s: Gloss) -> f32 {
    return select(s.layers.alpha_along, 1.0, s.layers.sheen_alpha > 0.0);
}
