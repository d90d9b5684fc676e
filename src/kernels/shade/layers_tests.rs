//! Sheen, anisotropy and films beside what KHR_materials_sheen, _anisotropy and _iridescence say, in f64.

use super::gloss::Gloss;
use super::more::{Shown, WHOLE};
use crate::kernels::layout::{GBUFFER_REFRACTS, GBuffer, More};
use crate::kernels::vector::{Vec3, cross, dot, normalize};
use crate::math::sampling::random4;
use bricks::{Layers, MATERIAL_MORE, MATERIAL_REFRACTS, Material};
use std::f64::consts::{PI, TAU};

const NORMAL: Vec3 = [0.0, 0.0, 1.0];

fn with(material: Material, layers: Layers) -> Material {
    let mut material = material;
    material.set_layers(&layers);
    material
}

fn plastic() -> Material {
    Material { specular: [0.04; 3], specular_weight: 1.0, ..Material::DIFFUSE }
}

fn metal() -> Material {
    Material { metallic: 1.0, ..plastic() }
}

/// Of a view in the plane turned by `azimuth` from x, where tangents point.
fn gloss(m: &Material, albedo: Vec3, roughness: f32, cosine: f32, azimuth: f32) -> Gloss {
    let level = (1.0 - cosine * cosine).sqrt();
    let view = [level * azimuth.cos(), level * azimuth.sin(), cosine];
    let refracts = if m.flags & MATERIAL_REFRACTS != 0 { GBUFFER_REFRACTS } else { 0 };
    let g = GBuffer {
        albedo,
        normal: NORMAL,
        metallic: m.metallic,
        roughness,
        tangent: [2.0, 0.0, 0.0],
        handedness: 1.0,
        state: refracts,
        ..GBuffer::default()
    };
    Gloss::of(&g, m, view)
}

/// A coated metal whose coat leans by an angle, seen from the coat's side or from the other.
fn leaning(coat: f32, angle: f32, cosine: f32, azimuth: f32) -> Gloss {
    let m = Material { clearcoat: coat, clearcoat_roughness: 0.4, flags: MATERIAL_MORE, ..metal() };
    let level = (1.0 - cosine * cosine).sqrt();
    let view = [level * azimuth.cos(), level * azimuth.sin(), cosine];
    let g = GBuffer { albedo: [1.0; 3], normal: NORMAL, metallic: 1.0, roughness: 0.6, ..GBuffer::default() };
    let x = More { normal: [angle.sin(), 0.0, angle.cos()], ..WHOLE };
    Gloss::of(Shown::of(&[g], &[x], 0), &m, view)
}

/// The integral over the hemisphere, on a grid that is denser where light grazes.
fn over_hemisphere(rows: u32, columns: u32, f: impl Fn(Vec3) -> [f64; 3]) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for i in 0..rows {
        let step = (f64::from(i) + 0.5) / f64::from(rows);
        let c = step * step;
        let level = (1.0 - c * c).sqrt();
        for j in 0..columns {
            let phi = TAU * (f64::from(j) + 0.5) / f64::from(columns);
            let found = f([level * phi.cos(), level * phi.sin(), c].map(|x| x as f32));
            (0..3).for_each(|k| sum[k] += 2.0 * step * found[k]);
        }
    }
    sum.map(|x| x * TAU / f64::from(rows * columns))
}

/// What the distribution function itself reflects of light from everywhere, but for the diffuse part.
fn integrated(s: &Gloss) -> [f64; 3] {
    over_hemisphere(500, 200, |d| s.reflected(d).map(|x| f64::from(x) * f64::from(d[2]) / PI))
}

fn wide(v: Vec3) -> [f64; 3] {
    v.map(f64::from)
}

fn close(found: [f64; 3], expected: [f64; 3], bound: f64, what: &str) {
    let is_close = found.iter().zip(expected).all(|(f, e)| (f - e).abs() < bound);
    assert!(is_close, "{what}: {found:?} instead of {expected:?}");
}

