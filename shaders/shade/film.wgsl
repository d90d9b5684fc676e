// What facets under a thin film reflect (KHR_materials_iridescence, after Belcour and Barla 2017, "A practical
// extension to microfacet theory for the modeling of varying iridescence"). The waves that both sides of the film
// reflect meet; two terms of their sum are seen by the sensitivity of the eye. Twin: src/kernels/shade/film.rs.

fn fifth_power(x: f32) -> f32 {
    let c = clamp(x, 0.0, 1.0);
    return c * c * c * c * c;
}

// cos(2 pi x); the integer part is taken off first, which devices need not do well.
fn turned_cosine(x: f32) -> f32 {
    return cos(TURN * (x - floor(x)));
}

// How the sensitivity of the eye sees waves with a path difference of `path`, nm, as linear RGB; x, y and z are
// multiplied by `signs`. Gaussians of Belcour and Barla, their places in periods a nm.
fn sensitivity(path: f32, signs: vec3<f32>) -> vec3<f32> {
    let squared = path * path;
    let x = 0.84659 * turned_cosine(0.001681 * path) * exp(-1.708547e-7 * squared)
        + 0.15386831 * turned_cosine(0.0022399 * path) * exp(-1.7876617e-7 * squared);
    let y = 1.0002219 * turned_cosine(0.0017953 * path) * exp(-3.6733088e-7 * squared);
    let z = 1.0011225 * turned_cosine(0.0022084 * path) * exp(-2.6103525e-7 * squared);
    let c = vec3<f32>(x, y, z) * signs;
    return vec3<f32>(
        3.2404542 * c.x - 1.5371385 * c.y - 0.4985314 * c.z,
        1.8760108 * c.y - 0.9692660 * c.x + 0.0415560 * c.z,
        0.0556434 * c.x - 0.2040259 * c.y + 1.0572252 * c.z,
    );
}

// What a film on a base that reflects f0 along the normal reflects, by the cosine outside; at most all.
fn film_color(l: Layers, f0: vec3<f32>, cosine: f32) -> vec3<f32> {
    let c = clamp(cosine, 0.0, 1.0);
    let beyond = sqrt(max(1.0 - (1.0 - c * c) / (l.film_index * l.film_index), 0.0));
    let outer = (l.film_index - 1.0) / (l.film_index + 1.0);
    let r12 = mix(outer * outer, 1.0, fifth_power(1.0 - c));
    let t121 = 1.0 - r12;
    let root = sqrt(min(f0 + vec3<f32>(1.0e-4), vec3<f32>(0.9999)));
    let base = (vec3<f32>(1.0) + root) / (vec3<f32>(1.0) - root);
    let index = vec3<f32>(l.film_index);
    let inner = (base - index) / (base + index);
    let r23 = mix(inner * inner, vec3<f32>(1.0), fifth_power(1.0 - beyond));
    let r123 = clamp(r12 * r23, vec3<f32>(1.0e-5), vec3<f32>(0.9999));
    let amplitude = sqrt(r123);
    let all = t121 * t121 * r23 / (vec3<f32>(1.0) - r123);
    let path = 2.0 * l.film_index * l.film_thickness * beyond;
    // Half a wave is lost at the outer side, and half a wave where the base is thinner than the film.
    let signs = select(vec3<f32>(-1.0), vec3<f32>(1.0), base < index);
    var wave = (all - vec3<f32>(t121)) * amplitude;
    var sum = vec3<f32>(r12) + all + wave * (2.0 * sensitivity(path, signs));
    wave *= amplitude;
    sum += wave * (2.0 * sensitivity(2.0 * path, vec3<f32>(1.0)));
    return clamp(sum, vec3<f32>(0.0), vec3<f32>(1.0));
}

// Cosines between the view and facets, each of which stands for a quarter of what white facets reflect.
fn facet_cosines(cosine: f32, alpha: f32) -> vec4<f32> {
    let most = f32(REFLECTANCE_SIZE - 1u);
    let x = clamp(sqrt(cosine), 0.0, 1.0) * most;
    let y = clamp(sqrt(alpha), 0.0, 1.0) * most;
    let column = min(u32(x), REFLECTANCE_SIZE - 2u);
    let row = min(u32(y), REFLECTANCE_SIZE - 2u);
    let at = FACET_COSINES + 2u * (row * REFLECTANCE_SIZE + column);
    let right = x - f32(column);
    let up = y - f32(row);
    let next = at + 2u * REFLECTANCE_SIZE;
    var found: array<vec2<f32>, 2>;
    for (var k = 0u; k < 2u; k++) {
        let low = mix(reflectances[at + k], reflectances[at + k + 2u], right);
        let high = mix(reflectances[next + k], reflectances[next + k + 2u], right);
        found[k] = mix(low, high, up);
    }
    return vec4<f32>(found[0], found[1]);
}

// Puts the film on the facets: what they reflect of light from everywhere, and what of it is left to the diffuse part,
// which is that of the brightest colour. `white`: what white facets reflect by single bounces; `bounces`: by what more.
fn lay_film(
    s: ptr<function, Gloss>,
    left: ptr<function, vec3<f32>>,
    specular: vec3<f32>,
    g: GBuffer,
    white: f32,
    bounces: f32,
) {
    var l = (*s).layers;
    if l.film == 0.0 {
        return;
    }
    let cosines = facet_cosines((*s).cos_view, (*s).alpha);
    var dielectric = vec3<f32>(0.0);
    var metal = vec3<f32>(0.0);
    for (var i = 0u; i < 4u; i++) {
        if g.metallic < 1.0 {
            dielectric += 0.25 * film_color(l, specular, cosines[i]);
        }
        if g.metallic > 0.0 {
            metal += 0.25 * film_color(l, g.albedo, cosines[i]);
        }
    }
    l.metallic = g.metallic;
    l.dielectric = specular;
    l.metal = g.albedo;
    l.dielectric_more = vec3<f32>(1.0) + dielectric * bounces;
    l.metal_more = vec3<f32>(1.0) + metal * bounces;
    let of_dielectric = white * (dielectric * l.dielectric_more);
    let of_metal = white * (metal * l.metal_more);
    (*s).share = mix((*s).share, mix(of_dielectric, of_metal, g.metallic), l.film);
    let greatest = max(of_dielectric.x, max(of_dielectric.y, of_dielectric.z));
    *left = mix(*left, vec3<f32>(1.0 - greatest), l.film);
    (*s).layers = l;
}

// What a facet reflects by a cosine, with its film; f: without.
fn with_film(s: Gloss, cosine: f32, f: vec3<f32>) -> vec3<f32> {
    let l = s.layers;
    if l.film == 0.0 {
        return f;
    }
    var seen = vec3<f32>(0.0);
    if l.metallic < 1.0 {
        seen = (1.0 - l.metallic) * (film_color(l, l.dielectric, cosine) * l.dielectric_more);
    }
    if l.metallic > 0.0 {
        seen += l.metallic * (film_color(l, l.metal, cosine) * l.metal_more);
    }
    return mix(f, seen, l.film);
}
