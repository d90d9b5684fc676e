//! Materials and their textures (glTF 2.0, sections 3.8 and 3.9, and the extensions KHR_materials_anisotropy,
//! _clearcoat, _emissive_strength, _ior, _iridescence, _pbrSpecularGlossiness, _sheen, _specular, _transmission,
//! _unlit, _volume and KHR_texture_transform).
//!
//! Filters of samplers are not kept: textures are averaged over what a pixel covers, whatever the sampler asks for.

use super::document::{Document, Lenient, Material as Json, TextureInfo, TextureTransform};
use super::file::{File, Problem, item};
use super::further::{self, Pack};
use super::names::label;
use super::passing::{Changed, Passing};
use crate::import::warnings::Warnings;
use bricks::{
    BASE_COLOR, Layers, MATERIAL_BLEND, MATERIAL_DOUBLE_SIDED, MATERIAL_MASK, MATERIAL_MORE, MATERIAL_REFRACTS,
    MATERIAL_TEXTURES, MATERIAL_UNLIT, Material, NONE, NORMAL,
};
use bricks::{WRAP_CLAMP, WRAP_MIRROR, WRAP_REPEAT};
use gltf::json::material::AlphaMode;
use gltf::json::texture::{MagFilter, WrappingMode};
use gltf::json::validation::Checked::{Invalid, Valid};
use gltf::json::{self, Index};
use std::collections::BTreeMap;

/// Sets of texture coordinates that are read.
const SETS: u32 = 2;

/// Greatest index of refraction of a body; what none has.
pub(super) const MOST_INDEX: f64 = 100.0;

/// An image and, in order, those to fall back to when it cannot be used; in range.
pub(super) type Images = Vec<usize>;

/// What a texture shows.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Picture {
    /// An image.
    Whole(Images),
    /// Of each channel an image and the channel of that; white where there is none. At least one image is there.
    Packed {
        /// Red, green, blue, alpha.
        channels: [Option<(Images, usize)>; 4],
        /// A transmission texture that changes them.
        passing: Option<(Images, Passing, Changed)>,
    },
}

impl Picture {
    /// All images that it is made of.
    pub fn images(&self) -> impl Iterator<Item = &Images> {
        let (whole, packed) = match self {
            Self::Whole(images) => (Some(images), None),
            Self::Packed { channels, passing } => (None, Some((channels, passing))),
        };
        let packed = packed.into_iter().flat_map(|(channels, passing)| {
            let channels = channels.iter().flatten().map(|(images, _)| images);
            channels.chain(passing.iter().map(|(images, ..)| images))
        });
        whole.into_iter().chain(packed)
    }
}

/// A picture with the way it is repeated.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Texture {
    pub picture: Picture,
    /// `bricks::WRAP_*` of s in the low half, of t in the high half.
    pub wrap: u32,
}

impl Texture {
    /// The image that names it.
    pub fn image(&self) -> usize {
        self.picture.images().flatten().next().copied().unwrap_or_default()
    }
}

/// Materials and the textures of those in use.
#[derive(Debug, Default)]
pub(super) struct Materials {
    /// Every material of the file in order, further textures behind those that have them.
    pub records: Vec<Material>,
    /// Where each material of the file is among them.
    pub places: Vec<u32>,
    /// In order of first use.
    pub textures: Vec<Texture>,
    known: BTreeMap<Texture, u32>,
}

/// The coordinates that the textures of a material are looked up at.
#[derive(Clone, Debug, Default)]
pub(super) struct Coordinates {
    /// Whether each set is used.
    pub sets: [bool; SETS as usize],
    /// Set and rows of the normal texture, or of that of a coat, or of that of an anisotropy; without one, but with
    /// anisotropy, those of the first set as they are.
    pub normal: Option<(usize, [[f32; 4]; 2])>,
    /// Whether its reflection has a direction along the surface.
    pub is_anisotropic: bool,
}