const VELVET: Layers = Layers { sheen: [1.0; 3], sheen_roughness: 0.5, ..Layers::NONE };

/// What white sheen reflects, and what it leaves to a white base, come to all of the light.
#[test]
fn sheen_and_what_lies_below_reflect_all_light() {
    for sheen_roughness in [0.15, 0.3, 0.5, 0.8, 1.0] {
        for cosine in [0.1, 0.3, 0.6, 0.95] {
            for base in [Material::DIFFUSE, plastic(), metal()] {
                let m = with(base, Layers { sheen_roughness, ..VELVET });
                let s = gloss(&m, [1.0; 3], 0.6, cosine, 0.0);
                let (sum, around) = (integrated(&s), wide(s.around()));
                close(sum, around, 0.012, &format!("around {sheen_roughness} {cosine}"));
                let all = [0, 1, 2].map(|k| sum[k] + f64::from(s.diffuse[k]));
                close(all, [1.0; 3], 0.012, &format!("all {sheen_roughness} {cosine}"));
            }
        }
    }
    // Coloured sheen takes from the base what its brightest colour reflects: no colour gains.
    let m = with(plastic(), Layers { sheen: [1.0, 0.2, 0.0], ..VELVET });
    let s = gloss(&m, [1.0; 3], 0.6, 0.3, 0.0);
    let all = [0, 1, 2].map(|k| integrated(&s)[k] + f64::from(s.diffuse[k]));
    assert!((all[0] - 1.0).abs() < 0.012 && all[1] < 0.9 && all[2] < all[1], "{all:?}");
    // Without the scaling there would be too much light.
    let bare = gloss(&plastic(), [1.0; 3], 0.6, 0.3, 0.0);
    assert!(all[0] + f64::from(bare.diffuse[0] - s.diffuse[0]) > 1.1);
}

/// The sheen of the specification, as it stands there.
#[test]
fn sheen_is_that_of_the_specification() {
    let specified = |cosines: [f64; 3], roughness: f64| {
        let alpha = roughness * roughness;
        let [view, light, half] = cosines;
        let l = |x: f64| {
            let m = |p: f64, q: f64| p * (1.0 - (1.0 - alpha).powi(2)) + q * (1.0 - alpha).powi(2);
            m(21.5473, 25.3245) / (1.0 + m(3.82987, 3.32435) * x.powf(m(0.19823, 0.16801)))
                + m(-1.97760, -1.27393) * x
                + m(-4.32054, -4.85967)
        };
        let lambda = |c: f64| if c < 0.5 { l(c).exp() } else { (2.0 * l(0.5) - l(1.0 - c)).exp() };
        let distribution = (2.0 + 1.0 / alpha) * (1.0 - half * half).powf(0.5 / alpha) / TAU;
        distribution / ((1.0 + lambda(view) + lambda(light)) * 4.0 * view * light)
    };
    let layers = Layers { sheen: [1.0, 0.5, 0.25], ..VELVET };
    let (m, mut greatest) = (with(Material::DIFFUSE, layers), 0.0f64);
    let roughness = f64::from(m.layers().sheen_roughness);
    for cosine in [0.2, 0.5, 0.9] {
        let s = gloss(&m, [1.0; 3], 1.0, cosine, 0.7);
        let level = (1.0 - cosine * cosine).sqrt();
        let view = [level * 0.7f32.cos(), level * 0.7f32.sin(), cosine];
        for i in 0..50 {
            let words = random4(i, 3, 1).map(|word| word as f32 / u32::MAX as f32);
            let d = normalize([words[0] - 0.5, words[1] - 0.5, 0.02 + words[2]]);
            let half = normalize([view[0] + d[0], view[1] + d[1], view[2] + d[2]]);
            let expected = specified([cosine, d[2], half[2]].map(f64::from), roughness);
            let found = f64::from(s.reflected(d)[0]) / PI;
            assert!((found - expected).abs() < 1e-4 + 1e-3 * expected, "{cosine} {d:?}: {found}, not {expected}");
            let green = f64::from(s.reflected(d)[1]) / PI;
            assert!((green - 0.5 * expected).abs() < 1e-4 + 1e-3 * expected);
            greatest = greatest.max((specified([cosine, d[2], half[2]].map(f64::from), 0.6) - found).abs());
        }
    }
    // Another roughness would be seen.
    assert!(greatest > 0.01, "{greatest}");
}

