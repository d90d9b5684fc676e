//! Diffuse light by `walk --secondary roma`, whose hits reflective shadow maps light: against closed forms and exact
//! rays, what it loads, that it is the same again and again.

use crate::common::{self, city, converted, folder, sheet, sum};
use brickwalk::frame::{FrameOutput, Renderer};
use brickwalk::kernels::lamps::{Emitter, Lamps, Shape};
use brickwalk::scene::Camera;
use glam::DVec3;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::Arc;

const SIZE: usize = 48;

/// Sheets of squares of side 1/4, by corner and edges, as a scene; bricks of 64 triangles have resident cells of 1/8 m.
fn scene_of(folder: &Path, sheets: &[(DVec3, [DVec3; 2])]) -> PathBuf {
    let (mut text, mut count) = (String::new(), 0);
    for (corner, edges) in sheets {
        let squares = edges.map(|edge| (4.0 * edge.length()).round() as usize);
        sheet(&mut text, &mut count, *corner, *edges, squares);
    }
    converted(folder, &text, "--brick-triangles 64")
}

const HEIGHT: f64 = 2.0;

/// A floor of 8 m by 8 m and, 2 m high, a wall along its middle.
fn wall(folder: &Path, has_wall: bool) -> PathBuf {
    let floor = (DVec3::new(-4.0, 0.0, -4.0), [DVec3::X * 8.0, DVec3::Z * 8.0]);
    let wall = (DVec3::new(-4.0, 0.0, 0.0), [DVec3::X * 8.0, DVec3::Y * HEIGHT]);
    if has_wall { scene_of(folder, &[floor, wall]) } else { scene_of(folder, &[floor]) }
}

/// A room of 4 m by 3 m by 4 m around the origin of its floor, and a screen of 2 m by 1.5 m in its middle.
fn room(folder: &Path) -> PathBuf {
    let (x, y, z) = (DVec3::X * 4.0, DVec3::Y * 3.0, DVec3::Z * 4.0);
    let low = DVec3::new(-2.0, 0.0, -2.0);
    let sides = [(low, [x, z]), (low + y, [x, z]), (low, [x, y]), (low + z, [x, y]), (low, [y, z]), (low + x, [y, z])];
    let screen = (DVec3::new(-1.0, 0.0, -0.0625), [DVec3::X * 2.0, DVec3::Y * 1.5]);
    scene_of(folder, &[&sides[..], &[screen]].concat())
}

fn renderer(scene: &Path, options: &str) -> Renderer {
    let own = format!("--size {SIZE}x{SIZE} --tile 16 --aov --sky-intensity 0 --sun-angle 0 --diffuse-rays 16");
    common::renderer(scene, &format!("{own} --rotation full {options}"))
}

/// A view of a scene in a light.
struct View<'a> {
    scene: &'a Path,
    camera: Camera,
    light: &'a str,
    emitters: Vec<Emitter>,
}

/// Luminance of green that diffuse rays bring to every pixel, and the frame.
fn indirect(view: &View, options: &str) -> (Vec<f64>, FrameOutput) {
    // Exact rays need shadows for those of their hits; maps have them.
    let (with, without) = match options.contains("roma") {
        true => ("diffuse", "primary"),
        false => ("shadow,diffuse", "shadow"),
    };
    let [with, without] = [with, without].map(|effects| {
        let mut renderer = renderer(
            view.scene,
            &format!("{} --cache 100% --schedule plain --effects {effects} {options}", view.light),
        );
        if !view.emitters.is_empty() {
            renderer.light.lamps = Arc::new(Lamps::new(None, view.emitters.clone(), 4.0));
        }
        renderer.frame(0, &view.camera).expect("a frame")
    });
    let pixels = with.pixels.radiance.iter().zip(&without.pixels.radiance);
    (pixels.map(|(with, without)| f64::from(with[1]) - f64::from(without[1])).collect(), with)
}

/// Above the floor, looking down on the part of it before the wall.
fn eye() -> Camera {
    let (position, target) = (DVec3::new(0.0, 3.5, 1.7), DVec3::new(0.0, 0.0, 1.7));
    Camera { position, target, up: -DVec3::Z, fov_y: 52f64.to_radians() }
}

/// Distance from the wall of the point of the floor that a pixel shows.
fn before_wall(pixel: usize) -> f64 {
    let row = (pixel / SIZE) as f64 + 0.5;
    1.7 + (row / SIZE as f64 - 0.5) * 2.0 * 3.5 * 26f64.to_radians().tan()
}

/// The form factor of a wall of height `h` and width 8 from a point `d` before its middle: those of its halves (Howell,
/// "A Catalog of Radiation Heat Transfer Configuration Factors", B-4).
fn form_factor(d: f64, h: f64) -> f64 {
    let half = 4.0;
    let (x, y) = (h / half, d / half);
    let r = (x * x + y * y).sqrt();
    2.0 / std::f64::consts::TAU * ((1.0 / y).atan() - y / r * (1.0 / r).atan())
}

