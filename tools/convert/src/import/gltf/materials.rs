//! Materials and the textures of their base colours (glTF 2.0, sections 3.8 and 3.9).

use super::document::{Document, Index, Material as Json, TextureTransform, Uint};
use super::file::{File, Problem, item, read};
use super::{label, uri};
use crate::import::error::{ImportError, one_line, show};
use crate::import::warnings::Warnings;
use crate::progress::Progress;
use crate::source::SourceTexture;
use bricks::{MATERIAL_BLEND, MATERIAL_DOUBLE_SIDED, MATERIAL_MASK, MATERIAL_UNLIT, Material, NONE};
use bricks::{WRAP_CLAMP, WRAP_MIRROR, WRAP_REPEAT};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Longest side of an image, in texels: what devices commonly allow.
const MAX_SIDE: u32 = 16384;

/// Most bytes of RGBA texels for a byte of an image file, so that a few bytes cannot demand gigabytes. Deflate reaches
/// 1032:1, and a grey texel of one byte becomes four.
const MAX_COMPRESSION: u64 = 8192;

/// Images of so few bytes of RGBA texels may be compressed at will.
const FREE_TEXEL_BYTES: u64 = 1 << 20;

/// Set of texture coordinates of the base colour texture, and their transformation. `None`: no texture.
pub(super) fn base_color_set(material: &Json) -> Option<(Uint, Option<&TextureTransform>)> {
    let info = material.pbr_metallic_roughness.base_color_texture.as_ref()?;
    let transform = info.extensions.transform.as_ref();
    let set = transform.and_then(|t| t.tex_coord).unwrap_or(info.tex_coord);
    Some((set, transform))
}

/// The material of primitives that name none (glTF 2.0, section 3.9.5).
pub(super) fn default_material() -> Material {
    Material {
        base_color: [1.0; 4],
        emission: [0.0; 3],
        metallic: 1.0,
        roughness: 1.0,
        alpha_cutoff: 0.5,
        flags: 0,
        base_color_texture: NONE,
        _reserved: [0; 4],
    }
}

/// Every material of the file, in order, and the textures of those that `is_used` marks.
pub(super) fn load(
    file: &File,
    is_used: &[bool],
    warnings: &mut Warnings,
    progress: &Progress,
) -> Result<(Vec<Material>, Vec<SourceTexture>), ImportError> {
    let document = &file.document;
    let mut materials = Vec::with_capacity(document.materials.len() + 1);
    // Image and wrap modes of each texture, in order of first use.
    let mut wanted: Vec<(usize, u32)> = Vec::new();
    let mut known = BTreeMap::new();
    for (index, json) in document.materials.iter().enumerate() {
        let place = || label("material", index, json.name.as_deref());
        let mut material = convert(json, warnings, &place);
        if let Some(info) = &json.pbr_metallic_roughness.base_color_texture {
            let source = texture(document, info.index, warnings, &place);
            if let Some(source) = source.map_err(|problem| file.fault(place(), problem))?
                && is_used[index]
            {
                material.base_color_texture = *known.entry(source).or_insert_with(|| {
                    wanted.push(source);
                    wanted.len() as u32 - 1
                });
            }
        }
        materials.push(material);
    }
    let textures = decode(file, wanted, &mut materials, warnings, progress);
    Ok((materials, textures))
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
        base_color_texture: NONE,
        _reserved: [0; 4],
    }
}

