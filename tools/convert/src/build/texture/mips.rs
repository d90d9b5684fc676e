//! Mip chains of textures, averaged by what their texels mean, cut into tiles.

use super::content::Content;
use super::roughness::{Bumps, bumps};
use super::small::{SMALL_TEXELS, Small};
use crate::build::disk::journal::{WordReader, Words};
use crate::build::error::BuildError;
use crate::build::settings::TextureEncoding;
use crate::build::triangles::attributes::{MeanColors, Wants};
use crate::progress::Progress;
use crate::source::{Outline, Source, SourceTexture};
use block_compression::encode::compress_rgba8;
use block_compression::{BC7Settings, CompressionVariant};
use bricks::{BLOCK_TEXELS, MAX_TEXTURE_SIZE, Material, NONE, Span, TILE_TEXELS, Texture, Writer};
use bricks::{TEXTURE_BC5, TEXTURE_BC7, TEXTURE_RGBA8, TEXTURE_SRGB, WRAP_MIRROR, WRAP_REPEAT};
use rayon::prelude::*;
use std::collections::BTreeSet;

/// A texture with all its levels.
#[derive(Debug)]
pub(crate) struct EncodedTexture {
    /// The record, without the places of its payloads.
    pub record: Texture,
    /// Payloads of the tiles.
    pub tiles: Vec<Vec<u8>>,
    /// Payload of the tail.
    pub tail: Vec<u8>,
    /// Mean linear RGB.
    pub mean: [f32; 3],
    /// A small copy, of colours.
    pub small: Option<Small>,
}

/// Which textures some material uses, and for what, ascending. One that is used in two ways is stored twice.
pub(crate) fn used(materials: &[Material]) -> Vec<(u32, Content)> {
    let textures = materials.iter().flat_map(|material| material.textures().into_iter().zip(Content::of(material)));
    let used: BTreeSet<_> = textures.filter(|(texture, _)| *texture != NONE).collect();
    used.into_iter().collect()
}

/// Materials and textures as they are stored.
#[derive(Clone, Debug, Default)]
pub(crate) struct Textures {
    /// All materials, with the indices of the textures that are stored.
    pub materials: Vec<Material>,
    /// Records of the textures in use.
    pub records: Vec<Texture>,
    /// Their tiles.
    pub tiles: Vec<Span>,
    /// Their names in the source.
    pub names: Vec<String>,
    /// What the source warned of, and which textures were left out.
    pub warnings: Vec<String>,
    /// Mean linear RGB of the textures.
    means: Vec<[f32; 3]>,
    /// Small copies of those of colours, if they are wanted.
    small: Vec<Option<Small>>,
    /// Their indices, by index in the source and [`Content`]; [`NONE`] where it is not stored.
    new_of_old: Vec<u32>,
}

/// Writes the textures in use, `at_once` of which are in memory together, and keeps small copies if they are wanted.
/// One that cannot be read is left out with a warning.
pub(crate) fn write(
    source: &dyn Source,
    (encoding, with_small): (TextureEncoding, bool),
    at_once: usize,
    writer: &mut Writer,
    progress: &Progress,
) -> Result<Textures, BuildError> {
    let Outline { textures: names, materials, warnings, .. } = source.outline();
    let mut stored =
        Textures { new_of_old: vec![NONE; place(names.len() as u32, Content::Color)], ..Textures::default() };
    stored.warnings.clone_from(warnings);
    let (used, bumps) = (used(materials), bumps(materials));
    progress.phase("textures", used.len() as u64);
    for some in used.chunks(at_once) {
        progress.check()?;
        let read = |&(index, content): &(u32, Content)| {
            // What cannot be read has no bumps; it is warned of in its own place.
            let bumps = bumps.get(&index).filter(|_| content == Content::Data);
            let bumps = bumps.and_then(|bumps| Some((*bumps, source.texture(bumps.normals as usize).ok()?)));
            let bumps = bumps.as_ref().map(|(bumps, normals)| (*bumps, &**normals));
            source.texture(index as usize).map(|texture| encode(&texture, content, encoding, bumps))
        };
        let encoded: Vec<_> = some.par_iter().with_max_len(1).map(read).collect();
        for (&(index, content), texture) in some.iter().zip(encoded) {
            match texture {
                Ok(texture) => {
                    let mut texture = texture?;
                    texture.small = texture.small.filter(|_| with_small);
                    stored.push(place(index, content), texture, writer)?;
                    stored.names.push(names[index as usize].clone());
                }
                Err(error) => {
                    let warning = format!("{error}; texture skipped");
                    if !stored.warnings.contains(&warning) {
                        stored.warnings.push(warning);
                    }
                }
            }
            progress.advance(1);
        }
    }
    stored.materials = stored.renumber(materials);
    Ok(stored)
}

