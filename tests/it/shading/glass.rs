//! Bodies that refract: closed forms of slabs, white things in furnaces, the sides of lamps.

use super::gloss::{converted, cube, glow, mean, path, render};
use crate::common;
use exr::prelude::write_rgb_file;
use std::path::Path;

/// A material of glass; attenuation over a distance of 2 to this share.
fn glass(index: f64, roughness: f64, left: f64) -> String {
    format!(
        r#"{{"pbrMetallicRoughness": {{"metallicFactor": 0, "roughnessFactor": {roughness}}},
        "extensions": {{"KHR_materials_ior": {{"ior": {index}}},
        "KHR_materials_transmission": {{"transmissionFactor": 1}},
        "KHR_materials_volume": {{"thicknessFactor": 2, "attenuationDistance": 2,
        "attenuationColor": [{left}, 1, 0.5]}}}}}}"#
    )
}

/// An environment of one radiance, and the options that leave it alone.
fn even(folder: &Path) -> String {
    let image = folder.join("even.exr");
    write_rgb_file(&image, 32, 16, |_, _| (1.0f32, 1.0f32, 1.0f32)).expect("an environment");
    format!("--environment {} --sun-intensity 0", image.display())
}

/// Seen along the normals of two of its sides, a cube of glass is a slab: what it reflects and lets pass is a geometric
/// series.
#[test]
fn a_slab_reflects_absorbs_and_passes_as_its_series() {
    let folder = common::folder();
    let folder = folder.path();
    let view = path(folder, "ahead", 2.0, [0.0, 0.0, 30.0], [0.0; 3]);
    let light = even(folder);
    for (index, left) in [(1.0, 0.3), (1.5, 1.0), (1.5, 0.3), (2.4, 0.6)] {
        let scene = converted(folder, &format!("slab-{index}-{left}"), &glass(index, 0.0, left), &cube());
        // The slab fills the view.
        let seen = |options: &str| {
            let found = &render(&scene, &view, &format!("{light} --spp 256 {options}"))["R"];
            found.iter().map(|&x| f64::from(x)).sum::<f64>() / found.len() as f64
        };
        let f = ((index - 1.0) / (index + 1.0f64)).powi(2);
        let series = 1.0 - f * f * left * left;
        let reflected = f + (1.0 - f) * (1.0 - f) * f * left * left / series;
        let expected = reflected + (1.0 - f) * (1.0 - f) * left / series;
        let found = seen("--effects path --bounces 16 --diffuse-rays 1");
        println!("{index} {left}: {found}, {expected}");
        assert!((found - expected).abs() < 0.006, "{index}, {left}: {found} instead of {expected}");
        // Where paths do not follow light it passes straight through, unchanged, beside what is reflected.
        let found = seen("--effects glossy");
        assert!((found - 1.0).abs() < 0.01, "{index}, {left}: {found} as thin walls");
    }
}

/// With so many bounces as many ways within the slab are followed, the last by a ray through its facets.
#[test]
fn the_last_bounce_shows_what_lies_behind_glass() {
    let folder = common::folder();
    let folder = folder.path();
    let view = path(folder, "ahead", 2.0, [0.0, 0.0, 30.0], [0.0; 3]);
    let light = even(folder);
    let index = 2.4f64;
    let scene = converted(folder, "slab", &glass(index, 0.0, 1.0), &cube());
    let f = ((index - 1.0) / (index + 1.0)).powi(2);
    let expected = |ways: i32| f + (0..ways).map(|k| (1.0 - f) * (1.0 - f) * f.powi(k)).sum::<f64>();
    for bounces in [2, 3, 4] {
        let options = format!("{light} --spp 1024 --effects path --diffuse-rays 1 --bounces {bounces}");
        let found = mean(&render(&scene, &view, &options));
        println!("{bounces}: {found}, {}", expected(bounces));
        assert!((found - expected(bounces)).abs() < 0.004, "{bounces}: {found} instead of {}", expected(bounces));
    }
    assert!(expected(2) - expected(1) > 0.1 && expected(3) - expected(2) > 0.015, "control");
}

/// Light that enters a white body leaves it: nothing is lost but between facets of rough ones, and nothing is gained.
#[test]
fn clear_glass_vanishes_in_a_uniform_environment() {
    let folder = common::folder();
    let folder = folder.path();
    let view = path(folder, "outside", 50.0, [3.0, 2.0, 4.0], [0.0; 3]);
    let light = even(folder);
    for (index, roughness, least) in [(1.5, 0.0, 0.995), (2.0, 0.0, 0.99), (1.5, 0.3, 0.9), (1.5, 0.7, 0.4)] {
        let scene = converted(folder, &format!("clear-{index}-{roughness}"), &glass(index, roughness, 1.0), &cube());
        let options = format!("{light} --effects path --bounces 64 --diffuse-rays 1 --spp 64");
        let found = mean(&render(&scene, &view, &options));
        println!("{index} {roughness}: {found}");
        assert!((least..1.005).contains(&found), "{index}, {roughness}: {found}");
    }
}

