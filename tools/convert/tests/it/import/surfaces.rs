//! Materials with all their textures, tangents, and lights.

use super::writer::*;
use bricks::{
    BASE_COLOR, EMISSIVE, LIGHT_DISTANT, LIGHT_POINT, LIGHT_SPOT, MATERIAL_ANISOTROPIC, MATERIAL_BLEND,
    MATERIAL_FURTHER, MATERIAL_LAYERS, MATERIAL_MORE, MATERIAL_REFRACTS, METALLIC_ROUGHNESS, Material, NONE, NORMAL,
    OCCLUSION, unpack_absorption,
};
use brickwalk_convert::import::Input;
use brickwalk_convert::source::{Primitive, SourceScene};
use serde_json::{Value, json};

/// Two triangles, a square of x and y, whose coordinates of set 0 run along x and down y, those of set 1 the other way
/// round.
fn square(material: Value) -> Writer {
    let mut file = Writer::new();
    let positions = file.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0]);
    let normals = file.floats("VEC3", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    let uvs = file.floats("VEC2", &[0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
    let uvs1 = file.floats("VEC2", &[1.0, 0.0, 1.0, 1.0, 0.0, 1.0, 0.0, 0.0]);
    let indices = file.accessor(&le16(&[0, 1, 2, 0, 2, 3]), U16, "SCALAR", 6);
    let attributes = json!({"POSITION": positions, "NORMAL": normals, "TEXCOORD_0": uvs, "TEXCOORD_1": uvs1});
    let mesh = file.mesh(json!({"attributes": attributes, "indices": indices, "material": 0}));
    file.node(json!({"mesh": mesh}));
    for _ in 0..3 {
        let image = file.view(&png(1, 1, &[128, 128, 255, 255]));
        file.push("images", json!({"bufferView": image}));
    }
    for image in 0..3 {
        file.push("textures", json!({"source": image}));
    }
    file.root["materials"] = json!([material]);
    file
}

fn only(scene: &SourceScene) -> (&Primitive, Material) {
    assert_eq!((scene.meshes[0].primitives.len(), scene.materials.len()), (1, 1));
    (&scene.meshes[0].primitives[0], scene.materials[0])
}

/// The material alone.
fn material(json: Value) -> (Material, Vec<String>) {
    let scene = square(json).scene();
    (only(&scene).1, scene.warnings)
}

#[test]
fn all_textures_with_their_sets_and_transformations() {
    let scene = square(json!({
        "pbrMetallicRoughness": {
            "baseColorTexture": {"index": 0},
            "metallicRoughnessTexture": {"index": 1, "texCoord": 1}
        },
        "normalTexture": {"index": 2, "scale": -0.5, "extensions": {
            "KHR_texture_transform": {"scale": [2, 4], "offset": [0.5, 0.25]}}},
        "occlusionTexture": {"index": 1, "strength": 0.25},
        "emissiveTexture": {"index": 0, "extensions": {
            "KHR_texture_transform": {"texCoord": 1, "rotation": std::f64::consts::FRAC_PI_2}}},
        "emissiveFactor": [1, 0.5, 0],
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 4}}
    }))
    .scene();
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let (primitive, material) = only(&scene);
    // An image used in several ways is one texture here.
    assert_eq!(material.textures(), [0, 1, 2, 2, 0]);
    assert_eq!(scene.textures.len(), 3);
    assert_eq!(material.uv_sets, 1 << bricks::METALLIC_ROUGHNESS | 1 << bricks::EMISSIVE);
    assert_eq!((material.normal_scale, material.occlusion_strength), (-0.5, 0.25));
    assert_eq!(material.emission, [4.0, 2.0, 0.0]);
    let rows = |place: usize| [material.uv_from_set[2 * place], material.uv_from_set[2 * place + 1]];
    assert_eq!(rows(bricks::NORMAL), [[2.0, 0.0, 0.5, 8.0], [0.0, 4.0, 0.25, 0.0]]);
    assert_eq!(rows(bricks::OCCLUSION), [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 0.0]]);
    let [[cos, sin, ..], [minus_sin, ..]] = rows(bricks::EMISSIVE);
    assert!(cos.abs() < 1e-6 && (sin - 1.0).abs() < 1e-6 && (minus_sin + 1.0).abs() < 1e-6);
    // Coordinates are those of the file.
    assert_eq!(primitive.uvs.as_ref().unwrap()[..2], [[0.0, 1.0], [1.0, 1.0]]);
    assert_eq!(primitive.uvs1.as_ref().unwrap()[..2], [[1.0, 0.0], [1.0, 1.0]]);
    // The second set of coordinates is read where it is used.
    let plain = square(json!({"occlusionTexture": {"index": 0}})).scene();
    assert!(only(&plain).0.uvs1.is_none() && only(&plain).0.tangents.is_none());
    assert_eq!(only(&plain).1.textures(), [NONE, NONE, NONE, 0, NONE]);
}

