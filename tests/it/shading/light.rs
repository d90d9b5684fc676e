//! Effects against closed forms: what a surface reflects of a sky behind a wall, inside an emissive box,
//! under rectangular lights, surfaces that emit, points, spots and distant lights, in uniform environments and under a
//! single bright texel.

use crate::common;
use bricks::{MATERIAL_DOUBLE_SIDED, Material};
use brickwalk::kernels::lamps::{Emitter, Lamps, Shape};
use brickwalk::scene::path::CameraPath;
use brickwalk::session::opened::{Opened, open_scene};
use brickwalk::session::renderer::renderer;
use brickwalk_convert::build::{BuildSettings, build};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{Mesh, Placement, Primitive, SourceScene};
use exr::prelude::*;
use glam::DVec3;
use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::path::Path;
use std::sync::Arc;

/// A view straight down on the point x, 0, 0 from a height of 3, a few centimetres wide.
fn down_on(folder: &Path, x: f64) -> String {
    let path = folder.join("down.json");
    let text = format!(
        r#"{{"fov_y_degrees": 1, "up": [0,0,1],
        "keyframes": [{{"time": 0, "position": [{x},3,0], "target": [{x},0,0]}}]}}"#
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
    let values = channels(&output.join("frames/0000.exr")).remove("R").expect("red");
    assert_eq!(values.len(), 256);
    values
}

/// The channels of an EXR by their names.
fn channels(file: &Path) -> BTreeMap<String, Vec<f32>> {
    let image = read_all_flat_layers_from_file(file).expect("an EXR");
    let list = &image.layer_data[0].channel_data.list;
    list.iter().map(|channel| (channel.name.to_string(), channel.sample_data.values_as_f32().collect())).collect()
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
    // A strip of height h that begins at distance d hides (1 - d / sqrt(d^2 + h^2)) / 2 of the cosine-weighted
    // hemisphere.
    let truth = 1.0 - 0.5 * (1.0 - 0.5f64.sqrt());
    // 256 directions of the Halton sequence, turned by 256 pixels: its discrepancy is of the order of ln(n)^2 / n =
    // 0.1, and much less after turning; the wall ends after 200.
    let measured = share("--ao-rays 64 --ao-length 400 --rotation full");
    assert!((measured - truth).abs() < 0.01, "{measured} of the sky's light, not {truth}");
    // Rays that end before the wall find nothing.
    let short = share("--ao-rays 4 --ao-length 0.9");
    assert!((short - 1.0).abs() < 1e-5, "{short}");
    // Of few rays the mean is right, too, within three standard errors of 1024 that know nothing of each other.
    let few = share("--ao-rays 1 --ao-length 400 --rotation full");
    let error = (truth * (1.0 - truth) / 1024.0).sqrt();
    assert!((few - truth).abs() < 3.0 * error, "{few} of the sky's light, not {truth}");
    // Control: directions that are turned alone have four heights.
    let turned = share("--ao-rays 1 --ao-length 400 --rotation 359");
    assert!((turned - truth).abs() > 3.0 * error, "{turned}");
    // The samples of a pixel are spread over the hemisphere: they err by less than chance. Control: samples of 16
    // pictures, which know nothing of each other, do not.
    let pixels = |options: &str| {
        render(&scene, &path, &format!("{light} ao --ao-rays 1 --ao-length 400 --rotation full {options}"))
    };
    let by_chance = truth * (1.0 - truth) / 16.0;
    let error = |pixels: &[f32]| {
        let square = |&x: &f32| (f64::from(x) / open - truth).powi(2) as f32;
        mean(&pixels.iter().map(square).collect::<Vec<_>>()) / by_chance
    };
    let pictures: Vec<_> = (0..16).map(|seed| pixels(&format!("--spp 1 --seed {seed}"))).collect();
    let apart: Vec<f32> = (0..256).map(|i| pictures.iter().map(|picture| picture[i]).sum::<f32>() / 16.0).collect();
    let (spread, apart) = (error(&pixels("--spp 16")), error(&apart));
    assert!(spread < 0.65 && apart > 0.8, "{spread}, apart {apart}");
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
    let text = r#"{"fov_y_degrees": 90, "up": [0,1,0],
        "keyframes": [{"time": 0, "position": [0.1,0.2,0.3], "target": [0.7,-0.1,1]}]}"#;
    std::fs::write(&path, text).expect("a camera path");
    let path = path.display().to_string();
    let dark = "--sun-intensity 0 --sky-intensity 0 --effects";
    // No ray leaves the box, so there is no noise: emission, and the reflected share of it.
    let gathered = render(&scene, &path, &format!("{dark} diffuse --diffuse-rays 5 --rotation full"));
    assert!(gathered.iter().all(|x| (x - 0.375).abs() < 1e-5), "{gathered:?}");
    let alone = render(&scene, &path, &format!("{dark} primary"));
    assert!(alone.iter().all(|x| (x - 0.25).abs() < 1e-6), "{alone:?}");
    // Of n bounces it is a geometric series. Up to two, no path ends by chance.
    let series = |n: i32| 0.25 * (1.0 - 0.5f64.powi(n + 1)) / 0.5;
    for n in [2, 5, 64] {
        let paths = render(&scene, &path, &format!("{dark} diffuse --diffuse-rays 5 --spp 8 --bounces {n}"));
        let within = if n == 2 { 1e-5 } else { 0.005 * series(n) };
        assert!((mean(&paths) - series(n)).abs() < within, "{n} bounces: {}, not {}", mean(&paths), series(n));
    }
    // By rays to the walls as lamps as well, which bring a bounce more. In the corners few of them bring most.
    for n in [2, 64] {
        let lit = format!("{dark} shadow,diffuse --diffuse-rays 1 --spp 512 --bounces {n}");
        let lit = mean(&render(&scene, &path, &lit));
        assert!((lit - series(n + 1)).abs() < 0.02 * series(n + 1), "{n} bounces: {lit}, not {}", series(n + 1));
    }
}