/// Image and wrap modes of a texture; `None` when only an extension says where the image is.
fn texture(
    document: &Document,
    index: Index,
    warnings: &mut Warnings,
    place: &dyn Fn() -> String,
) -> Result<Option<(usize, u32)>, Problem> {
    let texture = item(&document.textures, index, "texture")?;
    let mut wrap = [WRAP_REPEAT; 2];
    if let Some(sampler) = texture.sampler {
        let sampler = item(&document.samplers, sampler, "sampler")?;
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
    let Some(source) = texture.source else {
        warnings.add("its texture is in no format that is read; white is used", place);
        return Ok(None);
    };
    item(&document.images, source, "image")?;
    Ok(Some((source.0 as usize, wrap[0] | wrap[1] << 16)))
}

/// Texels of an image: width, height, RGBA8.
type Texels = (u32, u32, Vec<u8>);

/// Decodes the images of the `wanted` textures, each once. Textures whose image fails are dropped and materials renumbered.
fn decode(
    file: &File,
    wanted: Vec<(usize, u32)>,
    materials: &mut [Material],
    warnings: &mut Warnings,
    progress: &Progress,
) -> Vec<SourceTexture> {
    let mut images: Vec<usize> = wanted.iter().map(|(image, _)| *image).collect();
    images.sort_unstable();
    images.dedup();
    if !images.is_empty() {
        progress.phase("textures", images.len() as u64);
    }
    let decoded: Vec<Result<Texels, String>> = images
        .par_iter()
        .map(|&image| {
            let texels = decode_image(file, image);
            progress.advance(1);
            texels
        })
        .collect();
    let name = |image: usize| file.document.images[image].name.as_deref().filter(|name| !name.is_empty());
    let mut texels = BTreeMap::new();
    for (image, result) in images.into_iter().zip(decoded) {
        match result {
            Ok(t) => {
                texels.insert(image, t);
            }
            Err(reason) => warnings.add("the image cannot be used, white takes its place", || {
                format!("{} ({reason})", label("image", image, name(image)))
            }),
        }
    }
    let mut textures = Vec::with_capacity(wanted.len());
    let mut renumbered = vec![NONE; wanted.len()];
    let last_use: BTreeMap<usize, usize> = wanted.iter().enumerate().map(|(i, (image, _))| (*image, i)).collect();
    for (i, (image, wrap)) in wanted.into_iter().enumerate() {
        // Moved at the last use, so that only images with several wrap modes are copied.
        let taken = if last_use.get(&image) == Some(&i) { texels.remove(&image) } else { texels.get(&image).cloned() };
        if let Some((width, height, rgba)) = taken {
            renumbered[i] = textures.len() as u32;
            let name = super::display_name(image, name(image));
            textures.push(SourceTexture { name, width, height, wrap, rgba });
        }
    }
    for material in materials {
        if let Some(&texture) = renumbered.get(material.base_color_texture as usize) {
            material.base_color_texture = texture;
        }
    }
    textures
}

/// Reads and decodes an image; the error says why it cannot be used.
fn decode_image(file: &File, index: usize) -> Result<Texels, String> {
    let json = &file.document.images[index];
    let owned;
    let bytes: &[u8] = match (&json.uri, json.buffer_view) {
        (Some(text), _) => {
            owned = match uri::resolve(text)? {
                uri::Target::Data(data) => data,
                uri::Target::File(below) => {
                    read(&file.folder.join(&below)).map_err(|reason| format!("{}: {reason}", show(&below)))?
                }
            };
            &owned
        }
        (None, Some(view)) => file.view(view).map_err(|problem| problem.what)?.0,
        (None, None) => return Err("it has neither a URI nor a buffer view".into()),
    };
    let format = match image::guess_format(bytes) {
        Ok(format @ (image::ImageFormat::Png | image::ImageFormat::Jpeg)) => format,
        _ => return Err("it is neither PNG nor JPEG".into()),
    };
    let reader = || image::ImageReader::with_format(std::io::Cursor::new(bytes), format);
    let (width, height) = reader().into_dimensions().map_err(|e| one_line(&e.to_string()))?;
    let texel_bytes = 4 * u64::from(width) * u64::from(height);
    if texel_bytes > FREE_TEXEL_BYTES && texel_bytes / MAX_COMPRESSION > bytes.len() as u64 {
        return Err(format!("it claims {width}x{height} texels, more than its {} bytes can hold", bytes.len()));
    }
    let mut reader = reader();
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(MAX_SIDE);
    limits.max_image_height = Some(MAX_SIDE);
    limits.max_alloc = Some(4 * 4 * u64::from(MAX_SIDE) * u64::from(MAX_SIDE));
    reader.limits(limits);
    let image = reader.decode().map_err(|e| one_line(&e.to_string()))?.into_rgba8();
    Ok((image.width(), image.height(), image.into_raw()))
}
