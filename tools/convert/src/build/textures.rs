//! Mip chains of textures, averaged in linear light.

use super::attributes::MeanColors;
use super::error::BuildError;
use super::journal::{WordReader, Words};
use crate::progress::Progress;
use crate::source::{Outline, Source, SourceTexture};
use bricks::{MAX_TEXTURE_SIZE, Material, NONE, Span, Texture, WRAP_MIRROR, WRAP_REPEAT, Writer};
use rayon::prelude::*;
use std::sync::LazyLock;

/// A texture with all its levels.
#[derive(Debug)]
pub(super) struct EncodedTexture {
    /// The record, without the place of its payload.
    pub record: Texture,
    /// The payload.
    pub texels: Vec<u8>,
    /// Mean linear RGB.
    pub mean: [f32; 3],
}

/// Which textures some material uses, ascending.
pub(super) fn used(count: usize, materials: &[Material]) -> Vec<usize> {
    let mut is_used = vec![false; count];
    for material in materials.iter().filter(|material| material.base_color_texture != NONE) {
        is_used[material.base_color_texture as usize] = true;
    }
    (0..count).filter(|&index| is_used[index]).collect()
}

/// Materials and textures as they are stored.
#[derive(Clone, Debug, Default)]
pub(super) struct Textures {
    /// All materials, with the indices of the textures that are stored.
    pub materials: Vec<Material>,
    /// Records of the textures in use.
    pub records: Vec<Texture>,
    /// What the source warned of, and which textures were left out.
    pub warnings: Vec<String>,
    /// Mean linear RGB of the textures.
    means: Vec<[f32; 3]>,
    /// Their indices, by index in the source; [`NONE`] where it is not stored.
    new_of_old: Vec<u32>,
}

/// Writes the textures in use, `at_once` of which are in memory together. One that cannot be read is left out with a
/// warning.
pub(super) fn write(
    source: &dyn Source,
    at_once: usize,
    writer: &mut Writer,
    progress: &Progress,
) -> Result<Textures, BuildError> {
    let Outline { textures: names, materials, warnings, .. } = source.outline();
    let mut stored =
        Textures { new_of_old: vec![NONE; names.len()], warnings: warnings.clone(), ..Textures::default() };
    let used = used(names.len(), materials);
    progress.phase("textures", used.len() as u64);
    for some in used.chunks(at_once) {
        progress.check()?;
        let read = |&index: &usize| source.texture(index).map(|texture| encode(&texture));
        let encoded: Vec<_> = some.par_iter().with_max_len(1).map(read).collect();
        for (&index, texture) in some.iter().zip(encoded) {
            match texture {
                Ok(texture) => stored.push(index, texture?, writer)?,
                Err(error) => stored.warnings.push(format!("{error}; the texture is left out")),
            }
            progress.advance(1);
        }
    }
    stored.materials = stored.renumber(materials);
    Ok(stored)
}

impl Textures {
    fn push(&mut self, index: usize, texture: EncodedTexture, writer: &mut Writer) -> Result<(), BuildError> {
        self.new_of_old[index] = self.records.len() as u32;
        self.records.push(Texture { texels: writer.write(&texture.texels)?, ..texture.record });
        self.means.push(texture.mean);
        Ok(())
    }

    /// Materials with the indices among the stored textures; without one where it is not stored.
    fn renumber(&self, materials: &[Material]) -> Vec<Material> {
        let renumber = |material: &Material| match material.base_color_texture {
            NONE => *material,
            old => Material { base_color_texture: self.new_of_old[old as usize], ..*material },
        };
        materials.iter().map(renumber).collect()
    }

    /// Whether a texture, by its index in the source, is stored.
    pub fn is_stored(&self, texture: u32) -> bool {
        self.new_of_old[texture as usize] != NONE
    }

    /// Mean colours by material.
    pub fn material_means(&self) -> Vec<MeanColors> {
        self.materials.iter().map(|material| MeanColors::of(material, &self.means)).collect()
    }

