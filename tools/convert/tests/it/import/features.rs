//! What is read, feature by feature.

use super::writer::*;
use brickwalk_convert::import::{ImportSettings, import};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{IDENTITY, PART_TRIANGLES, Primitive, Source, SourceScene};
use serde_json::{Value, json};

/// The only primitive of the only mesh.
fn only(scene: &SourceScene) -> &Primitive {
    assert_eq!((scene.meshes.len(), scene.meshes[0].primitives.len()), (1, 1));
    &scene.meshes[0].primitives[0]
}

/// A file with one primitive over `vertices` positions (i, i^2, 0), changed by `primitive`.
fn primitive(vertices: usize, mut primitive: Value, write: impl FnOnce(&mut Writer, &mut Value)) -> Writer {
    let mut file = Writer::new();
    let positions: Vec<f32> = (0..vertices).flat_map(|i| [i as f32, (i * i) as f32, 0.0]).collect();
    primitive["attributes"]["POSITION"] = json!(file.floats("VEC3", &positions));
    write(&mut file, &mut primitive);
    let mesh = file.mesh(primitive);
    file.node(json!({"mesh": mesh}));
    file
}

#[test]
fn a_triangle_arrives_whole() {
    let scene = Writer::triangle().scene();
    let triangle = only(&scene);
    assert_eq!(triangle.positions, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    assert_eq!(triangle.indices, [0, 1, 2]);
    assert!(triangle.normals.is_none() && triangle.uvs.is_none() && triangle.colors.is_none());
    assert_eq!(scene.placements.len(), 1);
    assert_eq!(scene.placements[0].world_from_mesh, IDENTITY);
    assert_eq!((scene.meshes[0].name.as_str(), scene.placements[0].name.as_str()), ("0", "0"));
    // Without material and without colours of vertices it is grey; the default of the specification is beside it.
    assert_eq!(scene.materials.len(), 2);
    let material = scene.materials[triangle.material as usize];
    assert_eq!(material.base_color, bricks::Material::GREY.base_color);
    let default = scene.materials[0];
    assert_eq!((default.base_color, default.metallic, default.roughness), ([1.0; 4], 1.0, 1.0));
    assert_eq!(material.base_color_texture, bricks::NONE);
    assert!(scene.warnings.is_empty() && !scene.has_animation, "{:?}", scene.warnings);
}

#[test]
fn modes_expand_as_specified() {
    let indices = |mode: u32, count: usize| {
        let scene = primitive(count, json!({"mode": mode}), |_, _| {}).scene();
        (only(&scene).indices.clone(), scene.warnings.len())
    };
    assert_eq!(indices(4, 6), (vec![0, 1, 2, 3, 4, 5], 0));
    assert_eq!(indices(5, 5), (vec![0, 1, 2, 1, 3, 2, 2, 3, 4], 0));
    assert_eq!(indices(6, 5), (vec![1, 2, 0, 2, 3, 0, 3, 4, 0], 0));
    // Left-over vertices form no triangle; that is told.
    assert_eq!(indices(4, 5), (vec![0, 1, 2], 1));
    assert_eq!(indices(5, 2), (vec![], 0));
    for mode in 0..4 {
        assert_eq!(indices(mode, 6), (vec![], 1), "points and lines");
    }
}

#[test]
fn strips_and_fans_follow_their_indices() {
    for (component, bytes) in [
        (U8, vec![3, 1, 0, 2]),
        (U16, le16(&[3, 1, 0, 2])),
        (U32, [3u32, 1, 0, 2].iter().flat_map(|i| i.to_le_bytes()).collect()),
    ] {
        for (mode, expected) in [(5, [3, 1, 0, 1, 2, 0]), (6, [1, 0, 3, 0, 2, 3])] {
            let file = primitive(4, json!({"mode": mode}), |file, primitive| {
                primitive["indices"] = json!(file.accessor(&bytes, component, "SCALAR", 4));
            });
            assert_eq!(only(&file.scene()).indices, expected);
        }
    }
}

#[test]
fn skipped_primitives_keep_their_number() {
    let mut file = Writer::triangle();
    let points = json!({"attributes": {"POSITION": 0}, "mode": 0});
    file.root["meshes"][0]["primitives"].as_array_mut().unwrap().insert(0, points);
    let scene = file.scene();
    let counts: Vec<_> = scene.meshes[0].primitives.iter().map(|p| p.indices.len()).collect();
    assert_eq!(counts, [0, 3]);
}

#[test]
fn interleaved_attributes() {
    let mut file = Writer::new();
    // Position, normal, padding: 28 bytes a vertex behind 4 bytes that belong to nobody.
    let mut bytes = vec![0xee; 4];
    for v in 0..3 {
        let v = v as f32;
        bytes.extend(le32(&[v, v + 0.25, v + 0.5, 0.0, v, 1.0, f32::NAN]));
    }
    let view = file.view(&bytes);
    file.root["bufferViews"][view]["byteStride"] = json!(28);
    let accessor =
        |offset| json!({"bufferView": view, "byteOffset": offset, "componentType": F32, "type": "VEC3", "count": 3});
    let (positions, normals) = (file.push("accessors", accessor(4)), file.push("accessors", accessor(16)));
    let mesh = file.mesh(json!({"attributes": {"POSITION": positions, "NORMAL": normals}}));
    file.node(json!({"mesh": mesh}));
    let scene = file.scene();
    let primitive = only(&scene);
    assert_eq!(primitive.positions, [[0.0, 0.25, 0.5], [1.0, 1.25, 1.5], [2.0, 2.25, 2.5]]);
    assert_eq!(primitive.normals.as_deref(), Some(&[[0.0, 0.0, 1.0], [0.0, 1.0, 1.0], [0.0, 2.0, 1.0]][..]));
}

#[test]
fn sparse_accessors_replace_elements() {
    for has_base in [true, false] {
        let mut file = primitive(4, json!({"mode": 5}), |_, _| {});
        let indices = file.view(&le16(&[1, 3]));
        let values = file.view(&le32(&[10.0, 11.0, 12.0, 30.0, 31.0, 32.0]));
        let accessor = &mut file.root["accessors"][0];
        accessor["sparse"] = json!({
            "count": 2, "indices": {"bufferView": indices, "componentType": U16}, "values": {"bufferView": values}
        });
        if !has_base {
            accessor.as_object_mut().unwrap().remove("bufferView");
        }
        let base = |i: f64| if has_base { [i, i * i, 0.0] } else { [0.0; 3] };
        let expected = [base(0.0), [10.0, 11.0, 12.0], base(2.0), [30.0, 31.0, 32.0]];
        assert_eq!(only(&file.scene()).positions, expected);
    }
}

#[test]
fn an_accessor_without_buffer_view_is_zero() {
    let mut file = Writer::triangle();
    let normals = file.push("accessors", json!({"componentType": F32, "type": "VEC3", "count": 3}));
    file.root["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(normals);
    assert_eq!(only(&file.scene()).normals.as_deref(), Some(&[[0.0; 3]; 3][..]));
}

#[test]
fn colours_of_every_type() {
    let cases: [(u32, &str, Vec<u8>, [f32; 4]); 6] = [
        (F32, "VEC3", le32(&[0.25, 0.5, 2.0]), [0.25, 0.5, 1.0, 1.0]),
        (F32, "VEC4", le32(&[0.25, -1.0, 1.0, 0.75]), [0.25, 0.0, 1.0, 0.75]),
        (U8, "VEC3", vec![0, 51, 255, 0], [0.0, 0.2, 1.0, 1.0]),
        (U8, "VEC4", vec![0, 51, 255, 102], [0.0, 0.2, 1.0, 0.4]),
        (U16, "VEC3", le16(&[0, 13107, 65535, 0]), [0.0, 0.2, 1.0, 1.0]),
        (U16, "VEC4", le16(&[0, 13107, 65535, 26214]), [0.0, 0.2, 1.0, 0.4]),
    ];
    for (component, kind, element, expected) in cases {
        let file = primitive(3, json!({}), |file, primitive| {
            let colors = file.accessor(&element.repeat(3), component, kind, 3);
            file.root["accessors"][colors]["normalized"] = json!(component != F32);
            let stride = element.len();
            file.root["bufferViews"].as_array_mut().unwrap().last_mut().unwrap()["byteStride"] = json!(stride);
            primitive["attributes"]["COLOR_0"] = json!(colors);
        });
        assert_eq!(only(&file.scene()).colors.as_deref(), Some(&[expected; 3][..]), "{component} {kind}");
    }
}

#[test]
fn quantised_attributes() {
    let file = primitive(3, json!({}), |file, primitive| {
        let positions = file.accessor(&le16(&[1, 2, 3, 65535, 0, 0, 7, 8, 9]), U16, "VEC3", 3);
        let normals = file.accessor(&[127, 0, 129, 0, 128, 0, 64, 0, 0], 5120, "VEC3", 3);
        let uvs = file.accessor(&[0, 255, 51, 102, 1, 2], U8, "VEC2", 3);
        file.root["accessors"][uvs]["normalized"] = json!(true);
        primitive["attributes"] = json!({"POSITION": positions, "NORMAL": normals, "TEXCOORD_0": uvs});
    });
    let mut file = file;
    file.root["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    let scene = file.scene();
    let primitive = only(&scene);
    assert_eq!(primitive.positions, [[1.0, 2.0, 3.0], [65535.0, 0.0, 0.0], [7.0, 8.0, 9.0]]);
    let third = (64.0f64 / 127.0) as f32;
    assert_eq!(primitive.normals.as_deref(), Some(&[[1.0, 0.0, -1.0], [0.0, -1.0, 0.0], [third, 0.0, 0.0]][..]));
    let small = [(1.0f64 / 255.0) as f32, (2.0f64 / 255.0) as f32];
    assert_eq!(primitive.uvs.as_deref(), Some(&[[0.0, 1.0], [0.2, 0.4], small][..]));
}

#[test]
fn values_that_are_not_finite() {
    let file = primitive(3, json!({}), |file, primitive| {
        let positions = file.floats("VEC3", &[f32::NAN, 0.0, 0.0, f32::INFINITY, 0.0, 0.0, 1.0, 1.0, 1.0]);
        let normals = file.floats("VEC3", &[f32::NAN, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
        let uvs = file.floats("VEC2", &[f32::INFINITY, 0.5, 0.25, 0.75, 0.0, 0.0]);
        let colors = file.floats("VEC3", &[f32::NAN, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5]);
        primitive["attributes"] =
            json!({"POSITION": positions, "NORMAL": normals, "TEXCOORD_0": uvs, "COLOR_0": colors});
    });
    let scene = file.scene();
    let primitive = only(&scene);
    assert!(primitive.positions[0][0].is_nan() && primitive.positions[1][0] == f64::INFINITY, "left to the builder");
    assert_eq!(primitive.normals.as_ref().unwrap()[0], [0.0; 3]);
    assert_eq!(primitive.uvs.as_ref().unwrap()[..2], [[0.0, 0.5], [0.25, 0.75]]);
    assert_eq!(primitive.colors.as_ref().unwrap()[0], [1.0, 0.5, 0.5, 1.0]);
    assert_eq!(scene.warnings.len(), 3, "{:?}", scene.warnings);
}

#[test]
fn a_shared_vertex_buffer_is_not_copied_whole() {
    let mut file = primitive(999, json!({}), |file, primitive| {
        primitive["indices"] = json!(file.accessor(&le16(&[900, 7, 20, 20, 7, 5]), U16, "SCALAR", 6));
    });
    let whole = primitive(999, json!({}), |_, _| {});
    let scene = file.scene();
    let few = only(&scene);
    assert_eq!(few.positions.len(), 4);
    let xs: Vec<_> = few.indices.iter().map(|&i| few.positions[i as usize][0]).collect();
    assert_eq!(xs, [900.0, 7.0, 20.0, 20.0, 7.0, 5.0]);
    assert_eq!(only(&whole.scene()).positions.len(), 999);
    file.root["meshes"][0]["primitives"][0]["indices"] = json!(null);
    assert_eq!(only(&file.scene()).positions.len(), 999);
}

#[test]
fn hierarchy_in_depth_first_order() {
    let mut file = Writer::triangle();
    // 1 (mesh) -> 2 -> 3 (mesh); 1 -> 4 (mesh): depth first is 0 1 3 4, breadth first would be 0 1 4 3.
    file.node(json!({"mesh": 0, "name": "one", "children": [2, 4], "translation": [1, 2, 3]}));
    file.push("nodes", json!({"children": [3], "scale": [-2, 3, 4]}));
    // Column-major: x and y swapped, moved by 5 6 7.
    let matrix = json!([0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1]);
    file.push("nodes", json!({"mesh": 0, "name": "three", "matrix": matrix}));
    file.push("nodes", json!({"mesh": 0, "name": "four"}));
    let scene = file.scene();
    let names: Vec<_> = scene.placements.iter().map(|p| p.name.as_str()).collect();
    assert_eq!(names, ["0", "one", "three", "four"]);
    assert_eq!(scene.meshes.len(), 1, "one mesh, several placements");
    assert!(scene.placements.iter().all(|p| p.mesh == 0 && p.source == 0));
    let moved = [1.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 2.0, 0.0, 0.0, 1.0, 3.0];
    assert_eq!(scene.placements[1].world_from_mesh, moved);
    assert_eq!(scene.placements[3].world_from_mesh, moved);
    let three = [0.0, -2.0, 0.0, 1.0 - 10.0, 3.0, 0.0, 0.0, 2.0 + 18.0, 0.0, 0.0, 4.0, 3.0 + 28.0];
    assert_eq!(scene.placements[2].world_from_mesh, three);
}

#[test]
fn matrices_are_read_in_f64() {
    let fine = 16777217.000000125; // Neither it nor its integer part is an f32.
    assert_ne!(fine as f32 as f64, fine);
    let mut file = Writer::triangle();
    file.root["nodes"][0]["translation"] = json!([fine, 0, 0]);
    file.node(json!({"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, fine, 0, 1]}));
    let scene = file.scene();
    assert_eq!(scene.placements[0].world_from_mesh[3], fine);
    assert_eq!(scene.placements[1].world_from_mesh[7], fine);
}

#[test]
fn the_default_scene_is_chosen() {
    let mut file = Writer::triangle();
    file.push("nodes", json!({"mesh": 0, "name": "other"}));
    file.push("scenes", json!({"nodes": [1]}));
    let names = |file: &Writer| file.scene().placements.into_iter().map(|p| p.name).collect::<Vec<_>>();
    assert_eq!(names(&file), ["0"]);
    assert_eq!(file.scene().warnings.len(), 1, "nodes left out are told");
    file.root["scene"] = json!(1);
    assert_eq!(names(&file), ["other"]);
    file.root.as_object_mut().unwrap().remove("scene");
    assert_eq!(names(&file), ["0"]);
    file.root.as_object_mut().unwrap().remove("scenes");
    assert_eq!(names(&file), ["0", "other"]);
}

#[test]
fn a_deep_hierarchy_needs_no_stack() {
    let mut file = Writer::triangle();
    let depth = 200_000;
    file.root["nodes"][0] = json!({"children": [1], "translation": [0, 1, 0]});
    let nodes = file.root["nodes"].as_array_mut().unwrap();
    nodes.extend((1..depth).map(|i| json!({"children": [i + 1], "translation": [0, 1, 0]})));
    nodes.push(json!({"mesh": 0}));
    assert_eq!(file.scene().placements[0].world_from_mesh[7], depth as f64);
}

#[test]
fn instances_are_placed() {
    let mut file = Writer::triangle();
    let translation = file.floats("VEC3", &[1.0, 0.0, 0.0, 0.0, 2.0, 0.0]);
    let scale = file.floats("VEC3", &[1.0, 1.0, 1.0, 3.0, 3.0, 3.0]);
    file.root["nodes"][0]["scale"] = json!([10, 10, 10]);
    file.root["nodes"][0]["extensions"] =
        json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": translation, "SCALE": scale}}});
    let scene = file.scene();
    let matrices: Vec<_> = scene.placements.iter().map(|p| p.world_from_mesh).collect();
    let expected = [
        [10.0, 0.0, 0.0, 10.0, 0.0, 10.0, 0.0, 0.0, 0.0, 0.0, 10.0, 0.0],
        [30.0, 0.0, 0.0, 0.0, 0.0, 30.0, 0.0, 20.0, 0.0, 0.0, 30.0, 0.0],
    ];
    assert_eq!(matrices, expected);
}

#[test]
fn material_factors() {
    let mut file = Writer::triangle();
    file.push(
        "materials",
        json!({
            "pbrMetallicRoughness": {
                "baseColorFactor": [0.5, 0.25, 1, 0.75], "metallicFactor": 0.5, "roughnessFactor": 0.125
            },
            "emissiveFactor": [1, 0.5, 0], "alphaMode": "MASK", "alphaCutoff": 0.25, "doubleSided": true,
            "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 8}}
        }),
    );
    file.push("materials", json!({"alphaMode": "BLEND", "extensions": {"KHR_materials_unlit": {}}}));
    file.push("materials", json!({"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0}}));
    file.root["meshes"][0]["primitives"][0]["material"] = json!(1);
    let scene = file.scene();
    assert_eq!(scene.materials.len(), 3, "no default material when every primitive has one");
    assert_eq!(only(&scene).material, 1);
    let [first, second, third] = scene.materials[..] else { panic!() };
    assert_eq!(first.base_color, [0.5, 0.25, 1.0, 0.75]);
    assert_eq!(first.emission, [8.0, 4.0, 0.0]);
    assert_eq!((first.metallic, first.roughness, first.alpha_cutoff), (0.5, 0.125, 0.25));
    assert_eq!(first.flags, bricks::MATERIAL_MASK | bricks::MATERIAL_DOUBLE_SIDED);
    assert_eq!((second.flags, second.alpha_cutoff), (bricks::MATERIAL_BLEND | bricks::MATERIAL_UNLIT, 0.5));
    assert_eq!((third.emission, third.emissive_texture), ([1.0; 3], bricks::NONE), "its texture is not there");
    assert_eq!(scene.warnings.len(), 1, "{:?}", scene.warnings);
}

/// A triangle whose material 0 has texture 0, an image of two texels in a buffer view.
fn textured() -> Writer {
    let mut file = Writer::triangle();
    let image = file.view(&png(2, 1, &[255, 0, 0, 255, 0, 128, 255, 64]));
    let uvs = file.floats("VEC2", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    let other = file.floats("VEC2", &[0.5, 0.5, 0.25, 0.5, 0.5, 0.75]);
    file.push("images", json!({"bufferView": image, "mimeType": "image/png", "name": "bricks"}));
    file.push("samplers", json!({"wrapS": 33071, "wrapT": 33648}));
    file.push("textures", json!({"source": 0, "sampler": 0}));
    file.push("textures", json!({"source": 0}));
    file.push("materials", json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}));
    let primitive = &mut file.root["meshes"][0]["primitives"][0];
    primitive["material"] = json!(0);
    primitive["attributes"]["TEXCOORD_0"] = json!(uvs);
    primitive["attributes"]["TEXCOORD_1"] = json!(other);
    file
}

#[test]
fn textures_are_decoded() {
    let scene = textured().scene();
    assert_eq!(scene.materials[0].base_color_texture, 0);
    let [texture] = &scene.textures[..] else { panic!("{} textures", scene.textures.len()) };
    assert_eq!((texture.name.as_str(), texture.width, texture.height), ("bricks", 2, 1));
    assert_eq!(texture.rgba, [255, 0, 0, 255, 0, 128, 255, 64]);
    assert_eq!(texture.wrap, bricks::WRAP_CLAMP | bricks::WRAP_MIRROR << 16);
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}

#[test]
fn a_texture_for_each_wrap_mode_of_an_image() {
    let mut file = textured();
    for texture in [1, 0] {
        let material =
            file.push("materials", json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": texture}}}));
        let mut primitive = file.root["meshes"][0]["primitives"][0].clone();
        primitive["material"] = json!(material);
        file.root["meshes"][0]["primitives"].as_array_mut().unwrap().push(primitive);
    }
    // Material 3 is used by nothing: its texture is not decoded.
    file.push("materials", json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}));
    let scene = file.scene();
    let used: Vec<_> = scene.materials.iter().map(|m| m.base_color_texture).collect();
    assert_eq!(used, [0, 1, 0, bricks::NONE]);
    let wraps: Vec<_> = scene.textures.iter().map(|t| t.wrap).collect();
    assert_eq!(wraps, [bricks::WRAP_CLAMP | bricks::WRAP_MIRROR << 16, 0]);
    assert_eq!(scene.textures[0].rgba, scene.textures[1].rgba);
}

#[test]
fn the_set_of_texture_coordinates_is_that_of_the_material() {
    let mut file = textured();
    let set0 = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
    let set1 = [[0.5, 0.5], [0.25, 0.5], [0.5, 0.75]];
    assert_eq!(only(&file.scene()).uvs.as_deref(), Some(&set0[..]));
    let path = "/materials/0/pbrMetallicRoughness/baseColorTexture";
    file.root.pointer_mut(path).unwrap()["texCoord"] = json!(1);
    let scene = file.scene();
    assert_eq!(only(&scene).uvs1.as_deref(), Some(&set1[..]));
    assert_eq!(scene.materials[0].uv_sets, 1 << bricks::BASE_COLOR);
    // KHR_texture_transform overrides the set; coordinates stay those of the file.
    file.root.pointer_mut(path).unwrap()["extensions"] =
        json!({"KHR_texture_transform": {"texCoord": 0, "scale": [2, 4], "offset": [0.5, 0.25]}});
    let scene = file.scene();
    assert_eq!((only(&scene).uvs.as_deref(), only(&scene).uvs1.as_deref()), (Some(&set0[..]), None));
    assert_eq!(scene.materials[0].uv_sets, 0);
    assert_eq!(scene.materials[0].uv_from_set[..2], [[2.0, 0.0, 0.5, 8.0], [0.0, 4.0, 0.25, 0.0]]);
    file.root.pointer_mut(path).unwrap()["texCoord"] = json!(7);
    file.root.pointer_mut(path).unwrap()["extensions"] = json!({});
    let scene = file.scene();
    assert_eq!(scene.materials[0].base_color_texture, bricks::NONE);
    assert_eq!(scene.warnings.len(), 1, "{:?}", scene.warnings);
}

#[test]
fn an_image_that_cannot_be_used_is_white() {
    let broken = [
        json!({"uri": "missing.png"}),
        json!({"uri": "../outside.png"}),
        json!({"uri": "data:image/png;base64,AAAA"}),
        json!({"bufferView": 0}),
        json!({"bufferView": 99}),
        json!({}),
    ];
    for image in broken {
        let mut file = textured();
        file.root["images"][0] = image.clone();
        let scene = file.scene();
        assert_eq!(scene.materials[0].base_color_texture, bricks::NONE, "{image}");
        assert!(scene.textures.is_empty());
        assert_eq!(scene.warnings.len(), 1, "{:?}", scene.warnings);
        assert!(scene.warnings[0].contains("image 0"), "{:?}", scene.warnings);
    }
    // A PNG whose header claims 16000x16000 texels is not even begun.
    let mut file = textured();
    let offset = file.root["bufferViews"][2]["byteOffset"].as_u64().unwrap() as usize;
    let header = &mut file.bytes[offset + 12..offset + 33];
    header[4..8].copy_from_slice(&16000u32.to_be_bytes());
    header[8..12].copy_from_slice(&16000u32.to_be_bytes());
    let checksum = crc32(&header[..17]);
    header[17..].copy_from_slice(&checksum.to_be_bytes());
    let warnings = file.scene().warnings;
    assert!(warnings[0].contains("claims 16000x16000 texels"), "{warnings:?}");
    // A PNG cut short is no image either.
    let mut file = textured();
    let length = file.root["bufferViews"][2]["byteLength"].as_u64().unwrap();
    file.root["bufferViews"][2]["byteLength"] = json!(length / 2);
    assert_eq!(file.scene().warnings.len(), 1);
}

/// The checksum of PNG chunks.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, &byte| {
        (0..8).fold(crc ^ byte as u32, |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xedb88320 } else { crc >> 1 })
    })
}

#[test]
fn buffers_and_images_from_every_place() {
    let file = textured();
    let from_glb = file.scene();
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("a b")).unwrap();
    write(folder.path(), "a b/büffer.bin", &file.bytes);
    let external = write(folder.path(), "external.gltf", &file.json(Some("a%20b/b%C3%BCffer.bin")));
    let inline: String = file.bytes.iter().map(|b| format!("%{b:02x}")).collect();
    let inline =
        write(folder.path(), "inline.gltf", &file.json(Some(&format!("data:application/octet-stream,{inline}"))));
    // The content decides, not the extension.
    let disguised = write(folder.path(), "disguised.gltf", &file.glb());
    for path in [external, inline, disguised] {
        let scene = import_one(&path).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(only(&scene).positions, only(&from_glb).positions);
        assert_eq!(only(&scene).indices, only(&from_glb).indices);
        assert_eq!(scene.textures[0].rgba, from_glb.textures[0].rgba);
    }
}

#[test]
fn sources_carry_name_length_and_hash() {
    let file = Writer::triangle();
    let folder = tempfile::tempdir().unwrap();
    let json = file.json(Some("b.bin"));
    write(folder.path(), "b.bin", &file.bytes);
    let path = write(folder.path(), "a.gltf", &json);
    let scene = import_one(&path).unwrap();
    let both = [json.clone(), file.bytes.clone()].concat();
    let hash = format!("{:016x}", xxhash_rust::xxh3::xxh3_64(&both));
    assert_eq!(scene.sources, [bricks::Source { name: "a.gltf".into(), bytes: json.len() as u64, hash: hash.clone() }]);
    // A changed buffer changes the hash.
    let mut bytes = file.bytes.clone();
    bytes[0] ^= 1;
    write(folder.path(), "b.bin", &bytes);
    assert_ne!(import_one(&path).unwrap().sources[0].hash, hash);
}

#[test]
fn several_files_are_concatenated() {
    let folder = tempfile::tempdir().unwrap();
    let a = write(folder.path(), "a.glb", &textured().glb());
    let b = write(folder.path(), "b.glb", &Writer::triangle().glb());
    let paths = [a.clone(), b, a];
    let scene = import_all(&paths.map(Into::into)).unwrap();
    let names: Vec<_> = scene.sources.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(names, ["a.glb", "b.glb", "a.glb"]);
    let uses: Vec<_> = scene.placements.iter().map(|p| (p.mesh, p.source)).collect();
    assert_eq!(uses, [(0, 0), (1, 1), (2, 2)]);
    let materials: Vec<_> = scene.meshes.iter().map(|m| m.primitives[0].material).collect();
    assert_eq!(materials, [0, 2, 3]);
    let textures: Vec<_> = scene.materials.iter().map(|m| m.base_color_texture).collect();
    assert_eq!(textures, [0, bricks::NONE, bricks::NONE, 1]);
    assert_eq!(scene.textures.len(), 2);
}

#[test]
fn what_moves_is_taken_at_rest() {
    let mut file = Writer::triangle();
    // Malformed, and none of our business.
    file.root["animations"] = json!([{"channels": 7}]);
    file.root["cameras"] = json!("none");
    file.root["skins"] = json!([{"joints": [99]}]);
    file.root["nodes"][0]["skin"] = json!(0);
    file.root["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": 0}]);
    let scene = file.scene();
    assert!(scene.has_animation);
    assert_eq!(only(&scene).indices.len(), 3);
    assert_eq!(scene.warnings.len(), 3, "{:?}", scene.warnings);
}

#[test]
fn extensions_that_leave_geometry_alone_only_warn() {
    let mut file = Writer::triangle();
    file.root["extensionsUsed"] = json!(["KHR_lights_other", "VENDOR_anything", "KHR_materials_unlit"]);
    file.root["extensionsRequired"] = json!(["KHR_lights_other", "KHR_texture_other", "KHR_materials_unlit"]);
    let scene = file.scene();
    assert_eq!(scene.warnings.len(), 1);
    assert!(scene.warnings[0].ends_with("extensions ignored: KHR_lights_other, VENDOR_anything, KHR_texture_other"));
}

#[test]
fn names_cannot_break_lines() {
    let mut file = Writer::triangle();
    file.root["meshes"][0]["name"] = json!("a\nb");
    file.root["nodes"][0]["name"] = json!("n".repeat(100_000));
    let scene = file.scene();
    assert_eq!(scene.meshes[0].name, "a b");
    assert!(scene.placements[0].name.len() < 1000);
}

#[test]
fn integers_may_be_written_as_floats() {
    let text = String::from_utf8(Writer::triangle().json(Some("data:,"))).unwrap();
    let data: String = Writer::triangle().bytes.iter().map(|b| format!("%{b:02x}")).collect();
    let text = text.replace("data:,", &format!("data:,{data}"));
    let floats = text.replace("\"count\":3", "\"count\":3.0").replace("\"mesh\":0", "\"mesh\":0e0");
    assert_ne!(text, floats);
    assert_eq!(only(&import_bytes("test.gltf", floats.as_bytes()).unwrap()).indices, [0, 1, 2]);
}

#[test]
fn an_empty_scene_is_a_scene() {
    let scene = import_bytes("test.gltf", br#"{"asset": {"version": "2.0"}}"#).unwrap();
    assert!(scene.meshes.is_empty() && scene.placements.is_empty() && scene.warnings.is_empty());
    assert_eq!(scene.sources.len(), 1);
}

/// A primitive of two parts: messages count its vertices as the file does.
#[test]
fn vertices_are_numbered_as_in_the_file() {
    let triangles = PART_TRIANGLES as usize + 10;
    let mut file = Writer::new();
    let positions = file.floats("VEC3", &vec![0.5; 9 * triangles]);
    let mesh = file.mesh(json!({"attributes": {"POSITION": positions}}));
    file.node(json!({"mesh": mesh}));
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), "test.glb", &file.glb());
    let opened = import(&[path.as_path().into()], &ImportSettings::default(), &Progress::hidden()).unwrap();
    let name = Some(path.to_string_lossy().into_owned());
    assert_eq!(opened.outline().meshes[0].parts.len(), 2);
    assert_eq!(opened.origin(0, 0, 7), (name.clone(), 7));
    assert_eq!(opened.origin(0, 1, 7), (name, 3 * u64::from(PART_TRIANGLES) + 7));
}