#[test]
fn tangents_are_read_or_made() {
    let normal = |set: u32| json!({"normalTexture": {"index": 0, "texCoord": set}});
    let made = square(normal(0)).scene();
    assert_eq!(only(&made).0.tangents.as_deref(), Some(&[[1.0, 0.0, 0.0, 1.0]; 6][..]));
    // Of the second set u runs along -y, v along x: cross(z, -y) = x, down in the image.
    let made = square(normal(1)).scene();
    assert_eq!(only(&made).0.tangents.as_deref(), Some(&[[0.0, -1.0, 0.0, -1.0]; 6][..]));

    let mut file = square(normal(0));
    let values: Vec<f32> = (0..4).flat_map(|i| [0.0, i as f32, 1.0, if i == 3 { -1.0 } else { 1.0 }]).collect();
    let tangents = file.floats("VEC4", &values);
    file.root["meshes"][0]["primitives"][0]["attributes"]["TANGENT"] = json!(tangents);
    let scene = file.scene();
    let vertex = |i: usize| <[f32; 4]>::try_from(&values[4 * i..4 * i + 4]).unwrap();
    assert_eq!(only(&scene).0.tangents, Some([0, 1, 2, 0, 2, 3].map(vertex).to_vec()), "by corner");
    // Without normals they mean nothing: others are made by the triangles'.
    let attributes = file.root["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap();
    let normals = attributes.remove("NORMAL").unwrap();
    assert_eq!(only(&file.scene()).0.tangents.as_deref(), Some(&[[1.0, 0.0, 0.0, 1.0]; 6][..]));
    file.root["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = normals;
    // As integers, and not finite.
    let bytes = [127i8, 0, 0, 127].repeat(4).iter().map(|b| *b as u8).collect::<Vec<_>>();
    let packed = file.accessor(&bytes, 5120, "VEC4", 4);
    file.root["accessors"][packed]["normalized"] = json!(true);
    file.root["meshes"][0]["primitives"][0]["attributes"]["TANGENT"] = json!(packed);
    assert_eq!(only(&file.scene()).0.tangents.as_deref(), Some(&[[1.0, 0.0, 0.0, 1.0]; 6][..]));
    let nan = file.floats("VEC4", &[f32::NAN; 16]);
    file.root["meshes"][0]["primitives"][0]["attributes"]["TANGENT"] = json!(nan);
    let scene = file.scene();
    assert_eq!(only(&scene).0.tangents.as_deref(), Some(&[[0.0; 4]; 6][..]));
    assert!(scene.warnings.len() == 1 && scene.warnings[0].contains("tangents"), "{:?}", scene.warnings);
    // As many as vertices, and vectors of four.
    for (kind, values) in [("VEC4", 12), ("VEC3", 12)] {
        let wrong = file.floats(kind, &vec![1.0; values]);
        file.root["meshes"][0]["primitives"][0]["attributes"]["TANGENT"] = json!(wrong);
        assert!(file.error().contains("TANGENT"));
    }
    // Not asked for, they are not looked at.
    file.root["materials"] = json!([{}]);
    assert!(only(&file.scene()).0.tangents.is_none());
}

#[test]
fn sets_beyond_the_second_are_left_out() {
    let (found, warnings) =
        material(json!({"normalTexture": {"index": 0, "texCoord": 2}, "occlusionTexture": {"index": 1}}));
    assert_eq!(found.textures(), [NONE, NONE, NONE, 0, NONE]);
    assert!(warnings.len() == 1 && warnings[0].contains("uses a third set of texture coordinates"), "{warnings:?}");
    let mut file = square(json!({"emissiveTexture": {"index": 0, "texCoord": 1}}));
    file.root["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap().remove("TEXCOORD_1");
    let warnings = file.scene().warnings;
    assert!(warnings.len() == 1 && warnings[0].contains("without texture coordinates"), "{warnings:?}");
}

#[test]
fn dielectrics_reflect_by_their_index_and_their_factors() {
    let of = |extensions: Value| {
        let (material, warnings) = material(json!({"extensions": extensions}));
        (material.specular, material.specular_weight, warnings.len())
    };
    assert_eq!(of(json!({})), ([0.04; 3], 1.0, 0));
    assert_eq!(of(json!({"KHR_materials_ior": {}})), ([0.04; 3], 1.0, 0));
    assert_eq!(of(json!({"KHR_materials_ior": {"ior": 3}})), ([0.25; 3], 1.0, 0));
    assert_eq!(of(json!({"KHR_materials_ior": {"ior": 1}})), ([0.0; 3], 1.0, 0));
    assert_eq!(of(json!({"KHR_materials_ior": {"ior": 0}})), ([1.0; 3], 1.0, 0));
    assert_eq!(of(json!({"KHR_materials_specular": {"specularFactor": 0}})), ([0.0; 3], 0.0, 0));
    let colored = json!({"specularFactor": 0.5, "specularColorFactor": [1, 2, 100]});
    let (specular, weight, warnings) = of(json!({"KHR_materials_ior": {"ior": 3}, "KHR_materials_specular": colored}));
    assert_eq!((specular, weight, warnings), ([0.125, 0.25, 0.5], 0.5, 0));
    let coat = json!({"clearcoatFactor": 0.5, "clearcoatRoughnessFactor": 0.25});
    let (coated, warnings) = material(json!({"extensions": {"KHR_materials_clearcoat": coat}}));
    assert_eq!((coated.clearcoat, coated.clearcoat_roughness, warnings.len()), (0.5, 0.25, 0));
    let gloss = json!({"diffuseFactor": [0.5, 0.25, 0, 1], "specularFactor": [0.75, 0.5, 0.25],
        "glossinessFactor": 0.75, "diffuseTexture": {"index": 1}, "specularGlossinessTexture": {"index": 0}});
    let pbr = json!({"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 0}});
    let extensions = json!({"KHR_materials_pbrSpecularGlossiness": gloss});
    let (found, warnings) = material(json!({"pbrMetallicRoughness": pbr, "extensions": extensions}));
    assert_eq!((found.base_color, found.metallic, found.roughness), ([0.5, 0.25, 0.0, 1.0], 0.0, 0.25));
    assert_eq!((found.specular, found.specular_weight), ([0.75, 0.5, 0.25], 1.0));
    assert_eq!((found.textures(), warnings.len()), ([0, NONE, NONE, NONE, NONE], 1));
}

/// What passes and what is reflected, seen along the normal, is what the material says.
#[test]
fn transmission_keeps_energy() {
    let of = |transmission: f64, color: [f64; 4], mode: &str| {
        material(json!({
            "pbrMetallicRoughness": {"baseColorFactor": color, "metallicFactor": 0}, "alphaMode": mode,
            "extensions": {"KHR_materials_transmission": {"transmissionFactor": transmission}}
        }))
    };
    for (share, tone) in [(1.0, 1.0), (0.5, 1.0), (0.5, 0.5), (1.0, 0.25)] {
        let (found, warnings) = of(share, [tone, tone, tone, 0.5], "OPAQUE");
        assert!(warnings.is_empty(), "{warnings:?}");
        assert_eq!((found.flags, f64::from(found.transmission)), (MATERIAL_BLEND, share));
        let [alpha, color, specular] = [found.base_color[3], found.base_color[0], found.specular[0]].map(f64::from);
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-6, "{share} {tone}: {a} is not {b}");
        close(1.0 - alpha, 0.96 * share * tone);
        close(alpha * specular, 0.04);
        close(alpha * (1.0 - specular) * color, 0.96 * (1.0 - share) * tone);
    }
    let (half, _) = of(1.0, [1.0, 1.0, 1.0, 0.5], "BLEND");
    assert!((half.base_color[3] - 0.02).abs() < 1e-6, "its own alpha counts: {}", half.base_color[3]);
    let (tinted, warnings) = of(1.0, [1.0, 0.5, 0.5, 1.0], "OPAQUE");
    assert!(warnings.len() == 1 && warnings[0].contains("tinted") && tinted.flags == MATERIAL_BLEND);
    let (masked, warnings) = of(1.0, [1.0; 4], "MASK");
    assert!(warnings.len() == 1 && masked.transmission == 0.0 && masked.base_color == [1.0; 4]);
    assert_eq!(of(0.0, [1.0; 4], "OPAQUE").0.flags, 0);
}

#[test]
fn bodies_refract_by_index_and_attenuation() {
    let of = |volume: Value, more: Value| {
        let mut extensions = json!({"KHR_materials_transmission": {"transmissionFactor": 0.75},
            "KHR_materials_ior": {"ior": 2}, "KHR_materials_volume": volume});
        for (name, extension) in more.as_object().unwrap() {
            extensions[name] = extension.clone();
        }
        material(json!({
            "pbrMetallicRoughness": {"baseColorFactor": [1, 0.5, 0.25, 1], "metallicFactor": 0}, "extensions": extensions
        }))
    };
    let volume = json!({"thicknessFactor": 1, "attenuationDistance": 2, "attenuationColor": [1, 0.5, 0]});
    let (body, warnings) = of(volume.clone(), json!({}));
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!((body.flags, body.transmission), (MATERIAL_BLEND | MATERIAL_REFRACTS, 0.75));
    let close = |a: f32, b: f64| assert!((f64::from(a) - b).abs() < 1e-2 * b, "{a} is not {b}");
    close(body.specular[0], 1.0 / 9.0);
    close(body.base_color[1], 0.5);
    close(1.0 - body.base_color[3], 0.75 * (1.0 - 1.0 / 9.0));
    let [red, green, blue] = unpack_absorption(body.absorption);
    assert_eq!(red, 0.0);
    close(green, 0.5f64.ln() / -2.0);
    // What is black leaves a thousandth.
    close(blue, 1e-3f64.ln() / -2.0);
    // Without a thickness it is a wall; without a distance it is clear; specular colours are for others.
    let (wall, _) = of(json!({"attenuationDistance": 2}), json!({}));
    assert_eq!((wall.flags, wall.absorption), (MATERIAL_BLEND, 0));
    assert_eq!(of(json!({"thicknessFactor": 1}), json!({})).0.absorption, 0);
    let (_, warnings) = of(volume, json!({"KHR_materials_specular": {"specularFactor": 0.5}}));
    assert!(warnings.len() == 1 && warnings[0].contains("refracts"), "{warnings:?}");
}

#[test]
fn sheen_anisotropy_and_films_are_kept() {
    let all = json!({
        "KHR_materials_sheen": {"sheenColorFactor": [1, 0.5, 0], "sheenRoughnessFactor": 0.25},
        "KHR_materials_anisotropy": {"anisotropyStrength": 0.75, "anisotropyRotation": -std::f64::consts::FRAC_PI_2},
        "KHR_materials_iridescence": {"iridescenceFactor": 0.5, "iridescenceIor": 1.5,
            "iridescenceThicknessMinimum": 10, "iridescenceThicknessMaximum": 250}
    });
    let (found, warnings) = material(json!({"extensions": all}));
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!(found.flags, MATERIAL_LAYERS | MATERIAL_ANISOTROPIC);
    let layers = found.layers();
    let close = |a: f32, b: f32| assert!((a - b).abs() < 2e-4, "{a} is not {b}: {layers:?}");
    [(layers.sheen[0], 1.0), (layers.sheen[1], 0.5), (layers.sheen[2], 0.0), (layers.sheen_roughness, 0.25)]
        .into_iter()
        .chain([(layers.anisotropy, 0.75), (layers.rotation, 0.75), (layers.film, 0.5), (layers.film_index, 1.5)])
        .for_each(|(a, b)| close(a, b));
    assert_eq!(layers.film_thickness, 250.0);
    // What they leave out by default.
    let film = json!({"KHR_materials_iridescence": {"iridescenceFactor": 1}});
    let (found, _) = material(json!({"extensions": film}));
    assert_eq!((found.flags, found.layers().film_thickness), (MATERIAL_LAYERS, 400.0));
    assert!((found.layers().film_index - 1.3).abs() < 1e-3);
    for none in [
        json!({"KHR_materials_sheen": {"sheenRoughnessFactor": 1}}),
        json!({"KHR_materials_anisotropy": {"anisotropyRotation": 1}}),
        json!({"KHR_materials_iridescence": {"iridescenceIor": 2}}),
    ] {
        assert_eq!(material(json!({"extensions": none})).0, material(json!({})).0);
    }
    // Films on thin walls are left out, with a warning.
    let glass = |volume: Value| {
        let extensions = json!({"KHR_materials_iridescence": {"iridescenceFactor": 1}, "KHR_materials_volume": volume,
            "KHR_materials_transmission": {"transmissionFactor": 1}});
        material(json!({"pbrMetallicRoughness": {"metallicFactor": 0}, "extensions": extensions}))
    };
    let (wall, warnings) = glass(json!({}));
    assert!(warnings.len() == 1 && warnings[0].contains("thin walls") && wall.flags & MATERIAL_LAYERS == 0);
    let (body, warnings) = glass(json!({"thicknessFactor": 1}));
    assert!(warnings.is_empty() && body.flags & MATERIAL_LAYERS != 0);
}

/// The square, with an image of 2x1 texels as texture 3 and one of 4x2 as texture 4.
fn with_images(material: Value) -> Writer {
    let mut file = square(material);
    for (width, height, rgba) in
        [(2, 1, (1..9u8).map(|i| 10 * i).collect::<Vec<_>>()), (4, 2, (0..32u8).map(|i| 100 + i).collect::<Vec<_>>())]
    {
        let view = file.view(&png(width, height, &rgba));
        let image = file.push("images", json!({"bufferView": view}));
        file.push("textures", json!({"source": image}));
    }
    file
}

#[test]
fn further_textures_are_packed() {
    let mut file = with_images(json!({
        "normalTexture": {"index": 0},
        "extensions": {
            "KHR_materials_specular": {"specularTexture": {"index": 4}, "specularColorTexture": {"index": 4}},
            "KHR_materials_clearcoat": {
                "clearcoatFactor": 0.5,
                "clearcoatTexture": {"index": 3},
                "clearcoatRoughnessTexture": {"index": 4},
                "clearcoatNormalTexture": {"index": 2, "scale": 0.25, "texCoord": 1}
            },
            // The thickness has other coordinates than the coat.
            "KHR_materials_iridescence": {"iridescenceFactor": 1, "iridescenceThicknessMaximum": 500,
                "iridescenceTexture": {"index": 4}, "iridescenceThicknessTexture": {"index": 4, "texCoord": 1}},
            "KHR_materials_anisotropy": {"anisotropyStrength": 1, "anisotropyTexture": {"index": 4}},
            "KHR_materials_sheen": {"sheenColorFactor": [1, 1, 1], "sheenRoughnessFactor": 1,
                "sheenColorTexture": {"index": 4}, "sheenRoughnessTexture": {"index": 3}}
        }
    }));
    // Another material, and none: what lies behind materials with further textures is found.
    let mut other = file.root["meshes"][0]["primitives"][0].clone();
    other["material"] = json!(1);
    file.root["meshes"][0]["primitives"].as_array_mut().unwrap().push(other.clone());
    other.as_object_mut().unwrap().remove("material");
    file.root["meshes"][0]["primitives"].as_array_mut().unwrap().push(other);
    file.push("materials", json!({"pbrMetallicRoughness": {"roughnessFactor": 0.5}}));
    let scene = file.scene();
    assert!(scene.warnings.len() == 1 && scene.warnings[0].contains("different coordinates"), "{:?}", scene.warnings);
    let of_primitives: Vec<u32> = scene.meshes[0].primitives.iter().map(|primitive| primitive.material).collect();
    assert_eq!((of_primitives, scene.materials.len()), (vec![0, 2, 4], 5));
    assert_eq!(scene.materials[2].roughness, 0.5);

    let [material, further] = [scene.materials[0], scene.materials[1]];
    assert_eq!(material.flags & (MATERIAL_MORE | MATERIAL_LAYERS), MATERIAL_MORE | MATERIAL_LAYERS);
    assert_eq!((material.layers().film_least, material.layers().film_thickness), (100.0, 500.0));
    assert_eq!((further.flags, further.normal_scale, further.uv_sets), (MATERIAL_FURTHER, 0.25, 1 << NORMAL));
    let texels = |place: usize| {
        let texture = &scene.textures[further.textures()[place] as usize];
        ([texture.width, texture.height], texture.rgba.as_chunks::<4>().0.to_vec())
    };
    // Colour and weight come from one image.
    let image: Vec<[u8; 4]> = (0..8).map(|i| std::array::from_fn(|k| 100 + 4 * i + k as u8)).collect();
    assert_eq!(texels(BASE_COLOR), ([4, 2], image.clone()));
    assert_eq!(texels(NORMAL), ([1, 1], vec![[128, 128, 255, 255]]));
    // The coat from an image half as large, whose texels are interpolated; no thickness.
    let (size, coat) = texels(METALLIC_ROUGHNESS);
    assert_eq!(size, [4, 2]);
    let columns: Vec<u8> = coat.iter().map(|texel| texel[0]).collect();
    assert_eq!(columns[..4], columns[4..]);
    assert!(columns[..4].is_sorted() && columns[0] == 10 && columns[3] == 50 && columns[1] == 20, "{columns:?}");
    for (texel, own) in coat.iter().zip(&image) {
        assert_eq!(texel[1..], [own[1], own[0], 255]);
    }
    let opaque: Vec<[u8; 4]> = image.iter().map(|&[r, g, b, _]| [r, g, b, 255]).collect();
    assert_eq!(texels(OCCLUSION), ([4, 2], opaque));
    let (_, sheen) = texels(EMISSIVE);
    assert!(sheen.iter().zip(&image).all(|(texel, own)| texel[..3] == own[..3]));
    assert_eq!((sheen[0][3], sheen[3][3]), (40, 80));
}

/// Alpha and colours of a wall with a transmission texture are those of factors of what each texel lets pass.
#[test]
fn transmission_textures_are_in_alpha_and_colours() {
    let wall = |factor: f64, texture: Value, mode: &str, more: Value| {
        let mut material = json!({
            "alphaMode": mode,
            "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 0.5], "metallicFactor": 0,
                "baseColorTexture": {"index": 4}},
            "extensions": {"KHR_materials_transmission": {"transmissionFactor": factor}}
        });
        if !texture.is_null() {
            material["extensions"]["KHR_materials_transmission"]["transmissionTexture"] = texture;
        }
        for (name, extension) in more.as_object().unwrap() {
            material["extensions"][name] = extension.clone();
        }
        with_images(material).scene()
    };
    let texels = |scene: &brickwalk_convert::source::SourceScene, index: u32| {
        scene.textures[index as usize].rgba.as_chunks::<4>().0.to_vec()
    };
    let linear = |byte: u8| {
        let x = f64::from(byte) / 255.0;
        if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
    };
    // Texels of image 4; its red says what passes.
    let image: Vec<[u8; 4]> = (0..8).map(|i| std::array::from_fn(|k| 100 + 4 * i + k as u8)).collect();
    for (mode, own) in [("OPAQUE", 1.0), ("BLEND", 0.5)] {
        let scene = wall(0.75, json!({"index": 4}), mode, json!({}));
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        let [material, further] = [scene.materials[0], scene.materials[1]];
        assert_eq!((material.flags, further.flags), (MATERIAL_BLEND | MATERIAL_MORE, MATERIAL_FURTHER));
        assert_eq!((material.base_color[3], material.transmission), (own, 0.75));
        let (base, specular) =
            (texels(&scene, material.base_color_texture), texels(&scene, further.base_color_texture));
        for ((texel, base), specular) in image.iter().zip(&base).zip(&specular) {
            let passing = 0.75 * f64::from(texel[0]) / 255.0;
            let (plain, _) = material_of(passing);
            let of_texture = if mode == "BLEND" { f64::from(texel[3]) / 255.0 } else { 1.0 };
            let close = |found: f64, expected: f64, bound: f64| {
                assert!((found - expected).abs() < bound, "{mode} {texel:?}: {found} is not {expected}");
            };
            close(f64::from(base[3]) / 255.0, of_texture * f64::from(plain.base_color[3]), 0.5 / 255.0 + 1e-6);
            for k in 0..3 {
                close(0.5 * linear(base[k]), linear(texel[k]) * f64::from(plain.base_color[k]), 2e-3);
                let found = f64::from(material.specular[k]) * linear(specular[k]);
                close(found, f64::from(plain.specular[k]), 1e-3);
            }
        }
    }
    // Opaque without a texture of what passes: alpha of the base colour says nothing.
    let scene = wall(0.75, Value::Null, "OPAQUE", json!({}));
    assert!(texels(&scene, scene.materials[0].base_color_texture).iter().all(|texel| texel[3] == 255));
    // Bodies keep their colours, and know what passes.
    let scene = wall(1.0, json!({"index": 4}), "OPAQUE", json!({"KHR_materials_volume": {"thicknessFactor": 1}}));
    let [body, further] = [scene.materials[0], scene.materials[1]];
    assert_eq!((body.flags, body.base_color[3]), (MATERIAL_BLEND | MATERIAL_REFRACTS | MATERIAL_MORE, 1.0));
    let (base, share) = (texels(&scene, body.base_color_texture), texels(&scene, further.base_color_texture));
    for ((texel, base), share) in image.iter().zip(&base).zip(&share) {
        let alpha = 255.0 * (1.0 - 0.5 * 0.96 * f64::from(texel[0]) / 255.0);
        assert!(base[..3] == texel[..3] && (f64::from(base[3]) - alpha).abs() < 0.501, "{base:?}, {alpha}");
        assert_eq!(*share, [255, 255, 255, texel[0]]);
    }
    // Where the base colour has other coordinates the factor stands for it.
    let scene = wall(0.75, json!({"index": 4, "texCoord": 1}), "OPAQUE", json!({}));
    assert!(scene.warnings.len() == 1 && scene.warnings[0].contains("factor used"), "{:?}", scene.warnings);
    assert!(scene.materials.len() == 1 && scene.materials[0].base_color[3] < 0.7);
}

/// A wall of tone 0.5 without textures.
fn material_of(transmission: f64) -> (Material, Vec<String>) {
    material(json!({
        "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1], "metallicFactor": 0},
        "extensions": {"KHR_materials_transmission": {"transmissionFactor": transmission}}
    }))
}

#[test]
fn coats_over_bumps_have_normals_of_their_own() {
    let coated = |more: Value| {
        let mut material = json!({"extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 1}}});
        material.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        with_images(material).scene()
    };
    let bumpy = coated(json!({"normalTexture": {"index": 0}}));
    assert_eq!(bumpy.materials[1], Material::further());
    assert!(bumpy.materials.len() == 2 && bumpy.materials[0].flags & MATERIAL_MORE != 0);
    let smooth = coated(json!({}));
    assert!(smooth.materials.len() == 1 && smooth.materials[0].flags & MATERIAL_MORE == 0);
    // What a factor of zero leaves nothing of has no textures; an image that is missing is white, with a warning.
    let bare = coated(json!({"extensions": {"KHR_materials_clearcoat": {"clearcoatTexture": {"index": 3}}}}));
    assert!(bare.materials.len() == 1 && bare.textures.is_empty());
    let missing = json!({"extensions": {"KHR_materials_clearcoat":
        {"clearcoatFactor": 1, "clearcoatTexture": {"index": 99}}}});
    let missing = coated(missing);
    assert!(missing.materials.len() == 1 && missing.warnings[0].contains("white used"), "{:?}", missing.warnings);
}

#[test]
fn anisotropy_has_tangents() {
    let brushed = |rotation: f64, more: Value| {
        let mut material = json!({"extensions": {"KHR_materials_anisotropy":
            {"anisotropyStrength": 0.5, "anisotropyRotation": rotation}}});
        material.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        square(material)
    };
    // By the first coordinates, unless a normal texture has others.
    assert_eq!(only(&brushed(1.0, json!({})).scene()).0.tangents.as_deref(), Some(&[[1.0, 0.0, 0.0, 1.0]; 6][..]));
    let textured = brushed(1.0, json!({"normalTexture": {"index": 0, "texCoord": 1}})).scene();
    assert_eq!(only(&textured).0.tangents.as_deref(), Some(&[[0.0, -1.0, 0.0, -1.0]; 6][..]));
    // Without coordinates the file's; without either along x.
    let mut file = brushed(1.0, json!({}));
    let tangents = file.floats("VEC4", &[0.0, 1.0, 0.0, -1.0].repeat(4));
    let attributes = file.root["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap();
    attributes.remove("TEXCOORD_0");
    assert_eq!(only(&file.scene()).0.tangents.as_deref(), Some(&[[1.0, 0.0, 0.0, 1.0]; 6][..]));
    file.root["meshes"][0]["primitives"][0]["attributes"]["TANGENT"] = json!(tangents);
    assert_eq!(only(&file.scene()).0.tangents.as_deref(), Some(&[[0.0, 1.0, 0.0, -1.0]; 6][..]));
}

#[test]
fn lights_are_placed_by_their_nodes() {
    let mut file = square(json!({}));
    file.root["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    file.root["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"type": "point", "color": [1, 0.5, 0], "intensity": 20, "range": 8},
        {"type": "spot", "spot": {"innerConeAngle": 0.25, "outerConeAngle": 0.5}},
        {"type": "directional", "intensity": 3},
        {"type": "spot"},
        {"type": "spot", "spot": {"innerConeAngle": 1, "outerConeAngle": 2}},
        {"type": "area"}, {"type": "point", "intensity": -1}, 5
    ]}});
    let mut node = |light: Value, mut node: Value| {
        node["extensions"] = json!({"KHR_lights_punctual": {"light": light}});
        file.node(node)
    };
    node(json!(0), json!({"translation": [1, 2, 3], "scale": [2, 2, 2]}));
    let child = node(json!(0), json!({"translation": [1, 0, 0]}));
    // A quarter turn about x takes -z to y.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    node(json!(1), json!({"rotation": [half, 0, 0, half], "translation": [0, 5, 0]}));
    node(json!(2), json!({"scale": [1, 1, 3]}));
    node(json!(3), json!({}));
    node(json!(4), json!({}));
    for bad in [json!(5), json!(6), json!(7), json!(8), json!("x")] {
        node(bad, json!({}));
    }
    // The second node of light 0 becomes a child of the first.
    file.root["nodes"][1]["children"] = json!([child]);
    file.root["scenes"][0]["nodes"].as_array_mut().unwrap().retain(|node| *node != json!(child));
    let scene = file.scene();
    let kinds: Vec<u32> = scene.lights.iter().map(|light| light.kind).collect();
    assert_eq!(kinds, [LIGHT_POINT, LIGHT_POINT, LIGHT_SPOT, LIGHT_DISTANT, LIGHT_SPOT, LIGHT_SPOT]);
    let [first, second, spot, distant, default, wide] = scene.lights[..] else { panic!() };
    assert_eq!((first.position, first.color, first.range), ([1.0, 2.0, 3.0], [20.0, 10.0, 0.0], 8.0));
    assert_eq!((second.position, second.range), ([3.0, 2.0, 3.0], 8.0));
    assert!((spot.direction[1] - 1.0).abs() < 1e-12 && spot.position == [0.0, 5.0, 0.0], "{spot:?}");
    assert_eq!((spot.cone, spot.color), ([0.25, 0.5], [1.0; 3]));
    assert_eq!((distant.direction, distant.color), ([0.0, 0.0, -1.0], [3.0; 3]));
    assert_eq!(default.cone, [0.0, std::f32::consts::FRAC_PI_4]);
    assert_eq!(wide.cone, [1.0, std::f32::consts::FRAC_PI_2]);
    assert_eq!(scene.warnings.len(), 2, "five left out, one cone clamped: {:?}", scene.warnings);
    assert!(scene.warnings.iter().any(|warning| warning.contains("and 4 more: light skipped")));

    // Placements of the whole input move lights too.
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), "test.glb", &file.glb());
    let mut input = Input::from(path);
    input.transform = [0.0, 0.0, 1.0, 10.0, 0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0];
    let moved = import_all(&[input]).unwrap();
    assert_eq!(moved.lights[0].position, [13.0, 2.0, -1.0]);
    assert_eq!(moved.lights[3].direction, [-1.0, 0.0, 0.0]);
}

