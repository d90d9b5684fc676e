//! What lets light pass: thin walls and bodies (KHR_materials_transmission, _volume, _ior), and textures that say
//! where.

use super::document::{Material as Json, Volume};
use super::materials::{MOST_INDEX, unit};
use crate::import::warnings::Warnings;
use crate::srgb::{linear_of_srgb, srgb};
use bricks::{MATERIAL_BLEND, MATERIAL_MASK, MATERIAL_REFRACTS, Material, pack_absorption};

/// What a surface lets pass of the light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Passing {
    /// Bits of four shares, 0..=1, so that textures can be told apart by them: what is transmitted; what is no metal;
    /// the brightest component of the base colour; the greatest of what is reflected along the normal.
    shares: [u32; 4],
    /// It is a body, not a thin wall.
    pub is_body: bool,
}

/// What a transmission texture changes in a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Changed {
    /// The base colour, and alpha.
    Base,
    /// What is reflected along the normal.
    Specular,
}

impl Passing {
    /// Of a material that has not been told to let anything pass; `None`: it does not.
    pub fn of(json: &Json, material: &Material, warnings: &mut Warnings, place: &dyn Fn() -> String) -> Option<Self> {
        let extensions = &json.more.extensions;
        let transmission = unit(extensions.transmission.as_ref()?.transmission_factor.unwrap_or(0.0));
        if transmission == 0.0
            || material.metallic == 1.0 && json.pbr_metallic_roughness.metallic_roughness_texture.is_none()
        {
            // Metal lets nothing through.
            return None;
        }
        if material.flags & MATERIAL_MASK != 0 {
            warnings.add("transmission ignored beside alpha MASK", place);
            return None;
        }
        let [r, g, b, _] = material.base_color;
        let is_body = body(json).is_some();
        let of_wall = material.specular.into_iter().fold(0.0, f32::max);
        let along_normal = if is_body { body_reflects(json) } else { of_wall };
        let shares = [transmission, 1.0 - material.metallic, r.max(g).max(b), along_normal].map(f32::to_bits);
        Some(Self { shares, is_body })
    }

    /// The share of the rays that pass, before what is reflected, where a texture says `texel`.
    fn before_reflection(&self, texel: f32) -> f32 {
        let [share, dielectric, brightest, _] = self.shares.map(f32::from_bits);
        share * texel * dielectric * brightest
    }

    /// The share of the rays that meet it.
    fn alpha(&self, texel: f32) -> f32 {
        1.0 - self.before_reflection(texel) * (1.0 - f32::from_bits(self.shares[3]))
    }

    /// What those that meet it see of the base colour, if it is a wall.
    fn rest(&self, texel: f32) -> f32 {
        let passing = self.before_reflection(texel);
        if passing < 1.0 { (1.0 - f32::from_bits(self.shares[0]) * texel) / (1.0 - passing) } else { 0.0 }
    }