#[test]
fn a_rectangular_light_gives_its_form_factor() {
    let folder = common::folder();
    let folder = folder.path();
    let white = "newmtl white\nKd 1 1 1\n";
    let open = converted(folder, "open", white, &format!("{FLOOR}usemtl white\nf 1 2 3 4\n"));
    let path = down_on(folder, 0.0);
    let light = |v: &str| format!("--sun-intensity 0 --sky-intensity 0 --rect-light -0.5,1,-0.5,1,0,0,{v} --spp 16");
    // Hamilton and Morgan's factor of a point below the middle of a square of twice its height's half: four quarters of
    // x = y = 1/2.
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

/// Radiance and vertices of a polygon: what it sheds on a white floor at the origin, by Lambert's formula. It does not
/// reach below.
fn polygon(radiance: f64, corners: &[DVec3]) -> f64 {
    let edge = |i: usize| {
        let (a, b) = (corners[i].normalize(), corners[(i + 1) % corners.len()].normalize());
        a.dot(b).acos() * a.cross(b).normalize().y
    };
    (0..corners.len()).map(edge).sum::<f64>().abs() / 2.0 * radiance / PI
}

/// The red radiance of a frame of 16 x 16 with these emitters beside the options.
fn lit(scene: &Path, path: &str, options: &str, emitters: &[Emitter]) -> Vec<f32> {
    let settings = common::settings(&format!("--size 16x16 --cache 100% --frames 1 {options}"));
    let opened = Opened::open(open_scene(scene).expect("the scene"), scene, &settings).expect("a session");
    let mut renderer = renderer(opened, scene, &settings).expect("lamps");
    renderer.light.lamps = Arc::new(Lamps::new(None, emitters.to_vec(), 10.0));
    let camera = CameraPath::read(Path::new(path)).expect("a path").frame(0, 1);
    renderer.frame(0, &camera).expect("a frame").pixels.radiance.iter().map(|c| c[0]).collect()
}

#[test]
fn surfaces_that_emit_light_others_by_lamberts_formula() {
    let folder = common::folder();
    let folder = folder.path();
    let materials = "newmtl white\nKd 1 1 1\nnewmtl glow\nKd 0 0 0\nKe 10 10 10\n";
    // A square and a triangle of the same material, beside the view.
    let corners = [
        [1.0, 1.0, -0.5],
        [2.0, 1.0, -0.5],
        [2.0, 1.0, 0.5],
        [1.0, 1.0, 0.5],
        [-3.0, 0.5, 0.0],
        [-1.0, 1.0, 1.0],
        [-2.0, 2.0, -1.0],
    ];
    let vertices: String = corners.iter().map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect();
    let shape = format!("{FLOOR}{vertices}usemtl white\nf 1 2 3 4\nusemtl glow\nf 5 6 7 8\nf 9 10 11\n");
    let scene = converted(folder, "glow", materials, &shape);
    let path = down_on(folder, 0.0);
    let corners = corners.map(DVec3::from_array);
    let truth = polygon(10.0, &corners[..4]) + polygon(10.0, &corners[4..]);
    let dark = "--sun-intensity 0 --sky-intensity 0 --diffuse-rays 4 --rotation full --spp 64 --effects";
    // 16384 points, of which the light varies by less than all of it: 0.8 %; of four times as many rays that meet it by
    // chance, 2.5 %.
    for (effects, bound) in [("shadow", 0.03), ("shadow,diffuse", 0.03), ("diffuse", 0.08)] {
        let measured = mean(&render(&scene, &path, &format!("{dark} {effects}")));
        assert!((measured / truth - 1.0).abs() < bound, "{effects}: {measured}, not {truth}");
    }
    assert_eq!(mean(&render(&scene, &path, &format!("{dark} primary"))), 0.0, "without either nothing arrives");
    // A triangle shines to its front alone, unless both of its sides do.
    let [corner, b, c] = [corners[4], corners[5], corners[6]];
    let triangle = |b: DVec3, c: DVec3, two_sided: bool| Emitter {
        shape: Shape::Triangle { corner, edges: [b - corner, c - corner] },
        two_sided,
        radiance: [10.0; 3],
    };
    let open = converted(folder, "open", "newmtl white\nKd 1 1 1\n", &format!("{FLOOR}usemtl white\nf 1 2 3 4\n"));
    let shed = |emitter: Emitter| mean(&lit(&open, &path, &format!("{dark} shadow"), &[emitter]));
    let truth = polygon(10.0, &corners[4..]);
    let sides = [shed(triangle(b, c, false)), shed(triangle(c, b, false))];
    let (front, back) = (sides[0].max(sides[1]), sides[0].min(sides[1]));
    assert!(back == 0.0 && (front / truth - 1.0).abs() < 0.03, "{sides:?}, not {truth}");
    for both in [shed(triangle(b, c, true)), shed(triangle(c, b, true))] {
        assert!((both / truth - 1.0).abs() < 0.03, "{both}, not {truth}");
    }
}

/// A mirror turns triangles over; their front stays their front (glTF 2.0, section 3.7.4).
#[test]
fn mirrored_lamps_shine_to_their_front() {
    let square = |half: f64| Primitive {
        positions: [[-half, 0.0, -half], [-half, 0.0, half], [half, 0.0, half], [half, 0.0, -half]].to_vec(),
        indices: vec![0, 1, 2, 0, 2, 3],
        ..Primitive::default()
    };
    let placed = |name: &str, mesh: u32, y: f64, scale_y: f64| Placement {
        name: name.into(),
        under: Vec::new(),
        mesh,
        source: 0,
        world_from_mesh: [1.0, 0.0, 0.0, 0.0, 0.0, scale_y, 0.0, y, 0.0, 0.0, 1.0, 0.0],
    };
    let of = |name: &str, scale_y: f64| {
        let floor = Mesh { name: "floor".into(), primitives: vec![square(200.0)] };
        let lamp = Mesh { name: "lamp".into(), primitives: vec![Primitive { material: 1, ..square(0.5) }] };
        let white = Material { base_color: [1.0; 4], flags: MATERIAL_DOUBLE_SIDED, ..Material::GREY };
        let glow = Material { emission: [10.0; 3], flags: 0, ..Material::GREY };
        // Its front, at +Y, looks away from the floor unless it is turned over.
        let source = SourceScene {
            meshes: vec![floor, lamp],
            placements: vec![placed("floor", 0, 0.0, 1.0), placed("lamp", 1, 4.0, scale_y)],
            materials: vec![white, glow],
            ..brickwalk_scenes::one_mesh("lamp", Primitive::default())
        };
        let folder = common::folder();
        let scene = folder.path().join(format!("{name}.bricks"));
        build(source, &BuildSettings::default(), &scene, &Progress::hidden()).expect("a scene");
        let dark = "--sun-intensity 0 --sky-intensity 0 --effects shadow --spp 64";
        mean(&render(&scene, &down_on(folder.path(), 0.0), dark))
    };
    let corners = [[-0.5, 4.0, -0.5], [0.5, 4.0, -0.5], [0.5, 4.0, 0.5], [-0.5, 4.0, 0.5]].map(DVec3::from_array);
    let (truth, found) = (polygon(10.0, &corners), of("turned", -1.0));
    assert!((found / truth - 1.0).abs() < 0.03, "{found}, not {truth}");
    assert_eq!(of("as it is", 1.0), 0.0, "control: it shines to one side alone");
}

#[test]
fn points_spots_and_distant_lights_have_their_closed_forms() {
    let folder = common::folder();
    let folder = folder.path();
    let scene = converted(folder, "open", "newmtl white\nKd 1 1 1\n", &format!("{FLOOR}usemtl white\nf 1 2 3 4\n"));
    let path = down_on(folder, 0.0);
    let dark = "--sun-intensity 0 --sky-intensity 0 --effects shadow";
    let shed = |shapes: &[Shape], options: &str| {
        let emitters: Vec<Emitter> =
            shapes.iter().map(|&shape| Emitter { shape, two_sided: false, radiance: [3.0; 3] }).collect();
        mean(&lit(&scene, &path, &format!("{dark} {options}"), &emitters))
    };
    let near = |found: f64, truth: f64| assert!((found / truth - 1.0).abs() < 1e-3, "{found}, not {truth}");
    let at = |position: DVec3, range: f64| Shape::Point { position, range };
    // Intensity * cos / distance^2 / pi.
    near(shed(&[at(DVec3::Y * 2.0, 0.0)], ""), 3.0 / 4.0 / PI);
    near(shed(&[at(DVec3::Y * 4.0, 0.0)], ""), 3.0 / 16.0 / PI);
    near(shed(&[at(DVec3::new(3.0, 4.0, 0.0), 0.0)], ""), 3.0 * 0.8 / 25.0 / PI);
    near(shed(&[at(DVec3::Y * 2.0, 4.0)], ""), 3.0 / 4.0 / PI * (1.0 - 0.5f64.powi(4)));
    assert_eq!(shed(&[at(DVec3::Y * 2.0, 1.9)], ""), 0.0);
    assert_eq!(shed(&[at(DVec3::Y * -2.0, 0.0)], ""), 0.0, "from below nothing arrives");
    let direction = DVec3::new(0.6, -0.8, 0.0);
    near(shed(&[Shape::Distant { direction }], ""), 3.0 * 0.8 / PI);
    // Spots tilted from the origin by an angle: inside, between and outside of their cones.
    let spot = |tilt: f64| Shape::Spot {
        position: DVec3::Y * 2.0,
        direction: DVec3::new(tilt.sin(), -tilt.cos(), 0.0),
        range: 0.0,
        cone: [0.3, 0.6],
    };
    near(shed(&[spot(0.2)], ""), 3.0 / 4.0 / PI);
    let between = (0.45f64.cos() - 0.6f64.cos()) / (0.3f64.cos() - 0.6f64.cos());
    near(shed(&[spot(0.45)], ""), 3.0 / 4.0 / PI * between * between);
    assert_eq!(shed(&[spot(0.65)], ""), 0.0);
    // One of several is drawn by its power: 16384 draws of what varies by less than twice its mean.
    let several =
        [at(DVec3::Y * 2.0, 0.0), at(DVec3::new(3.0, 4.0, 0.0), 0.0), spot(0.2), Shape::Distant { direction }];
    let truth: f64 = several.iter().map(|&shape| shed(&[shape], "")).sum();
    let measured = shed(&several, "--spp 64");
    assert!((measured / truth - 1.0).abs() < 0.04, "{measured}, not {truth}");
}

/// Writes an environment of `width` x `height` texels of equal channels.
fn environment(
    folder: &Path,
    name: &str,
    (width, height): (usize, usize),
    radiance: impl Fn(usize, usize) -> f32 + Sync,
) -> String {
    let path = folder.join(name);
    let texel = |x: usize, y: usize| (radiance(x, y), radiance(x, y), radiance(x, y));
    write_rgb_file(&path, width, height, texel).expect("an environment");
    path.display().to_string()
}

#[test]
fn a_white_object_vanishes_in_a_uniform_environment() {
    let folder = common::folder();
    let folder = folder.path();
    let path = folder.join("outside.json");
    let text =
        r#"{"fov_y_degrees": 50, "up": [0,1,0], "keyframes": [{"time": 0, "position": [3,2,4], "target": [0,0,0]}]}"#;
    std::fs::write(&path, text).expect("a camera path");
    let around = environment(folder, "uniform.exr", (64, 32), |_, _| 0.7);
    let seen = |scene: &Path, options: &str| {
        let output = scene.with_extension("walk");
        let view = format!("--frames 1 --size 48x48 --aov --cache 100% --path {}", path.display());
        common::walk(scene, &output, &format!("{view} --environment {around} {options}"));
        let all = channels(&output.join("frames/0000.exr"));
        let is_hit = |i: &usize| all["depth.Z"][*i].is_finite();
        let (hit, missed): (Vec<usize>, Vec<usize>) = (0..48 * 48).partition(is_hit);
        assert!(hit.len() > 500 && missed.len() > 500);
        [hit, missed].map(|of| of.iter().map(|&i| f64::from(all["R"][i])).sum::<f64>() / of.len() as f64 / 0.7)
    };
    let scene = converted(folder, "white", "newmtl white\nKd 1 1 1\n", &format!("{BOX}usemtl white\n{SIDES}"));
    // Half of the directions meet a face, weighted by up to 4 times the mean: 1.3 of it, over 500,000 draws 0.2 %.
    let [object, around] = seen(&scene, "--effects environment --spp 512");
    // Pixels at the rim show both.
    assert!((object - 1.0).abs() < 0.005 && (around - 1.0).abs() < 1e-3, "{object} before {around}");
    // By harmonics, and by diffuse rays, none of which meets a convex object again.
    for effects in ["primary", "diffuse --rotation full --diffuse-rays 2"] {
        let [object, _] = seen(&scene, &format!("--effects {effects}"));
        assert!((object - 1.0).abs() < 2e-3, "{effects}: {object}");
    }
    let grey = converted(folder, "grey", "newmtl grey\nKd 0.8 0.8 0.8\n", &format!("{BOX}usemtl grey\n{SIDES}"));
    let [object, _] = seen(&grey, "--effects environment --spp 64");
    assert!((object - 0.8).abs() < 0.02, "a grey one shows: {object}");
}

/// An environment of 1 in a quarter of the directions around +Y and 0.1 in the others, all the way down: a white
/// surface that faces up reflects 0.325. It is uneven: the mean square is 2.44 times the squared mean.
fn quarter(folder: &Path) -> String {
    environment(folder, "quarter.exr", (64, 32), |x, _| if x < 16 { 1.0 } else { 0.1 })
}

/// Of directions drawn evenly over the sphere half lie behind a surface, and those before it count by 4 times their
/// cosine: a variance of 8/3 - 1 of the squared mean. One drawn from several by its cosine varies far less. Of an even
/// environment one drawn by the cosine alone does not vary.
#[test]
fn directions_to_an_environment_are_drawn_for_the_surface() {
    let folder = common::folder();
    let folder = folder.path();
    let scene = converted(folder, "floor", "newmtl white\nKd 1 1 1\n", &format!("{FLOOR}usemtl white\nf 1 2 3 4\n"));
    let even = environment(folder, "even.exr", (64, 32), |_, _| 0.5);
    let path = down_on(folder, 0.0);
    let found = |around: &str| {
        let values = render(&scene, &path, &format!("--effects environment --environment {around}"));
        let mean = mean(&values);
        let squares = values.iter().map(|&x| (f64::from(x) - mean).powi(2)).sum::<f64>();
        (mean, squares / (values.len() - 1) as f64 / (mean * mean))
    };
    // 256 pixels: the mean is within three standard errors of 0.042, and the variance, of 0.45, well below 1.
    let (mean, variance) = found(&quarter(folder));
    assert!((mean / 0.325 - 1.0).abs() < 0.13, "{mean}");
    assert!(variance < 0.9, "{variance} of the squared mean");
    let (mean, variance) = found(&even);
    assert!((mean / 0.5 - 1.0).abs() < 1e-5 && variance < 1e-8, "{mean}, {variance} of the squared mean");
}

/// However the light of an environment comes: by rays to it, by those that surfaces draw, or by both. Beside a wall
/// without end a floor sees half of an even environment, and of a white wall as much as that of it: after `n` bounces
/// half and half of what came after `n - 1`.
#[test]
fn an_environment_is_as_bright_however_its_light_comes() {
    let folder = common::folder();
    let folder = folder.path();
    let white = "newmtl white\nKd 1 1 1\n";
    let shiny = "newmtl white\nKd 0.5 0.5 0.5\nKs 0.3 0.3 0.3\nNs 20\n";
    let floor = format!("{FLOOR}usemtl white\nf 1 2 3 4\n");
    let path = down_on(folder, 1.0);
    let rotation = "--rotation full --diffuse-rays 1 --sun-intensity 0";
    let even = environment(folder, "even.exr", (64, 32), |_, _| 1.0);
    let quarter = quarter(folder);
    let light = |scene: &Path, around: &str, effects: &str| {
        let found = mean(&render(scene, &path, &format!("{rotation} --environment {around} --effects {effects}")));
        let summary = common::json(&scene.with_extension("walk").join("summary.json"));
        let rays = |pass: &str| summary["passes"][pass]["total"]["rays"].as_u64().unwrap_or(0);
        (found, rays("environment"))
    };
    let open = converted(folder, "open", white, &floor);
    for (around, truth) in [(&even, 1.0), (&quarter, 0.325)] {
        for effects in ["environment", "diffuse", "environment,diffuse", "environment,diffuse,glossy"] {
            // 16384 draws of what varies by up to 1.6 times its mean: 1.3 %, three times that.
            let (found, rays) = light(&open, around, &format!("{effects} --spp 64"));
            assert!((found / truth - 1.0).abs() < 0.04, "{effects}: {found}, not {truth}");
            // Diffuse rays alone bring what is even.
            let is_drawn = effects.contains("environment") && !(around == &even && effects.contains("diffuse"));
            assert_eq!(rays > 0, is_drawn, "{effects}: {rays} rays");
        }
    }
    let shiny = converted(folder, "shiny", shiny, &floor);
    for around in [&even, &quarter] {
        // Rays to it bring gloss; without them, rays that the gloss draws.
        let (truth, _) = light(&shiny, around, "environment --spp 256");
        assert!(truth > 0.5 * if around == &even { 1.0 } else { 0.325 }, "{truth}");
        for (effects, is_drawn) in [("environment,diffuse", true), ("environment,diffuse,glossy", around != &even)] {
            let (found, rays) = light(&shiny, around, &format!("{effects} --spp 128"));
            assert!((found / truth - 1.0).abs() < 0.04, "{effects}: {found}, not {truth}");
            assert_eq!(rays > 0, is_drawn, "{effects}: {rays} rays");
        }
    }
    let wall = format!("{FLOOR}v 0 0 -200\nv 0 400 -200\nv 0 400 200\nv 0 0 200\nusemtl white\nf 1 2 3 4\nf 5 6 7 8\n");
    let corner = converted(folder, "corner", white, &wall);
    let mut before = 0.5;
    for bounces in 1..=3 {
        let truth = 0.5 + 0.5 * before;
        let (found, _) = light(&corner, &even, &format!("environment,diffuse --spp 64 --bounces {bounces}"));
        assert!((found / truth - 1.0).abs() < 0.015, "{bounces} bounces: {found}, not {truth}");
        assert!((found / before - 1.0).abs() > 0.03, "the control must show");
        before = truth;
    }
}

#[test]
fn a_bright_texel_lights_by_its_solid_angle_and_casts_shadows() {
    let folder = common::folder();
    let folder = folder.path();
    let wall = "v 0 0 -200\nv 0 400 -200\nv 0 400 200\nv 0 0 200\n";
    let shape = format!("{FLOOR}{wall}usemtl white\nf 1 2 3 4\nf 5 6 7 8\n");
    let scene = converted(folder, "wall", "newmtl white\nKd 1 1 1\n", &shape);
    let path = down_on(folder, 1.0);
    // A sun of a million toward +X, 30 degrees above the horizon, between whose texels lookups are bilinear.
    let (width, height) = (128, 64);
    let (column, row) = (96, 21);
    let sun = environment(folder, "sun.exr", (width, height), |x, y| if (x, y) == (column, row) { 1e6 } else { 0.0 });
    let steps = 400;
    let sum: f64 = (0..2 * steps)
        .map(|i| {
            let offset = (f64::from(i) + 0.5) / f64::from(steps) - 1.0;
            let down = PI * (row as f64 + 0.5 + offset) / height as f64;
            (1.0 - offset.abs()) * down.sin() * down.cos()
        })
        .sum();
    let texel = 2.0 * PI / width as f64 * PI / height as f64;
    let truth = 1e6 * texel * sum / f64::from(steps) / PI;
    let with_sun = |options: &str| render(&scene, &path, &format!("--environment {sun} --sky-intensity 0 {options}"));
    // 8192 draws of a light that varies within four texels by about its half: 0.6 %.
    let open = mean(&with_sun("--effects environment --spp 32"));
    assert!((open / truth - 1.0).abs() < 0.03, "{open}, not {truth}");
    // Turned to the other side it is behind the wall; and the image's middle, turned by a quarter, is where +X was.
    assert_eq!(mean(&with_sun("--effects environment --environment-rotation 180")), 0.0);
    let ahead = environment(folder, "ahead.exr", (width, height), |x, y| if (x, y) == (64, row) { 1e6 } else { 0.0 });
    let turned = format!("--environment {ahead} --effects environment --spp 32 --environment-rotation -90");
    let turned = mean(&render(&scene, &path, &turned));
    assert!((turned / truth - 1.0).abs() < 0.03, "{turned}, not {truth}");
    // Of a uniform environment the wall hides a quarter turn.
    let even = environment(folder, "even.exr", (16, 8), |_, _| 1.0);
    let half = mean(&render(&scene, &path, &format!("--environment {even} --effects environment --spp 64")));
    assert!((half - 0.5).abs() < 0.02, "{half} beside a wall without end");
}

#[test]
fn bad_texels_are_counted_and_damaged_images_refused() {
    let folder = common::folder();
    let folder = folder.path();
    let scene = converted(folder, "open", "newmtl white\nKd 1 1 1\n", &format!("{FLOOR}usemtl white\nf 1 2 3 4\n"));
    let bad = environment(folder, "bad.exr", (32, 16), |x, y| match (x, y) {
        (3, 3) => f32::NAN,
        (4, 3) => f32::INFINITY,
        (5, 3) => -1.0,
        _ => 1.0,
    });
    let walk = |environment: &str| {
        let output = folder.join("out");
        let words = ["walk".as_ref(), scene.as_os_str(), "-o".as_ref(), output.as_os_str()];
        let options = format!(
            "--quality exact --frames 1 --size 16x16 --cache 100% --effects environment --environment {environment}"
        );
        let done = common::brickwalk(words.into_iter().chain(options.split_whitespace().map(std::ffi::OsStr::new)));
        (done.status.code(), String::from_utf8_lossy(&done.stderr).into_owned())
    };
    let (code, said) = walk(&bad);
    assert!(code == Some(0) && said.contains("3 texels"), "{said}");
    let summary = std::fs::read_to_string(folder.join("out/summary.json")).expect("a summary");
    let summary: serde_json::Value = serde_json::from_str(&summary).expect("JSON");
    assert_eq!(summary["lamps"]["environment"]["bad_texels"], 3);
    assert_eq!(
        summary["passes"]["environment"]["total"]["rays"].as_u64().map(|rays| rays > 0),
        Some(true),
        "{summary}"
    );
    let whole = std::fs::read(&bad).expect("the image");
    let cut = folder.join("cut.exr");
    std::fs::write(&cut, &whole[..whole.len() / 2]).expect("a part of it");
    for name in [cut.display().to_string(), "missing.hdr".into()] {
        let (code, said) = walk(&name);
        assert!(code == Some(1) && said.contains(&name) && said.trim().lines().count() == 1, "{said}");
    }
}