impl Coordinates {
    /// Of a material.
    pub fn of(material: &Json) -> Self {
        let mut coordinates = Self::default();
        for (place, info) in infos(material).into_iter().enumerate() {
            let Some((info, set)) = info.and_then(|info| Some((info, set(info)?))) else { continue };
            coordinates.sets[set] = true;
            if place == NORMAL {
                coordinates.normal = Some((set, rows(info).unwrap_or(SAME)));
            }
        }
        further::infos(material).filter_map(set).for_each(|set| coordinates.sets[set] = true);
        if coordinates.normal.is_none() {
            let directed = further::directed(material).and_then(|info| Some((info, set(info)?)));
            coordinates.normal = directed.map(|(info, set)| (set, rows(info).unwrap_or(SAME)));
        }
        let anisotropy = material.more.extensions.anisotropy.as_ref();
        coordinates.is_anisotropic =
            anisotropy.and_then(|extension| extension.anisotropy_strength).is_some_and(|strength| strength > 0.0);
        if coordinates.is_anisotropic {
            coordinates.normal = coordinates.normal.or(Some((0, SAME)));
        }
        coordinates
    }
}

/// Rows that leave coordinates as they are.
const SAME: [[f32; 4]; 2] = [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 0.0]];

/// The textures of a material in their places.
fn infos(material: &Json) -> [Option<&TextureInfo>; MATERIAL_TEXTURES] {
    let more = &material.more;
    let pbr = &more.pbr_metallic_roughness;
    let (color, gloss) = match &more.extensions.specular_glossiness {
        Some(extension) => (&extension.diffuse_texture, &None),
        None => (&pbr.base_color_texture, &pbr.metallic_roughness_texture),
    };
    [color, &more.normal_texture, gloss, &more.occlusion_texture, &more.emissive_texture].map(Option::as_ref)
}

/// The set of coordinates of a texture; `None`: it is not read.
fn set(info: &TextureInfo) -> Option<usize> {
    let transform = info.extensions.transform.as_ref();
    let set = transform.and_then(|t| t.tex_coord).unwrap_or(info.tex_coord);
    (set < SETS).then_some(set as usize)
}

/// The rows of [`Material::uv_from_set`] of a texture (KHR_texture_transform: translation * rotation * scale; a
/// positive angle turns counter-clockwise in an image whose v points down). `None`: they are beyond the range of
/// numbers.
fn rows(info: &TextureInfo) -> Option<[[f32; 4]; 2]> {
    let Some(TextureTransform { offset, rotation, scale, .. }) = &info.extensions.transform else { return Some(SAME) };
    let (sin, cos) = rotation.unwrap_or(0.0).sin_cos();
    let ([x, y], [sx, sy]) = (offset.unwrap_or([0.0; 2]), scale.unwrap_or([1.0; 2]));
    let rows = [[cos * sx, sin * sy, x, (sx * sy).abs()], [-sin * sx, cos * sy, y, 0.0]];
    let rows = rows.map(|row| row.map(|value| value as f32));
    rows.as_flattened().iter().all(|value| value.is_finite()).then_some(rows)
}

/// The material of primitives that name none (glTF 2.0, section 3.9.5).
pub(super) fn default_material() -> Material {
    Material { metallic: 1.0, specular: [DIELECTRIC as f32; 3], specular_weight: 1.0, ..Material::DIFFUSE }
}

/// What a dielectric of index 1.5 reflects along the normal.
const DIELECTRIC: f64 = 0.04;

