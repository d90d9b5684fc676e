//! The textures of materials beside the base colour's, against closed forms: normals with their tangents on turned and
//! mirrored things, metal, occlusion, emission, second coordinates and transformations; surfaces that are unlit.

use crate::common;
use bricks::{MATERIAL_DOUBLE_SIDED, MATERIAL_UNLIT, Material};
use brickwalk::scene::Camera;
use brickwalk::session::opened::{Opened, open_scene};
use brickwalk::session::renderer::renderer;
use brickwalk_convert::build::{BuildSettings, TextureEncoding, build};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{IDENTITY, Mesh, Placement, Primitive, SourceScene, SourceTexture};
use glam::DVec3;

/// Pixels each way.
const SIDE: u32 = 16;

/// Half way down a texture of 8 by 8 texels, all of one colour or, right of the middle, of another.
fn texture(left: [u8; 3], right: [u8; 3]) -> SourceTexture {
    let texel = |i: u32| if i % 8 < 4 { left } else { right };
    SourceTexture {
        name: "map".into(),
        width: 8,
        height: 8,
        wrap: bricks::WRAP_CLAMP | bricks::WRAP_CLAMP << 16,
        rgba: (0..64).flat_map(|i| [texel(i)[0], texel(i)[1], texel(i)[2], 255]).collect(),
    }
}

/// A sheet in the plane y = 0 from -1 to 1, whose coordinates grow along x and z, where it lies in the world.
struct Sheet {
    material: Material,
    texture: SourceTexture,
    places: Vec<[f64; 12]>,
}

/// The red radiance of a picture straight down, or up, on the point x, 0, 0.
fn seen(sheet: &Sheet, x: f64, from_below: bool, options: &str) -> Vec<f32> {
    seen_as(TextureEncoding::Raw, sheet, x, from_below, options)
}

/// The same with textures stored in some way.
fn seen_as(textures: TextureEncoding, sheet: &Sheet, x: f64, from_below: bool, options: &str) -> Vec<f32> {
    let primitive = Primitive {
        material: 0,
        positions: vec![[-1.0, 0.0, -1.0], [-1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, -1.0]],
        normals: Some(vec![[0.0, 1.0, 0.0]; 4]),
        uvs: Some(vec![[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]]),
        // Turned by a quarter, twice as large, beside.
        uvs1: Some(vec![[3.0, 2.0], [1.0, 2.0], [1.0, 4.0], [3.0, 4.0]]),
        tangents: Some(vec![[1.0, 0.0, 0.0, -1.0]; 6]),
        indices: vec![0, 1, 2, 0, 2, 3],
        ..Primitive::default()
    };
    let place =
        |&world_from_mesh| Placement { name: "p".into(), mesh: 0, source: 0, world_from_mesh, ..Placement::default() };
    let source = SourceScene {
        meshes: vec![Mesh { name: "sheet".into(), primitives: vec![primitive] }],
        placements: sheet.places.iter().map(place).collect(),
        materials: vec![sheet.material],
        textures: vec![sheet.texture.clone()],
        sources: vec![bricks::Source { name: "t".into(), bytes: 0, hash: "2d06800538d394c2".into() }],
        ..SourceScene::default()
    };
    let folder = common::folder();
    let path = folder.path().join("scene.bricks");
    let settings = BuildSettings { instance_min_triangles: 1, textures, ..BuildSettings::default() };
    build(source, &settings, &path, &Progress::hidden()).expect("a scene");
    let settings = common::settings(&format!("--size {SIDE}x{SIDE} --adapter cpu --cache 100% --frames 1 {options}"));
    let opened = Opened::open(open_scene(&path).expect("the scene"), &path, &settings).expect("a session");
    let camera = Camera {
        position: DVec3::new(x, if from_below { -4.0 } else { 4.0 }, 0.0),
        target: DVec3::new(x, 0.0, 0.0),
        up: DVec3::NEG_Z,
        fov_y: 10f64.to_radians(),
    };
    let output = renderer(opened, &path, &settings).expect("lamps").frame(0, &camera).expect("a frame");
    output.pixels.radiance.iter().map(|c| c[0]).collect()
}

fn mean(values: &[f32]) -> f64 {
    values.iter().map(|&x| f64::from(x)).sum::<f64>() / values.len() as f64
}

const WHITE: Material = Material { flags: MATERIAL_DOUBLE_SIDED, ..Material::DIFFUSE };
const SUN: [f64; 3] = [0.36, 0.8, 0.48];
const BY_SUN: &str = "--effects primary --sky-intensity 0 --sun-intensity 1";

fn sheet(material: Material, texture: SourceTexture) -> Sheet {
    Sheet { material, texture, places: vec![IDENTITY] }
}

