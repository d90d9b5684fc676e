//! What metals, polished and coated surfaces reflect: against closed forms and integrals in f64, in furnaces, and by
//! two ways to draw the same light.

use crate::common;
use brickwalk::frame::Seen;
use brickwalk::picture::denoise::Denoiser;
use brickwalk::scene::Camera;
use exr::prelude::*;
use glam::DVec3;
use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::path::{Path, PathBuf};

/// A glTF file of quads, each of a material, converted. Corners go round; normals are the geometric ones, texture
/// coordinates (x + 1) / 2 and (y + 1) / 2. Texture 0 is the file `map.png` beside it.
pub(super) fn converted(folder: &Path, name: &str, materials: &str, quads: &[([[f32; 3]; 4], usize)]) -> PathBuf {
    let mut bytes = Vec::new();
    let (mut views, mut accessors, mut primitives) = (Vec::new(), Vec::new(), Vec::new());
    for (i, (corners, material)) in quads.iter().enumerate() {
        let offset = bytes.len();
        let triangles = [0, 1, 2, 0, 2, 3].map(|k: usize| corners[k]);
        bytes.extend(triangles.iter().flatten().flat_map(|x| x.to_le_bytes()));
        let uvs = triangles.iter().flat_map(|[x, y, _]| [x, y].map(|c| 0.5 * c + 0.5));
        bytes.extend(uvs.flat_map(f32::to_le_bytes));
        views.push(format!(r#"{{"buffer": 0, "byteOffset": {offset}, "byteLength": 72}}"#));
        views.push(format!(r#"{{"buffer": 0, "byteOffset": {}, "byteLength": 48}}"#, offset + 72));
        let (least, greatest) =
            ([0, 1, 2].map(|k| bound(corners, k, f32::min)), [0, 1, 2].map(|k| bound(corners, k, f32::max)));
        accessors.push(format!(
            r#"{{"bufferView": {}, "componentType": 5126, "count": 6, "type": "VEC3",
            "min": {least:?}, "max": {greatest:?}}}"#,
            2 * i
        ));
        let view = 2 * i + 1;
        accessors.push(format!(r#"{{"bufferView": {view}, "componentType": 5126, "count": 6, "type": "VEC2"}}"#));
        let attributes = format!(r#"{{"POSITION": {}, "TEXCOORD_0": {view}}}"#, 2 * i);
        primitives.push(format!(r#"{{"attributes": {attributes}, "material": {material}}}"#));
    }
    let text = format!(
        r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0]}}], "nodes": [{{"mesh": 0}}],
        "extensionsUsed": ["KHR_materials_clearcoat", "KHR_materials_emissive_strength", "KHR_materials_volume"],
        "images": [{{"uri": "map.png"}}], "textures": [{{"source": 0}}],
        "materials": [{materials}], "meshes": [{{"primitives": [{}]}}], "accessors": [{}], "bufferViews": [{}],
        "buffers": [{{"uri": "{name}.bin", "byteLength": {}}}]}}"#,
        primitives.join(","),
        accessors.join(","),
        views.join(","),
        bytes.len()
    );
    std::fs::write(folder.join(format!("{name}.bin")), bytes).expect("a buffer");
    let input = folder.join(format!("{name}.gltf"));
    std::fs::write(&input, text).expect("a scene");
    let scene = folder.join(format!("{name}.bricks"));
    common::succeed(["convert".as_ref(), input.as_os_str(), "-o".as_ref(), scene.as_os_str()]);
    scene
}

fn bound(corners: &[[f32; 3]; 4], k: usize, of: fn(f32, f32) -> f32) -> f32 {
    corners.iter().map(|c| c[k]).reduce(of).expect("four")
}

/// A white material.
fn white(metallic: f64, roughness: f64, coat: f64) -> String {
    format!(
        r#"{{"doubleSided": true,
        "pbrMetallicRoughness": {{"metallicFactor": {metallic}, "roughnessFactor": {roughness}}},
        "extensions": {{"KHR_materials_clearcoat": {{"clearcoatFactor": {coat}, "clearcoatRoughnessFactor": 0.2}}}}}}"#
    )
}

/// A material that shines and reflects nothing.
pub(super) fn glow(radiance: f64) -> String {
    format!(
        r#"{{"doubleSided": true, "emissiveFactor": [1,1,1],
        "pbrMetallicRoughness": {{"baseColorFactor": [0,0,0,1], "metallicFactor": 1}},
        "extensions": {{"KHR_materials_emissive_strength": {{"emissiveStrength": {radiance}}}}}}}"#
    )
}