/// Every material of the file, and the textures of those that `is_used` marks.
pub(super) fn load(file: &File, is_used: &[bool], warnings: &mut Warnings) -> Materials {
    let document = &file.document;
    let mut materials = Materials::default();
    for (index, Lenient(json)) in document.materials.iter().enumerate() {
        let json = match json {
            Ok(json) => json,
            Err(problem) => {
                warnings.add("malformed material; white used instead", || format!("material {index} ({problem})"));
                materials.push(default_material());
                continue;
            }
        };
        let is_used = is_used[index];
        let place = || label("material", index, json.more.name.as_deref());
        let mut material = convert(json, warnings, &place);
        let passing = Passing::of(json, &material, warnings, &place);
        // Alpha of opaque things and of bodies says nothing.
        let has_alpha = material.flags & MATERIAL_BLEND != 0 && passing.is_none_or(|passing| !passing.is_body);
        let share = passing.and_then(|_| passing_texture(document, json, warnings, &place));
        if let Some(passing) = &passing {
            passing.apply(json, &mut material, share.is_some(), warnings, &place);
        }
        for (number, info) in infos(json).into_iter().enumerate() {
            let found = match passing {
                Some(passing) if number == BASE_COLOR && (share.is_some() || !has_alpha) => {
                    let alpha = has_alpha.then_some(3);
                    let pack = [Some(0), Some(1), Some(2), alpha].map(|channel| Some((info?, channel?)));
                    let share = share.map(|share| (share, passing, Changed::Base));
                    packed(document, pack, share, warnings, &place)
                }
                _ => info.and_then(|info| {
                    let (images, wrap) = images(document, info.index, warnings, &place)?;
                    Some((Texture { picture: Picture::Whole(images), wrap }, info))
                }),
            };
            if let Some((texture, info)) = found.filter(|_| is_used) {
                materials.put((&mut material, number), texture, info, warnings, &place);
            }
        }
        let layers = layers(json, &material, warnings, &place);
        material.set_layers(&layers);
        let mut more = Material::further();
        if let Some(scale) = further::normal_scale(json) {
            more.normal_scale = scale;
        }
        let packs = further::packs(json, &material, &layers, share);
        for (number, pack) in packs.into_iter().enumerate() {
            let passing = passing.filter(|passing| number == BASE_COLOR && !passing.is_body);
            let share = share.zip(passing).map(|(share, passing)| (share, passing, Changed::Specular));
            if let Some((texture, info)) = packed(document, pack, share, warnings, &place).filter(|_| is_used) {
                materials.put((&mut more, number), texture, info, warnings, &place);
            }
        }
        let has_more = more.textures() != [NONE; MATERIAL_TEXTURES] || further::coat_differs(json, &material);
        if has_more && is_used {
            material.flags |= MATERIAL_MORE;
        }
        materials.push(material);
        if has_more && is_used {
            materials.records.push(more);
        }
    }
    materials
}

impl Materials {
    /// Appends a material of the file.
    fn push(&mut self, material: Material) {
        self.places.push(self.records.len() as u32);
        self.records.push(material);
    }

    /// Gives a material a texture, looked up as `info` says.
    fn put(
        &mut self,
        (material, number): (&mut Material, usize),
        texture: Texture,
        info: &TextureInfo,
        warnings: &mut Warnings,
        place: &dyn Fn() -> String,
    ) {
        let Some(set) = set(info) else {
            warnings.add("uses a third set of texture coordinates or a later one; texture ignored", place);
            return;
        };
        *material.textures_mut()[number] = *self.known.entry(texture).or_insert_with_key(|texture| {
            self.textures.push(texture.clone());
            self.textures.len() as u32 - 1
        });
        material.uv_sets |= (set as u32) << number;
        match rows(info) {
            Some(rows) => material.uv_from_set[2 * number..2 * number + 2].copy_from_slice(&rows),
            None => warnings.add("texture transform out of range; ignored", place),
        }
    }
}