    /// Lets light pass through a material: rays pass straight through thin walls, whatever the roughness, and each is
    /// either let through or shaded.
    ///
    /// Let t be the share transmitted, c the greatest component of the base colour, F the greatest of what is reflected
    /// along the normal. A share 1 - a = t c (1 - F) of the rays passes: alpha is multiplied by a, and what is shaded,
    /// seen by the share a, is made brighter so that along the normal it is as bright as it was: specular / a, and of
    /// the base colour the share that is not transmitted, (1 - t) / (1 - t c). Then surfaces reflect and transmit no
    /// more than they receive. What is lost is the tint of what is seen through.
    ///
    /// Of a body (KHR_materials_volume with a thickness) alpha is the same, but colours are left as they are: where
    /// paths follow light through it they are needed so, and else shading does what is said above.
    ///
    /// With a texture of t, `is_textured`, textures have a and what follows from it; factors are those of its greatest
    /// t.
    pub fn apply(
        &self,
        json: &Json,
        material: &mut Material,
        is_textured: bool,
        warnings: &mut Warnings,
        place: &dyn Fn() -> String,
    ) {
        let [r, g, b, _] = material.base_color;
        if !self.is_body && (r != g || g != b) {
            warnings.add("transmitted light is not tinted", place);
        }
        material.transmission = f32::from_bits(self.shares[0]);
        if material.flags & MATERIAL_BLEND == 0 {
            // Opaque materials have no alpha of their own.
            material.base_color[3] = 1.0;
            material.flags |= MATERIAL_BLEND;
        }
        let alpha = self.alpha(1.0);
        if let Some(volume) = body(json) {
            if material.base_color[3] < 1.0 {
                warnings.add("alpha ignored of a body that refracts", place);
            }
            material.base_color[3] = if is_textured { 1.0 } else { alpha };
            refract(volume, json, material, warnings, place);
            return;
        }
        if !is_textured {
            let rest = self.rest(1.0);
            material.base_color[..3].iter_mut().for_each(|c| *c *= rest);
            material.base_color[3] *= alpha;
        }
        if alpha > 0.0 {
            material.specular = material.specular.map(|c| (c / alpha).min(1.0));
        }
    }

    /// Changes texels of a picture by those of the transmission texture, RGBA8, as many.
    pub fn change(&self, what: Changed, texels: &mut [u8], texture: &[u8]) {
        // By the red byte of the texture: what multiplies the colour, and alpha.
        let factors: Vec<[f32; 2]> = (0..=255u8)
            .map(|byte| {
                let texel = f32::from(byte) / 255.0;
                match what {
                    Changed::Base if self.is_body => [1.0, self.alpha(texel)],
                    Changed::Base => [self.rest(texel), self.alpha(texel)],
                    Changed::Specular => [self.alpha(1.0) / self.alpha(texel).max(f32::MIN_POSITIVE), 1.0],
                }
            })
            .collect();
        for (texel, &[byte, ..]) in texels.as_chunks_mut::<4>().0.iter_mut().zip(texture.as_chunks::<4>().0) {
            let [color, alpha] = factors[byte as usize];
            if color != 1.0 {
                texel[..3].iter_mut().for_each(|c| *c = srgb(linear_of_srgb(*c) * color));
            }
            texel[3] = (f32::from(texel[3]) * alpha).round() as u8;
        }
    }
}

/// What closes a body.
fn body(json: &Json) -> Option<&Volume> {
    json.more.extensions.volume.as_ref().filter(|volume| volume.thickness_factor.is_some_and(|x| x > 0.0))
}

/// What a body reflects along the normal, by its index of refraction.
fn body_reflects(json: &Json) -> f32 {
    let index = json.more.extensions.ior.as_ref().and_then(|extension| extension.ior);
    let index = index.unwrap_or(1.5).clamp(1.0, MOST_INDEX);
    (((index - 1.0) / (index + 1.0)).powi(2)) as f32
}

/// What a body that refracts is: its index of refraction and its absorption (KHR_materials_ior, _volume).
fn refract(volume: &Volume, json: &Json, material: &mut Material, warnings: &mut Warnings, place: &dyn Fn() -> String) {
    let along_normal = body_reflects(json);
    if material.specular != [along_normal; 3] || material.specular_weight != 1.0 {
        warnings.add("KHR_materials_specular ignored of a body that refracts", place);
        (material.specular, material.specular_weight) = ([along_normal; 3], 1.0);
    }
    if let Some(distance) = volume.attenuation_distance.filter(|distance| *distance > 0.0) {
        let color = volume.attenuation_color.unwrap_or([1.0; 3]);
        // Of what is black a thousandth is left, so that the packed absorptions of other colours keep their digits.
        material.absorption = pack_absorption(color.map(|c| -c.clamp(1e-3, 1.0).ln() / distance));
    }
    material.flags |= MATERIAL_REFRACTS;
}
