// How surfaces reflect otherwise than diffusely: microfacets with the distribution of Trowbridge and Reitz (GGX),
// Smith's masking, Fresnel by Schlick, the light of further bounces between facets by Turquin (2019), and a clear coat
// of the same kind on top. The diffuse part has what they leave of the light (the albedo scaling of
// KHR_materials_specular), so that no energy is gained. Facets of bodies that refract let pass what they do not reflect
// (Walter, Marschner, Li, Torrance 2007); the light of further bounces between them is lost. Sheen, anisotropy and thin
// films are in shade/layers.wgsl. Twin: src/kernels/shade/gloss.rs.
#include "shade/material.wgsl"
#include "shade/more.wgsl"
#include "shade/layers.wgsl"

// Of a lobe's square root of roughness; smoother ones are as sharp as this.
const LEAST_ALPHA: f32 = 0.001;
// What a clear coat reflects along its normal (KHR_materials_clearcoat: index of refraction 1.5).
const COAT_F0: f32 = 0.04;

struct Gloss {
    normal: vec3<f32>,
    cos_view: f32,        // of the normal and the view, at least LEAST_COS_VIEW
    view: vec3<f32>,      // unit vector to where the hit is seen from
    alpha: f32,
    f0: vec3<f32>,        // reflectance along the normal, bounces between facets included
    coat: f32,            // share of the clear coat
    f90: vec3<f32>,       // and at grazing angles
    coat_alpha: f32,
    diffuse: vec3<f32>,   // albedo of the diffuse part
    under: f32,           // share of the light that the coat leaves
    share: vec3<f32>,     // of light from everywhere, reflected by the facets below the coat
    coat_share: f32,      // of light from everywhere, reflected by the coat
    choice: f32,          // probability that a direction is drawn by the coat
    through: vec3<f32>,   // share of the light that facets do not reflect which enters the body, or leaves it
    layers: Layers,
    eta: f32,             // index of refraction on the side of the view over that beyond; 0 where nothing refracts
}

// The side of a lobe that is seen.
struct Frame {
    normal: vec3<f32>,
    cos_view: f32,
}

const LEAST_COS_VIEW: f32 = 1.0e-4;

// What a lobe with reflectances of (1, 0) and of (0, 1) along the normal and at grazing angles reflects of light from
// everywhere.
fn reflectance(cosine: f32, alpha: f32) -> vec2<f32> {
    return table_at(0u, cosine, alpha);
}

// Of one of the tables with the same rows and columns.
fn table_at(first: u32, cosine: f32, alpha: f32) -> vec2<f32> {
    let most = f32(REFLECTANCE_SIZE - 1u);
    let x = clamp(sqrt(cosine), 0.0, 1.0) * most;
    let y = clamp(sqrt(alpha), 0.0, 1.0) * most;
    let column = min(u32(x), REFLECTANCE_SIZE - 2u);
    let row = min(u32(y), REFLECTANCE_SIZE - 2u);
    let at = first + row * REFLECTANCE_SIZE + column;
    let right = x - f32(column);
    let low = mix(reflectances[at], reflectances[at + 1u], right);
    let high = mix(reflectances[at + REFLECTANCE_SIZE], reflectances[at + REFLECTANCE_SIZE + 1u], right);
    return mix(low, high, y - f32(row));
}

