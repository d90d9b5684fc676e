//! What facets under a thin film reflect: twin of `shaders/shade/film.wgsl`.

use crate::kernels::layer_tables::LAYER_TABLES;
use crate::kernels::layout::{FACET_COSINES, REFLECTANCE_SIZE};
use crate::kernels::vector::{Vec3, each, least, mix, most};
use std::f32::consts::TAU;

/// A film.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Film {
    /// Index of refraction.
    pub index: f32,
    /// nm.
    pub thickness: f32,
}

fn fifth_power(x: f32) -> f32 {
    let c = x.clamp(0.0, 1.0);
    c * c * c * c * c
}

/// cos(2 pi x).
fn turned_cosine(x: f32) -> f32 {
    (TAU * (x - x.floor())).cos()
}

/// How the sensitivity of the eye sees waves with a path difference of `path`, nm, as linear RGB; x, y and z are
/// multiplied by `signs`. Gaussians of Belcour and Barla, their places in periods a nm.
fn sensitivity(path: f32, signs: Vec3) -> Vec3 {
    let squared = path * path;
    let x = 0.84659 * turned_cosine(0.001681 * path) * (-1.708547e-7 * squared).exp()
        + 0.153_868_3 * turned_cosine(0.0022399 * path) * (-1.7876617e-7 * squared).exp();
    let y = 1.0002219 * turned_cosine(0.0017953 * path) * (-3.6733088e-7 * squared).exp();
    let z = 1.0011225 * turned_cosine(0.0022084 * path) * (-2.6103525e-7 * squared).exp();
    let [x, y, z] = [x * signs[0], y * signs[1], z * signs[2]];
    [
        3.240_454_3 * x - 1.5371385 * y - 0.4985314 * z,
        1.8760108 * y - 0.969266 * x + 0.041556 * z,
        0.0556434 * x - 0.2040259 * y + 1.0572252 * z,
    ]
}

impl Film {
    /// What it reflects on a base that reflects f0 along the normal, by the cosine outside; at most all.
    pub fn color(&self, f0: Vec3, cosine: f32) -> Vec3 {
        let c = cosine.clamp(0.0, 1.0);
        let beyond = most(1.0 - (1.0 - c * c) / (self.index * self.index), 0.0).sqrt();
        let outer = (self.index - 1.0) / (self.index + 1.0);
        let r12 = mix(outer * outer, 1.0, fifth_power(1.0 - c));
        let t121 = 1.0 - r12;
        let path = 2.0 * self.index * self.thickness * beyond;
        let base = f0.map(|f| {
            let root = least(f + 1.0e-4, 0.9999).sqrt();
            (1.0 + root) / (1.0 - root)
        });
        // Half a wave is lost at the outer side, and half a wave where the base is thinner than the film.
        let signs = base.map(|base| if base < self.index { 1.0 } else { -1.0 });
        let (once, twice) = (sensitivity(path, signs), sensitivity(2.0 * path, [1.0; 3]));
        each(|k| {
            let inner = (base[k] - self.index) / (base[k] + self.index);
            let r23 = mix(inner * inner, 1.0, fifth_power(1.0 - beyond));
            let r123 = (r12 * r23).clamp(1.0e-5, 0.9999);
            let amplitude = r123.sqrt();
            let all = t121 * t121 * r23 / (1.0 - r123);
            let mut wave = (all - t121) * amplitude;
            let mut sum = r12 + all + wave * (2.0 * once[k]);
            wave *= amplitude;
            sum += wave * (2.0 * twice[k]);
            sum.clamp(0.0, 1.0)
        })
    }
}

/// Cosines between the view and facets, each of which stands for a quarter of what white facets reflect.
pub(super) fn facet_cosines(cosine: f32, alpha: f32) -> [f32; 4] {
    let most = (REFLECTANCE_SIZE - 1) as f32;
    let [x, y] = [cosine, alpha].map(|x| x.sqrt().clamp(0.0, 1.0) * most);
    let [column, row] = [x, y].map(|x| (x as u32).min(REFLECTANCE_SIZE - 2));
    let at = (FACET_COSINES + 2 * (row * REFLECTANCE_SIZE + column)) as usize;
    let (right, up) = (x - column as f32, y - row as f32);
    let next = at + 2 * REFLECTANCE_SIZE as usize;
    let table = &LAYER_TABLES[..];
    let between = |at: usize, k: usize| mix(table[at][k], table[at + 2][k], right);
    [0, 1, 2, 3].map(|i| mix(between(at + i / 2, i % 2), between(next + i / 2, i % 2), up))
}
