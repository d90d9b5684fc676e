//! Materials and the textures of their base colours (glTF 2.0, sections 3.8 and 3.9).

use super::document::{Document, Index, Lenient, Material as Json, TextureTransform, Uint};
use super::file::{File, Problem, item};
use super::label;
use crate::import::warnings::Warnings;
use bricks::{MATERIAL_BLEND, MATERIAL_DOUBLE_SIDED, MATERIAL_MASK, MATERIAL_UNLIT, Material};
use bricks::{WRAP_CLAMP, WRAP_MIRROR, WRAP_REPEAT};
use std::collections::BTreeMap;

/// An image with the way it is repeated.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Texture {
    /// The image and, in order, those to fall back to when it cannot be used; in range.
    pub images: Vec<usize>,
    /// `bricks::WRAP_*` of s in the low half, of t in the high half.
    pub wrap: u32,
}

/// Set of texture coordinates of the base colour texture, and their transformation. `None`: no texture.
pub(super) fn base_color_set(material: &Json) -> Option<(Uint, Option<&TextureTransform>)> {
    let info = material.pbr_metallic_roughness.base_color_texture.as_ref()?;
    let transform = info.extensions.transform.as_ref();
    let set = transform.and_then(|t| t.tex_coord).unwrap_or(info.tex_coord);
    Some((set, transform))
}

/// The material of primitives that name none (glTF 2.0, section 3.9.5).
pub(super) fn default_material() -> Material {
    Material { metallic: 1.0, specular: [0.04; 3], specular_weight: 1.0, ..Material::DIFFUSE }
}

/// Every material of the file, in order, and the textures of those that `is_used` marks, in order of first use.
pub(super) fn load(file: &File, is_used: &[bool], warnings: &mut Warnings) -> (Vec<Material>, Vec<Texture>) {
    let document = &file.document;
    let mut materials = Vec::with_capacity(document.materials.len() + 1);
    let mut textures = Vec::new();
    let mut known = BTreeMap::new();
    for (index, Lenient(json)) in document.materials.iter().enumerate() {
        let json = match json {
            Ok(json) => json,
            Err(problem) => {
                warnings.add("the material is malformed, white takes its place", || {
                    format!("material {index} ({problem})")
                });
                materials.push(default_material());
                continue;
            }
        };
        let place = || label("material", index, json.name.as_deref());
        let mut material = convert(json, warnings, &place);
        if let Some(info) = &json.pbr_metallic_roughness.base_color_texture {
            match texture(document, info.index, warnings, &place) {
                Ok(texture) if is_used[index] => {
                    material.base_color_texture = *known.entry(texture).or_insert_with_key(|texture| {
                        textures.push(texture.clone());
                        textures.len() as u32 - 1
                    });
                }
                Ok(_) => {}
                Err(problem) => warnings.add("its texture cannot be used, white takes its place", || {
                    format!("{} ({})", place(), problem.what)
                }),
            }
        }
        materials.push(material);
    }
    (materials, textures)
}

/// The factors and flags of a material.
fn convert(json: &Json, warnings: &mut Warnings, place: &dyn Fn() -> String) -> Material {
    let pbr = &json.pbr_metallic_roughness;
    let unit = |x: f64| x.clamp(0.0, 1.0) as f32;
    let mut flags = match json.alpha_mode.as_deref() {
        None | Some("OPAQUE") => 0,
        Some("MASK") => MATERIAL_MASK,
        Some("BLEND") => MATERIAL_BLEND,
        Some(_) => {
            warnings.add("its alpha mode is not one of glTF; opaque is used", place);
            0
        }
    };
    if json.double_sided {
        flags |= MATERIAL_DOUBLE_SIDED;
    }
    if json.extensions.unlit.is_some() {
        flags |= MATERIAL_UNLIT;
    }
    let strength = json.extensions.emissive_strength.as_ref().and_then(|e| e.emissive_strength).unwrap_or(1.0);
    let mut emission = json.emissive_factor.map(|c| (c * strength).clamp(0.0, f32::MAX as f64) as f32);
    if json.emissive_texture.is_some() && emission != [0.0; 3] {
        // The factor alone would make all of the surface glow.
        warnings.add("emissive textures are not read; it does not emit", place);
        emission = [0.0; 3];
    }
    Material {
        base_color: pbr.base_color_factor.unwrap_or([1.0; 4]).map(unit),
        emission,
        metallic: unit(pbr.metallic_factor.unwrap_or(1.0)),
        roughness: unit(pbr.roughness_factor.unwrap_or(1.0)),
        alpha_cutoff: json.alpha_cutoff.unwrap_or(0.5).clamp(0.0, f32::MAX as f64) as f32,
        flags,
        ..default_material()
    }
}

/// Images and wrap modes of a texture.
fn texture(
    document: &Document,
    index: Index,
    warnings: &mut Warnings,
    place: &dyn Fn() -> String,
) -> Result<Texture, Problem> {
    let malformed = |problem: &String| Problem::new(format!("texture {index}: {problem}"));
    let texture = item(&document.textures, index, "texture")?.0.as_ref().map_err(malformed)?;
    let mut wrap = [WRAP_REPEAT; 2];
    if let Some(sampler) = texture.sampler {
        let sampler = item(&document.samplers, sampler, "sampler")?.0.as_ref().map_err(malformed)?;
        for (wrap, code) in wrap.iter_mut().zip([sampler.wrap_s, sampler.wrap_t]) {
            *wrap = match code.map(|code| code.0) {
                None | Some(10497) => WRAP_REPEAT,
                Some(33071) => WRAP_CLAMP,
                Some(33648) => WRAP_MIRROR,
                Some(_) => {
                    warnings.add("the wrap mode of its texture is not one of glTF; it is repeated", place);
                    WRAP_REPEAT
                }
            };
        }
    }
    // What extensions name comes first: the plain image is for readers that do not know them.
    let extensions = [&texture.extensions.basisu, &texture.extensions.webp];
    let sources = extensions.into_iter().flatten().map(|extension| extension.source).chain([texture.source]);
    let sources: Vec<_> = sources.flatten().collect();
    if sources.is_empty() {
        return Err(Problem::new(format!("texture {index} names no image in a format that is read")));
    }
    let found: Vec<_> = sources.iter().map(|&image| item(&document.images, image, "image").map(|_| image)).collect();
    let images: Vec<usize> = found.iter().flatten().map(|image| image.0 as usize).collect();
    match found.into_iter().find_map(Result::err) {
        Some(problem) if images.is_empty() => Err(problem),
        _ => Ok(Texture { images, wrap: wrap[0] | wrap[1] << 16 }),
    }
}
