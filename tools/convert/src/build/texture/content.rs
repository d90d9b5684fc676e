//! What texels mean: how they become numbers that can be averaged, and bytes again.

use crate::srgb::{linear_of_srgb, srgb};
use bricks::{MATERIAL_FURTHER, MATERIAL_TEXTURES, Material};
use rayon::prelude::*;

/// What texels mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Content {
    /// Colour in sRGB, with alpha. Coarser levels average light.
    Color,
    /// Numbers. Coarser levels average them; alpha is not kept.
    Data,
    /// Numbers, alpha one of them.
    Numbers,
    /// Directions. Texels of coarser levels are the directions of the means of those of the finest; alpha is not kept.
    Normals,
}

impl Content {
    /// Of the textures of a material, by their places.
    pub fn of(material: &Material) -> [Content; MATERIAL_TEXTURES] {
        let third = if material.flags & MATERIAL_FURTHER != 0 { Content::Numbers } else { Content::Data };
        [Content::Color, Content::Normals, third, Content::Data, Content::Color]
    }

    /// How many there are.
    pub const COUNT: usize = 4;
}

impl Content {
    /// What RGBA8 stands for: linear RGBA. Directions are numbers like others: their mean is that of the vectors, which
    /// lie in a cube twice as large about its middle.
    pub fn decode(self, rgba: &[u8]) -> Vec<[f32; 4]> {
        let (texels, _) = rgba.as_chunks::<4>();
        let unorm = |byte: u8| f32::from(byte) / 255.0;
        let texels = texels.par_iter().with_min_len(1 << 14);
        match self {
            Self::Color => texels
                .map(|&[r, g, b, a]| [linear_of_srgb(r), linear_of_srgb(g), linear_of_srgb(b), unorm(a)])
                .collect(),
            Self::Data | Self::Numbers | Self::Normals => texels.map(|texel| texel.map(unorm)).collect(),
        }
    }

    /// The inverse, rounded.
    pub fn encode(self, texels: &[[f32; 4]], out: &mut Vec<u8>) {
        let byte = |x: f32| (x.clamp(0.0, 1.0) * 255.0).round() as u8;
        let texels = texels.iter();
        match self {
            Self::Color => out.extend(texels.flat_map(|&[r, g, b, a]| [srgb(r), srgb(g), srgb(b), byte(a)])),
            Self::Data | Self::Numbers => out.extend(texels.flat_map(|texel| texel.map(byte))),
            Self::Normals => out.extend(texels.flat_map(|&[r, g, b, _]| {
                let [x, y, z] = direction([r, g, b]).map(|c| byte(0.5 * c + 0.5));
                [x, y, z, 255]
            })),
        }
    }
}

/// The unit vector of a mean texel of normals; along the surface's normal where the vectors cancel out.
pub(super) fn direction(rgb: [f32; 3]) -> [f32; 3] {
    let v = rgb.map(|c| 2.0 * c - 1.0);
    let length = v.iter().map(|c| c * c).sum::<f32>().sqrt();
    if length > 1e-6 { v.map(|c| c / length) } else { [0.0, 0.0, 1.0] }
}
