//! What decides which rays pass through triangles: the alpha of textures, as maps, and of materials.

use super::mips::sound_wrap;
use crate::build::disk::journal::{WordReader, Words};
use crate::build::error::BuildError;
use crate::build::triangles::attributes::VertexBits;
use crate::progress::Progress;
use crate::source::{Source, SourceTexture};
use bricks::{BASE_COLOR, MATERIAL_BLEND, MATERIAL_MASK, Material, NONE, OpacityMap, OpacityTriangle, Span, Writer};
use std::collections::BTreeMap;

/// The opacity of a scene.
#[derive(Clone, Debug, Default)]
pub(crate) struct Opacities {
    /// Records of the maps.
    pub records: Vec<OpacityMap>,
    /// Least texel of each map, of 255.
    least: Vec<u8>,
    /// The map of each material, or [`NONE`].
    map_of: Vec<u32>,
}

/// The opacity of a material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MaterialOpacity {
    /// From which alpha on no ray passes; 0 where none ever does.
    enough: f32,
    /// Least alpha of factor and texture.
    least: f32,
    /// Whether the base colour texture takes the second set of coordinates.
    second_set: bool,
    /// Its rows of [`Material::uv_from_set`].
    uv_from_set: [[f32; 4]; 2],
}

impl Opacities {
    /// Writes the map of every texture of `materials` that rays ask for; `read` are those of them, by index in the
    /// source, that could be read before. One whose alpha is 1 throughout has none.
    pub fn write(
        source: &dyn Source,
        materials: &[Material],
        is_stored: impl Fn(u32) -> bool,
        writer: &mut Writer,
        progress: &Progress,
    ) -> Result<Self, BuildError> {
        let mut all = Self { map_of: vec![NONE; materials.len()], ..Self::default() };
        let mut map_of_texture = BTreeMap::new();
        for (material, map) in materials.iter().zip(&mut all.map_of) {
            let texture = material.base_color_texture;
            if material.flags & (MATERIAL_MASK | MATERIAL_BLEND) == 0 || texture == NONE || !is_stored(texture) {
                continue;
            }
            *map = match map_of_texture.get(&texture) {
                Some(&known) => known,
                None => {
                    progress.check()?;
                    // It has been read once; should that fail now, its alpha is as if it were 1.
                    let map = match source.texture(texture as usize) {
                        Ok(texture) => push(&mut all.records, &mut all.least, &texture, writer)?,
                        Err(_) => NONE,
                    };
                    map_of_texture.insert(texture, map);
                    map
                }
            };
        }
        Ok(all)
    }

    /// `materials`, of which those with a map name it.
    pub fn name_maps(&self, materials: &mut [Material]) {
        for (material, &map) in materials.iter_mut().zip(&self.map_of) {
            material.opacity_map = map;
        }
    }

    /// The opacity of `materials`.
    pub fn of_materials(&self, materials: &[Material]) -> Vec<MaterialOpacity> {
        let of = |(material, &map): (&Material, &u32)| MaterialOpacity {
            enough: match material.flags & (MATERIAL_MASK | MATERIAL_BLEND) {
                0 => 0.0,
                MATERIAL_MASK => material.alpha_cutoff,
                _ => 1.0,
            },
            least: material.base_color[3] * self.least.get(map as usize).map_or(1.0, |&least| f32::from(least) / 255.0),
            second_set: material.uv_sets >> BASE_COLOR & 1 != 0,
            uv_from_set: [material.uv_from_set[2 * BASE_COLOR], material.uv_from_set[2 * BASE_COLOR + 1]],
        };
        materials.iter().zip(&self.map_of).map(of).collect()
    }

    /// For the journal: first how far the scene file is written and the payloads.
    pub fn to_words(&self, position: u64) -> Vec<u64> {
        let spans: Vec<Span> = self.records.iter().map(|record| record.texels).collect();
        let mut words = Words::default();
        words.put(position).put_records(&spans).put_records(&self.records).put_records(&self.least);
        words.put_records(&self.map_of);
        words.0
    }

    /// From the journal.
    pub fn from_words(words: &[u64], materials: usize) -> Option<Self> {
        let mut words = WordReader(words);
        words.take()?;
        words.take_records::<Span>()?;
        let (records, least) = (words.take_records()?, words.take_records()?);
        let all = Self { records, least, map_of: words.take_records()? };
        (all.map_of.len() == materials && all.least.len() == all.records.len()).then_some(all)
    }
}