/// A pack of channels that agree in their coordinates with the first, which is the transmission texture where one
/// changes them; those that do not are left out. `None`: nothing of it can be used.
fn packed<'a>(
    document: &Document,
    pack: Pack<'a>,
    share: Option<(&'a TextureInfo, Passing, Changed)>,
    warnings: &mut Warnings,
    place: &dyn Fn() -> String,
) -> Option<(Texture, &'a TextureInfo)> {
    let mut channels = [const { None }; 4];
    let mut first = None;
    let mut passing = None;
    if let Some((info, of, changed)) = share {
        let (images, wrap) = images(document, info.index, warnings, place)?;
        first = Some((info, looks(info, wrap)));
        passing = Some((images, of, changed));
    }
    for (channel, given) in channels.iter_mut().zip(pack) {
        let Some((info, from)) = given else { continue };
        let Some((images, wrap)) = images(document, info.index, warnings, place) else { continue };
        let (_, expected) = first.get_or_insert((info, looks(info, wrap)));
        if *expected == looks(info, wrap) {
            *channel = Some((images, from));
        } else {
            warnings.add("textures of one layer take different coordinates; the first used", place);
        }
    }
    let (info, (_, _, wrap)) = first?;
    Some((Texture { picture: Picture::Packed { channels, passing }, wrap }, info))
}

/// Where a texture is looked up.
type Looks = (Option<usize>, Option<[[f32; 4]; 2]>, u32);

fn looks(info: &TextureInfo, wrap: u32) -> Looks {
    (set(info), rows(info), wrap)
}

/// The transmission texture, if it can be used and is looked up where the base colour is: rays pass by the alpha of
/// both together.
fn passing_texture<'a>(
    document: &Document,
    json: &'a Json,
    warnings: &mut Warnings,
    place: &dyn Fn() -> String,
) -> Option<&'a TextureInfo> {
    let info = json.more.extensions.transmission.as_ref()?.transmission_texture.as_ref()?;
    let (_, wrap) = images(document, info.index, warnings, place)?;
    let [base, ..] = infos(json);
    let base = base.and_then(|base| Some((base, images(document, base.index, warnings, place)?.1)));
    if base.is_some_and(|(base, of_base)| looks(base, of_base) != looks(info, wrap)) || set(info).is_none() {
        warnings.add("transmission texture not looked up where the base colour is; factor used", place);
        return None;
    }
    Some(info)
}

/// The factors and flags of a material.
fn convert(json: &Json, warnings: &mut Warnings, place: &dyn Fn() -> String) -> Material {
    let pbr = &json.pbr_metallic_roughness;
    let extensions = &json.more.extensions;
    let mut flags = match json.alpha_mode {
        Valid(AlphaMode::Opaque) => 0,
        Valid(AlphaMode::Mask) => MATERIAL_MASK,
        Valid(AlphaMode::Blend) => MATERIAL_BLEND,
        Invalid => {
            warnings.add("unknown alpha mode; treated as opaque", place);
            0
        }
    };
    if json.double_sided {
        flags |= MATERIAL_DOUBLE_SIDED;
    }
    if extensions.unlit.is_some() {
        flags |= MATERIAL_UNLIT;
    }
    let strength = extensions.emissive_strength.as_ref().and_then(|e| e.emissive_strength).unwrap_or(1.0);
    let mut material = Material {
        base_color: pbr.base_color_factor.0.map(|c| unit(c.into())),
        emission: json.more.emissive_factor.map(|c| (c * strength).clamp(0.0, f32::MAX as f64) as f32),
        metallic: unit(pbr.metallic_factor.0.into()),
        roughness: unit(pbr.roughness_factor.0.into()),
        alpha_cutoff: json.alpha_cutoff.unwrap_or_default().0.clamp(0.0, f32::MAX),
        flags,
        ..default_material()
    };
    if let Some(texture) = &json.normal_texture {
        material.normal_scale = texture.scale.clamp(f32::MIN, f32::MAX);
    }
    if let Some(texture) = &json.occlusion_texture {
        material.occlusion_strength = unit(texture.strength.0.into());
    }
    reflect(json, &mut material, warnings, place);
    coat(json, &mut material);
    material
}

pub(super) fn unit(x: f64) -> f32 {
    x.clamp(0.0, 1.0) as f32
}

