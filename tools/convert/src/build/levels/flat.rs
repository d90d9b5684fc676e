//! Materials for levels of detail: as those of the scene, but without textures and opaque.

use crate::build::texture::opacity::MaterialOpacity;
use crate::build::triangles::attributes::MeanColors;
use bricks::{MATERIAL_BLEND, MATERIAL_MASK, Material, NONE};

/// The materials of the scene and those that are added for levels.
#[derive(Debug)]
pub(crate) struct Flattened {
    /// What is added, behind the materials of the scene.
    pub added: Vec<Material>,
    /// Mean colours of all.
    pub means: Vec<MeanColors>,
    /// Opacity of all.
    pub opacity: Vec<MaterialOpacity>,
    /// That none needs details.
    pub details: Vec<bool>,
    /// The family of each.
    pub family_of: Vec<u32>,
    /// What levels take in place of a material of the scene, by its index.
    pub families: Vec<Family>,
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

impl Flattened {
    /// Of the materials of a scene, their mean colours and opacity. `texture_means` are the linear means of textures;
    /// a bit of `used` for each material that is used, without which it needs nothing.
    pub fn of(
        materials: &[Material],
        (means, opacity): (&[MeanColors], &[MaterialOpacity]),
        texture_means: &[[f32; 3]],
        used: &[u64],
    ) -> Self {
        let mut all = Self {
            added: Vec::new(),
            means: means.to_vec(),
            opacity: opacity.to_vec(),
            details: vec![false; materials.len()],
            family_of: (0..materials.len() as u32).collect(),
            families: Vec::with_capacity(materials.len()),
        };
        for (index, (material, mean)) in (0u32..).zip(materials.iter().zip(means)) {
            if used[index as usize / 64] >> (index % 64) & 1 == 0 {
                all.families.push(Family { flat: index, white: index, base: [1.0; 3] });
                continue;
            }
            let flat = flattened(material, mean, texture_means);
            let [r, g, b, _] = flat.base_color;
            let own = if flat == *material { index } else { all.add(index, flat) };
            let is_white = [r, g, b] == [1.0; 3];
            let white = if is_white { own } else { all.add(index, Material { base_color: [1.0; 4], ..flat }) };
            all.families.push(Family { flat: own, white, base: [r, g, b] });
        }
        all
    }

    fn add(&mut self, family: u32, material: Material) -> u32 {
        self.means.push(MeanColors::of(&material, &[]));
        self.opacity.push(MaterialOpacity::OPAQUE);
        self.details.push(false);
        self.family_of.push(family);
        self.added.push(material);
        self.means.len() as u32 - 1
    }
}

/// A material without textures, of the same mean colours, through which no ray passes.
fn flattened(material: &Material, mean: &MeanColors, texture_means: &[[f32; 3]]) -> Material {
    let is_flat = material.textures().iter().all(|&texture| texture == NONE);
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
        flags: material.flags & !(MATERIAL_MASK | MATERIAL_BLEND),
        opacity_map: NONE,
        alpha_cutoff: Material::DIFFUSE.alpha_cutoff,
        uv_sets: 0,
        uv_from_set: Material::SAME_UV,
        ..*material
    };
    flat.textures_mut().into_iter().for_each(|texture| *texture = NONE);
    flat
}
