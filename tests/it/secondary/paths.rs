//! Methods that answer rays of paths from the second hit on (`--secondary bounces=M`): against closed forms and exact
//! paths of the same samples, what they leave to be traced, that they are the same whatever the cache.

use crate::common::{self, adapters, brickwalk, city, converted, folder, frames, polished_city, records, sheet, sum};
use brickwalk::frame::{FrameOutput, Renderer};
use brickwalk::kernels::lamps::{Emitter, Lamps, Shape};
use brickwalk::scene::Camera;
use glam::DVec3;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Rays of a pass of a frame: traced, and answered.
fn rays(output: &FrameOutput, pass: &str) -> [u64; 2] {
    let found = output.records.iter().find(|record| record.pass == pass);
    found.map_or([0; 2], |record| [record.rays_traced, record.rays_answered])
}

fn mean(output: &FrameOutput) -> f64 {
    output.pixels.radiance.iter().map(|c| f64::from(c[1])).sum::<f64>() / output.pixels.radiance.len() as f64
}

const RADIUS: f64 = 2.0;

/// A sphere around the origin, seen from within, of a cube's squares.
fn sphere(folder: &Path) -> PathBuf {
    let n = 24;
    let (mut text, mut count) = (String::new(), 1);
    for (axis, sign) in (0..3).flat_map(|axis| [(axis, -1.0), (axis, 1.0)]) {
        let at = |i: usize, j: usize| {
            let mut p = [sign; 3];
            let angle = |i: usize| ((2.0 * i as f64 / n as f64 - 1.0) * std::f64::consts::FRAC_PI_4).tan();
            (p[(axis + 1) % 3], p[(axis + 2) % 3]) = (angle(i), angle(j));
            let p = RADIUS * DVec3::from(p).normalize();
            format!("v {} {} {}\n", p.x, p.y, p.z)
        };
        (0..=n).flat_map(|j| (0..=n).map(move |i| (i, j))).for_each(|(i, j)| text += &at(i, j));
        for (i, j) in (0..n).flat_map(|j| (0..n).map(move |i| (i, j))) {
            let p = count + i + j * (n + 1);
            let [a, b, c, d] = [p, p + 1, p + n + 2, p + n + 1];
            text += &if sign > 0.0 { format!("f {a} {d} {c} {b}\n") } else { format!("f {a} {b} {c} {d}\n") };
        }
        count += (n + 1) * (n + 1);
    }
    converted(folder, &text, "--brick-triangles 64")
}

/// The sphere, with a point in its middle that shines to all sides by the intensity 5, seen from beside it.
fn lit_sphere(scene: &Path, options: &str) -> FrameOutput {
    let own = "--size 32x32 --tile 16 --cache 100% --schedule plain --aov --sun-intensity 0 --sky-intensity 0 --spp 16";
    let mut renderer: Renderer = common::renderer(scene, &format!("{own} --diffuse-rays 1 {options}"));
    let shape = Shape::Point { position: DVec3::ZERO, range: 0.0 };
    let emitter = Emitter { shape, two_sided: false, radiance: [5.0; 3] };
    renderer.light.lamps = Arc::new(Lamps::new(None, vec![emitter], 4.0));
    let (position, target) = (DVec3::new(0.9, 0.4, 0.3), DVec3::new(-1.0, -0.2, -0.5));
    renderer.frame(0, &Camera { position, target, up: DVec3::Y, fov_y: 80f64.to_radians() }).expect("a frame")
}

