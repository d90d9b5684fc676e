//! What some materials have besides: sheen, anisotropy and a thin film, packed into words of a material that are zero
//! in all others; and further textures, which the record behind it holds.

use crate::records::{MATERIAL_TEXTURES, Material, NONE};

/// [`Material::flags`]: it has [`Layers`].
pub const MATERIAL_LAYERS: u32 = 32;
/// [`Material::flags`]: its [`Layers`] have a direction, so that its triangles want tangents.
pub const MATERIAL_ANISOTROPIC: u32 = 64;
/// [`Material::flags`]: the next record holds further textures of it, as [`Material::further`] says. Its clear coat has
/// a normal of its own.
pub const MATERIAL_MORE: u32 = 128;
/// [`Material::flags`]: it is such a record, and no material by itself.
pub const MATERIAL_FURTHER: u32 = 256;

/// Steps of a packed share, from 0 to 1.
pub const LAYER_STEPS: u32 = 4095;
/// Bits of a packed number.
pub const LAYER_BITS: u32 = 12;
/// A packed index of refraction k stands for 1 + k / this.
pub const LAYER_INDEX_STEPS: u32 = 1024;

/// Sheen, anisotropy and iridescence of a material (KHR_materials_sheen, _anisotropy and _iridescence). All zero, and
/// `film_index` 1, has none of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layers {
    /// Linear RGB of the sheen, 0..=1; black is none.
    pub sheen: [f32; 3],
    /// Roughness of the sheen, 0..=1.
    pub sheen_roughness: f32,
    /// Strength of the anisotropy, 0..=1: along its direction the square of roughness a is a + (1 - a) strength².
    pub anisotropy: f32,
    /// Direction of the anisotropy, turns from the tangent to the bitangent, 0 to below 1.
    pub rotation: f32,
    /// Share of the surface that a thin film covers, 0..=1.
    pub film: f32,
    /// Index of refraction of the film, 1 to below 5.
    pub film_index: f32,
    /// Thickness of the film, nm, 0..=4095; its greatest where a texture says how thick it is. No colours are left of
    /// thicker ones.
    pub film_thickness: f32,
    /// Its least where a texture says so, nm, 0..=4095.
    pub film_least: f32,
}

impl Layers {
    /// None of them.
    pub const NONE: Self = Self {
        sheen: [0.0; 3],
        sheen_roughness: 0.0,
        anisotropy: 0.0,
        rotation: 0.0,
        film: 0.0,
        film_index: 1.0,
        film_thickness: 0.0,
        film_least: 0.0,
    };

    /// Ten numbers of 12 bits in five words.
    fn pack(&self) -> [u32; MATERIAL_TEXTURES] {
        let number = |x: f32| x.round().clamp(0.0, LAYER_STEPS as f32) as u32;
        let share = |x: f32| number(x * LAYER_STEPS as f32);
        let [red, green, blue] = self.sheen.map(share);
        let turns = number(((self.rotation - self.rotation.floor()) * 4096.0).round() % 4096.0);
        let index = number((self.film_index - 1.0) * LAYER_INDEX_STEPS as f32);
        [
            [red, green],
            [blue, share(self.sheen_roughness)],
            [share(self.anisotropy), turns],
            [share(self.film), index],
            [number(self.film_thickness), number(self.film_least)],
        ]
        .map(|[low, high]| low | high << LAYER_BITS)
    }

    fn unpack(words: [u32; MATERIAL_TEXTURES]) -> Self {
        let halves = words.map(|word| [word & LAYER_STEPS, word >> LAYER_BITS].map(|x| x as f32));
        let share = |x: f32| x * (1.0 / LAYER_STEPS as f32);
        let [[red, green], [blue, roughness], [anisotropy, turns], [film, index], [thickness, least]] = halves;
        Self {
            sheen: [red, green, blue].map(share),
            sheen_roughness: share(roughness),
            anisotropy: share(anisotropy),
            rotation: turns * (1.0 / (LAYER_STEPS + 1) as f32),
            film: share(film),
            film_index: 1.0 + index * (1.0 / LAYER_INDEX_STEPS as f32),
            film_thickness: thickness,
            film_least: least,
        }
    }
}

impl Material {
    /// Its layers, and [`Layers::NONE`] without [`MATERIAL_LAYERS`].
    pub fn layers(&self) -> Layers {
        if self.flags & MATERIAL_LAYERS == 0 {
            return Layers::NONE;
        }
        Layers::unpack(std::array::from_fn(|i| self.uv_from_set[2 * i + 1][3] as u32))
    }

