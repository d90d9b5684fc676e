//! Effects against closed forms: what a surface reflects of a sky behind a wall, inside an emissive box, in a mirror, under a
//! rectangular light.

mod common;

use exr::prelude::*;
use std::path::Path;

/// A view straight down on the point x, 0, 0 from a height of 3, a few centimetres wide.
fn down_on(folder: &Path, x: f64) -> String {
    let path = folder.join("down.json");
    let text = format!(
        r#"{{"fov_y_degrees": 1, "up": [0,0,1], "keyframes": [{{"time": 0, "position": [{x},3,0], "target": [{x},0,0]}}]}}"#
    );
    std::fs::write(&path, text).expect("a camera path");
    path.display().to_string()
}

/// Converts an OBJ file with its materials.
fn converted(folder: &Path, name: &str, materials: &str, shape: &str) -> std::path::PathBuf {
    std::fs::write(folder.join(format!("{name}.mtl")), materials).expect("materials");
    let input = folder.join(format!("{name}.obj"));
    std::fs::write(&input, format!("mtllib {name}.mtl\n{shape}")).expect("a shape");
    let scene = folder.join(format!("{name}.bricks"));
    common::succeed(["convert".as_ref(), input.as_os_str(), "-o".as_ref(), scene.as_os_str()]);
    scene
}

/// The red radiance of every pixel of one frame of 16 x 16.
fn render(scene: &Path, path: &str, options: &str) -> Vec<f32> {
    let output = scene.with_extension("walk");
    common::walk(scene, &output, &format!("--frames 1 --size 16x16 --aov --cache 100% --path {path} {options}"));
    let image = read_all_flat_layers_from_file(output.join("frames/0000.exr")).expect("an EXR");
    let red = image.layer_data[0].channel_data.list.iter().find(|channel| channel.name.to_string() == "R");
    let values: Vec<f32> = red.expect("red").sample_data.values_as_f32().collect();
    assert_eq!(values.len(), 256);
    values
}

fn mean(values: &[f32]) -> f64 {
    values.iter().map(|&x| f64::from(x)).sum::<f64>() / values.len() as f64
}

const FLOOR: &str = "v -200 0 -200\nv -200 0 200\nv 200 0 200\nv 200 0 -200\n";

#[test]
fn occlusion_by_a_wall_is_its_form_factor() {
    let folder = common::folder();
    let folder = folder.path();
    let wall = "v 0 0 -200\nv 0 1 -200\nv 0 1 200\nv 0 0 200\n";
    let shape = format!("{FLOOR}{wall}usemtl white\nf 1 2 3 4\nf 5 6 7 8\n");
    let scene = converted(folder, "wall", "newmtl white\nKd 1 1 1\n", &shape);
    let path = down_on(folder, 1.0);
    let light = "--sun-intensity 0 --effects";
    let open = mean(&render(&scene, &path, &format!("{light} primary")));
    let share = |options: &str| mean(&render(&scene, &path, &format!("{light} ao --spp 4 {options}"))) / open;
    // A strip of height h that begins at distance d hides (1 - d / sqrt(d^2 + h^2)) / 2 of the cosine-weighted hemisphere.
    let truth = 1.0 - 0.5 * (1.0 - 0.5f64.sqrt());
    // 256 directions of the Halton sequence, turned by 256 pixels: its discrepancy is of the order of ln(n)^2 / n = 0.1, and much
    // less after turning; the wall ends after 200.
    let measured = share("--ao-rays 64 --ao-length 400 --rotation full");
    assert!((measured - truth).abs() < 0.01, "{measured} of the sky's light, not {truth}");
    // Rays that end before the wall find nothing.
    let short = share("--ao-rays 4 --ao-length 0.9");
    assert!((short - 1.0).abs() < 1e-5, "{short}");
}

const BOX: &str = "v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1\n";
const SIDES: &str = "f 1 2 3 4\nf 5 8 7 6\nf 1 5 6 2\nf 4 3 7 8\nf 1 4 8 5\nf 2 6 7 3\n";