#[test]
fn obj_maps_become_textures() {
    let folder = tempfile::tempdir().unwrap();
    let library = "newmtl a\nKd 1 1 1\nmap_Ke e.png\nmap_Pr r.png\nmap_Pm m.png\nnorm n.png\nmap_Kd c.png\n\
        newmtl b\nmap_Pr r.png\nmap_Pm m.png\nmap_Kd n.png\n";
    write(folder.path(), "m.mtl", library.as_bytes());
    for (name, value) in [("e", 1), ("n", 2), ("c", 3)] {
        write(folder.path(), &format!("{name}.png"), &png(1, 1, &[value; 4]));
    }
    write(folder.path(), "r.png", &png(2, 1, &[10, 0, 0, 255, 20, 0, 0, 255]));
    write(folder.path(), "m.png", &png(1, 2, &[30, 0, 0, 255, 40, 0, 0, 255]));
    let text = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\n\
        usemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 1/1 2/2 3/3\n";
    let scene = import_one(&write(folder.path(), "a.obj", text.as_bytes())).unwrap();
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let textures = |material: usize| scene.materials[material].textures();
    let [color, normal, gloss, none, glow] = textures(0);
    assert_eq!([color, normal, glow].map(|t| scene.textures[t as usize].rgba[0]), [3, 2, 1]);
    assert_eq!((none, textures(1)), (NONE, [normal, NONE, gloss, NONE, NONE]));
    let combined = &scene.textures[gloss as usize];
    assert_eq!((combined.width, combined.height), (2, 2));
    let channels: Vec<[u8; 2]> = combined.rgba.chunks(4).map(|texel| [texel[1], texel[2]]).collect();
    assert_eq!(channels, [[10, 30], [20, 30], [10, 40], [20, 40]]);
    let primitives = &scene.meshes[0].primitives;
    assert_eq!(primitives[0].tangents.as_deref(), Some(&[[1.0, 0.0, 0.0, 1.0]; 3][..]));
    assert!(primitives[1].tangents.is_none());
}