/// The facets of the specification, as they stand there; x is along.
fn anisotropic(view: Vec3, d: Vec3, [at, ab]: [f64; 2]) -> f64 {
    let (v, l) = (wide(view), wide(d));
    let h: [f64; 3] = std::array::from_fn(|k| v[k] + l[k]);
    let length = h.iter().map(|x| x * x).sum::<f64>().sqrt();
    let h = h.map(|x| x / length);
    let q = (h[0] / at).powi(2) + (h[1] / ab).powi(2) + h[2] * h[2];
    let distribution = 1.0 / (PI * at * ab * q * q);
    let root = |d: [f64; 3]| ((at * d[0]).powi(2) + (ab * d[1]).powi(2) + d[2] * d[2]).sqrt();
    distribution * 0.5 / (l[2] * root(v) + v[2] * root(l))
}

#[test]
fn facets_are_those_of_the_specification_and_turn_with_their_direction() {
    for (rotation, azimuth) in [(0.0, 0.4f32), (0.25, 0.4), (0.125, 1.2)] {
        let m = with(metal(), Layers { anisotropy: 0.8, rotation, ..Layers::NONE });
        let strength = f64::from(m.layers().anisotropy);
        let (cosine, roughness) = (0.7f32, 0.4f32);
        let s = gloss(&m, [1.0; 3], roughness, cosine, azimuth);
        let level = (1.0 - cosine * cosine).sqrt();
        let across = f64::from(roughness * roughness);
        let alphas = [across + (1.0 - across) * strength * strength, across];
        // In the frame of the direction everything is turned back.
        let back = |v: Vec3| {
            let (sin, cos) = (rotation * std::f32::consts::TAU).sin_cos();
            [cos * v[0] + sin * v[1], cos * v[1] - sin * v[0], v[2]]
        };
        let view = back([level * azimuth.cos(), level * azimuth.sin(), cosine]);
        let (mut scales, mut wrong) = (Vec::new(), Vec::new());
        for i in 0..100 {
            let words = random4(i, 3, 1).map(|word| word as f32 / u32::MAX as f32);
            let d = normalize([words[0] - 0.5, words[1] - 0.5, 0.05 + words[2]]);
            let found = f64::from(s.reflected(d)[0]) / PI;
            scales.push(found / anisotropic(view, back(d), alphas));
            wrong.push(found / anisotropic(view, back(d), [alphas[1], alphas[0]]));
        }
        // White facets: all are brighter by one number, that of further bounces.
        let spread = |x: &[f64]| {
            let (low, high) = (x.iter().copied().fold(f64::MAX, f64::min), x.iter().copied().fold(0.0, f64::max));
            (high - low) / low
        };
        assert!(spread(&scales) < 1e-3 && scales[0] >= 1.0 && scales[0] < 1.6, "{rotation}: {scales:?}");
        assert!(spread(&wrong) > 0.5, "{rotation}: a quarter turn aside agrees as well");
    }
}