// Of hit `index` of the set, seen along -view, of any length.
fn gloss_of(seen: GBuffer, index: u32, view: vec3<f32>) -> Gloss {
    var g = seen;
    let m = materials[g.material];
    var s: Gloss;
    s.diffuse = g.albedo;
    let has_layers = (m.flags & MATERIAL_LAYERS) != 0u;
    let is_matt = !(g.metallic > 0.0 || m.specular_weight > 0.0 || m.clearcoat > 0.0 || has_layers);
    if (m.flags & MATERIAL_UNLIT) != 0u || is_matt {
        return s;
    }
    s.normal = g.normal;
    s.view = normalize(view);
    s.cos_view = max(dot(s.normal, s.view), LEAST_COS_VIEW);
    s.alpha = max(g.roughness * g.roughness, LEAST_ALPHA);
    let x = more_of(g, index);
    lay(&s, g, m, x);
    let around = facets_around(s);
    let white = around.x + around.y;
    var bounces = (1.0 - white) / white;
    var specular = m.specular;
    var specular_weight = m.specular_weight;
    var inside = 0.0;
    if (m.flags & MATERIAL_REFRACTS) == 0u {
        specular *= x.specular * x.specular_weight;
        specular_weight *= x.specular_weight;
    } else {
        let share = m.transmission * x.specular_weight;
        if (g.state & GBUFFER_REFRACTS) != 0u {
            let root = sqrt(m.specular.x);
            let ior = (1.0 + root) / (1.0 - root);
            s.eta = select(1.0 / ior, ior, (g.state & GBUFFER_BACK) != 0u);
            inside = share;
            bounces = 0.0;
        } else {
            // Rays that meet it stand for those as well that pass straight through, by alpha. Light enters it more
            // often, and by as much its base colour is brighter.
            let passing = share * (1.0 - m.metallic) * max(m.base_color.r, max(m.base_color.g, m.base_color.b));
            let alpha = 1.0 - passing * (1.0 - m.specular.x);
            specular = min(specular / max(alpha, 1.0e-6), vec3<f32>(1.0));
            g.albedo *= select(0.0, (1.0 - share) / (1.0 - passing), passing < 1.0);
        }
    }
    let of_dielectric = vec3<f32>(1.0) + specular * bounces;
    let of_metal = vec3<f32>(1.0) + g.albedo * bounces;
    s.f0 = mix(specular * of_dielectric, g.albedo * of_metal, g.metallic);
    s.f90 = mix(specular_weight * of_dielectric, of_metal, g.metallic);
    s.share = s.f0 * around.x + s.f90 * around.y;
    var left = vec3<f32>(1.0) - (specular * around.x + vec3<f32>(specular_weight * around.y)) * of_dielectric;
    lay_film(&s, &left, specular, g, white, bounces);
    let below_facets = g.albedo * (1.0 - g.metallic);
    s.diffuse = below_facets * (1.0 - inside) * max(left, vec3<f32>(0.0));
    s.through = below_facets * inside;
    s.coat = m.clearcoat * x.coat;
    s.under = 1.0;
    if s.coat > 0.0 {
        let roughness = m.clearcoat_roughness * x.coat_roughness;
        s.coat_alpha = max(roughness * roughness, LEAST_ALPHA);
        let of_coat = reflectance(coat_frame(s).cos_view, s.coat_alpha);
        s.coat_share = s.coat * (COAT_F0 * of_coat.x + of_coat.y);
        s.under = 1.0 - s.coat_share;
        s.diffuse *= s.under;
        s.through *= s.under;
    }
    lay_sheen(&s);
    let below = s.under * max(s.share.x, max(s.share.y, s.share.z));
    let sheen = sheen_around(s);
    let of_sheen = max(sheen.x, max(sheen.y, sheen.z));
    let all = max(s.coat_share + below + of_sheen, 1.0e-20);
    s.choice = s.coat_share / all;
    s.layers.choice = of_sheen / all;
    return s;
}

fn is_glossy(s: Gloss) -> bool {
    return s.alpha > 0.0;
}

// Square of the roughness of its widest lobe.
fn greatest_alpha(s: Gloss) -> f32 {
    return max(max(s.alpha, s.coat_alpha), layers_alpha(s));
}

// A lobe toward d: x is distribution and masking over 4 times both cosines, y the density by which directions are
// drawn.
fn lobe(s: Frame, alpha: f32, d: vec3<f32>, half_way: vec3<f32>) -> vec2<f32> {
    let cosine = max(dot(s.normal, d), 0.0);
    let across = cross(s.normal, half_way);
    let c = dot(s.normal, half_way);
    let squared = alpha * alpha;
    // The squared sine by the cross product: that of small angles is not lost.
    let q = squared * c * c + dot(across, across);
    let distribution = squared / (PI * q * q);
    let by_view = sqrt(squared + (1.0 - squared) * s.cos_view * s.cos_view);
    let by_light = sqrt(squared + (1.0 - squared) * cosine * cosine);
    let masked = 0.5 / max(cosine * by_view + s.cos_view * by_light, 1.0e-20);
    return vec2<f32>(distribution * masked, 0.5 * distribution / (s.cos_view + by_view));
}