/// What the dielectric part reflects (KHR_materials_ior, _specular, _pbrSpecularGlossiness).
fn reflect(json: &Json, material: &mut Material, warnings: &mut Warnings, place: &dyn Fn() -> String) {
    let extensions = &json.more.extensions;
    if let Some(extension) = &extensions.specular_glossiness {
        // Its specular colour stands for metals too.
        material.base_color = extension.diffuse_factor.unwrap_or([1.0; 4]).map(unit);
        material.metallic = 0.0;
        material.roughness = unit(1.0 - extension.glossiness_factor.unwrap_or(1.0));
        material.specular = extension.specular_factor.unwrap_or([1.0; 3]).map(unit);
        material.specular_weight = if material.specular == [0.0; 3] { 0.0 } else { 1.0 };
        if extension.specular_glossiness_texture.is_some() {
            warnings.add("specular-glossiness textures ignored; factors used", place);
        }
        return;
    }
    let mut along_normal = DIELECTRIC;
    if let Some(index) = extensions.ior.as_ref().and_then(|extension| extension.ior) {
        // An index of 0 stands for infinity.
        along_normal = if index > 0.0 { ((index - 1.0) / (index + 1.0)).powi(2) } else { 1.0 };
        if index != 0.0 && index < 1.0 {
            warnings.add("index of refraction below 1", place);
        }
    }
    let (mut color, mut weight) = ([1.0; 3], 1.0);
    if let Some(extension) = &extensions.specular {
        color = extension.specular_color_factor.unwrap_or([1.0; 3]);
        weight = extension.specular_factor.unwrap_or(1.0).clamp(0.0, 1.0);
    }
    material.specular = color.map(|c| unit((along_normal * c).clamp(0.0, 1.0) * weight));
    material.specular_weight = unit(weight);
}

/// KHR_materials_clearcoat.
fn coat(json: &Json, material: &mut Material) {
    let Some(extension) = &json.more.extensions.clearcoat else { return };
    material.clearcoat = unit(extension.clearcoat_factor.unwrap_or(0.0));
    material.clearcoat_roughness = unit(extension.clearcoat_roughness_factor.unwrap_or(0.0));
}

/// KHR_materials_sheen, _anisotropy and _iridescence.
fn layers(json: &Json, material: &Material, warnings: &mut Warnings, place: &dyn Fn() -> String) -> Layers {
    let extensions = &json.more.extensions;
    let mut layers = Layers::NONE;
    if let Some(sheen) = &extensions.sheen {
        layers.sheen = sheen.sheen_color_factor.unwrap_or([0.0; 3]).map(unit);
        layers.sheen_roughness = unit(sheen.sheen_roughness_factor.unwrap_or(0.0));
    }
    if let Some(anisotropy) = &extensions.anisotropy {
        layers.anisotropy = unit(anisotropy.anisotropy_strength.unwrap_or(0.0));
        let turns = anisotropy.anisotropy_rotation.unwrap_or(0.0) / std::f64::consts::TAU;
        layers.rotation = if turns.is_finite() { (turns - turns.floor()) as f32 } else { 0.0 };
    }
    if let Some(film) = extensions.iridescence.as_ref().filter(|film| film.iridescence_factor.is_some_and(|f| f > 0.0))
    {
        let passes = material.transmission > 0.0 && material.flags & MATERIAL_REFRACTS == 0;
        if passes {
            // Their specular reflection is that of the rays that do not pass, and no index of refraction.
            warnings.add("iridescence ignored of thin walls that let light through", place);
            return layers;
        }
        layers.film = unit(film.iridescence_factor.unwrap_or(0.0));
        layers.film_index = film.iridescence_ior.unwrap_or(1.3).clamp(1.0, MOST_INDEX) as f32;
        let nanometers = |x: Option<f64>, default: f64| x.unwrap_or(default).clamp(0.0, 1e6) as f32;
        layers.film_thickness = nanometers(film.iridescence_thickness_maximum, 400.0);
        if film.iridescence_thickness_texture.is_some() {
            layers.film_least = nanometers(film.iridescence_thickness_minimum, 100.0);
        }
    }
    layers
}

