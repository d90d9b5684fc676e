//! Materials for levels of detail: as those of the scene, but without textures and opaque.

use super::merge::Shade;
use crate::build::texture::mips::Textures;
use crate::build::texture::opacity::MaterialOpacity;
use crate::build::texture::small::Small;
use crate::build::triangles::attributes::{MeanColors, Wants};
use bricks::{BASE_COLOR, MATERIAL_BLEND, MATERIAL_MASK, MATERIAL_MORE, MATERIAL_REFRACTS, Material, NONE};

/// Where a texture is looked up under a triangle, as weights of its corners.
const SAMPLES: [[f64; 3]; 4] = {
    let (most, least) = (2.0 / 3.0, 1.0 / 6.0);
    [[1.0 / 3.0; 3], [most, least, least], [least, most, least], [least, least, most]]
};

/// The materials of the scene and those that are added for levels.
#[derive(Debug)]
pub(crate) struct Flattened<'a> {
    /// What is added, behind the materials of the scene.
    pub added: Vec<Material>,
    /// Mean colours of all.
    pub means: Vec<MeanColors>,
    /// Opacity of all.
    pub opacity: Vec<MaterialOpacity>,
    /// What triangles of each want: nothing.
    pub wants: Vec<Wants>,
    /// The family of each.
    pub family_of: Vec<u32>,
    /// What levels take in place of a material of the scene, by its index.
    pub families: Vec<Family>,
    /// What triangles of a material of the scene show, by its index; behind them all that is added is opaque.
    looks: Vec<Look<'a>>,
}

/// What triangles of a material show, linear RGB.
#[derive(Debug)]
struct Look<'a> {
    /// Base colour: factor times the mean of what is opaque.
    mean: [f32; 3],
    /// Share of the surface that is opaque.
    cover: f32,
    /// Whether rays pass where alpha is low.
    has_alpha: bool,
    /// Base colour factor.
    factor: [f32; 4],
    /// Its base colour texture, whether that takes the second set of coordinates, and its rows of
    /// [`Material::uv_from_set`].
    texture: Option<(&'a Small, bool, [[f32; 4]; 2])>,
}

impl<'a> Look<'a> {
    fn of(material: &Material, mean: &MeanColors, textures: &'a Textures) -> Self {
        let small = textures.small(material.base_color_texture);
        let has_alpha = material.flags & (MATERIAL_MASK | MATERIAL_BLEND) != 0;
        let [r, g, b, factor] = material.base_color;
        let (mut mean, mut cover) = (mean.albedo, 1.0);
        if has_alpha {
            let [x, y, z, alpha] = small.map_or([1.0; 4], Small::opaque_mean);
            let is_mask = material.flags & MATERIAL_MASK != 0;
            cover = match small {
                None if is_mask => f32::from(factor >= material.alpha_cutoff),
                _ if is_mask => alpha,
                _ => (factor * alpha).clamp(0.0, 1.0),
            };
            if small.is_some() {
                mean = [r * x, g * y, b * z];
            }
        }
        let rows = [material.uv_from_set[2 * BASE_COLOR], material.uv_from_set[2 * BASE_COLOR + 1]];
        let second_set = material.uv_sets >> BASE_COLOR & 1 != 0;
        let texture = small.map(|small| (small, second_set, rows));
        Self { mean, cover, has_alpha, factor: material.base_color, texture }
    }

    /// Base colour and opaque share under a triangle, vertex colours aside.
    fn under(&self, corners: [&Shade; 3]) -> ([f32; 3], f32) {
        let Some((small, second_set, rows)) = &self.texture else { return (self.mean, self.cover) };
        let uvs: [[f64; 2]; 3] = corners.map(|corner| {
            let [s, t] = corner.uvs[usize::from(*second_set)].map(f64::from);
            rows.map(|[a, b, c, _]| f64::from(a) * s + f64::from(b) * t + f64::from(c))
        });
        // What covers as much as the whole texture shows its mean.
        let [p, q, r] = uvs;
        let covered = ((q[0] - p[0]) * (r[1] - p[1]) - (r[0] - p[0]) * (q[1] - p[1])).abs();
        if covered.is_nan() || covered > 0.25 {
            return (self.mean, self.cover);
        }
        let (mut sum, mut alphas) = ([0.0f32; 3], 0.0f32);
        for weights in SAMPLES {
            let at = [0, 1].map(|k| (0..3).map(|corner| weights[corner] * uvs[corner][k]).sum());
            let [red, green, blue, alpha] = small.at(at);
            let alpha = if self.has_alpha { alpha } else { 1.0 };
            for (sum, x) in sum.iter_mut().zip([red, green, blue]) {
                *sum += alpha * x;
            }
            alphas += alpha;
        }
        if alphas <= 0.0 {
            return (self.mean, 0.0);
        }
        let cover = if self.has_alpha { alphas / SAMPLES.len() as f32 } else { 1.0 };
        (std::array::from_fn(|k| self.factor[k] * sum[k] / alphas), cover)
    }
}