/// The sun low before the wall, and behind it.
const BEFORE: &str = "--sun 0,0.3,1";
const BEHIND: &str = "--sun 0,0.3,-1";

#[test]
fn a_sunlit_wall_lights_the_floor_as_the_closed_form_says_but_for_cells() {
    let folder = folder();
    let scene = wall(folder.path(), true);
    let view = |light| View { scene: &scene, camera: eye(), light, emitters: Vec::new() };
    let near = |light: &[f64], frame: &FrameOutput, d: f64| {
        let pixels = (0..SIZE * SIZE).filter(|&i| frame.pixels.normal[i][1] > 0.9 && (before_wall(i) - d).abs() < 0.1);
        let all: Vec<f64> = pixels.map(|i| light[i]).collect();
        assert!(all.len() > 40, "{} pixels at {d}", all.len());
        all.iter().sum::<f64>() / all.len() as f64
    };
    let exact = indirect(&view(BEFORE), "--spp 2");
    let roma = indirect(&view(BEFORE), "--secondary roma --spp 4");
    let unsnapped = indirect(&view(BEFORE), "--secondary roma --roma-unsnapped all --roma-steps 64 --spp 4");
    // What the wall reflects of the sun, and the floor of that.
    let albedo = f64::from(exact.1.pixels.albedo[SIZE * SIZE / 2][1]);
    let sun = f64::from(renderer(&scene, BEFORE).light.sun_color[1]);
    let shown = albedo * albedo * sun / (1.0f64 + 0.3 * 0.3).sqrt();
    let cell = 1.75 / 8.0;
    for d in [0.6, 1.0, 1.5, 2.0, 3.0] {
        let expected = shown * form_factor(d, HEIGHT);
        let [exact, roma, unsnapped] = [&exact, &roma, &unsnapped].map(|(light, frame)| near(light, frame, d));
        println!("{d} m: closed form {expected:.5}, exact {exact:.5}, roma {roma:.5}, unsnapped {unsnapped:.5}");
        assert!((exact / expected - 1.0).abs() < 0.05, "{exact} instead of {expected}");
        // As occlusion by it (tests/it/secondary/roma.rs): cells are thicker than the wall, and rays start above the
        // floor; points that are looked up, moved by half a cell, leave it at its upper edge.
        let brightest = shown * form_factor(d - 2.75 / 8.0, HEIGHT + 2.75 / 8.0);
        let darkest = shown * form_factor(d + 1.0 * cell, HEIGHT - 3.0 * cell);
        for found in [roma, unsnapped] {
            assert!(found > darkest && found < brightest, "{found} is not in {darkest} to {brightest}");
        }
    }
    // Controls: a wall that is lit from behind is dark before, though its lit side lies in the same cells; without one
    // there is no light.
    let (behind, frame) = indirect(&view(BEHIND), "--secondary roma --spp 2");
    let [behind, before] = [(&behind, &frame), (&roma.0, &roma.1)].map(|(light, frame)| near(light, frame, 1.0));
    assert!(before > 0.01 && behind < 0.02 * before, "{behind} beside {before}");
    let bare = wall(folder.path(), false);
    let (light, _) = indirect(&View { scene: &bare, ..view(BEFORE) }, "--secondary roma --spp 2");
    assert!(light.iter().all(|&x| x < 0.05 * before), "a floor does not light itself");
}

/// In the room.
fn inside() -> Camera {
    let (position, target) = (DVec3::new(1.7, 1.9, 1.8), DVec3::new(-0.6, 0.6, -0.8));
    Camera { position, target, up: DVec3::Y, fov_y: 75f64.to_radians() }
}

#[test]
fn points_and_spots_light_a_room_as_exact_rays_do_but_for_cells() {
    let folder = folder();
    let scene = room(folder.path());
    let radiance = [6.0, 5.0, 4.0];
    let top = DVec3::new(0.3, 2.4, 0.5);
    let point = Shape::Point { position: top, range: 0.0 };
    let spot = |outer| Shape::Spot {
        position: top,
        direction: DVec3::new(-0.4, -1.0, -0.3).normalize(),
        range: 0.0,
        cone: [0.5 * outer, outer],
    };
    let mean = |light: &[f64]| light.iter().sum::<f64>() / light.len() as f64;
    // What is seen of a cell is up to 1.9 of its sides from where the lamp is asked, and of that 1.5 count: so some
    // light is lost, in small spots of it more, where part of the points that are asked for lie in the dark.
    for (name, shape, bound) in [("point", point, 0.05), ("spot", spot(0.6), 0.2), ("wide spot", spot(1.3), 0.2)] {
        let emitters = vec![Emitter { shape, two_sided: false, radiance }];
        let view = View { scene: &scene, camera: inside(), light: "--sun-intensity 0", emitters };
        let exact = mean(&indirect(&view, "--spp 4").0);
        assert!(exact > 0.005, "{name}: {exact}");
        // Of snapped rays all pixels share 16 directions a sample: the mean of four samples is off by 4 % (one
        // deviation), of 32 by 1.4 %.
        for options in ["--secondary roma --spp 32", "--secondary roma --roma-unsnapped all --roma-steps 64 --spp 4"] {
            let bias = mean(&indirect(&view, options).0) / exact - 1.0;
            println!("{name}, {options}: exact {exact:.5}, bias {:+.1} %", 100.0 * bias);
            assert!(bias.abs() < bound, "{name}: {bias}");
        }
        // Controls: without a map the lamp lights nothing; one that stands elsewhere does it otherwise.
        assert_eq!(mean(&indirect(&view, "--secondary roma --rsm-lamps 0").0), 0.0, "{name}");
        let shape = match shape {
            Shape::Spot { cone, .. } => Shape::Spot { position: top, direction: DVec3::Y, range: 0.0, cone },
            _ => Shape::Point { position: DVec3::new(0.3, -2.4, 0.5), range: 0.0 },
        };
        let elsewhere = View { emitters: vec![Emitter { shape, two_sided: false, radiance }], ..view };
        let bias = mean(&indirect(&elsewhere, "--secondary roma --spp 2").0) / exact - 1.0;
        assert!(bias.abs() > 0.2, "{name} elsewhere must show: {bias}");
    }
}