/// The place of a texture in [`Textures::new_of_old`].
fn place(index: u32, content: Content) -> usize {
    index as usize * Content::COUNT + content as usize
}

impl Textures {
    fn push(&mut self, place: usize, texture: EncodedTexture, writer: &mut Writer) -> Result<(), BuildError> {
        self.new_of_old[place] = self.records.len() as u32;
        let first_tile = self.tiles.len() as u32;
        for tile in &texture.tiles {
            self.tiles.push(writer.write(tile)?);
        }
        self.records.push(Texture { first_tile, tail: writer.write(&texture.tail)?, ..texture.record });
        self.means.push(texture.mean);
        self.small.push(texture.small);
        Ok(())
    }

    /// Materials with the indices among the stored textures; without one where it is not stored.
    fn renumber(&self, materials: &[Material]) -> Vec<Material> {
        let renumber = |material: &Material| {
            let mut material = *material;
            let mut sets = material.uv_sets;
            let contents = Content::of(&material);
            for (number, (texture, content)) in material.textures_mut().into_iter().zip(contents).enumerate() {
                if *texture != NONE {
                    *texture = self.new_of_old[place(*texture, content)];
                }
                if *texture == NONE {
                    sets &= !(1 << number);
                }
            }
            Material { uv_sets: sets, ..material }
        };
        materials.iter().map(renumber).collect()
    }

    /// Whether a texture, by its index in the source, is stored as one of base colour.
    pub fn is_stored(&self, texture: u32) -> bool {
        self.new_of_old[place(texture, Content::Color)] != NONE
    }

    /// What triangles want, by material.
    pub fn wants(&self) -> Vec<Wants> {
        self.materials.iter().map(Wants::of).collect()
    }

    /// Mean linear RGB of the textures.
    pub fn means(&self) -> &[[f32; 3]] {
        &self.means
    }

    /// The small copy of a stored texture, if it is one of colours and they are wanted.
    pub fn small(&self, texture: u32) -> Option<&Small> {
        self.small.get(texture as usize)?.as_ref()
    }

    /// Mean colours by material.
    pub fn material_means(&self) -> Vec<MeanColors> {
        self.materials.iter().map(|material| MeanColors::of(material, &self.means)).collect()
    }

    /// For the journal: first how far the scene file is written and the payloads.
    pub fn to_words(&self, position: u64) -> Vec<u64> {
        // As they were written.
        let spans = self.records.iter().flat_map(|record| {
            let tiles = &self.tiles[record.first_tile as usize..][..record.tile_count as usize];
            tiles.iter().copied().chain([record.tail])
        });
        let spans: Vec<Span> = spans.collect();
        let mut words = Words::default();
        words
            .put(position)
            .put_records(&spans)
            .put_records(&self.records)
            .put_records(&self.tiles)
            .put_records(&self.means);
        words.put_records(&self.new_of_old);
        for texts in [&self.names, &self.warnings] {
            words.put(texts.len() as u64);
            texts.iter().for_each(|text| _ = words.put_records(text.as_bytes()));
        }
        for small in &self.small {
            words.put(u64::from(small.is_some()));
            small.iter().for_each(|small| small.put(&mut words));
        }
        words.0
    }