/// White anisotropic metals and plastics lose and gain a few percent at most, which is what the table leaves.
#[test]
fn anisotropic_facets_keep_their_energy() {
    let mut worst = 0.0f64;
    for base in [metal(), plastic()] {
        for (roughness, anisotropy) in [(0.4, 0.5), (0.4, 1.0), (0.7, 0.7), (1.0, 0.3), (0.55, 0.85)] {
            for cosine in [0.2, 0.5, 0.9] {
                for azimuth in [0.0, 0.5, 1.1, std::f32::consts::FRAC_PI_2] {
                    let m = with(base, Layers { anisotropy, ..Layers::NONE });
                    let s = gloss(&m, [1.0; 3], roughness, cosine, azimuth);
                    let sum = integrated(&s)[0];
                    worst = worst.max((sum - f64::from(s.around()[0])).abs());
                    worst = worst.max((sum + f64::from(s.diffuse[0]) - 1.0).abs());
                }
            }
        }
    }
    assert!(worst < 0.025, "{worst}");
    // By the alpha across alone the table would be off by much more.
    let m = with(metal(), Layers { anisotropy: 1.0, ..Layers::NONE });
    let lost = integrated(&gloss(&m, [1.0; 3], 0.3, 0.3, 0.0))[0]
        / f64::from(gloss(&metal(), [1.0; 3], 0.3, 0.3, 0.0).around()[0]);
    assert!((lost - 1.0).abs() < 0.03, "{lost}");
}

/// The film of the specification (Belcour, Barla 2017), as it stands there.
fn film([index, thickness]: [f64; 2], f0: [f64; 3], cosine: f64) -> [f64; 3] {
    let fresnel0 = |transmitted: f64, incident: f64| ((transmitted - incident) / (transmitted + incident)).powi(2);
    let schlick = |f0: f64, c: f64| f0 + (1.0 - f0) * (1.0 - c).powi(5);
    let cosine2 = (1.0 - (1.0 - cosine * cosine) / (index * index)).sqrt();
    let r12 = schlick(fresnel0(index, 1.0), cosine);
    let t121 = 1.0 - r12;
    let base = f0.map(|f| {
        let root = (f + 0.0001).min(0.9999).sqrt();
        (1.0 + root) / (1.0 - root)
    });
    let r23 = base.map(|base| schlick(fresnel0(base, index), cosine2));
    let phi = base.map(|base| PI + if base < index { PI } else { 0.0 });
    let path = 2.0 * index * thickness * cosine2;
    let sensitivity = |path: f64, shift: [f64; 3]| {
        let phase = TAU * path * 1e-9;
        let of = |value: f64, position: f64, variance: f64, shift: f64| {
            value * (TAU * variance).sqrt() * (position * phase + shift).cos() * (-phase * phase * variance).exp()
                / 1.0685e-7
        };
        let x = of(5.4856e-13, 1.6810e6, 4.3278e9, shift[0]) + of(9.7470e-14, 2.2399e6, 4.5282e9, shift[0]);
        let y = of(4.4201e-13, 1.7953e6, 9.3046e9, shift[1]);
        let z = of(5.2481e-13, 2.2084e6, 6.6121e9, shift[2]);
        [
            3.2404542 * x - 1.5371385 * y - 0.4985314 * z,
            -0.9692660 * x + 1.8760108 * y + 0.0415560 * z,
            0.0556434 * x - 0.2040259 * y + 1.0572252 * z,
        ]
    };
    let once = sensitivity(path, phi);
    let twice = sensitivity(2.0 * path, phi.map(|phi| 2.0 * phi));
    std::array::from_fn(|k| {
        let r123 = (r12 * r23[k]).clamp(1e-5, 0.9999);
        let rs = t121 * t121 * r23[k] / (1.0 - r123);
        let first = (rs - t121) * r123.sqrt();
        let sum: f64 = r12 + rs + 2.0 * first * once[k] + 2.0 * first * r123.sqrt() * twice[k];
        sum.clamp(0.0, 1.0)
    })
}

const BUBBLE: Layers = Layers { film: 1.0, film_index: 1.3, film_thickness: 400.0, ..Layers::NONE };