/// Writes the alpha of a texture, unless it is 1 throughout, and returns its number.
fn push(
    records: &mut Vec<OpacityMap>,
    least: &mut Vec<u8>,
    texture: &SourceTexture,
    writer: &mut Writer,
) -> Result<u32, BuildError> {
    let (texels, _) = texture.rgba.as_chunks::<4>();
    let lowest = texels.iter().map(|texel| texel[3]).min().unwrap_or(255);
    if lowest == 255 {
        return Ok(NONE);
    }
    let mut alphas: Vec<u8> = texels.iter().map(|texel| texel[3]).collect();
    alphas.resize(alphas.len().next_multiple_of(16), 0);
    let (width, height, wrap) = (texture.width, texture.height, sound_wrap(texture));
    records.push(OpacityMap { width, height, wrap, _reserved: 0, texels: writer.write(&alphas)? });
    least.push(lowest);
    Ok(records.len() as u32 - 1)
}

impl MaterialOpacity {
    /// Of a material through which no ray passes.
    pub const OPAQUE: Self =
        Self { enough: 0.0, least: 0.0, second_set: false, uv_from_set: [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 0.0]] };

    /// What decides which rays pass through a triangle with these attribute vertices; `None` if none does.
    pub fn triangle(&self, material: u32, vertices: [&VertexBits; 3]) -> Option<OpacityTriangle> {
        let alphas = vertices.map(|vertex| vertex.0[3] >> 24);
        let lowest = alphas[0].min(alphas[1]).min(alphas[2]) as f32 / 255.0;
        if self.least * lowest >= self.enough {
            return None;
        }
        let uv = vertices.map(|vertex| self.coordinates(vertex));
        Some(OpacityTriangle { uv, material, alphas: alphas[0] | alphas[1] << 8 | alphas[2] << 16 })
    }

    /// Where the base colour texture is looked up at a vertex; zero where that is beyond the range of numbers.
    fn coordinates(&self, vertex: &VertexBits) -> [f32; 2] {
        let [s, t] = if self.second_set { vertex.detail().uv } else { vertex.vertex().uv }.map(f64::from);
        self.uv_from_set.map(|row| {
            let [a, b, c, _] = row.map(f64::from);
            let x = (a * s + b * t + c) as f32;
            if x.is_finite() { x } else { 0.0 }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::build::triangles::attributes::NO_DETAIL;

    #[test]
    fn only_what_may_let_rays_through_is_asked() {
        let white = VertexBits([0, 0, 0, u32::MAX], NO_DETAIL);
        let thin = VertexBits([0, 1.5f32.to_bits(), 0, 0x80ff_ffff], NO_DETAIL);
        let uv_from_set = [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 0.0]];
        let opaque = MaterialOpacity { enough: 0.0, least: 0.0, second_set: false, uv_from_set };
        assert_eq!(opaque.triangle(0, [&thin, &thin, &thin]), None);
        let mask = |least| MaterialOpacity { enough: 0.5, least, ..opaque };
        assert_eq!(mask(0.5).triangle(3, [&white, &white, &white]), None);
        assert!(mask(0.49).triangle(3, [&white, &white, &white]).is_some());
        let found = mask(0.9).triangle(3, [&white, &thin, &white]).unwrap();
        assert_eq!((found.material, found.alphas), (3, 0x00ff_80ff));
        assert_eq!(found.uv, [[0.0, 0.0], [1.5, 0.0], [0.0, 0.0]]);
        let blend = MaterialOpacity { enough: 1.0, least: 1.0, ..opaque };
        assert_eq!(blend.triangle(0, [&white, &white, &white]), None);
        assert!(blend.triangle(0, [&white, &white, &thin]).is_some());
    }

    #[test]
    fn coordinates_are_those_of_the_base_colour_texture() {
        let (s, t) = (0.25f32.to_bits(), 3.0f32.to_bits());
        let vertex = VertexBits([0, t, s, u32::MAX], [0, 0, s, t]);
        let uv_from_set = [[2.0, 0.5, -1.0, 1.0], [0.0, 1.0, 0.25, 0.0]];
        let first = MaterialOpacity { enough: 1.0, least: 0.5, second_set: false, uv_from_set };
        let of = |opacity: MaterialOpacity| opacity.triangle(0, [&vertex; 3]).unwrap().uv[1];
        assert_eq!(of(first), [5.125, 0.5]);
        assert_eq!(of(MaterialOpacity { second_set: true, ..first }), [1.0, 3.25]);
        let huge = [[f32::MAX, f32::MAX, 0.0, 1.0], [0.0, 1.0, 0.0, 0.0]];
        assert_eq!(of(MaterialOpacity { uv_from_set: huge, ..first }), [0.0, 0.25]);
    }
}