#[test]
fn paths_in_a_sphere_have_the_light_of_the_closed_form_up_to_where_maps_end_them() {
    let folder = folder();
    let scene = sphere(folder.path());
    let direct = lit_sphere(&scene, "--effects shadow");
    let albedo = f64::from(direct.pixels.albedo[500][1]);
    let shown = albedo * 5.0 / (std::f64::consts::PI * RADIUS * RADIUS);
    let direct = mean(&direct);
    assert!((direct / shown - 1.0).abs() < 0.02, "{direct} instead of {shown}");
    // Every point of a sphere sees every other alike: each bounce reflects all light of the one before to all sides.
    let closed_form = |kept: &[f64]| {
        let (mut bounce, mut sum) = (direct, direct);
        for kept in kept {
            bounce *= albedo * kept;
            sum += bounce;
        }
        sum
    };
    let of = |bounces: u32, options: &str| {
        lit_sphere(&scene, &format!("--effects shadow,diffuse --bounces {bounces} {options}"))
    };
    for bounces in [2, 4] {
        let (exact, expected) = (mean(&of(bounces, "")), closed_form(&vec![1.0; bounces as usize]));
        assert!((exact / expected - 1.0).abs() < 0.02, "{bounces} bounces: {exact} instead of {expected}");
        let roma = of(bounces, "--secondary bounces=roma");
        let [traced, answered] = rays(&roma, "bounce-2").map(|count| count as f64);
        assert!(answered > 4.0 * traced && traced > 0.0, "{traced} traced, {answered} answered");
        assert_eq!(rays(&roma, "diffuse")[1] + rays(&roma, "diffuse-shadow")[1], 0, "the first bounce is exact");
        // Answered rays bring light of the lamp, and paths end there.
        let left = traced / (traced + answered);
        let expected = closed_form(&[&[1.0, 1.0], &vec![left; bounces as usize - 2][..]].concat());
        let found = mean(&roma);
        println!("{bounces} bounces: exact {exact:.4}, roma {found:.4}, expected {expected:.4}, {left:.3} traced");
        assert!((found / expected - 1.0).abs() < 0.03, "{bounces} bounces: {found} instead of {expected}");
        // Controls: what paths lose of the third and fourth bounce shows, and so would the second.
        assert!(bounces == 2 || found < 0.93 * exact, "{found} beside {exact}");
        let without = closed_form(&[1.0]);
        assert!(found > 1.1 * without, "{found} beside {without}");
    }
    // A lamp without a map is not known: what is met is traced.
    let unknown = of(4, "--secondary bounces=roma --rsm-lamps 0");
    assert!(rays(&unknown, "bounce-2")[1] == 0 && unknown.pixels.radiance == of(4, "").pixels.radiance);
    // Rays to the lamp: their ends lie in the open.
    let shadows = of(4, "--secondary bounces=sift --auto-error off");
    let [_, answered] = rays(&shadows, "bounce-2-shadow");
    assert!(answered > 1000 && (mean(&shadows) / mean(&of(4, "")) - 1.0).abs() < 1e-3, "{answered}");
}

/// A floor of 8 m by 8 m and, 2 m high, a wall along its middle.
fn wall(folder: &Path) -> PathBuf {
    let (mut text, mut count) = (String::new(), 0);
    sheet(&mut text, &mut count, DVec3::new(-4.0, 0.0, -4.0), [DVec3::X * 8.0, DVec3::Z * 8.0], [32, 32]);
    sheet(&mut text, &mut count, DVec3::new(-4.0, 0.0, 0.0), [DVec3::X * 8.0, DVec3::Y * 2.0], [32, 8]);
    converted(folder, &text, "--brick-triangles 64")
}

/// Before the wall.
fn eye() -> Camera {
    Camera {
        position: DVec3::new(0.5, 1.5, 3.5),
        target: DVec3::new(0.0, 0.5, 0.0),
        up: DVec3::Y,
        fov_y: 60f64.to_radians(),
    }
}