#[test]
fn normals_are_turned_by_their_texture_on_either_side_and_on_mirrored_things() {
    let plain = sheet(WHITE, texture([255; 3], [255; 3]));
    let sun = |up: f64| format!("{BY_SUN} --sun {},{},{}", SUN[0], up * SUN[1], SUN[2]);
    let straight = mean(&seen(&plain, 0.0, false, &sun(1.0))) / SUN[1];
    // The texel, as it is read.
    let texel = [171u8, 90, 230];
    let n = DVec3::from_array(texel.map(|c| f64::from(c) / 255.0 * 2.0 - 1.0)).normalize();
    let turn = [0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0];
    let mirror = [-1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let aside = [1.0, 0.0, 0.0, 50.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    // Tangent along x, bitangent -cross(y, x), along z.
    let along = |t: DVec3, b: DVec3| t * n.x + b * n.y + DVec3::Y * n.z;
    let cases = [
        (IDENTITY, along(DVec3::X, DVec3::Z)),
        (turn, along(DVec3::NEG_Z, DVec3::X)),
        (mirror, along(DVec3::NEG_X, DVec3::Z)),
    ];
    for (place, normal) in cases {
        // Used once it is baked into the world, used twice it is an instance.
        for places in [vec![place], vec![place, aside]] {
            let material = Material { normal_texture: 0, ..WHITE };
            let one = Sheet { material, texture: texture(texel, texel), places };
            for (from_below, side) in [(false, 1.0), (true, -1.0)] {
                let found = mean(&seen(&one, 0.0, from_below, &sun(side)));
                let truth = straight * side * normal.dot(DVec3::new(SUN[0], side * SUN[1], SUN[2]));
                assert!((found - truth).abs() < 2e-4, "{place:?} {from_below}: {found} instead of {truth}");
            }
        }
    }
    // The scale acts on x and y alone.
    let scaled = sheet(Material { normal_texture: 0, normal_scale: 0.5, ..WHITE }, texture(texel, texel));
    let normal = DVec3::new(0.5 * n.x, n.z, 0.5 * n.y).normalize();
    let truth = straight * normal.dot(DVec3::from_array(SUN));
    let found = mean(&seen(&scaled, 0.0, false, &sun(1.0)));
    assert!((found - truth).abs() < 2e-4 && (truth / straight - SUN[1]).abs() > 0.01, "{found} instead of {truth}");
}

/// As blocks, normals lose their length and half a step of 1 / 127.5 in x and y, and z follows: within 0.01 along any
/// direction here.
#[test]
fn normals_of_blocks_are_those_of_their_texels() {
    let plain = sheet(WHITE, texture([255; 3], [255; 3]));
    let options = format!("{BY_SUN} --sun {},{},{}", SUN[0], SUN[1], SUN[2]);
    let straight = mean(&seen(&plain, 0.0, false, &options)) / SUN[1];
    // Of a length of 1, 0.8 and 1.2, and with z below zero, which is taken without its sign.
    for texel in [[171u8, 90, 240], [162, 98, 212], [180, 82, 255], [171, 90, 15]] {
        let n = texel.map(|c| f64::from(c) / 255.0 * 2.0 - 1.0);
        let n = DVec3::new(n[0], n[1], n[2].abs()).normalize();
        let one = sheet(Material { normal_texture: 0, ..WHITE }, texture(texel, texel));
        let found = mean(&seen_as(TextureEncoding::Bc7, &one, 0.0, false, &options)) / straight;
        // Tangent along x, bitangent along z.
        let along = |[x, y, z]: [f64; 3]| DVec3::new(x, z, y).dot(DVec3::from_array(SUN));
        let truth = along(n.to_array());
        assert!((found - truth).abs() < 0.01, "{texel:?}: {found} instead of {truth}");
        // Controls: x and y exchanged, and z left out.
        for other in [[n.y, n.x, n.z], [n.x, n.y, 0.0]] {
            assert!((found - along(other)).abs() > 0.03, "{texel:?}: {found}, {other:?}");
        }
    }
}

#[test]
fn occlusion_emission_and_unlit_colours_are_what_their_textures_say() {
    let by_sky = "--effects primary --sun-intensity 0";
    let open = mean(&seen(&sheet(WHITE, texture([0; 3], [0; 3])), 0.0, false, by_sky));
    let grey = texture([51; 3], [51; 3]);
    let occluded = Material { occlusion_texture: 0, occlusion_strength: 0.75, ..WHITE };
    let found = mean(&seen(&sheet(occluded, grey.clone()), 0.0, false, by_sky));
    let truth = open * (1.0 + 0.75 * (51.0 / 255.0 - 1.0));
    assert!((found - truth).abs() < 1e-5, "{found} instead of {truth}");
    // The sun has shadows of its own.
    let [lit, unoccluded] = [occluded, WHITE].map(|m| mean(&seen(&sheet(m, grey.clone()), 0.0, false, BY_SUN)));
    assert!((lit - unoccluded).abs() < 1e-6, "{lit} of {unoccluded}");

    let dark = "--effects primary --sun-intensity 0 --sky-intensity 0";
    let linear = ((188.0 / 255.0 + 0.055) / 1.055f64).powf(2.4);
    let of_texel = texture([188; 3], [188; 3]);
    let glowing = Material { emission: [3.0; 3], emissive_texture: 0, ..WHITE };
    for effects in ["primary", "shadow"] {
        let found = mean(&seen(&sheet(glowing, of_texel.clone()), 0.0, false, &dark.replace("primary", effects)));
        assert!((found - 3.0 * linear).abs() < 1e-4, "{found} instead of {}", 3.0 * linear);
    }
    let unlit = Material { flags: MATERIAL_UNLIT, base_color: [0.5; 4], base_color_texture: 0, ..WHITE };
    for options in [dark, by_sky, BY_SUN] {
        let found = mean(&seen(&sheet(unlit, of_texel.clone()), 0.0, false, options));
        assert!((found - 0.5 * linear).abs() < 1e-4, "{options}: {found} instead of {}", 0.5 * linear);
    }
    let plain = Material { base_color: [0.5; 4], ..unlit };
    let plain = sheet(Material { flags: MATERIAL_DOUBLE_SIDED, ..plain }, of_texel);
    assert_eq!(mean(&seen(&plain, 0.0, false, dark)), 0.0, "lit surfaces are dark in the dark");
}

#[test]
fn metal_is_where_blue_says_and_rough_where_green_does() {
    let material = Material { metallic: 1.0, metallic_roughness_texture: 0, ..WHITE };
    // Metal to the right, where the sun stands beside what it mirrors.
    let map = texture([255, 64, 0], [255, 64, 255]);
    let one = sheet(material, map);
    let options = format!("{BY_SUN} --sun 0.8,0.6,0");
    let [left, right] = [-0.5, 0.5].map(|x| mean(&seen(&one, x, false, &options)));
    let plain = mean(&seen(&sheet(WHITE, texture([0; 3], [0; 3])), 0.0, false, &options));
    assert!((left / plain - 1.0).abs() < 1e-4, "no metal: {left} of {plain}");
    assert!(right < 0.3 * plain, "metal: {right} of {plain}");
    // A rougher one spreads more that far.
    let rougher = sheet(material, texture([255, 255, 255], [255, 255, 255]));
    let spread = mean(&seen(&rougher, 0.0, false, &options));
    assert!(spread > 1.5 * right, "{spread} of a rough metal, {right} of a smoother one");
}

#[test]
fn coordinates_are_those_of_the_set_and_transformed() {
    let map = texture([255; 3], [0; 3]);
    let picture = |material: Material| seen(&sheet(material, map.clone()), 0.0, false, BY_SUN);
    let lit = mean(&picture(WHITE));
    let halves = |picture: &[f32]| {
        let of = |test: &dyn Fn(usize, usize) -> bool| {
            let all: Vec<f32> = (0..256).filter(|i| test(i % 16, i / 16)).map(|i| picture[i]).collect();
            mean(&all) / lit
        };
        [of(&|x, _| x < 6), of(&|x, _| x > 9), of(&|_, y| y < 6), of(&|_, y| y > 9)]
    };
    let is = |found: [f64; 4], truth: [f64; 4]| {
        assert!(found.iter().zip(truth).all(|(f, t)| (f - t).abs() < 0.02), "{found:?} instead of {truth:?}");
    };
    let by_set = Material { base_color_texture: 0, ..WHITE };
    is(halves(&picture(by_set)), [1.0, 0.0, 0.5, 0.5]);
    // s = (3 - z) - 1 + ..: 3 at z = -1 down to 1 at z = 1, so that (s - 1) / 2 falls with z; the picture's y is z.
    let mut second = Material { uv_sets: 1, ..by_set };
    (second.uv_from_set[0], second.uv_from_set[1]) = ([0.5, 0.0, -0.5, 0.25], [0.0, 0.5, -1.0, 0.0]);
    is(halves(&picture(second)), [0.5, 0.5, 0.0, 1.0]);
    let mut turned = by_set;
    (turned.uv_from_set[0], turned.uv_from_set[1]) = ([-1.0, 0.0, 1.0, 1.0], [0.0, 1.0, 0.0, 0.0]);
    is(halves(&picture(turned)), [0.0, 1.0, 0.5, 0.5]);
}