    /// For the journal: first how far the scene file is written and the payloads.
    pub fn to_words(&self, position: u64) -> Vec<u64> {
        let spans: Vec<Span> = self.records.iter().map(|record| record.texels).collect();
        let mut words = Words::default();
        words.put(position).put_records(&spans).put_records(&self.records).put_records(&self.means);
        words.put_records(&self.new_of_old).put(self.warnings.len() as u64);
        for warning in &self.warnings {
            words.put_records(warning.as_bytes());
        }
        words.0
    }

    /// From the journal.
    pub fn from_words(words: &[u64], outline: &Outline) -> Option<Self> {
        let mut words = WordReader(words);
        words.take()?;
        words.take_records::<Span>()?;
        let (records, means) = (words.take_records()?, words.take_records()?);
        let new_of_old: Vec<u32> = words.take_records()?;
        let count = words.take()?;
        let warnings = (0..count).map(|_| String::from_utf8(words.take_records()?).ok()).collect::<Option<_>>()?;
        let mut stored = Self { materials: Vec::new(), records, warnings, means, new_of_old };
        if stored.new_of_old.len() != outline.textures.len() {
            return None;
        }
        stored.materials = stored.renumber(&outline.materials);
        Some(stored)
    }
}

/// How a texture is repeated, in ways that are known.
pub(super) fn sound_wrap(texture: &SourceTexture) -> u32 {
    let is_known = texture.wrap & 0xffff <= WRAP_MIRROR && texture.wrap >> 16 <= WRAP_MIRROR;
    if is_known { texture.wrap } else { WRAP_REPEAT | WRAP_REPEAT << 16 }
}

/// Makes the mip chain of a texture.
pub(super) fn encode(source: &SourceTexture) -> Result<EncodedTexture, BuildError> {
    let (width, height) = (source.width, source.height);
    let rule = |ok: bool, what: &str, found: String, expected: String| {
        let what = format!("texture \"{}\": {what}", source.name);
        if ok { Ok(()) } else { Err(BuildError::Inconsistent { what, found, expected }) }
    };
    let in_range = [width, height].iter().all(|size| (1..=MAX_TEXTURE_SIZE).contains(size));
    rule(in_range, "size", format!("{width} by {height}"), format!("1 to {MAX_TEXTURE_SIZE} texels each way"))?;
    let bytes = width as usize * height as usize * 4;
    rule(source.rgba.len() == bytes, "length", source.rgba.len().to_string(), format!("{bytes} bytes"))?;
    let wrap = sound_wrap(source);

    let levels = width.max(height).ilog2() + 1;
    let mut texels = source.rgba.clone();
    let mut level = Image { width: width as usize, height: height as usize, texels: decode(&source.rgba) };
    for _ in 1..levels {
        level = level.halve();
        encode_level(&level, &mut texels);
    }
    let [red, green, blue, _] = level.texels[0];
    texels.resize(texels.len().next_multiple_of(16), 0);
    let record = Texture { width, height, levels, wrap, texels: bricks::Span::default() };
    Ok(EncodedTexture { record, texels, mean: [red, green, blue] })
}

/// Linear RGBA.
struct Image {
    width: usize,
    height: usize,
    texels: Vec<[f32; 4]>,
}

impl Image {
    /// The next level: each texel is the mean over its share of the area, exact for odd sizes too.
    fn halve(&self) -> Self {
        let (width, height) = ((self.width / 2).max(1), (self.height / 2).max(1));
        let columns: Vec<Taps> = (0..width).map(|x| taps(self.width, width, x)).collect();
        let rows: Vec<Taps> = (0..height).map(|y| taps(self.height, height, y)).collect();
        let mut texels = vec![[0.0; 4]; width * height];
        texels.par_chunks_mut(width).zip(&rows).for_each(|(out, row)| {
            for (out, column) in out.iter_mut().zip(&columns) {
                let mut sum = [0.0f32; 4];
                for (dy, wy) in row.weights.iter().enumerate().filter(|(_, w)| **w > 0.0) {
                    for (dx, wx) in column.weights.iter().enumerate().filter(|(_, w)| **w > 0.0) {
                        let texel = self.texels[(row.first + dy) * self.width + column.first + dx];
                        (0..4).for_each(|k| sum[k] += wy * wx * texel[k]);
                    }
                }
                *out = sum;
            }
        });
        Self { width, height, texels }
    }
}

