//! Many samples a pixel show what a larger picture of fewer does, textures among it: a sample reads the level that its
//! share of the pixel asks for.

use crate::common;
use bricks::{MATERIAL_DOUBLE_SIDED, Material, NONE};
use brickwalk::scene::Camera;
use brickwalk::session::opened::{Opened, open_scene};
use brickwalk::session::renderer::renderer;
use brickwalk_convert::build::{BuildSettings, build};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{IDENTITY, Mesh, Placement, Primitive, SourceScene, SourceTexture};
use glam::DVec3;
use std::path::{Path, PathBuf};

/// Pixels of the small picture.
const SIZE: [usize; 2] = [48, 32];
/// Pixels of the large one for each of the small one, each way.
const FACTOR: usize = 8;

/// Bumps of all directions, a texel each; of a `height` of 1 up to some 50 degrees.
fn bumps(height: f64) -> SourceTexture {
    let side = 256u32;
    let hash = |x: u32| (x.wrapping_mul(0x9E37_79B9) ^ (x >> 7)).wrapping_mul(0x85EB_CA6B) >> 24;
    let texel = |i: u32| {
        let [x, y] = [hash(2 * i), hash(2 * i + 1)].map(|h| 0.75 * height * (f64::from(h) / 127.5 - 1.0));
        let n = DVec3::new(x, y, 0.8).normalize() * 127.5 + 127.5;
        [n.x.round() as u8, n.y.round() as u8, n.z.round() as u8, 255]
    };
    SourceTexture {
        name: "bumps".into(),
        width: side,
        height: side,
        wrap: 0,
        rgba: (0..side * side).flat_map(texel).collect(),
    }
}

/// Metal of a roughness in 1/255, of `side` texels each way.
fn metal(side: u32, roughness: u8) -> SourceTexture {
    SourceTexture {
        name: "metal".into(),
        width: side,
        height: side,
        wrap: 0,
        rgba: [255, roughness, 255, 255].repeat((side * side) as usize),
    }
}

/// A floor that recedes to its far end, of a material whose textures are `bumps` and `roughness`.
fn floor(folder: &Path, name: &str, material: Material, textures: [SourceTexture; 2]) -> PathBuf {
    let primitive = Primitive {
        positions: vec![[-8.0, 0.0, -8.0], [-8.0, 0.0, 8.0], [8.0, 0.0, 8.0], [8.0, 0.0, -8.0]],
        normals: Some(vec![[0.0, 1.0, 0.0]; 4]),
        uvs: Some(vec![[0.0, 0.0], [0.0, 2.0], [2.0, 2.0], [2.0, 0.0]]),
        tangents: Some(vec![[1.0, 0.0, 0.0, -1.0]; 6]),
        indices: vec![0, 1, 2, 0, 2, 3],
        ..Primitive::default()
    };
    let source = SourceScene {
        meshes: vec![Mesh { name: "floor".into(), primitives: vec![primitive] }],
        placements: vec![Placement { world_from_mesh: IDENTITY, ..Placement::default() }],
        materials: vec![Material { flags: MATERIAL_DOUBLE_SIDED, ..material }],
        textures: textures.into(),
        sources: vec![bricks::Source { name: "t".into(), bytes: 0, hash: "2d06800538d394c2".into() }],
        ..SourceScene::default()
    };
    let path = folder.join(name);
    build(source, &BuildSettings::default(), &path, &Progress::hidden()).expect("a scene");
    path
}

