//! Further textures of materials (KHR_materials_specular, _clearcoat, _iridescence, _anisotropy and _sheen), packed as
//! [`bricks::Material::further`] says. Textures of one pack share their coordinates.

use super::document::{Material as Json, TextureInfo};
use bricks::{
    BASE_COLOR, EMISSIVE, Layers, MATERIAL_REFRACTS, MATERIAL_TEXTURES, METALLIC_ROUGHNESS, Material, NORMAL, OCCLUSION,
};

/// A texture of a material, and the channel of it that becomes each of a pack; `None`: white.
pub(super) type Pack<'a> = [Option<(&'a TextureInfo, usize)>; 4];

/// The packs of a material, by their places; those of what it has not are empty. `share`: the texture of what passes.
pub(super) fn packs<'a>(
    json: &'a Json,
    material: &Material,
    layers: &Layers,
    share: Option<&'a TextureInfo>,
) -> [Pack<'a>; MATERIAL_TEXTURES] {
    let extensions = &json.more.extensions;
    let mut packs = [[None; 4]; MATERIAL_TEXTURES];
    let is_body = material.flags & MATERIAL_REFRACTS != 0;
    if is_body {
        packs[BASE_COLOR][3] = share.map(|info| (info, 0));
    }
    let mut put = |place: usize, info: &'a Option<TextureInfo>, channels: &[(usize, usize)]| {
        let Some(info) = info else { return };
        channels.iter().for_each(|&(from, to)| packs[place][to] = Some((info, from)));
    };
    let rgb = [(0, 0), (1, 1), (2, 2)];
    if let Some(specular) = &extensions.specular
        && extensions.specular_glossiness.is_none()
        && !is_body
        && material.specular_weight > 0.0
    {
        put(BASE_COLOR, &specular.specular_color_texture, &rgb);
        put(BASE_COLOR, &specular.specular_texture, &[(3, 3)]);
    }
    if let Some(coat) = &extensions.clearcoat
        && material.clearcoat > 0.0
    {
        put(NORMAL, &coat.clearcoat_normal_texture, &rgb);
        put(METALLIC_ROUGHNESS, &coat.clearcoat_texture, &[(0, 0)]);
        put(METALLIC_ROUGHNESS, &coat.clearcoat_roughness_texture, &[(1, 1)]);
    }
    if let Some(film) = &extensions.iridescence
        && layers.film > 0.0
    {
        put(METALLIC_ROUGHNESS, &film.iridescence_texture, &[(0, 2)]);
        put(METALLIC_ROUGHNESS, &film.iridescence_thickness_texture, &[(1, 3)]);
    }
    if let Some(anisotropy) = &extensions.anisotropy
        && layers.anisotropy > 0.0
    {
        put(OCCLUSION, &anisotropy.anisotropy_texture, &rgb);
    }
    if let Some(sheen) = &extensions.sheen
        && layers.sheen != [0.0; 3]
    {
        put(EMISSIVE, &sheen.sheen_color_texture, &rgb);
        put(EMISSIVE, &sheen.sheen_roughness_texture, &[(3, 3)]);
    }
    packs
}

/// All textures that packs may have, whether they are used or not.
pub(super) fn infos(json: &Json) -> impl Iterator<Item = &TextureInfo> {
    let extensions = &json.more.extensions;
    let specular = extensions.specular.iter().flat_map(|x| [&x.specular_texture, &x.specular_color_texture]);
    let coat = extensions
        .clearcoat
        .iter()
        .flat_map(|x| [&x.clearcoat_texture, &x.clearcoat_roughness_texture, &x.clearcoat_normal_texture]);
    let film = extensions.iridescence.iter();
    let film = film.flat_map(|x| [&x.iridescence_texture, &x.iridescence_thickness_texture]);
    let anisotropy = extensions.anisotropy.iter().map(|x| &x.anisotropy_texture);
    let sheen = extensions.sheen.iter().flat_map(|x| [&x.sheen_color_texture, &x.sheen_roughness_texture]);
    let passing = extensions.transmission.iter().map(|x| &x.transmission_texture);
    specular.chain(coat).chain(film).chain(anisotropy).chain(sheen).chain(passing).flatten()
}

/// The texture by whose coordinates tangents run where there is no normal texture.
pub(super) fn directed(json: &Json) -> Option<&TextureInfo> {
    let extensions = &json.more.extensions;
    let coat = extensions.clearcoat.as_ref().and_then(|coat| coat.clearcoat_normal_texture.as_ref());
    coat.or(extensions.anisotropy.as_ref().and_then(|anisotropy| anisotropy.anisotropy_texture.as_ref()))
}

/// Whether the clear coat has another normal than what is below it.
pub(super) fn coat_differs(json: &Json, material: &Material) -> bool {
    material.clearcoat > 0.0 && json.more.normal_texture.is_some()
}

/// Of x and y of the normals of the coat.
pub(super) fn normal_scale(json: &Json) -> Option<f32> {
    let info = json.more.extensions.clearcoat.as_ref()?.clearcoat_normal_texture.as_ref()?;
    Some(info.scale?.clamp(f32::MIN.into(), f32::MAX.into()) as f32)
}