fn grazing(half_way: vec3<f32>, view: vec3<f32>) -> f32 {
    let c = clamp(1.0 - dot(half_way, view), 0.0, 1.0);
    return c * c * c * c * c;
}

// Square of the cosine of the angle by which light goes on beyond a facet that it meets by this cosine; negative where
// all of it is reflected.
fn squared_beyond(s: Gloss, cosine: f32) -> f32 {
    return 1.0 - s.eta * s.eta * (1.0 - cosine * cosine);
}

// What a facet reflects, by the cosine on the side that is not within the body (Schlick).
fn fresnel(s: Gloss, half_way: vec3<f32>) -> vec3<f32> {
    var cosine = dot(half_way, s.view);
    if s.eta > 1.0 {
        let squared = squared_beyond(s, cosine);
        if squared <= 0.0 {
            return vec3<f32>(1.0);
        }
        cosine = sqrt(squared);
    }
    let c = clamp(1.0 - cosine, 0.0, 1.0);
    return with_film(s, cosine, mix(s.f0, s.f90, c * c * c * c * c));
}

// Probability that a direction by a facet is one of reflection.
fn reflects_by(s: Gloss, half_way: vec3<f32>) -> f32 {
    if s.eta == 0.0 {
        return 1.0;
    }
    let f = fresnel(s, half_way);
    return max(f.x, max(f.y, f.z));
}

// What the surface reflects of light from d, a unit vector, otherwise than diffusely: pi times its distribution
// function.
fn reflected(s: Gloss, d: vec3<f32>) -> vec3<f32> {
    if s.alpha == 0.0 || dot(s.normal, d) <= 0.0 {
        return vec3<f32>(0.0);
    }
    let half_way = normalize(s.view + d);
    var sum = fresnel(s, half_way) * (s.under * facet_lobe(s, d, half_way).x) + sheen_toward(s, d, half_way);
    if s.coat > 0.0 {
        let f = grazing(half_way, s.view);
        let of_coat = lobe(coat_frame(s), s.coat_alpha, d, half_way).x * coat_cosines(s, d);
        sum += vec3<f32>(s.coat * mix(COAT_F0, 1.0, f) * of_coat);
    }
    return PI * sum;
}

// By which gloss_direction draws d, a unit vector.
fn density_of(s: Gloss, d: vec3<f32>) -> f32 {
    if s.alpha == 0.0 || dot(s.normal, d) <= 0.0 {
        return 0.0;
    }
    let half_way = normalize(s.view + d);
    let of_facets = 1.0 - s.choice - s.layers.choice;
    var density = of_facets * reflects_by(s, half_way) * facet_lobe(s, d, half_way).y + s.layers.choice / TURN;
    if s.coat > 0.0 {
        density += s.choice * lobe(coat_frame(s), s.coat_alpha, d, half_way).y;
    }
    return density;
}

// Share of light of one radiance from everywhere that the surface reflects otherwise than diffusely.
fn reflected_around(s: Gloss) -> vec3<f32> {
    return s.share * s.under + vec3<f32>(s.coat_share) + sheen_around(s);
}

// What the surface reflects otherwise than diffusely of the background, unshadowed, where rays of its own do not bring
// it.
fn reflected_ambient(s: Gloss) -> vec3<f32> {
    if s.alpha == 0.0 || (params.flags & (PARAM_GLOSSY | PARAM_BOUNCE)) == PARAM_GLOSSY {
        return vec3<f32>(0.0);
    }
    return reflected_around(s) * ambient(reflect(-s.view, s.normal));
}

// Of light from around, what diffuse rays stand for: the diffuse part, and the rest where it has no rays of its own and
// diffuse rays share nothing with rays to the environment.
fn reflected_by_diffuse_rays(s: Gloss) -> vec3<f32> {
    if s.alpha == 0.0 || (params.flags & PARAM_GLOSSY) != 0u || params.diffuse_count > 0.0 {
        return s.diffuse;
    }
    return s.diffuse + reflected_around(s);
}