    /// From the journal.
    pub fn from_words(words: &[u64], outline: &Outline) -> Option<Self> {
        let mut words = WordReader(words);
        words.take()?;
        words.take_records::<Span>()?;
        let (records, tiles, means) = (words.take_records()?, words.take_records()?, words.take_records()?);
        let new_of_old: Vec<u32> = words.take_records()?;
        let mut texts = || -> Option<Vec<String>> {
            let count = words.take()?;
            (0..count).map(|_| String::from_utf8(words.take_records()?).ok()).collect()
        };
        let (names, warnings) = (texts()?, texts()?);
        let records: Vec<Texture> = records;
        let small = |_| if words.take()? == 0 { Some(None) } else { Small::take(&mut words).map(Some) };
        let small = records.iter().map(small).collect::<Option<Vec<_>>>()?;
        let mut stored = Self { materials: Vec::new(), records, tiles, names, warnings, means, small, new_of_old };
        if stored.new_of_old.len() != outline.textures.len() * Content::COUNT {
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

/// Makes the mip chain of a texture and encodes it; coarser levels of roughness stand for `bumps` of a normal texture,
/// if that has the same size.
///
/// As blocks, normals are BC5: unit vectors without the sign of z. See `docs/results/textures.md` for the angles
/// that it costs.
pub(crate) fn encode(
    source: &SourceTexture,
    content: Content,
    encoding: TextureEncoding,
    bumps: Option<(Bumps, &SourceTexture)>,
) -> Result<EncodedTexture, BuildError> {
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
    if matches!(content, Content::Data | Content::Normals) {
        texels.iter_mut().skip(3).step_by(4).for_each(|alpha| *alpha = 255);
    }
    let (encoding, grid) = match encoding {
        TextureEncoding::Raw => (TEXTURE_RGBA8, None),
        TextureEncoding::Bc7 if content == Content::Normals => (TEXTURE_BC5, Some(CompressionVariant::BC5)),
        // The fastest settings: the next ones take six times as long.
        TextureEncoding::Bc7 if texels.iter().skip(3).step_by(4).all(|&alpha| alpha == 255) => {
            (TEXTURE_BC7, Some(CompressionVariant::BC7(BC7Settings::opaque_ultra_fast())))
        }
        TextureEncoding::Bc7 => (TEXTURE_BC7, Some(CompressionVariant::BC7(BC7Settings::alpha_ultrafast()))),
    };
    let flags = if content == Content::Color { TEXTURE_SRGB } else { 0 };
    let mut record = Texture { width, height, levels, wrap, encoding, flags, ..Texture::default() };
    let (mut tiles, mut tail, mut small) = (Vec::new(), Vec::new(), None);
    let mut level = Image { width: width as usize, height: height as usize, texels: content.decode(&texels) };
    if encoding == TEXTURE_BC5 {
        // Unit vectors.
        texels.clear();
        content.encode(&level.texels, &mut texels);
    }
    let is_alike =
        |normals: &SourceTexture| (normals.width, normals.height) == (width, height) && normals.rgba.len() == bytes;
    let of_one_size = bumps.filter(|(_, normals)| is_alike(normals));
    let mut bumps = of_one_size.map(|(bumps, normals)| {
        let texels = Content::Normals.decode(&normals.rgba).into_iter().map(|texel| bumps.unit(texel)).collect();
        (bumps, Image { width: width as usize, height: height as usize, texels })
    });
    for number in 0..levels {
        if number > 0 {
            level = level.halve();
            texels.clear();
            if let Some((bumps, means)) = &mut bumps {
                *means = means.halve();
                let mut widened = Image { texels: level.texels.clone(), ..level };
                widened.texels.iter_mut().zip(&means.texels).for_each(|(texel, mean)| bumps.widen(texel, mean));
                content.encode(&widened.texels, &mut texels);
            } else {
                content.encode(&level.texels, &mut texels);
            }
        }
        let size = record.size(number);
        if content == Content::Color && small.is_none() && size.iter().all(|&side| side <= SMALL_TEXELS) {
            small = Some(Small { size, wrap, rgba: texels.clone() });
        }
        if number < record.tail_level() {
            let [columns, rows] = record.tiles_of(number);
            let of_level = (0..columns * rows).into_par_iter().map(|tile| {
                let corner = [tile % columns * TILE_TEXELS, tile / columns * TILE_TEXELS];
                encode_grid(cut(&texels, size, corner, [TILE_TEXELS; 2]), TILE_TEXELS, grid)
            });
            tiles.par_extend(of_level);
        } else {
            let padded = size.map(|side| side.next_multiple_of(BLOCK_TEXELS));
            tail.extend(encode_grid(cut(&texels, size, [0; 2], padded), padded[0], grid));
        }
    }
    record.tile_count = tiles.len() as u32;
    let [red, green, blue, _] = level.texels[0];
    Ok(EncodedTexture { record, tiles, tail, mean: [red, green, blue], small })
}

/// The texels from `corner` on, `to` each way, of an image of `size`; beyond its edges its last texels are repeated.
fn cut(rgba: &[u8], size: [u32; 2], corner: [u32; 2], to: [u32; 2]) -> Vec<u8> {
    let mut out = Vec::with_capacity(to[0] as usize * to[1] as usize * 4);
    for y in 0..to[1] {
        let row = (corner[1] + y).min(size[1] - 1) as usize * size[0] as usize;
        let inside = (size[0] - corner[0]).min(to[0]) as usize;
        let first = row + corner[0] as usize;
        out.extend_from_slice(&rgba[4 * first..4 * (first + inside)]);
        let last = 4 * (row + size[0] as usize - 1);
        for _ in inside..to[0] as usize {
            out.extend_from_slice(&rgba[last..last + 4]);
        }
    }
    out
}

/// Texels in rows of `width`, as blocks if there is a kind of them.
fn encode_grid(rgba: Vec<u8>, width: u32, blocks_of: Option<CompressionVariant>) -> Vec<u8> {
    let Some(variant) = blocks_of else { return rgba };
    let mut blocks = vec![0; rgba.len() / 4];
    let height = (rgba.len() / 4) as u32 / width;
    compress_rgba8(variant, &rgba, &mut blocks, width, height, 4 * width);
    blocks
}

/// Texels as they are averaged.
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

/// The taps of texel `i` of `to` over `from`; `to` is `from / 2`, or both are 1. The texel covers `from / to` ≤ 3
/// texels.
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

#[cfg(test)]
mod tests {
    use super::super::content::direction;
    use super::*;
    use block_compression::decode::decompress_blocks_as_rgba8;

    /// Normal textures of Sponza, and what they lose less than as BC5, degrees: two smooth ones and the roughest.
    const SPONZA_NORMALS: [(&str, f64); 3] =
        [("8773302468495022225.jpg", 1.0), ("14267839433702832875.jpg", 2.0), ("14118779221266351425.jpg", 5.0)];

    fn texture(width: u32, height: u32, texel: impl Fn(u32, u32) -> [u8; 4]) -> SourceTexture {
        let rgba = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).flat_map(|(x, y)| texel(x, y)).collect();
        SourceTexture { name: "test".to_owned(), width, height, wrap: 0, rgba }
    }

    #[test]
    fn means_are_those_of_linear_light_for_odd_sizes_too() {
        for (width, height) in [(1, 1), (2, 2), (5, 3), (7, 1), (1, 6), (13, 11), (64, 3)] {
            let source = texture(width, height, |x, y| [(x * 19 % 256) as u8, (y * 83 % 256) as u8, 255, 128]);
            let encoded = encode(&source, Content::Color, TextureEncoding::Raw, None).unwrap();
            assert_eq!(encoded.record.levels, width.max(height).ilog2() + 1);
            assert_eq!(encoded.tail.len() as u64, encoded.record.tail_bytes());
            let linear = Content::Color.decode(&source.rgba);
            for k in 0..3 {
                let mean = linear.iter().map(|texel| f64::from(texel[k])).sum::<f64>() / linear.len() as f64;
                assert!((f64::from(encoded.mean[k]) - mean).abs() < 1e-5, "{width} by {height}, channel {k}");
            }
        }
        // Half black, half white is lighter than the mean of the codes.
        let encoded =
            encode(&texture(2, 1, |x, _| [(x * 255) as u8; 4]), Content::Color, TextureEncoding::Raw, None).unwrap();
        let level_1 = encoded.record.tail_offset(1) as usize;
        assert_eq!(encoded.tail[level_1..level_1 + 4], [188, 188, 188, 128]);
    }

    #[test]
    fn numbers_and_directions_are_averaged_as_such() {
        let level_1 = |content, texel: fn(u32) -> [u8; 4]| {
            let encoded = encode(&texture(2, 1, |x, _| texel(x)), content, TextureEncoding::Raw, None).unwrap();
            assert_eq!(encoded.record.flags, 0);
            let at = encoded.record.tail_offset(1) as usize;
            <[u8; 4]>::try_from(&encoded.tail[at..at + 4]).unwrap()
        };
        assert_eq!(level_1(Content::Data, |x| [x as u8 * 255, 10, 20 + 2 * x as u8, 7]), [128, 10, 21, 255]);
        // Two directions at 45 degrees to both sides of z: their mean is z, and as long as it was.
        let tilted = |x: u32| if x == 0 { [218, 128, 218, 255] } else { [37, 128, 218, 255] };
        assert_eq!(level_1(Content::Normals, tilted), [128, 128, 255, 255]);
        assert_eq!(level_1(Content::Normals, |x| if x == 0 { [255; 4] } else { [0, 0, 0, 255] }), [128, 128, 255, 255]);
    }

    #[test]
    fn unused_textures_are_left_out() {
        let material = |texture| Material { base_color_texture: texture, ..Material::DIFFUSE };
        // The third texture of further ones has four numbers.
        let further = Material { metallic_roughness_texture: 4, ..Material::further() };
        let mut materials = [material(3), material(NONE), material(1), material(3), material(2), further];
        // A texture of two kinds, and two uses of one kind.
        (materials[0].normal_texture, materials[1].occlusion_texture) = (1, 4);
        (materials[1].metallic_roughness_texture, materials[2].emissive_texture) = (4, 3);
        materials.iter_mut().for_each(|material| material.uv_sets = 0b1_1111);
        use Content::{Color, Data, Normals, Numbers};
        let all = [(1, Color), (1, Normals), (2, Color), (3, Color), (4, Data), (4, Numbers)];
        assert_eq!(used(&materials), all);
        let mut stored = Textures { new_of_old: vec![NONE; 5 * Content::COUNT], ..Textures::default() };
        // Texture 2 could not be read.
        for (new, (old, content)) in (0..).zip([(1, Color), (1, Normals), (3, Color), (4, Data), (4, Numbers)]) {
            stored.new_of_old[place(old, content)] = new;
        }
        let renumbered = stored.renumber(&materials);
        let indices: Vec<_> = renumbered.iter().map(Material::textures).collect();
        assert_eq!(indices[0], [2, 1, NONE, NONE, NONE]);
        assert_eq!(indices[1], [NONE, NONE, 3, 3, NONE]);
        assert_eq!(indices[2], [0, NONE, NONE, NONE, 2]);
        assert_eq!(indices[3..], [[2, NONE, NONE, NONE, NONE], [NONE; 5], [NONE, NONE, 4, NONE, NONE]]);
        let sets: Vec<u32> = renumbered.iter().map(|material| material.uv_sets).collect();
        assert_eq!(sets, [0b11, 0b1100, 0b1_0001, 1, 0, 0b100], "sets of textures alone");
    }

    const BC7: fn() -> CompressionVariant = || CompressionVariant::BC7(BC7Settings::opaque_ultra_fast());

    /// RGBA8 of a texture of whole blocks that is encoded at once.
    fn decoded(blocks: &[u8], width: u32, variant: CompressionVariant) -> Vec<u8> {
        let mut rgba = vec![0; 4 * blocks.len()];
        let height = blocks.len() as u32 / width;
        if variant != CompressionVariant::BC5 {
            decompress_blocks_as_rgba8(variant, width, height, blocks, &mut rgba);
            return rgba;
        }
        // As `bricks/FORMAT.md` says, in f64.
        for (number, block) in (0..).zip(blocks.as_chunks::<16>().0) {
            let bits = u128::from_le_bytes(*block);
            for texel in 0..16 {
                let [x, y] = [0, 64].map(|at| {
                    let [first, last] = [at, at + 8].map(|at| f64::from((bits >> at) as u8));
                    let index = (bits >> (at + 16 + 3 * texel)) as u32 & 7;
                    let share = f64::from([0, 7].get(index as usize).copied().unwrap_or(index.wrapping_sub(1)));
                    assert!(first > last || index < 2, "the encoder leaves the other kind of blocks out");
                    (first + share / 7.0 * (last - first)).round()
                });
                let length = (x / 127.5 - 1.0).powi(2) + (y / 127.5 - 1.0).powi(2);
                let z = (127.5 + 127.5 * (1.0 - length).max(0.0).sqrt()).round();
                let [column, row] = [number % (width / 4), number / (width / 4)];
                let at = (4 * row + texel as u32 / 4) * width + 4 * column + texel as u32 % 4;
                rgba[4 * at as usize..][..4].copy_from_slice(&[x as u8, y as u8, z as u8, 255]);
            }
        }
        rgba
    }

    /// Angles between directions and what blocks make of them, in degrees: mean and greatest; the PSNR of red, green
    /// and blue; milliseconds to encode.
    fn loss(texture: &SourceTexture, variant: CompressionVariant) -> [f64; 4] {
        let size = [texture.width, texture.height];
        let mut texels = texture.rgba.clone();
        let start = std::time::Instant::now();
        if variant == CompressionVariant::BC5 {
            let [width, height] = size.map(|side| side as usize);
            texels.clear();
            let level = Image { width, height, texels: Content::Normals.decode(&texture.rgba) };
            Content::Normals.encode(&level.texels, &mut texels);
        }
        let blocks = encode_grid(texels, size[0], Some(variant));
        let milliseconds = 1e3 * start.elapsed().as_secs_f64();
        let found = decoded(&blocks, size[0], variant);
        let (mut sum, mut most, mut error) = (0.0, 0.0f64, 0.0);
        for (a, b) in texture.rgba.chunks(4).zip(found.chunks(4)) {
            let [a, b] = [a, b].map(|texel| [0, 1, 2].map(|k| f64::from(texel[k])));
            error += (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>() / 3.0;
            let [a, b] = [a, b].map(|rgb| direction(rgb.map(|c| c as f32 / 255.0)).map(f64::from));
            let angle = (0..3).map(|k| a[k] * b[k]).sum::<f64>().min(1.0).acos().to_degrees();
            (sum, most) = (sum + angle, most.max(angle));
        }
        let count = (found.len() / 4) as f64;
        [sum / count, most, 10.0 * (255.0 * 255.0 * count / error).log10(), milliseconds]
    }

    /// What is lost of Sponza's is in `docs/results/textures.md`.
    #[test]
    fn directions_lose_little_as_bc5_and_less_than_as_bc7() {
        // Waves of 80 and 40 texels, up to 35 degrees steep.
        let waves = texture(256, 256, |x, y| {
            let slope = |at: u32| 0.5 * (f64::from(at) * 0.0785).sin();
            let v = [slope(x + y / 3), slope(2 * y), 1.0];
            let length = v.iter().map(|c| c * c).sum::<f64>().sqrt();
            let [r, g, b] = v.map(|c| (127.5 * (c / length + 1.0)).round() as u8);
            [r, g, b, 255]
        });
        let [bc5, bc7] = [CompressionVariant::BC5, BC7()].map(|variant| loss(&waves, variant));
        println!(
            "waves, bc5: {:.2} degrees in the mean, {:.1} at most; bc7: {:.2}, {:.1}",
            bc5[0], bc5[1], bc7[0], bc7[1]
        );
        assert!(bc5[0] < 0.5 && bc5[0] < bc7[0], "{bc5:?} {bc7:?}");
        let noise = texture(128, 128, |x, y| [(x * 97 + y * 57) as u8, (x * 31 + y * y * 77) as u8, 200, 255]);
        assert!(loss(&noise, CompressionVariant::BC5)[0] > 1.0, "noise is lost");
        let Some(folder) = crate::skip::shared_scenes() else { return };
        for (name, limit) in SPONZA_NORMALS {
            let image = image::open(folder.join("sponza").join(name)).unwrap().into_rgba8();
            let (width, height) = image.dimensions();
            let texture = SourceTexture { name: name.into(), width, height, wrap: 0, rgba: image.into_raw() };
            let [bc5, bc7] = [CompressionVariant::BC5, BC7()].map(|variant| {
                let [mean, most, psnr, milliseconds] = loss(&texture, variant);
                let kind = if variant == CompressionVariant::BC5 { "bc5" } else { "bc7" };
                println!(
                    "{name}, {kind}: {mean:.2} degrees in the mean, {most:.1} at most, {psnr:.1} dB, \
                     {milliseconds:.0} ms"
                );
                mean
            });
            assert!(bc5 < limit && bc5 < bc7, "{name}: {bc5} degrees, {bc7} as BC7");
        }
    }

    #[test]
    fn normals_are_unit_vectors_as_bc5() {
        // Directions of other lengths, one of them with z below zero.
        let v = [[255, 128, 255], [191, 128, 191], [218, 218, 37], [128, 128, 128]];
        let source = texture(16, 4, |x, _| [v[x as usize / 4][0], v[x as usize / 4][1], v[x as usize / 4][2], 9]);
        let encoded = encode(&source, Content::Normals, TextureEncoding::Bc7, None).unwrap();
        assert_eq!((encoded.record.encoding, encoded.record.flags), (TEXTURE_BC5, 0));
        assert_eq!(encoded.tail.len() as u64, encoded.record.tail_bytes());
        let found = decoded(&encoded.tail[..64], 16, CompressionVariant::BC5);
        let first: Vec<&[u8]> = found.chunks(4).step_by(4).take(4).collect();
        let ends = [[218, 128, 218, 255], [218, 128, 218, 255], [201, 201, 201, 255], [201, 201, 201, 255]];
        for (texel, expected) in first.iter().zip(ends) {
            assert!(texel.iter().zip(expected).all(|(a, b): (&u8, u8)| a.abs_diff(b) <= 1), "{texel:?}, {expected:?}");
        }
        // Of other contents nothing is BC5.
        for content in [Content::Color, Content::Data] {
            assert_eq!(encode(&source, content, TextureEncoding::Bc7, None).unwrap().record.encoding, TEXTURE_BC7);
        }
    }

    #[test]
    fn wrong_lengths_are_errors() {
        let mut source = texture(3, 3, |_, _| [0; 4]);
        assert!(encode(&source, Content::Color, TextureEncoding::Raw, None).is_ok());
        source.rgba.pop();
        assert!(matches!(
            encode(&source, Content::Color, TextureEncoding::Raw, None),
            Err(BuildError::Inconsistent { .. })
        ));
    }
}
