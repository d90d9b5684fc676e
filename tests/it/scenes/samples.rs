//! The sample models of other projects: each shows the feature that it is there for.

use crate::common;
use exr::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Pixels each way.
const SIDE: usize = 64;

/// What a picture of the whole of a model shows.
struct Shown {
    /// Pixels that show a surface.
    hit: usize,
    /// Their mean albedo.
    albedo: [f64; 3],
    /// Distinct albedos, in steps of 1/32.
    colours: usize,
    /// Mean radiance.
    radiance: [f64; 3],
    /// Lines of standard error of the conversion.
    said: Vec<String>,
}

fn shown(input: &Path, options: &str) -> Shown {
    let folder = common::folder();
    let scene = folder.path().join("s.bricks");
    let words = ["convert".as_ref(), input.as_os_str(), "-o".as_ref(), scene.as_os_str()];
    let done = common::brickwalk(words);
    let said = String::from_utf8_lossy(&done.stderr).into_owned();
    assert!(done.status.success(), "{}: {said}", input.display());
    let output = folder.path().join("o");
    common::walk(&scene, &output, &format!("--frames 1 --size {SIDE}x{SIDE} --aov --cache 100% {options}"));
    let image = read_all_flat_layers_from_file(output.join("frames/0000.exr")).expect("an EXR");
    let list = &image.layer_data[0].channel_data.list;
    let all: BTreeMap<String, Vec<f32>> =
        list.iter().map(|c| (c.name.to_string(), c.sample_data.values_as_f32().collect())).collect();
    let hit: Vec<usize> = (0..SIDE * SIDE).filter(|&i| all["depth.Z"][i].is_finite()).collect();
    let mean =
        |names: [&str; 3]| names.map(|n| hit.iter().map(|&i| f64::from(all[n][i])).sum::<f64>() / hit.len() as f64);
    let albedo = ["albedo.R", "albedo.G", "albedo.B"];
    let colours: BTreeSet<[u32; 3]> = hit.iter().map(|&i| albedo.map(|n| (all[n][i] * 32.0).round() as u32)).collect();
    Shown {
        hit: hit.len(),
        albedo: mean(albedo),
        colours: colours.len(),
        radiance: mean(["R", "G", "B"]),
        said: said.lines().map(String::from).collect(),
    }
}

fn near(a: [f64; 3], b: [f64; 3], within: f64) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() < within)
}

#[test]
fn textures_of_every_container_and_transformation_are_seen() {
    let Some(scenes) = common::shared_scenes() else { return };
    let stress = scenes.join("stress");
    // WebP, KTX2 with Basis, JPEG beside Draco, an embedded one.
    for (file, least) in [
        ("BoxTexturedWebp/BoxTexturedWebp.gltf", 10),
        ("CesiumBalloon/CesiumBalloonKTX2.glb", 20),
        ("DracoCompressed/CesiumMilkTruck.gltf", 20),
        ("asset-generator/Buffer_Interleaved/Buffer_Interleaved_00.gltf", 10),
    ] {
        let seen = shown(&stress.join(file), "--effects primary");
        assert!(seen.hit > 100 && seen.colours >= least, "{file}: {} colours on {} pixels", seen.colours, seen.hit);
    }
    // Quantised coordinates with a KHR_texture_transform: all ducks are as yellow as the plain one.
    let plain = shown(&stress.join("DucksMeshopt/Duck.glb"), "--effects primary");
    assert!(plain.albedo[0] > 2.0 * plain.albedo[2] && plain.colours > 10, "{:?}", plain.albedo);
    for bits in ["9-vt-9-vn-9", "12-vt-12-vn-12", "15-vt-15-vn-15"] {
        let duck = shown(&stress.join(format!("DucksMeshopt/Duck-vp-{bits}.glb")), "--effects primary");
        assert!(near(duck.albedo, plain.albedo, 0.03), "{bits}: {:?} instead of {:?}", duck.albedo, plain.albedo);
    }
}

#[test]
fn colours_of_vertices_and_of_factors_are_seen() {
    let Some(scenes) = common::shared_scenes() else { return };
    let generator = scenes.join("stress/asset-generator");
    // One picture, whatever the accessor's type.
    let colours = |i: u32| {
        let file = generator.join(format!("Mesh_PrimitiveVertexColor/Mesh_PrimitiveVertexColor_0{i}.gltf"));
        shown(&file, "--effects primary")
    };
    let first = colours(0);
    assert!(first.colours > 50, "{} colours", first.colours);
    for i in 1..6 {
        let other = colours(i);
        assert!(near(other.albedo, first.albedo, 0.01), "{i}: {:?} instead of {:?}", other.albedo, first.albedo);
    }
    let two = shown(&generator.join("Mesh_Primitives/Mesh_Primitives_00.gltf"), "--effects primary");
    assert_eq!(two.colours, 2, "two primitives of a colour each");
}

#[test]
fn metal_mirrors_what_is_around() {
    let Some(scenes) = common::shared_scenes() else { return };
    let teapots = scenes.join("teapots_instanced/TeapotsGalore.gltf");
    let bunny = scenes.join("stress/bunny_meshopt.glb");
    for file in [teapots, bunny] {
        let light = "--sun-intensity 0 --effects";
        let without = shown(&file, &format!("{light} primary")).radiance;
        let with = shown(&file, &format!("{light} glossy --spp 4")).radiance;
        // What is around is then no longer the sky alone.
        assert!(!near(without, with, 1e-3), "{}: {without:?}", file.display());
        assert!(with.iter().all(|c| *c > 0.0), "{with:?}");
    }
}

#[test]
fn what_is_not_read_is_named_once() {
    let Some(scenes) = common::shared_scenes() else { return };
    let folder = scenes.join("stress/asset-generator/Node_NegativeScale");
    for i in [0, 6, 12] {
        let seen = shown(&folder.join(format!("Node_NegativeScale_{i:02}.gltf")), "--effects primary");
        let missing: Vec<_> = seen.said.iter().filter(|line| line.contains("MetallicRoughness_Nodes.png")).collect();
        assert_eq!(missing.len(), 1, "{:?}", seen.said);
        assert!(seen.colours > 10 && seen.hit > 100, "{i}: {} colours", seen.colours);
    }
    let modes = shown(&scenes.join("stress/MeshPrimitiveModes/MeshPrimitiveModes.gltf"), "--effects primary");
    let left: Vec<_> = modes.said.iter().filter(|line| line.contains("points")).collect();
    assert_eq!(left.len(), 1, "{:?}", modes.said);
}