    /// Gives it layers, each number rounded to what is stored, and the flags that go with them. Without any of
    /// sheen, anisotropy and film it has none.
    pub fn set_layers(&mut self, layers: &Layers) {
        let words = layers.pack();
        let has =
            [words[0] != 0 || words[1] & LAYER_STEPS != 0, words[2] & LAYER_STEPS != 0, words[3] & LAYER_STEPS != 0];
        self.flags &= !(MATERIAL_LAYERS | MATERIAL_ANISOTROPIC);
        if has.contains(&true) {
            self.flags |= MATERIAL_LAYERS;
        }
        if has[1] {
            self.flags |= MATERIAL_ANISOTROPIC;
        }
        for (i, word) in words.into_iter().enumerate() {
            self.uv_from_set[2 * i + 1][3] = if has.contains(&true) { word as f32 } else { 0.0 };
        }
    }

    /// Whether the words of its layers are whole numbers of 24 bits that say what the flags say.
    pub(crate) fn has_sound_layers(&self) -> bool {
        let words: [f32; MATERIAL_TEXTURES] = std::array::from_fn(|i| self.uv_from_set[2 * i + 1][3]);
        let most = (1u32 << (2 * LAYER_BITS)) as f32;
        let mut again = *self;
        again.set_layers(&self.layers());
        let kept = MATERIAL_LAYERS | MATERIAL_ANISOTROPIC;
        words.iter().all(|word| *word >= 0.0 && *word < most && word.fract() == 0.0)
            && again.flags & kept == self.flags & kept
            && (self.flags & MATERIAL_LAYERS != 0 || words == [0.0; MATERIAL_TEXTURES])
    }

    /// What follows a material with [`MATERIAL_MORE`]: five textures, with their places and sets of coordinates as
    /// those of any material. They multiply its factors. Of a body that refracts the first has alpha alone: the share
    /// that is transmitted. Of others:
    ///
    /// | place | texture |
    /// | --- | --- |
    /// | base colour | sRGB: what the dielectric part reflects; alpha: its weight (KHR_materials_specular) |
    /// | normal | linear: of the clear coat; without one it has that of the surface before its normal texture |
    /// | metallic-roughness | linear: clear coat, its roughness, share of the film, its thickness |
    /// | occlusion | linear: direction of the anisotropy, 2 rg - 1, and its strength |
    /// | emissive | sRGB: sheen; alpha: its roughness |
    ///
    /// The film is as thick as [`Layers::film_least`] where the texture has 0, and [`Layers::film_thickness`] where it
    /// has 1.
    pub const fn further() -> Self {
        Self { flags: MATERIAL_FURTHER, ..Self::DIFFUSE }
    }

    /// Whether it is [`Self::further`] but for textures and the scale of normals.
    pub(crate) fn is_sound_further(&self) -> bool {
        let mut bare = *self;
        bare.textures_mut().into_iter().for_each(|texture| *texture = NONE);
        let (normal_scale, uv_sets, uv_from_set) = (self.normal_scale, self.uv_sets, self.uv_from_set);
        bare == Self { normal_scale, uv_sets, uv_from_set, ..Self::further() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_are_kept_but_for_their_digits() {
        let layers = Layers {
            sheen: [1.0, 0.5, 0.125],
            sheen_roughness: 0.75,
            anisotropy: 0.25,
            rotation: -0.25,
            film: 1.0,
            film_index: 1.3,
            film_thickness: 400.4,
            film_least: 100.0,
        };
        let mut material = Material::DIFFUSE;
        material.set_layers(&layers);
        assert_eq!(material.flags, MATERIAL_LAYERS | MATERIAL_ANISOTROPIC);
        assert!(material.has_sound_layers() && material.is_glossy() && material.needs_details());
        let found = material.layers();
        let pairs = found.sheen.into_iter().zip(layers.sheen).chain([
            (found.sheen_roughness, layers.sheen_roughness),
            (found.anisotropy, layers.anisotropy),
            (found.rotation, 0.75),
            (found.film, layers.film),
        ]);
        assert!(pairs.clone().all(|(a, b)| (a - b).abs() < 2e-4), "{:?}", pairs.collect::<Vec<_>>());
        assert!((found.film_index - 1.3).abs() < 5e-4 && found.film_thickness == 400.0, "{found:?}");
        // What was rounded stays so.
        let mut again = material;
        again.set_layers(&found);
        assert_eq!(again, material);
    }

    #[test]
    fn nothing_is_kept_of_nothing() {
        let mut material = Material::DIFFUSE;
        material.set_layers(&Layers { sheen_roughness: 0.5, rotation: 0.3, film_thickness: 100.0, ..Layers::NONE });
        assert_eq!((material, material.layers()), (Material::DIFFUSE, Layers::NONE));
        // Words without the flag, a flag without words, and half a word.
        material.uv_from_set[1][3] = 1.0;
        assert!(!material.has_sound_layers());
        assert!(!Material { flags: MATERIAL_LAYERS, ..Material::DIFFUSE }.has_sound_layers());
        material.flags = MATERIAL_LAYERS;
        assert!(material.has_sound_layers());
        for bad in [0.5, -1.0, 16_777_216.0, f32::NAN] {
            material.uv_from_set[1][3] = bad;
            assert!(!material.has_sound_layers(), "{bad}");
        }
    }
}