/// Mirrors show the film's colours along their mirror directions, of dielectrics, metals and mixtures.
#[test]
fn films_are_those_of_the_specification() {
    let mut greatest = 0.0f64;
    for thickness in [0.0, 100.0, 250.0, 400.0, 800.0, 2000.0] {
        for index in [1.1, 1.3, 2.0] {
            for cosine in [0.1f32, 0.4, 0.8, 1.0] {
                let layers = Layers { film_index: index, film_thickness: thickness, ..BUBBLE };
                let albedo = [0.9, 0.6, 0.3];
                let level = (1.0 - cosine * cosine).sqrt();
                let mirrored = [-level, 0.0, cosine];
                for (base, metallic) in
                    [(plastic(), 0.0), (metal(), 1.0), (Material { metallic: 0.5, ..plastic() }, 0.5)]
                {
                    let m = with(base, layers);
                    let numbers = [m.layers().film_index, m.layers().film_thickness].map(f64::from);
                    let s = gloss(&m, albedo, 0.05, cosine, 0.0);
                    // Beside it the same facets without Fresnel: white metal, too smooth for bounces between facets.
                    let white = gloss(&metal(), [1.0; 3], 0.05, cosine, 0.0);
                    let found: [f64; 3] =
                        std::array::from_fn(|k| f64::from(s.reflected(mirrored)[k] / white.reflected(mirrored)[k]));
                    let of = |f0: [f64; 3]| film(numbers, f0, f64::from(cosine));
                    let (dielectric, conductor) = (of([0.04; 3].map(|x: f32| f64::from(x))), of(wide(albedo)));
                    let expected: [f64; 3] =
                        std::array::from_fn(|k| dielectric[k] * (1.0 - metallic) + conductor[k] * metallic);
                    close(found, expected, 0.01, &format!("{thickness} {index} {cosine} {metallic}"));
                    let other = film([numbers[0], numbers[1] + 60.0], [0.04; 3], f64::from(cosine));
                    greatest = greatest.max((other[0] - dielectric[0]).abs());
                }
            }
        }
    }
    // Another thickness would be seen.
    assert!(greatest > 0.05, "{greatest}");
}

/// A film of air is none, and a share of a film is that share of it.
#[test]
fn films_end_where_they_should() {
    for base in [plastic(), metal()] {
        let of =
            |layers: Layers| gloss(&with(base, layers), [0.8, 0.5, 0.2], 0.3, 0.6, 0.0).reflected([-0.8, 0.0, 0.6]);
        let (bare, full, half) = (
            gloss(&base, [0.8, 0.5, 0.2], 0.3, 0.6, 0.0).reflected([-0.8, 0.0, 0.6]),
            of(BUBBLE),
            of(Layers { film: 0.5, ..BUBBLE }),
        );
        // Along the normal. Terms are kept that would vanish there: 2 sqrt(1e-5) of a cosine in linear RGB.
        let along = |layers: Layers| gloss(&with(base, layers), [0.8, 0.5, 0.2], 0.05, 1.0, 0.0).reflected(NORMAL);
        let white = f64::from(gloss(&metal(), [1.0; 3], 0.05, 1.0, 0.0).reflected(NORMAL)[0]);
        let air = along(Layers { film_index: 1.0, ..BUBBLE });
        close(wide(air), wide(along(Layers::NONE)), 0.025 * white, "air");
        let scale = f64::from(gloss(&metal(), [1.0; 3], 0.3, 0.6, 0.0).reflected([-0.8, 0.0, 0.6])[0]);
        let mean: [f64; 3] = std::array::from_fn(|k| 0.5 * f64::from(bare[k] + full[k]));
        close(wide(half), mean, 1e-3 * scale, "half");
        assert!((0..3).any(|k| f64::from((full[k] - bare[k]).abs()) > 0.05 * f64::from(bare[k])), "no colour");
    }
}