/// Maps lie beside the material library, or beside the OBJ file; where both have one, the library's is meant.
#[test]
fn obj_maps_lie_beside_their_library_or_the_model() {
    let folder = tempfile::tempdir().unwrap();
    let below = |name: &str| {
        let path = folder.path().join(name);
        std::fs::create_dir_all(&path).unwrap();
        path
    };
    let (looks, pictures) = (below("looks"), below("looks/pictures"));
    write(
        &looks,
        "m.mtl",
        b"newmtl a\nmap_Kd pictures\\c.png\nmap_Ke e.png\nnewmtl b\nmap_Kd both.png\nnorm none.png\n",
    );
    write(&pictures, "c.png", &png(1, 1, &[1; 4]));
    write(folder.path(), "e.png", &png(1, 1, &[2; 4]));
    write(&looks, "both.png", &png(1, 1, &[3; 4]));
    write(folder.path(), "both.png", &png(1, 1, &[4; 4]));
    let text =
        "mtllib looks\\m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\nusemtl b\nf 1/1 2/1 3/1\n";
    let model = write(folder.path(), "a.obj", text.as_bytes());
    let first = |scene: &SourceScene| {
        let of = |texture: u32| scene.textures.get(texture as usize).map(|texture| texture.rgba[0]);
        let [a, b] = [0, 1].map(|material| scene.materials[material].textures());
        [of(a[0]), of(a[4]), of(b[0])]
    };
    let scene = import_one(&model).unwrap();
    assert_eq!(first(&scene), [Some(1), Some(2), Some(3)]);
    assert!(scene.warnings.iter().all(|warning| warning.contains("none.png")), "{:?}", scene.warnings);
    // The control: without the library's own, the model's is taken.
    std::fs::remove_file(looks.join("both.png")).unwrap();
    assert_eq!(first(&import_one(&model).unwrap()), [Some(1), Some(2), Some(4)]);
}