#[test]
fn rays_that_maps_find_free_see_the_sky_as_exact_ones_do() {
    let folder = folder();
    let scene = wall(folder.path());
    let of = |options: &str| {
        let own = "--size 48x48 --cache 100% --schedule plain --spp 8 --diffuse-rays 1 --bounces 4";
        common::evenly_lit(&scene, "path", &format!("{own} {options}")).frame(0, &eye()).expect("a frame")
    };
    let (exact, sift, roma) = (of(""), of("--secondary bounces=sift"), of("--secondary bounces=roma"));
    for pass in ["diffuse", "glossy", "environment"] {
        assert_eq!((rays(&sift, pass), rays(&sift, pass)[1]), (rays(&exact, pass), 0), "{pass}");
    }
    let [traced, answered] = rays(&sift, "bounce-2");
    assert_eq!(traced + answered, rays(&exact, "bounce-2")[0]);
    assert!(answered > traced, "{traced} traced, {answered} answered");
    let bias = |output: &FrameOutput| mean(output) / mean(&exact) - 1.0;
    println!("sift {:+.5}, roma {:+.5}; {traced} traced, {answered} answered", bias(&sift), bias(&roma));
    // Nothing but what lies below the start of a ray is overlooked.
    assert!(bias(&sift).abs() < 1e-3, "{}", bias(&sift));
    // Control, and what is lost: the sky shines on what is met, and maps know nothing of that.
    assert!(bias(&roma) < -2e-3 && bias(&roma) > -0.05, "{}", bias(&roma));
    assert!(rays(&roma, "bounce-2")[1] > answered);
}

#[test]
fn what_maps_do_not_know_is_traced() {
    let folder = folder();
    // Lamps that shine by themselves are met by rays alone. A box that is open to one side.
    let scene = folder.path().join("cornell.bricks");
    let words = "scene cornell --triangles 10K --brick-triangles 500 -o";
    common::succeed(words.split(' ').map(std::ffi::OsStr::new).chain([scene.as_os_str()]));
    let path = brickwalk::scene::path::CameraPath::read(&scene.with_extension("near.json")).expect("a path");
    let of = |scene: &Path, options: &str| {
        let own = "--size 48x48 --tile 16 --cache 100% --effects path --bounces 4 --diffuse-rays 1 --spp 4";
        common::renderer(scene, &format!("{own} {options}")).frame(0, &path.frame(0, 1)).expect("a frame")
    };
    let (exact, roma) = (of(&scene, ""), of(&scene, "--secondary bounces=roma"));
    let bias = mean(&roma) / mean(&exact) - 1.0;
    assert!(bias.abs() < 2e-3, "{bias}");
    // Of metal and polish most rays have a direction that a cell is too coarse for; those are traced to what they meet.
    let polished = polished_city(folder.path(), 40_000, 1000);
    let path = brickwalk::scene::path::CameraPath::read(&polished.with_extension("near.json")).expect("a path");
    let met = |scene: &Path| {
        let of = |method: &str| {
            let own = "--size 48x32 --tile 16 --cache 100% --effects shadow,diffuse,glossy --bounces 2 --spp 4";
            let options = format!("{own} --secondary bounces={method}");
            let output = common::renderer(scene, &options).frame(0, &path.frame(0, 1)).expect("a frame");
            rays(&output, "bounce-2")
        };
        // Beside those that are free.
        let ([traced, free], [_, known]) = (of("sift"), of("roma"));
        (known - free) as f64 / traced as f64
    };
    let (sharp, dull) = (met(&polished), met(&city(folder.path(), "40K", "1K")));
    println!("{sharp:.3} of what is met is answered, {dull:.3} where nothing is polished");
    assert!(sharp < 0.75 * dull && dull > 0.5, "{sharp}, {dull}");
}

