//! Nodes that are left out: rays meet what f64 brute force over the other triangles meets, light comes in where a roof
//! is hidden, and neither cache nor device changes a byte.

use crate::common::{adapters, box_corners, converted, folder, light_on_floor, settings};
use brickwalk::session::{Ray, Session, extent, find};
use brickwalk::settings::Group as _;
use glam::DVec3;
use std::path::Path;

/// Triangles of a node.
const EACH: usize = 300;

/// A number in 0..1.
fn random(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 40) as f64 / (1u64 << 24) as f64
}

/// Triangles of four nodes in the same room, and the text of an OBJ file with them.
fn shapes() -> (Vec<[DVec3; 3]>, String) {
    let (mut state, mut triangles, mut text) = (7, Vec::new(), String::new());
    for name in ["left", "right", "bolt", "bolt"] {
        text += &format!("o {name}\n");
        for _ in 0..EACH {
            let at = DVec3::from_array([0; 3].map(|_| 10.0 * random(&mut state)));
            // Of a step that an f32 holds, so that nothing is rounded.
            let corner = |state: &mut u64| {
                let off = DVec3::from_array([0; 3].map(|_| random(state)));
                ((at + off) * 4096.0).round() / 4096.0
            };
            let own = [0; 3].map(|_| corner(&mut state));
            for p in own {
                text += &format!("v {} {} {}\n", p.x, p.y, p.z);
            }
            let first = 3 * triangles.len() + 1;
            text += &format!("f {first} {} {}\n", first + 1, first + 2);
            triangles.push(own);
        }
    }
    (triangles, text)
}

/// The nearest hit of those of `triangles` that are there (Möller, Trumbore): distance and number.
fn brute_force(ray: &Ray, triangles: &[[DVec3; 3]], is_there: impl Fn(usize) -> bool) -> (f64, Option<u32>) {
    let (origin, direction) = (DVec3::from_array(ray.origin), DVec3::from_array(ray.direction));
    let mut best = (f64::INFINITY, None);
    for (number, [a, b, c]) in triangles.iter().enumerate().filter(|&(number, _)| is_there(number)) {
        let (ab, ac) = (*b - *a, *c - *a);
        let (p, s) = (direction.cross(ac), origin - *a);
        let (det, q) = (ab.dot(p), s.cross(ab));
        let (u, v, t) = (s.dot(p) / det, direction.dot(q) / det, ac.dot(q) / det);
        if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 && t < best.0 {
            best = (t, Some(number as u32));
        }
    }
    best
}

fn rays(count: usize) -> Vec<Ray> {
    let mut state = 99;
    let ray = |_| {
        let [origin, to] = [0; 2].map(|_| [0; 3].map(|_| 11.0 * random(&mut state)));
        let direction = std::array::from_fn(|k| to[k] - origin[k]);
        Ray { origin, direction, t_min: 0.0, t_max: f64::INFINITY }
    };
    (0..count).map(ray).collect()
}

#[test]
fn rays_meet_what_brute_force_meets_of_the_nodes_that_are_left() {
    let folder = folder();
    let (triangles, text) = shapes();
    let scene = converted(folder.path(), &text, "--brick-triangles 100");
    let rays = rays(3000);
    let of = |name: usize| move |number: usize| number / EACH == name;
    type IsThere = Box<dyn Fn(usize) -> bool>;
    let cases: [(&str, IsThere); 6] = [
        ("", Box::new(|_| true)),
        ("--hide right", Box::new(move |number| !of(1)(number))),
        ("--only left", Box::new(of(0))),
        ("--hide bolt", Box::new(move |number| number < 2 * EACH)),
        // A node whose name another one has, too.
        ("--hide #700", Box::new(move |number| !of(2)(number))),
        ("--only left,b* --hide #1000", Box::new(move |number| of(0)(number) || of(2)(number))),
    ];
    let mut hits = Vec::new();
    for adapter in adapters() {
        let with = |options: &str| {
            // Out of core on the processor alone: rounds of queries take long on software Vulkan.
            let cache = if adapter == "cpu" { "30%" } else { "100%" };
            // As many pixels as rays, and a few more.
            let mut settings = settings(&format!("{options} --cache {cache} --size 64x48"));
            settings.set("adapter", &adapter).expect("an adapter");
            settings
        };
        let mut session = Session::open(&scene, &with("")).expect("a session");
        for (options, is_there) in &cases {
            session.set(&with(options)).expect("settings");
            let traced = session.trace(&rays, false).expect("hits");
            let occluded = session.trace(&rays, true).expect("hits");
            let mut others = 0;
            for ((ray, hit), any) in rays.iter().zip(&traced).zip(&occluded) {
                let (t, number) = brute_force(ray, &triangles, is_there);
                assert_eq!(hit.t.is_finite(), any.t.is_finite());
                if number != (hit.t.is_finite()).then_some(hit.triangle) {
                    // Within roundings of an edge.
                    others += 1;
                    assert!(hit.triangle as usize >= triangles.len() || is_there(hit.triangle as usize), "{options}");
                } else if number.is_some() {
                    assert!((hit.t / t - 1.0).abs() < 1e-6, "{options}: {} and {t}", hit.t);
                }
            }
            assert!(others <= 2, "{options}: {others} rays meet something else");
            hits.push(traced.iter().map(|hit| hit.triangle).collect::<Vec<_>>());
        }
    }
    // The control: each case has other hits.
    for (a, b) in (0..6).flat_map(|a| (0..a).map(move |b| (a, b))) {
        assert!(hits[a].iter().zip(&hits[b]).filter(|(a, b)| a != b).count() > 100, "cases {a} and {b}");
    }
}