pub(super) fn path(folder: &Path, name: &str, fov: f64, position: [f64; 3], target: [f64; 3]) -> String {
    let file = folder.join(format!("{name}.json"));
    let text = format!(
        r#"{{"fov_y_degrees": {fov}, "up": [0.1,1,0.2],
        "keyframes": [{{"time": 0, "position": {position:?}, "target": {target:?}}}]}}"#
    );
    std::fs::write(&file, text).expect("a camera path");
    file.display().to_string()
}

/// The channels of one frame of 32 x 32.
pub(super) fn render(scene: &Path, path: &str, options: &str) -> BTreeMap<String, Vec<f32>> {
    let output = scene.with_extension("walk");
    common::walk(scene, &output, &format!("--frames 1 --size 32x32 --aov --cache 100% --path {path} {options}"));
    let image = read_all_flat_layers_from_file(output.join("frames/0000.exr")).expect("an EXR");
    let list = &image.layer_data[0].channel_data.list;
    list.iter().map(|channel| (channel.name.to_string(), channel.sample_data.values_as_f32().collect())).collect()
}

/// The mean red of the pixels that show a surface.
pub(super) fn mean(channels: &BTreeMap<String, Vec<f32>>) -> f64 {
    let hit: Vec<usize> = (0..32 * 32).filter(|&i| channels["depth.Z"][i].is_finite()).collect();
    assert!(hit.len() > 250, "{} pixels show a surface", hit.len());
    hit.iter().map(|&i| f64::from(channels["R"][i])).sum::<f64>() / hit.len() as f64
}

/// The sides of a cube from -1 to 1, of material 0, turned outward.
pub(super) fn cube() -> Vec<([[f32; 3]; 4], usize)> {
    let mut quads = Vec::new();
    for axis in 0..3 {
        for side in [-1.0f32, 1.0] {
            let corner = |u: f32, v: f32| {
                let mut p = [0.0; 3];
                (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (side, u * side, v);
                p
            };
            quads.push(([corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)], 0));
        }
    }
    quads
}

/// Options of light that is reflected alone, from an environment of stripes of three degrees.
fn stripes(folder: &Path) -> String {
    let image = folder.join("stripes.exr");
    let stripe = |x: usize| if (x / 4).is_multiple_of(2) { 0.9f32 } else { 0.1 };
    write_rgb_file(&image, 480, 240, |x, _| (stripe(x), stripe(x), stripe(x))).expect("an environment");
    format!("--environment {} --sun-intensity 0 --effects glossy --rotation full", image.display())
}

/// On the way past a mirror its history ends, as what it shows moves otherwise than its surface. The control takes the
/// mirror for matt.
#[test]
fn a_walk_past_a_mirror_leaves_no_trail() {
    let folder = common::folder();
    let scene = converted(folder.path(), "mirror", &white(1.0, 0.0, 0.0), &cube());
    let light = stripes(folder.path());
    let open = |samples: &str| common::renderer(&scene, &format!("--size 32x32 --cache 100% {samples} {light}"));
    let mut renderer = open("--spp 2 --denoise");
    let camera = |k: u32| {
        // Half a stripe a frame.
        let angle = 0.9 + f64::from(k) * 1.5f64.to_radians();
        let position = 5.0 * DVec3::new(angle.sin(), 0.4, angle.cos());
        Camera { position, target: DVec3::ZERO, up: DVec3::Y, fov_y: 50f64.to_radians() }
    };
    let (mut denoiser, mut matt) = (Denoiser::default(), Denoiser::default());
    let last = 7;
    let mut pictures = [const { Vec::new() }; 3];
    let mut hits = Vec::new();
    for k in 0..=last {
        let output = renderer.frame(k, &camera(k)).expect("a frame");
        let (noisy, guides) = (output.pixels.radiance, output.guides.expect("guides"));
        hits = guides.seen.iter().map(Seen::is_hit).collect();
        let mut as_matt = guides.clone();
        as_matt.seen.iter_mut().for_each(|seen| seen.polish = 0.0);
        pictures = [noisy.clone(), noisy.clone(), noisy];
        denoiser.frame(guides, &mut pictures[1]);
        matt.frame(as_matt, &mut pictures[2]);
    }
    let truth = open("--spp 512").frame(last, &camera(last)).expect("a frame").pixels.radiance;
    let error = |picture: &[[f32; 3]]| {
        let of = (0..truth.len()).filter(|&i| hits[i]).map(|i| f64::from(picture[i][0] - truth[i][0]).powi(2));
        of.sum::<f64>().sqrt()
    };
    let [noisy, denoised, control] = pictures.each_ref().map(|picture| error(picture));
    println!("noisy {noisy}, denoised {denoised}, taken for matt {control}");
    assert!(denoised < 1.1 * noisy && control > 2.0 * denoised, "{noisy} {denoised} {control}");
}