/// Each half of a picture of a wall or body whose texture says how much passes is that of one without a texture. Light
/// comes from behind and from before.
#[test]
fn as_much_passes_as_a_texture_says() {
    let folder = common::folder();
    let folder = folder.path();
    let view = path(folder, "ahead", 3.0, [0.0, 0.0, 30.0], [0.0; 3]);
    let square =
        |side: f32, z: f32| [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[x, y]| [side * x, side * y, z]);
    // What the right and the left half let pass; alpha of the texture is of no use.
    let [left, right] = [60u8, 255];
    let texels = image::RgbaImage::from_fn(8, 8, |x, _| image::Rgba([if x < 4 { left } else { right }, 9, 0, 77]));
    texels.save(folder.join("map.png")).expect("a texture");
    let material = |share: f64, texture: &str, more: &str| {
        format!(
            r#"{{"doubleSided": true,
            "pbrMetallicRoughness": {{"metallicFactor": 0, "baseColorFactor": [0.6, 0.6, 0.6, 1]}},
            "extensions": {{"KHR_materials_transmission": {{"transmissionFactor": {share} {texture}}} {more}}}}},
            {}"#,
            glow(12.0)
        )
    };
    let texture = r#", "transmissionTexture": {"index": 0}"#;
    // Light goes straight through this one, so that no half sees the other.
    let body = r#", "KHR_materials_volume": {"thicknessFactor": 1}, "KHR_materials_ior": {"ior": 1}"#;
    let specular = r#", "KHR_materials_specular": {"specularColorFactor": [1, 0.5, 0.5], "specularFactor": 0.75}"#;
    let lights = "--sun 0.2,0.3,1 --sky-intensity 0.5 --spp 256 --seed 3";
    for (what, more, solid, effects) in [
        ("wall", specular, false, "primary,glossy"),
        ("wall of paths", "", false, "path --bounces 2"),
        ("body seen straight through", body, true, "primary,glossy"),
        ("body", body, true, "path --bounces 3"),
    ] {
        let mut quads = if solid { cube() } else { vec![(square(1.0, 0.0), 0)] };
        quads.push((square(3.0, -5.0), 1));
        // Means of columns away from the middle.
        let seen = |share: f64, texture: &str| {
            let scene = converted(folder, "passing", &material(share, texture, more), &quads);
            let found = &render(&scene, &view, &format!("{lights} --effects {effects}"))["R"];
            [0..13, 19..32].map(|columns| {
                let all = found.iter().enumerate().filter(|(i, _)| columns.contains(&(i % 32)));
                all.map(|(_, &x)| f64::from(x)).sum::<f64>() / (32.0 * columns.len() as f64)
            })
        };
        let found = seen(0.9, texture);
        let expected = [seen(0.9 * f64::from(left) / 255.0, "")[0], seen(0.9 * f64::from(right) / 255.0, "")[1]];
        println!("{what}: {found:?}, {expected:?}");
        for (found, expected) in found.into_iter().zip(expected) {
            assert!((found - expected).abs() < 0.015 * expected, "{what}: {found} instead of {expected}");
        }
        assert!((expected[0] - expected[1]).abs() > 0.3 * expected[0], "control: {what}: {expected:?}");
    }
}

/// A lamp of one side is black from behind, to the camera and to rays that go on; one of two sides is not.
#[test]
fn lamps_shine_to_their_front_alone() {
    let folder = common::folder();
    let folder = folder.path();
    let square = [[-0.5f32, -0.5, 0.0], [0.5, -0.5, 0.0], [0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]];
    let seen = |name: &str, material: &str, z: f64| {
        let scene = converted(folder, name, material, &[(square, 0)]);
        let view = path(folder, name, 20.0, [0.0, 0.0, z], [0.0; 3]);
        mean(&render(&scene, &view, "--sun-intensity 0 --sky-intensity 0 --effects path --spp 4"))
    };
    let both = glow(3.0);
    let front = both.replace("\"doubleSided\": true,", "");
    assert!((seen("front", &front, 2.0) - 3.0).abs() < 1e-3);
    assert_eq!(seen("behind", &front, -2.0), 0.0);
    assert!((seen("both", &both, -2.0) - 3.0).abs() < 1e-3);
}