/// What facets under films reflect of light from everywhere is what was put down for it; the base below gets what the
/// brightest colour leaves, and no colour gains.
#[test]
fn films_gain_nothing() {
    let mut least = f64::MAX;
    for thickness in [150.0, 400.0, 900.0] {
        for base in [plastic(), metal()] {
            for roughness in [0.3, 0.6, 1.0] {
                for cosine in [0.2, 0.5, 0.9] {
                    let m = with(base, Layers { film_thickness: thickness, film_index: 1.6, ..BUBBLE });
                    let s = gloss(&m, [1.0; 3], roughness, cosine, 0.0);
                    let (sum, around) = (integrated(&s), wide(s.around()));
                    close(sum, around, 0.015, &format!("{thickness} {roughness} {cosine}"));
                    let all: [f64; 3] = std::array::from_fn(|k| sum[k] + f64::from(s.diffuse[k]));
                    assert!(all.iter().all(|x| *x < 1.015), "{thickness} {roughness} {cosine}: {all:?}");
                    if base.metallic == 0.0 {
                        // That colour, and it alone, comes to all of the light.
                        close([all.iter().copied().fold(0.0, f64::max); 3], [1.0; 3], 0.015, "brightest");
                        least = least.min(all.iter().copied().fold(1.0, f64::min));
                    }
                }
            }
        }
    }
    assert!(least < 0.97, "{least}: no colour loses");
}

/// What directions are drawn by, over all kinds of layers at once.
fn mixtures() -> [Gloss; 6] {
    let all = Layers { sheen: [0.9, 0.6, 0.3], sheen_roughness: 0.4, anisotropy: 0.7, rotation: 0.1, ..BUBBLE };
    let coated = Material { clearcoat: 0.5, clearcoat_roughness: 0.3, ..plastic() };
    [
        gloss(&with(coated, all), [0.5; 3], 0.5, 0.6, 0.3),
        gloss(&with(metal(), all), [0.9, 0.6, 0.3], 0.3, 0.3, 1.0),
        gloss(&with(Material::DIFFUSE, VELVET), [0.5; 3], 1.0, 0.4, 0.0),
        gloss(&with(metal(), Layers { anisotropy: 1.0, ..Layers::NONE }), [1.0; 3], 0.2, 0.5, 0.8),
        leaning(1.0, 0.4, 0.7, 0.3),
        leaning(0.6, 0.7, 0.5, 1.2),
    ]
}

/// A coat with a normal of its own reflects no more than all of the light, and what its normal says.
#[test]
fn coats_that_lean_gain_nothing() {
    for angle in [0.0, 0.2, 0.5, 0.9] {
        for (cosine, azimuth) in [(0.9, 0.0), (0.6, 1.0), (0.3, 3.1), (0.1, 0.0)] {
            let s = leaning(1.0, angle, cosine, azimuth);
            let sum = integrated(&s);
            assert!(sum.iter().all(|x| (0.5..1.004).contains(x)), "{angle} {cosine} {azimuth}: {sum:?}");
        }
    }
    // Where it mirrors the view it is brighter than where the surface below does.
    let toward = |s: &Gloss, n: Vec3, view: Vec3| {
        let along = 2.0 * dot(n, view);
        s.reflected(std::array::from_fn(|k| along * n[k] - view[k]))[0]
    };
    let (view, normal) = ([0.0, 0.0, 1.0], [0.3f32.sin(), 0.0, 0.3f32.cos()]);
    let straight = |angle: f32| leaning(1.0, angle, 1.0, 0.0);
    let (flat, leaned) = (straight(0.0), straight(0.3));
    assert!(toward(&leaned, normal, view) > 1.02 * toward(&flat, normal, view));
    assert!(toward(&leaned, NORMAL, view) < 0.98 * toward(&flat, NORMAL, view));
}

/// The mean of what is reflected over the density, over drawn directions, is the integral.
#[test]
fn drawn_directions_bring_the_integral() {
    for (which, s) in mixtures().iter().enumerate() {
        let count = 200_000;
        let mut sum = [0.0; 3];
        for i in 0..count {
            let d = s.direction(random4(i, 1, 2)).direction;
            let density = s.density(d);
            if density > 0.0 {
                let reflected = s.reflected(d);
                (0..3).for_each(|k| sum[k] += f64::from(reflected[k] * d[2] / density) / PI);
            }
        }
        close(sum.map(|x| x / f64::from(count)), integrated(s), 6e-3, &format!("mixture {which}"));
    }
}