#[test]
fn light_comes_in_where_a_roof_is_hidden() {
    let folder = folder();
    let corners = box_corners();
    let shape = format!("{corners}o floor\nf 1 5 6 2\no walls\nf 1 2 4 3\nf 5 7 8 6\nf 1 3 7 5\nf 2 6 8 4\n");
    let mean = |scene: &Path, options: &str| light_on_floor(folder.path(), scene, options);
    let [open, closed] = ["open", "closed"].map(|name| {
        let place = folder.path().join(name);
        std::fs::create_dir(&place).expect("a folder");
        let roof = if name == "closed" { "o roof\nf 3 4 8 7\n" } else { "" };
        converted(&place, &format!("{shape}{roof}"), "")
    });
    let truth = mean(&open, "");
    assert!(truth > 0.1 && mean(&closed, "") == 0.0);
    assert_eq!(mean(&closed, "--hide roof"), truth);
    // The control: without walls the roof still stops the sun.
    assert_eq!(mean(&closed, "--hide walls"), 0.0);
}

#[test]
fn neither_cache_nor_schedule_nor_device_changes_what_is_left() {
    let folder = folder();
    let (_, text) = shapes();
    let scene = converted(folder.path(), &text, "--brick-triangles 100");
    let common = "--size 64x36 --spp 1 --effects primary,shadow,ao,diffuse,glossy --hide left,#700";
    let picture = |options: &str, adapter: &str| {
        let mut settings = settings(&format!("{common} {options}"));
        settings.set("adapter", adapter).expect("an adapter");
        let mut session = Session::open(&scene, &settings).expect("a session");
        let camera = session.path().frame(0, 1);
        let first = session.picture(&camera, &mut ()).expect("a frame").expect("a frame").pixels.radiance;
        // Shown, hidden again: the same.
        let all = {
            let mut all = settings.clone();
            all.hide.clear();
            all
        };
        session.set(&all).expect("settings");
        let whole = session.picture(&camera, &mut ()).expect("a frame").expect("a frame").pixels.radiance;
        session.set(&settings).expect("settings");
        let again = session.picture(&camera, &mut ()).expect("a frame").expect("a frame").pixels.radiance;
        assert!(first == again && first != whole, "{adapter}, {options}");
        first
    };
    for adapter in adapters() {
        let expected = picture("--cache 100% --schedule plain", &adapter);
        let all = ["--cache 20% --schedule chc", "--cache 30% --schedule demand --bands 3", "--tile 16 --cache 50%"];
        for options in &all[..if adapter == "cpu" { 3 } else { 1 }] {
            assert!(picture(options, &adapter) == expected, "{adapter}, {options}");
        }
    }
}

#[test]
fn a_name_that_nothing_has_is_refused_and_changes_nothing() {
    let folder = folder();
    let (_, text) = shapes();
    let scene = converted(folder.path(), &text, "");
    let error = Session::open(&scene, &settings("--hide wheel")).err().expect("an error");
    assert!(format!("{error:#}").contains("--hide wheel: no node has this name; there are left, right, bolt"));
    let plain = settings("--size 32x18");
    let mut session = Session::open(&scene, &plain).expect("a session");
    let camera = session.path().frame(0, 1);
    let before = session.picture(&camera, &mut ()).expect("a frame").expect("a frame").pixels.radiance;
    assert!(session.set(&settings("--size 32x18 --only wheel")).is_err() && *session.settings() == plain);
    assert!(session.picture(&camera, &mut ()).expect("a frame").expect("a frame").pixels.radiance == before);
}

#[test]
fn nodes_are_found_and_measured() {
    let folder = folder();
    let (triangles, text) = shapes();
    let scene = converted(folder.path(), &text, "--brick-triangles 100");
    let file = brickwalk::session::open_scene(&scene).expect("the scene");
    let (nodes, count) = find(&file.resident().manifest, "", 10);
    assert_eq!((nodes.len(), count), (4, 4));
    for (number, node) in nodes.iter().enumerate() {
        let [min, max] = extent(&file, &node.ids).expect("bricks").expect("triangles");
        let own = triangles[number * EACH..][..EACH].iter().flatten();
        let (least, most) = own.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(a, b), &p| (a.min(p), b.max(p)));
        assert!((min - least).length() + (max - most).length() < 1e-6, "{}: {min} and {least}", node.name);
    }
}