// A direction drawn by the facets that are seen (Dupuy, Benyoub 2023, "Sampling visible GGX normals with spherical
// caps"), a unit vector; it may lead below the surface. w: 1 where it leads through a facet, else it is reflected.
fn gloss_direction(s: Gloss, words: vec4<u32>) -> vec4<f32> {
    let number = unit(words.z);
    let is_coat = number < s.choice;
    if !is_coat && draws_sheen(s, number) {
        return vec4<f32>(sheen_direction(s, words), 0.0);
    }
    var alphas = vec2<f32>(select(s.alpha, s.coat_alpha, is_coat));
    var frame = Frame(s.normal, s.cos_view);
    if is_coat {
        frame = coat_frame(s);
    }
    var x = tangent(frame.normal);
    if !is_coat {
        stretch(s, &x, &alphas);
    }
    let y = cross(frame.normal, x);
    let v = normalize(vec3<f32>(alphas.x * dot(s.view, x), alphas.y * dot(s.view, y), frame.cos_view));
    let around = TURN * unit(words.x);
    let down = unit(words.y);
    // On the cap of heights -v.z to 1.
    let height = 1.0 - down * (1.0 + v.z);
    let level = sqrt(max((1.0 - height) * (1.0 + height), 0.0));
    let h = vec3<f32>(level * cos(around), level * sin(around), height) + v;
    let facet = normalize(vec3<f32>(alphas.x * h.x, alphas.y * h.y, max(h.z, 0.0)));
    let half_way = facet.x * x + facet.y * y + facet.z * frame.normal;
    let cosine = dot(s.view, half_way);
    if s.eta > 0.0 && !is_coat && unit(pcg(words.z)) >= reflects_by(s, half_way) {
        let beyond = sqrt(max(squared_beyond(s, cosine), 0.0));
        return vec4<f32>(normalize((s.eta * cosine - beyond) * half_way - s.eta * s.view), 1.0);
    }
    return vec4<f32>(normalize(2.0 * cosine * half_way - s.view), 0.0);
}

// What light from d, a direction through a facet, brings over the density by which it was drawn: what the facet does
// not reflect of it, and others do not mask. Radiance grows by the square of the index of refraction; that is left out.
fn passed(s: Gloss, d: vec3<f32>) -> vec3<f32> {
    let sum = d + s.eta * s.view;
    // Of a body like what is around it every facet is one.
    let across = select(sum, s.normal, dot(sum, sum) < 1.0e-12);
    let half_way = normalize(select(across, -across, dot(across, s.view) < 0.0));
    let reflects = fresnel(s, half_way);
    let left = max(1.0 - max(reflects.x, max(reflects.y, reflects.z)), 1.0e-6);
    let cosine = max(-dot(s.normal, d), 0.0);
    let unmasked = 2.0 * cosine / max(cosine + facet_root(s, d, cosine), 1.0e-20);
    let of_facets = 1.0 - s.choice - s.layers.choice;
    return s.through * (vec3<f32>(1.0) - reflects) * (unmasked / (left * of_facets));
}

// Share of the light that facets do not reflect which goes through them.
fn through_facets(s: Gloss) -> vec3<f32> {
    return s.through;
}

// By what radiance grows as it goes through a facet, seen against its way.
fn radiance_scale(s: Gloss) -> f32 {
    return s.eta * s.eta;
}

// What is left of light that went through the body whose back is hit, so far from where it started.
fn left_within(g: GBuffer, way: f32) -> vec3<f32> {
    let word = materials[g.material].absorption;
    let within = GBUFFER_REFRACTS | GBUFFER_BACK;
    if (g.state & within) != within || word == 0u {
        return vec3<f32>(1.0);
    }
    let scale = exp2(f32(word >> 27u) - 24.0) * params.origin.w * way;
    return exp(-scale * vec3<f32>(f32(word & 511u), f32((word >> 9u) & 511u), f32((word >> 18u) & 511u)));
}
