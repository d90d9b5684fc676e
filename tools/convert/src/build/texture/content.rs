//! What texels mean: how they become numbers that can be averaged, and bytes again.

use bricks::{MATERIAL_FURTHER, MATERIAL_TEXTURES, Material};
use rayon::prelude::*;
use std::sync::LazyLock;

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

static LINEAR_OF_SRGB: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|i| {
        let x = i as f64 / 255.0;
        (if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }) as f32
    })
});

/// The linear value of one of sRGB.
pub(super) fn linear_of_srgb(value: u8) -> f32 {
    LINEAR_OF_SRGB[value as usize]
}

/// Linear values from which on the sRGB value is at least i + 1.
static SRGB_BORDERS: LazyLock<[f32; 255]> = LazyLock::new(|| {
    std::array::from_fn(|i| {
        let x = (i as f64 + 0.5) / 255.0;
        (if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }) as f32
    })
});

/// Sections of the linear range, for finding borders fast.
const SECTIONS: usize = 1024;

/// Borders at or below the start of each section.
static FIRST_BORDER: LazyLock<[u8; SECTIONS + 1]> = LazyLock::new(|| {
    std::array::from_fn(|section| {
        let start = section as f32 / SECTIONS as f32;
        SRGB_BORDERS.partition_point(|&border| border <= start) as u8
    })
});

/// The nearest sRGB value of a linear one.
fn srgb(linear: f32) -> u8 {
    let linear = linear.clamp(0.0, 1.0);
    let mut value = FIRST_BORDER[(linear * SECTIONS as f32) as usize];
    while value < 255 && SRGB_BORDERS[value as usize] <= linear {
        value += 1;
    }
    value
}

impl Content {
    /// What RGBA8 stands for: linear RGBA. Directions are numbers like others: their mean is that of the vectors, which
    /// lie in a cube twice as large about its middle.
    pub fn decode(self, rgba: &[u8]) -> Vec<[f32; 4]> {
        let table = &*LINEAR_OF_SRGB;
        let (texels, _) = rgba.as_chunks::<4>();
        let unorm = |byte: u8| f32::from(byte) / 255.0;
        let texels = texels.par_iter().with_min_len(1 << 14);
        match self {
            Self::Color => texels
                .map(|&[r, g, b, a]| [table[r as usize], table[g as usize], table[b as usize], unorm(a)])
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_is_nearest() {
        for i in 0..=255u8 {
            assert_eq!(srgb(LINEAR_OF_SRGB[i as usize]), i);
        }
        for i in 0..=10_000 {
            let x = i as f32 / 10_000.0;
            let y = f64::from(x);
            let exact = 255.0 * if y <= 0.0031308 { y * 12.92 } else { 1.055 * y.powf(1.0 / 2.4) - 0.055 };
            assert!((f64::from(srgb(x)) - exact).abs() <= 0.501, "{x}");
        }
    }
}