/// Images and wrap modes of a texture. `None`: it cannot be used, which is warned of.
fn images(
    document: &Document,
    index: Index<json::Texture>,
    warnings: &mut Warnings,
    place: &dyn Fn() -> String,
) -> Option<(Images, u32)> {
    match texture(document, index, warnings, place) {
        Ok(found) => Some(found),
        Err(problem) => {
            warnings.add("unusable texture; white used instead", || format!("{} ({})", place(), problem.what));
            None
        }
    }
}

fn texture(
    document: &Document,
    index: Index<json::Texture>,
    warnings: &mut Warnings,
    place: &dyn Fn() -> String,
) -> Result<(Images, u32), Problem> {
    let malformed = |problem: &String| Problem::new(format!("texture {index}: {problem}"));
    let texture = item(&document.textures, index, "texture")?.0.as_ref().map_err(malformed)?;
    let mut wrap = [WRAP_REPEAT; 2];
    if let Some(sampler) = texture.sampler {
        let sampler = item(&document.samplers, sampler, "sampler")?.0.as_ref().map_err(malformed)?;
        for (wrap, mode) in wrap.iter_mut().zip([sampler.wrap_s, sampler.wrap_t]) {
            *wrap = match mode {
                Valid(WrappingMode::Repeat) => WRAP_REPEAT,
                Valid(WrappingMode::ClampToEdge) => WRAP_CLAMP,
                Valid(WrappingMode::MirroredRepeat) => WRAP_MIRROR,
                Invalid => {
                    warnings.add("unknown texture wrap mode; repeat used", place);
                    WRAP_REPEAT
                }
            };
        }
        if sampler.mag_filter == Some(Valid(MagFilter::Nearest)) {
            warnings.add("nearest filtering ignored; textures are always interpolated", place);
        }
    }
    // What extensions name comes first: the plain image is for readers that do not know them.
    let extensions = &texture.more.extensions;
    let extensions = [&extensions.basisu, &extensions.webp].into_iter().flatten();
    // The crate takes the last index for an absent image.
    let plain = Some(texture.source).filter(|source| source.value() != u32::MAX as usize);
    let sources: Vec<_> = extensions.filter_map(|extension| extension.source).chain(plain).collect();
    if sources.is_empty() {
        return Err(Problem::new(format!("texture {index}: no image in a supported format")));
    }
    let found: Vec<_> = sources.iter().map(|&image| item(&document.images, image, "image").map(|_| image)).collect();
    let images: Images = found.iter().flatten().map(|image| image.value()).collect();
    match found.into_iter().find_map(Result::err) {
        Some(problem) if images.is_empty() => Err(problem),
        _ => Ok((images, wrap[0] | wrap[1] << 16)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texture_transform_of_the_specification() {
        // The specification's matrix for rotation: [cos sin; -sin cos], offset last.
        let info: TextureInfo =
            serde_json::from_value(serde_json::json!({"index": 0, "extensions": {"KHR_texture_transform": {
            "offset": [0.5, 0.25], "rotation": std::f64::consts::FRAC_PI_2, "scale": [2.0, -3.0], "texCoord": 1}}}))
            .unwrap();
        let rows = rows(&info).unwrap();
        let [u, v] = rows.map(|[a, b, c, _]| a * 0.25 + b * 0.5 + c);
        assert!((u - (-1.5 + 0.5)).abs() < 1e-6 && (v - (-0.5 + 0.25)).abs() < 1e-6, "{u} {v}");
        assert_eq!((rows[0][3], rows[1][3], set(&info)), (6.0, 0.0, Some(1)));
    }
}