/// Where the camera stands, and the sun.
type View = ([f64; 3], &'static str);

/// Low above the floor, under a low sun.
const LOW: View = ([0.0, 2.5, 9.0], "0.7,0.4,0.6");
/// High above it, under a high sun.
const HIGH: View = ([0.0, 9.0, 7.0], "0.2,1,-0.5");

/// The red radiance of a picture by the sun alone.
fn picture(scene: &Path, (eye, sun): View, [width, height]: [usize; 2], samples: u32) -> Vec<f64> {
    let options = "--adapter cpu --cache 100% --frames 1 --effects primary --sky-intensity 0 --sun";
    let settings = common::settings(&format!("--size {width}x{height} --spp {samples} {options} {sun}"));
    let opened = Opened::open(open_scene(scene).expect("the scene"), scene, &settings).expect("a session");
    let camera = Camera {
        position: DVec3::from_array(eye),
        target: DVec3::new(0.0, 0.0, 2.0),
        up: DVec3::Y,
        fov_y: 40f64.to_radians(),
    };
    let output = renderer(opened, scene, &settings).expect("lamps").frame(0, &camera).expect("a frame");
    output.pixels.radiance.iter().map(|c| f64::from(c[0])).collect()
}

/// How a picture is off another: the relative difference of the means, and the mean difference of pixels over the mean.
fn off(found: &[f64], truth: &[f64]) -> [f64; 2] {
    let mean = truth.iter().sum::<f64>() / truth.len() as f64;
    let differences: Vec<f64> = found.iter().zip(truth).map(|(f, t)| f - t).collect();
    let over = |sum: f64| sum / (truth.len() as f64 * mean);
    [over(differences.iter().sum()), over(differences.iter().map(|d| d.abs()).sum())]
}

/// What a small picture of many samples is to show, from a large one.
fn truth(scene: &Path, view: View) -> Vec<f64> {
    let large = picture(scene, view, SIZE.map(|s| s * FACTOR), 1);
    let block = |i: usize| {
        let (x, y) = (i % SIZE[0] * FACTOR, i / SIZE[0] * FACTOR);
        let texel = |k: usize| large[(y + k / FACTOR) * SIZE[0] * FACTOR + x + k % FACTOR];
        (0..FACTOR * FACTOR).map(texel).sum::<f64>() / (FACTOR * FACTOR) as f64
    };
    (0..SIZE[0] * SIZE[1]).map(block).collect()
}

#[test]
fn many_samples_show_what_a_larger_picture_does() {
    let folder = common::folder();
    let [plain, bumpy] = [NONE, 0].map(|normal_texture| {
        let material = Material { normal_texture, ..Material::DIFFUSE };
        floor(folder.path(), &format!("{normal_texture}.bricks"), material, [bumps(1.0), metal(1, 89)])
    });
    let samples = (FACTOR * FACTOR) as u32;
    let of = |scene| off(&picture(scene, LOW, SIZE, samples), &truth(scene, LOW));
    let [off_plain, off_bumpy] = [&plain, &bumpy].map(|scene| of(scene));
    println!("mean and pixels off: {off_plain:?} without bumps, {off_bumpy:?} with them");
    assert!(off_bumpy[0].abs() < 0.01, "{off_bumpy:?}");
    assert!(off_bumpy[1] < off_plain[1] + 0.03, "{off_bumpy:?} with bumps, {off_plain:?} without");
    // Control: levels as wide as pixels show.
    let coarse = off(&picture(&bumpy, LOW, SIZE, 1), &truth(&bumpy, LOW));
    assert!(coarse[0].abs() > 0.02, "one sample is {coarse:?} off");
}

/// In highlights of a metal with bumps a coarse level shows about what the fine one does: the roughness beside it
/// stands for them. `docs/results/textures.md` has other bumps and views.
#[test]
fn roughness_stands_for_bumps_that_are_averaged() {
    let folder = common::folder();
    let material = Material {
        metallic: 1.0,
        roughness: 1.0,
        normal_texture: 0,
        metallic_roughness_texture: 1,
        ..Material::DIFFUSE
    };
    for height in [0.1, 0.25, 0.5, 1.0] {
        for roughness in [50, 89, 150] {
            // One of the same size as the bumps, and one of another, which can stand for nothing.
            let scenes = [256, 1].map(|side| {
                let textures = [bumps(height), metal(side, roughness)];
                floor(folder.path(), &format!("{side}.bricks"), material, textures)
            });
            let of = |view| {
                let truth = truth(&scenes[1], view);
                scenes
                    .each_ref()
                    .map(|scene| [1, 16].map(|samples| off(&picture(scene, view, SIZE, samples), &truth)[1]))
            };
            let (highlight, far) = (of(HIGH), of(LOW));
            println!(
                "height {height}, roughness {roughness}, with and without: {highlight:.2?}, far from it {far:.2?}"
            );
            // Bumps that are much wider than the highlight have no lobe.
            if roughness > 50 && (0.25..1.0).contains(&height) {
                let [with, without] = highlight;
                assert!((0..2).all(|k| with[k] < 0.8 * without[k]), "pixels are {with:?} off, {without:?} without");
            }
        }
    }
}