/// Densities are those of the directions drawn: shares of parts of the hemisphere agree, and come to one with those
/// below it.
#[test]
fn directions_are_drawn_by_their_density() {
    for (which, s) in mixtures().iter().enumerate() {
        let parts: [fn(Vec3) -> bool; 3] = [|d| d[0] > 0.0, |d| d[1] > 0.2 && d[2] < 0.5, |d| d[2] > 0.7];
        let count = 400_000;
        let mut drawn = [0.0; 3];
        for i in 0..count {
            let d = s.direction(random4(i, 5, 9)).direction;
            (0..3).filter(|&k| d[2] > 0.0 && parts[k](d)).for_each(|k| drawn[k] += 1.0 / f64::from(count));
        }
        let expected = over_hemisphere(1500, 800, |d| {
            let density = f64::from(s.density(d));
            parts.map(|part| if part(d) { density } else { 0.0 })
        });
        close(drawn, expected, 5e-3, &format!("mixture {which}"));
        assert!(expected.iter().any(|x| *x > 0.05));
    }
}

/// Facets that refract under a film, anisotropic ones too: what they reflect and let pass comes to no more than all,
/// and where they are smooth to all of it.
#[test]
fn facets_that_refract_gain_nothing() {
    let body = Material { transmission: 1.0, flags: MATERIAL_REFRACTS, ..plastic() };
    for (roughness, anisotropy) in [(0.0, 0.0), (0.3, 0.0), (0.3, 0.6)] {
        for cosine in [0.3, 0.8] {
            let m = with(body, Layers { anisotropy, film_index: 1.6, ..BUBBLE });
            let s = gloss(&m, [1.0; 3], roughness, cosine, 0.4);
            let (count, mut sum, mut mirrored) = (100_000, [0.0; 3], 0.0);
            for i in 0..count {
                let drawn = s.direction(random4(i, 3, 4));
                let d = drawn.direction;
                let found = if drawn.is_through {
                    if d[2] < 0.0 { s.passed(d) } else { [0.0; 3] }
                } else if s.density(d) > 0.0 {
                    s.reflected(d).map(|x| x * d[2] / (std::f32::consts::PI * s.density(d)))
                } else {
                    [0.0; 3]
                };
                (0..3).for_each(|k| sum[k] += f64::from(found[k]) / f64::from(count));
                mirrored += if drawn.is_through { 0.0 } else { f64::from(found[0]) / f64::from(count) };
            }
            let least = if roughness == 0.0 { 0.99 } else { 0.7 };
            assert!(sum.iter().all(|x| (least..1.005).contains(x)), "{roughness} {anisotropy} {cosine}: {sum:?}");
            assert!(mirrored > 0.01);
        }
    }
}

/// Beside textured normals the direction stays along the surface, and where there is no tangent there is some.
#[test]
fn directions_lie_along_the_surface() {
    let m = with(metal(), Layers { anisotropy: 0.9, ..Layers::NONE });
    for (tangent, handedness) in [([1.0, 0.0, 0.5], -1.0), ([0.0; 3], 0.0), ([0.0, 0.0, 1.0], 1.0)] {
        let normal = normalize([0.3, -0.2, 1.0]);
        let g = GBuffer {
            albedo: [1.0; 3],
            normal,
            metallic: 1.0,
            roughness: 0.3,
            tangent,
            handedness,
            ..GBuffer::default()
        };
        let s = Gloss::of(&g, &m, [0.1, 0.4, 0.9]);
        let sum = over_hemisphere(400, 200, |d| {
            // Around the normal.
            let x = normalize(cross(normal, [0.0, 1.0, 0.0]));
            let y = cross(normal, x);
            let d: Vec3 = std::array::from_fn(|k| d[0] * x[k] + d[1] * y[k] + d[2] * normal[k]);
            s.reflected(d).map(|c| f64::from(c * dot(normal, d)) / PI)
        });
        close(sum, wide(s.around()), 0.02, &format!("{tangent:?}"));
    }
}