/// The filter leaves mirrors as they are, and takes noise from rough metal.
#[test]
fn mirrored_things_stay_sharp_under_the_denoiser() {
    let folder = common::folder();
    let folder = folder.path();
    let view = path(folder, "outside", 50.0, [3.0, 2.0, 4.0], [0.0; 3]);
    let light = stripes(folder);
    for (roughness, bound) in [(0.0, 1.1), (0.5, 0.7)] {
        let scene = converted(folder, &format!("metal-{roughness}"), &white(1.0, roughness, 0.0), &cube());
        let seen = |options: &str| render(&scene, &view, &format!("{light} {options}"));
        let truth = seen("--spp 512 --seed 5");
        let error = |found: BTreeMap<String, Vec<f32>>| {
            let hit = (0..32 * 32).filter(|&i| truth["depth.Z"][i].is_finite());
            hit.map(|i| f64::from(found["R"][i] - truth["R"][i]).powi(2)).sum::<f64>().sqrt()
        };
        let [noisy, denoised] = ["--spp 2", "--spp 2 --denoise"].map(|options| error(seen(options)));
        println!("{roughness}: {noisy} {denoised}");
        assert!(denoised < bound * noisy, "roughness {roughness}: {denoised} of {noisy}");
    }
}

#[test]
fn white_objects_vanish_in_a_uniform_environment_whatever_their_gloss() {
    let folder = common::folder();
    let folder = folder.path();
    let view = path(folder, "outside", 50.0, [3.0, 2.0, 4.0], [0.0; 3]);
    let image = folder.join("even.exr");
    write_rgb_file(&image, 32, 16, |_, _| (0.7f32, 0.7f32, 0.7f32)).expect("an environment");
    let seen = |scene: &Path, options: &str| {
        mean(&render(scene, &view, &format!("--environment {} {options}", image.display()))) / 0.7
    };
    for (i, (metallic, roughness, coat)) in [
        (1.0, 0.0, 0.0),
        (1.0, 0.15, 0.0),
        (1.0, 0.4, 0.0),
        (1.0, 0.7, 0.0),
        (1.0, 1.0, 0.0),
        (0.0, 0.0, 0.0),
        (0.0, 0.5, 0.0),
        (0.0, 1.0, 1.0),
        (0.5, 0.6, 0.0),
    ]
    .into_iter()
    .enumerate()
    {
        let scene = converted(folder, &format!("white-{i}"), &white(metallic, roughness, coat), &cube());
        let what = format!("metallic {metallic}, roughness {roughness}, coat {coat}");
        // Some 500 pixels times 256 samples of what varies by about its mean where light is drawn by the environment:
        // 0.3 %.
        let ways = [
            ("glossy,diffuse --diffuse-rays 1 --rotation full --spp 256", 0.005),
            ("environment,glossy --spp 512", 0.005),
            ("environment,diffuse,glossy --diffuse-rays 2 --rotation full --spp 256", 0.005),
        ];
        for (effects, within) in ways {
            let found = seen(&scene, &format!("--effects {effects}"));
            println!("{what}: {found} by {effects}");
            assert!((found - 1.0).abs() < within, "{what}: {found} by {effects}");
        }
        // Sharper lobes are seldom met that way.
        if roughness >= 0.7 && coat == 0.0 {
            let found = seen(&scene, "--effects environment --spp 512");
            assert!((found - 1.0).abs() < 0.012, "{what}: {found} by rays to the environment alone");
        }
        // The table brings it at once.
        let found = seen(&scene, "--effects primary");
        assert!((found - 1.0).abs() < 0.005, "{what}: {found} unshadowed");
    }
    let grey =
        white(1.0, 0.5, 0.0).replace(r#""metallicFactor""#, r#""baseColorFactor": [0.5,0.5,0.5,1], "metallicFactor""#);
    let found = seen(&converted(folder, "grey", &grey, &cube()), "--effects environment,glossy --spp 32");
    assert!(found < 0.6, "a grey metal does not vanish: {found}");
}

/// White walls lose nothing: all light that comes into an open box leaves it again, after enough bounces.
#[test]
fn an_open_white_box_vanishes_after_many_bounces() {
    let folder = common::folder();
    let folder = folder.path();
    let view = path(folder, "into", 40.0, [0.2, 0.1, 3.5], [0.0, 0.0, -0.2]);
    let image = folder.join("even.exr");
    write_rgb_file(&image, 32, 16, |_, _| (0.7f32, 0.7f32, 0.7f32)).expect("an environment");
    // Without the side at z = 1.
    let open: Vec<_> = cube().into_iter().filter(|(corners, _)| corners.iter().any(|p| p[2] < 1.0)).collect();
    assert_eq!(open.len(), 5);
    // Metal alone reflects into a wide lobe without a diffuse part: its pictures have more noise.
    for (metallic, roughness, coat, samples) in
        [(0.0, 1.0, 0.0, 64), (0.0, 0.4, 0.0, 64), (1.0, 0.6, 0.0, 256), (0.0, 0.8, 1.0, 64)]
    {
        let scene = converted(folder, "open", &white(metallic, roughness, coat), &open);
        let seen = |options: &str| {
            let light = format!("--environment {} --spp {samples}", image.display());
            let options = format!("{light} --diffuse-rays 1 --effects {options}");
            mean(&render(&scene, &view, &options)) / 0.7
        };
        let what = format!("metallic {metallic}, roughness {roughness}, coat {coat}");
        for effects in ["environment,diffuse,glossy", "diffuse,glossy", "path"] {
            let found = seen(&format!("{effects} --bounces 64"));
            println!("{what}: {found} by {effects}");
            assert!((found - 1.0).abs() < 0.01, "{what}: {found} by {effects}");
        }
        // The control: what comes by one bounce is not all.
        let found = seen("environment,diffuse,glossy --bounces 1");
        assert!(found < 0.95, "{what}: {found} by one bounce");
    }
}

/// What a white metal reflects of light from `d`, times its cosine, in f64: Trowbridge–Reitz with Smith's masking,
/// correlated, over what that reflects of light from everywhere (Turquin 2019: the rest leaves after more bounces
/// between facets, spread alike).
fn reflected(roughness: f64, view: [f64; 3], d: [f64; 3]) -> f64 {
    let (rows, columns) = (800, 400);
    let direction = |i: i32| {
        let c = (f64::from(i / columns) + 0.5) / f64::from(rows);
        let phi = 2.0 * PI * (f64::from(i % columns) + 0.5) / f64::from(columns);
        [(1.0 - c * c).sqrt() * phi.cos(), c, (1.0 - c * c).sqrt() * phi.sin()]
    };
    let all = (0..rows * columns).map(|i| once(roughness, view, direction(i))).sum::<f64>();
    once(roughness, view, d) / (all * 2.0 * PI / f64::from(rows * columns))
}

/// Of one bounce.
fn once(roughness: f64, view: [f64; 3], d: [f64; 3]) -> f64 {
    let a2 = roughness.powi(4);
    let length = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let normal = |v: [f64; 3]| v.map(|x| x / length(v));
    let (o, i) = (normal(view), normal(d));
    let h = normal([0, 1, 2].map(|k| o[k] + i[k]));
    let q = h[1] * h[1] * (a2 - 1.0) + 1.0;
    let root = |c: f64| (a2 + (1.0 - a2) * c * c).sqrt();
    let masked = 0.5 / (i[1] * root(o[1]) + o[1] * root(i[1]));
    a2 / (PI * q * q) * masked * i[1]
}

const FLOOR: [[f32; 3]; 4] = [[-50.0, 0.0, -50.0], [-50.0, 0.0, 50.0], [50.0, 0.0, 50.0], [50.0, 0.0, -50.0]];

#[test]
fn a_polished_floor_reflects_a_lamp_by_its_distribution_however_it_is_drawn() {
    let folder = common::folder();
    let folder = folder.path();
    // A square of radiance 5 two metres above and ahead; the floor is seen from the other side.
    let square = [[1.5f32, 2.0, -0.5], [2.5, 2.0, -0.5], [2.5, 2.0, 0.5], [1.5, 2.0, 0.5]];
    let eye = [-2.0, 2.2, 0.1];
    let view = path(folder, "down", 0.2, eye, [0.0; 3]);
    for roughness in [0.2, 0.35] {
        let quads = [(FLOOR, 0), (square, 1)];
        let materials = format!("{},{}", white(1.0, roughness, 0.0), glow(5.0));
        let scene = converted(folder, &format!("floor-{roughness}"), &materials, &quads);
        // Over the square, by a grid: the cosine of the square over the squared distance.
        let steps = 20;
        let mut truth = 0.0;
        for i in 0..steps * steps {
            let [x, z] = [i % steps, i / steps].map(|k| (f64::from(k) + 0.5) / f64::from(steps));
            let d = [1.5 + x, 2.0, z - 0.5];
            let squared = d.iter().map(|x| x * x).sum::<f64>();
            truth += 5.0 * reflected(roughness, eye, d) * 2.0 / squared.sqrt() / squared / f64::from(steps * steps);
        }
        let dark = "--sun-intensity 0 --sky-intensity 0 --effects";
        for (effects, within) in
            [("shadow --spp 256", 0.02), ("glossy --spp 64", 0.02), ("shadow,glossy --spp 64", 0.02)]
        {
            let found = mean(&render(&scene, &view, &format!("{dark} {effects}")));
            assert!((found / truth - 1.0).abs() < within, "{roughness}: {found} by {effects}, not {truth}");
        }
    }
}

#[test]
fn the_sun_is_reflected_with_its_disc_however_it_is_drawn() {
    let folder = common::folder();
    let folder = folder.path();
    let eye = [-0.4, 0.8, -0.45];
    for (roughness, angle, within) in [(0.3, 0.53, 0.02), (0.1, 4.0, 0.03)] {
        let scene = converted(folder, &format!("sun-{roughness}"), &white(1.0, roughness, 0.0), &[(FLOOR, 0)]);
        // From where the sun is mirrored, and a little beside.
        let view = path(folder, "mirrored", 0.2, [eye[0] * 10.0 + 0.4, eye[1] * 10.0, eye[2] * 10.0], [0.0; 3]);
        let light = format!("--sky-intensity 0 --sun-intensity 1 --sun 0.4,0.8,0.45 --sun-angle {angle} --effects");
        let found = |effects: &str| mean(&render(&scene, &view, &format!("{light} {effects}")));
        let (lamp, both) = (found("shadow --spp 256"), found("shadow,glossy --spp 256"));
        assert!((lamp / both - 1.0).abs() < within, "{lamp} by rays to the sun, {both} by both");
        if roughness > 0.2 {
            // Of a small sun: its colour times pi is the irradiance, red is 0.60 of the intensity.
            let of_sun = [0.4, 0.8, 0.45].map(|x: f64| x / 0.4f64.hypot(0.8).hypot(0.45));
            let truth = 0.6 * PI * reflected(roughness, [eye[0] * 10.0 + 0.4, eye[1] * 10.0, eye[2] * 10.0], of_sun);
            assert!((both / truth - 1.0).abs() < 0.03, "{both}, not {truth}");
        }
    }
}

#[test]
fn a_smooth_metal_is_a_mirror_and_a_smooth_dielectric_shows_four_hundredths() {
    let folder = common::folder();
    let folder = folder.path();
    let ceiling = [[-50.0f32, 5.0, -50.0], [50.0, 5.0, -50.0], [50.0, 5.0, 50.0], [-50.0, 5.0, 50.0]];
    let view = path(folder, "above", 1.0, [0.0, 3.0, 0.0], [0.0; 3]);
    let black =
        white(0.0, 0.0, 0.0).replace(r#""metallicFactor""#, r#""baseColorFactor": [0,0,0,1], "metallicFactor""#);
    for (name, material, truth) in [("metal", white(1.0, 0.0, 0.0), 0.8), ("polish", black, 0.032)] {
        let scene = converted(folder, name, &format!("{material},{}", glow(0.8)), &[(FLOOR, 0), (ceiling, 1)]);
        let seen = render(&scene, &view, "--sun-intensity 0 --sky-intensity 0 --effects glossy");
        assert!((mean(&seen) / truth - 1.0).abs() < 0.01, "{name}: {} instead of {truth}", mean(&seen));
        let without = mean(&render(&scene, &view, "--sun-intensity 0 --sky-intensity 0 --effects primary"));
        assert!(without < 1e-6, "{name} without its rays: {without}");
    }
}