/// What stands for a material.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Family {
    /// The material itself, or its flat copy.
    pub flat: u32,
    /// The same with a white base colour.
    pub white: u32,
    /// Base colour of the flat one, linear RGB.
    pub base: [f32; 3],
}

impl<'a> Flattened<'a> {
    /// Of the materials of `textures`, their mean colours and opacity; a bit of `used` for each material that is used,
    /// without which it needs nothing.
    pub fn of(textures: &'a Textures, (means, opacity): (&[MeanColors], &[MaterialOpacity]), used: &[u64]) -> Self {
        let materials = &textures.materials;
        let look = |(material, mean): (&Material, &MeanColors)| Look::of(material, mean, textures);
        let mut all = Self {
            added: Vec::new(),
            means: means.to_vec(),
            opacity: opacity.to_vec(),
            wants: vec![Wants::default(); materials.len()],
            family_of: (0..materials.len() as u32).collect(),
            families: Vec::with_capacity(materials.len()),
            looks: materials.iter().zip(means).map(look).collect(),
        };
        for (index, (material, mean)) in (0u32..).zip(materials.iter().zip(means)) {
            if used[index as usize / 64] >> (index % 64) & 1 == 0 {
                all.families.push(Family { flat: index, white: index, base: [1.0; 3] });
                continue;
            }
            let mean = MeanColors { albedo: all.looks[index as usize].mean, ..*mean };
            let flat = flattened(material, &mean, textures.means());
            let [r, g, b, _] = flat.base_color;
            let own = if flat == *material { index } else { all.add(index, flat) };
            let is_white = [r, g, b] == [1.0; 3];
            let white = if is_white { own } else { all.add(index, Material { base_color: [1.0; 4], ..flat }) };
            all.families.push(Family { flat: own, white, base: [r, g, b] });
        }
        all
    }

    /// Base colour and opaque share of a triangle, vertex colours aside.
    pub(super) fn under(&self, material: u32, corners: [&Shade; 3]) -> ([f32; 3], f32) {
        match self.looks.get(material as usize) {
            Some(look) => look.under(corners),
            None => (self.means[material as usize].albedo, 1.0),
        }
    }

    /// Whether no ray passes through triangles of a material.
    pub fn is_opaque(&self, material: u32) -> bool {
        self.looks.get(material as usize).is_none_or(|look| !look.has_alpha)
    }

    fn add(&mut self, family: u32, material: Material) -> u32 {
        self.means.push(MeanColors::of(&material, &[]));
        self.opacity.push(MaterialOpacity::OPAQUE);
        self.wants.push(Wants::default());
        self.family_of.push(family);
        self.added.push(material);
        self.means.len() as u32 - 1
    }
}

/// A material without textures, of the same mean colours, through which no ray passes.
fn flattened(material: &Material, mean: &MeanColors, texture_means: &[[f32; 3]]) -> Material {
    let is_flat = material.flags & MATERIAL_MORE == 0 && material.textures().iter().all(|&texture| texture == NONE);
    let is_opaque = material.flags & (MATERIAL_MASK | MATERIAL_BLEND) == 0;
    if is_flat && is_opaque {
        return *material;
    }
    let [red, green, blue] = mean.albedo;
    let [_, rough, metal] = match material.metallic_roughness_texture {
        NONE => [1.0; 3],
        texture => texture_means[texture as usize],
    };
    let mut flat = Material {
        base_color: [red, green, blue, 1.0],
        emission: mean.emission,
        metallic: material.metallic * metal,
        roughness: material.roughness * rough,
        flags: material.flags & !(MATERIAL_MASK | MATERIAL_BLEND | MATERIAL_MORE | MATERIAL_REFRACTS),
        transmission: 0.0,
        absorption: 0,
        opacity_map: NONE,
        alpha_cutoff: Material::DIFFUSE.alpha_cutoff,
        uv_sets: 0,
        uv_from_set: Material::SAME_UV,
        ..*material
    };
    flat.textures_mut().into_iter().for_each(|texture| *texture = NONE);
    // Their words are those of its coordinates.
    flat.set_layers(&material.layers());
    flat
}