#[test]
fn a_closed_emissive_box_gathers_one_bounce() {
    let folder = common::folder();
    let folder = folder.path();
    let scene = converted(
        folder,
        "box",
        "newmtl glow\nKd 0.5 0.5 0.5\nKe 0.25 0.25 0.25\n",
        &format!("{BOX}usemtl glow\n{SIDES}"),
    );
    let path = folder.join("inside.json");
    let text = r#"{"fov_y_degrees": 90, "up": [0,1,0], "keyframes": [{"time": 0, "position": [0.1,0.2,0.3], "target": [0.7,-0.1,1]}]}"#;
    std::fs::write(&path, text).expect("a camera path");
    let path = path.display().to_string();
    let dark = "--sun-intensity 0 --sky-intensity 0 --effects";
    // No ray leaves the box, so there is no noise: emission, and the reflected share of it.
    let gathered = render(&scene, &path, &format!("{dark} diffuse --diffuse-rays 5 --rotation full"));
    assert!(gathered.iter().all(|x| (x - 0.375).abs() < 1e-5), "{gathered:?}");
    let alone = render(&scene, &path, &format!("{dark} primary"));
    assert!(alone.iter().all(|x| (x - 0.25).abs() < 1e-6), "{alone:?}");
    // Half a mirror shows half of the surface and half of what it sees.
    let mirrored = render(&scene, &path, &format!("{dark} mirror"));
    assert!(mirrored.iter().all(|x| (x - 0.25).abs() < 1e-6), "{mirrored:?}");
}

#[test]
fn mirrors_show_half_of_what_is_opposite() {
    let folder = common::folder();
    let folder = folder.path();
    let ceiling = "v -200 5 -200\nv -200 5 200\nv 200 5 200\nv 200 5 -200\n";
    let materials = "newmtl black\nKd 0 0 0\nnewmtl glow\nKd 0 0 0\nKe 0.8 0.8 0.8\n";
    let shape = format!("{FLOOR}{ceiling}usemtl black\nf 1 2 3 4\nusemtl glow\nf 5 6 7 8\n");
    let scene = converted(folder, "mirror", materials, &shape);
    let path = down_on(folder, 0.0);
    let seen = render(&scene, &path, "--effects mirror,shadow");
    assert!(seen.iter().all(|x| (x - 0.4).abs() < 1e-6), "{seen:?}");
    assert!(mean(&render(&scene, &path, "--effects shadow")) < 0.01, "the floor itself is black");
}

#[test]
fn a_rectangular_light_gives_its_form_factor() {
    let folder = common::folder();
    let folder = folder.path();
    let white = "newmtl white\nKd 1 1 1\n";
    let open = converted(folder, "open", white, &format!("{FLOOR}usemtl white\nf 1 2 3 4\n"));
    let path = down_on(folder, 0.0);
    let light = |v: &str| format!("--sun-intensity 0 --sky-intensity 0 --rect-light -0.5,1,-0.5,1,0,0,{v} --spp 16");
    // Hamilton and Morgan's factor of a point below the middle of a square of twice its height's half: four quarters of x = y = 1/2.
    let x = 0.5 / 1.25f64.sqrt();
    let truth = 10.0 * 4.0 / std::f64::consts::PI * x * x.atan();
    // 4096 points, of which the irradiance varies by a quarter: 0.4 %, five times that is allowed.
    for effects in ["shadow", "primary"] {
        let measured = mean(&render(&open, &path, &format!("{} --effects {effects}", light("0,0,1"))));
        assert!((measured / truth - 1.0).abs() < 0.02, "{effects}: {measured}, not {truth}");
    }
    // It shines to one side, and what lies between casts a shadow.
    assert_eq!(mean(&render(&open, &path, &format!("{} --effects shadow", light("0,0,-1")))), 0.0);
    let cover =
        "v -2 0.5 -2\nv -2 0.5 2\nv -0.1 0.5 2\nv -0.1 0.5 -2\nv 0.1 0.5 -2\nv 0.1 0.5 2\nv 2 0.5 2\nv 2 0.5 -2\n";
    let shape = format!("{FLOOR}{cover}usemtl white\nf 1 2 3 4\nf 5 6 7 8\nf 9 10 11 12\n");
    let covered = converted(folder, "covered", white, &shape);
    let shadowed = mean(&render(&covered, &path, &format!("{} --effects shadow", light("0,0,1"))));
    let unshadowed = mean(&render(&covered, &path, &format!("{} --effects primary", light("0,0,1"))));
    assert!(shadowed < 0.5 * unshadowed && shadowed > 0.0, "{shadowed} of {unshadowed}");
}