/// Texels along an axis that a texel of the next level averages.
struct Taps {
    first: usize,
    /// Their sum is 1; trailing ones may be 0.
    weights: [f32; 3],
}

/// The taps of texel `i` of `to` over `from`; `to` is `from / 2`, or both are 1. The texel covers `from / to` ≤ 3 texels.
fn taps(from: usize, to: usize, i: usize) -> Taps {
    // In units of 1 / to texels: the texel covers [i from, (i + 1) from], texel j of the source [j to, (j + 1) to].
    let (start, end) = (i * from, (i + 1) * from);
    let first = start / to;
    let weights = std::array::from_fn(|d| {
        let (low, high) = ((first + d) * to, (first + d + 1) * to);
        let overlap = high.min(end).saturating_sub(low.max(start));
        overlap as f32 / from as f32
    });
    Taps { first, weights }
}

static LINEAR_OF_SRGB: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|i| {
        let x = i as f64 / 255.0;
        (if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }) as f32
    })
});

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

fn decode(rgba: &[u8]) -> Vec<[f32; 4]> {
    let table = &*LINEAR_OF_SRGB;
    let (texels, _) = rgba.as_chunks::<4>();
    texels
        .par_iter()
        .with_min_len(1 << 14)
        .map(|&[r, g, b, a]| [table[r as usize], table[g as usize], table[b as usize], f32::from(a) / 255.0])
        .collect()
}

fn encode_level(level: &Image, out: &mut Vec<u8>) {
    let alpha = |a: f32| (a.clamp(0.0, 1.0) * 255.0).round() as u8;
    out.extend(level.texels.iter().flat_map(|&[r, g, b, a]| [srgb(r), srgb(g), srgb(b), alpha(a)]));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texture(width: u32, height: u32, texel: impl Fn(u32, u32) -> [u8; 4]) -> SourceTexture {
        let rgba = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).flat_map(|(x, y)| texel(x, y)).collect();
        SourceTexture { name: "test".to_owned(), width, height, wrap: 0, rgba }
    }

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

    #[test]
    fn means_are_those_of_linear_light_for_odd_sizes_too() {
        for (width, height) in [(1, 1), (2, 2), (5, 3), (7, 1), (1, 6), (13, 11), (64, 3)] {
            let source = texture(width, height, |x, y| [(x * 19 % 256) as u8, (y * 83 % 256) as u8, 255, 128]);
            let encoded = encode(&source).unwrap();
            assert_eq!(encoded.record.levels, width.max(height).ilog2() + 1);
            assert_eq!(Some(encoded.texels.len() as u64), encoded.record.texel_bytes().map(|b| b.next_multiple_of(16)));
            let linear = decode(&source.rgba);
            for k in 0..3 {
                let mean = linear.iter().map(|texel| f64::from(texel[k])).sum::<f64>() / linear.len() as f64;
                assert!((f64::from(encoded.mean[k]) - mean).abs() < 1e-5, "{width} by {height}, channel {k}");
            }
        }
        // Half black, half white is lighter than the mean of the codes.
        let encoded = encode(&texture(2, 1, |x, _| [(x * 255) as u8; 4])).unwrap();
        assert_eq!(encoded.texels[8..12], [188, 188, 188, 128]);
    }

    #[test]
    fn unused_textures_are_left_out() {
        let material = |texture| Material { base_color_texture: texture, ..bytemuck::Zeroable::zeroed() };
        let materials = [material(3), material(NONE), material(1), material(3), material(2)];
        assert_eq!(used(5, &materials), [1, 2, 3]);
        // Texture 2 could not be read.
        let stored = Textures { new_of_old: vec![NONE, 0, NONE, 1, NONE], ..Textures::default() };
        let renumbered = stored.renumber(&materials);
        let indices: Vec<u32> = renumbered.iter().map(|material| material.base_color_texture).collect();
        assert_eq!(indices, [1, NONE, 0, 1, NONE]);
    }

    #[test]
    fn wrong_lengths_are_errors() {
        let mut source = texture(3, 3, |_, _| [0; 4]);
        assert!(encode(&source).is_ok());
        source.rgba.pop();
        assert!(matches!(encode(&source), Err(BuildError::Inconsistent { .. })));
    }
}