#[test]
fn answers_do_not_depend_on_the_cache_and_all_rays_are_counted() {
    let folder = folder();
    let scene = city(folder.path(), "40K", "500");
    let path = scene.with_extension("near.json");
    let common = format!("--path {} --frames 2 --size 48x32 --aov --effects path --bounces 4", path.display());
    for adapter in adapters() {
        let name = adapter.split_whitespace().next().expect("a name");
        let run = |options: &str| {
            let output = folder.path().join("out");
            let own = format!("{common} --diffuse-rays 1 --spp 2 --roma-size 64 --adapter {name}");
            common::walk(&scene, &output, &format!("{own} {options}"));
            (frames(&output), records(&output))
        };
        let exact = run("--cache 100%");
        for method in ["roma", "sift"] {
            let by = |options: &str| run(&format!("--secondary bounces={method} {options}"));
            let first = by("--cache 100% --schedule chc");
            assert!(first.0 != exact.0, "{adapter}: {method} must show");
            for options in ["--cache 15% --schedule chc", "--cache 15% --schedule demand --evict lru", "--tile 16"] {
                assert!(by(options).0 == first.0, "{adapter}: {method}, {options}: frames differ");
            }
            assert!(by("--seed 1").0 != first.0, "{adapter}: another seed changed nothing");
            for record in first.1.iter().chain(&exact.1) {
                let of = |field: &str| record[field].as_u64().expect("a number");
                assert_eq!(of("rays"), of("rays_traced") + of("rays_answered"), "{record}");
            }
            let of = |records: &[Value], pass: &str, field: &str| sum(records, pass, field);
            for pass in ["primary", "diffuse", "glossy", "shadow", "environment", "bounce-2"] {
                assert_eq!(of(&first.1, pass, "rays"), of(&exact.1, pass, "rays"), "{method}, {pass}");
                let answered = of(&first.1, pass, "rays_answered");
                assert_eq!(answered > 0.0, pass == "bounce-2", "{method}, {pass}: {answered}");
            }
            for pass in ["diffuse-shadow", "bounce-2-shadow", "bounce-3"] {
                assert!(of(&first.1, pass, "rays_answered") > 0.0, "{adapter}: {method}, {pass}");
            }
            let by_method = first.1.iter().filter(|record| record["methods"] == method).count();
            assert!(by_method > 4, "{method}: {by_method} records");
        }
        // One bounce ends before the second hit goes on: nothing is answered.
        let one = |options: &str| run(&format!("--bounces 1 --cache 100% {options}")).0;
        assert!(one("") == one("--secondary bounces=roma"), "{adapter}");
    }
}

#[test]
fn fields_answer_what_they_know_of_later_hits() {
    let folder = folder();
    let scene = city(folder.path(), "40K", "500");
    let words = ["bake-displacement".as_ref(), scene.as_os_str(), "--adapter".as_ref(), "cpu".as_ref()];
    assert!(brickwalk(words).status.success());
    let path = scene.with_extension("near.json");
    let run = |options: &str| {
        let output = folder.path().join("out");
        let own = format!("--path {} --frames 1 --size 64x48 --effects path --bounces 3", path.display());
        common::walk(&scene, &output, &format!("{own} --diffuse-rays 1 --spp 2 --adapter cpu {options}"));
        (frames(&output), records(&output))
    };
    let exact = run("--cache 100%");
    let answered = |records: &[Value], pass: &str| {
        let traced = sum(records, pass, "rays_traced");
        let [whole, part] = ["rays_answered", "rays_shortened"].map(|field| sum(records, pass, field));
        assert_eq!(sum(records, pass, "rays"), traced + whole, "{pass}");
        whole + part
    };
    let displacement = "--secondary bounces=displacement --displacement-against all --displacement-near 1";
    let (pictures, all) = run(&format!("{displacement} --cache 100%"));
    assert!(pictures != exact.0 && pictures == run(&format!("{displacement} --cache 20%")).0);
    for pass in ["bounce-2", "bounce-2-shadow", "bounce-2-environment", "bounce-3", "diffuse-shadow"] {
        assert!(answered(&all, pass) > 0.0, "{pass}");
    }
    for pass in ["diffuse", "glossy", "shadow", "environment"] {
        assert_eq!(answered(&all, pass), 0.0, "{pass}");
    }
    let (_, all) = run("--secondary environment=dvf --dvf-points 20000 --cache 100%");
    for pass in ["environment", "diffuse-environment", "bounce-2-environment", "bounce-3-environment"] {
        assert!(answered(&all, pass) > 0.0 && answered(&exact.1, pass) == 0.0, "{pass}");
    }
    assert_eq!(answered(&all, "bounce-2"), 0.0);
}