fn records(scene: &Path, output: &Path, options: &str) -> Vec<Value> {
    let path = scene.with_extension("near.json");
    common::walk(scene, output, &format!("--adapter cpu --size 64x48 --tile 16 --path {} {options}", path.display()));
    common::records(output)
}

#[test]
fn only_maps_load_bricks() {
    let folder = folder();
    let scene = city(folder.path(), "40K", "1K");
    let of = |options: &str| {
        let options = format!("--frames 2 --effects shadow,diffuse --diffuse-rays 4 --cache 30% {options}");
        records(&scene, &folder.path().join("out"), &options)
    };
    let (exact, roma) = (of(""), of("--secondary roma"));
    for pass in ["diffuse", "diffuse-shadow"] {
        for field in ["bricks_loaded", "bricks_needed", "bytes_bvh", "bytes_geometry", "bytes_attributes", "queries"] {
            assert_eq!(sum(&roma, pass, field), 0.0, "{pass} {field}");
        }
        assert!(sum(&exact, pass, "bricks_needed") > 0.0, "the control needs some");
    }
    assert_eq!(sum(&roma, "diffuse", "rays"), sum(&exact, "diffuse", "rays"));
    assert!(sum(&roma, "diffuse", "ms_phase1") > 0.0 && sum(&roma, "diffuse", "ms_phase3") > 0.0);
    assert!(sum(&roma, "diffuse-shadow", "ms_phase3") > 0.0);
    assert!(sum(&roma, "rsm", "rays") > 10_000.0 && sum(&roma, "rsm", "bricks_loaded") > 0.0);
    let summary = std::fs::read(folder.path().join("out/summary.json")).expect("a summary");
    let summary: Value = serde_json::from_slice(&summary).expect("JSON");
    let rsm = &summary["settings"]["rsm"];
    assert!(rsm["maps"].as_u64() > Some(0) && rsm["texels"].as_f64() == Some(sum(&roma[..1], "rsm", "rays")), "{rsm}");
    // Maps stay while nothing moves. The path ends where it began.
    let path = scene.with_extension("near.json");
    let mut still: Value = serde_json::from_slice(&std::fs::read(&path).expect("a path")).expect("JSON");
    still["keyframes"].as_array_mut().expect("keyframes").truncate(1);
    std::fs::write(&path, still.to_string()).expect("a path");
    let resting = of("--secondary roma");
    let frames: Vec<&Value> = resting.iter().filter(|r| r["pass"] == "rsm").map(|r| &r["frame"]).collect();
    assert_eq!(frames, [&Value::from(0)]);
}

/// Everything resident.
const ALL: &str = "--cache 100% --schedule plain";

#[test]
fn it_is_the_same_whatever_came_before_and_whatever_the_cache() {
    let folder = folder();
    let scene = city(folder.path(), "40K", "1K");
    let path = brickwalk::scene::path::CameraPath::read(&scene.with_extension("near.json")).expect("a path");
    let frame = |options: &str, before: &[u32]| {
        let mut renderer = renderer(&scene, &format!("--effects shadow,diffuse --secondary roma {options}"));
        for &k in before {
            renderer.frame(k, &path.frame(k, 30)).expect("a frame");
        }
        renderer.frame(9, &path.frame(9, 30)).expect("a frame").pixels.radiance
    };
    let one = frame(ALL, &[]);
    assert!(one.iter().flatten().all(|x| x.is_finite()) && one.iter().any(|x| x[1] > 0.0));
    for (options, before) in
        [(ALL, &[0, 29][..]), ("--cache 20% --schedule chc", &[]), ("--cache 30% --schedule demand", &[8])]
    {
        assert!(frame(options, before) == one, "{options}, after {before:?}");
    }
    for other in ["--seed 1", "--roma-diffuse-k 8", "--rsm-size 64", "--roma-unsnapped diffuse"] {
        assert!(frame(&format!("{ALL} {other}"), &[]) != one, "{other} must show");
    }
}
