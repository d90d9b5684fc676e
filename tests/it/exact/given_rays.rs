//! Rays that are given in f64, from wherever they start: `t` is that of the given ray and the triangle, to f64's last
//! digits; hits of rays from far away are those of exact predicates.

use crate::common::{self, adapters, folder};
use bricks::SceneFile;
use brickwalk::kernels::frame::Frame;
use brickwalk::kernels::layout::NONE;
use brickwalk::output::npy::{Hit, Ray};
use brickwalk::reference::{Tally, Truth, TruthRay, judge};
use brickwalk::schedule::Pass;
use brickwalk::session::Session;
use brickwalk::session::opened::{Opened, open_scene};
use brickwalk::session::trace::{EXTENT, Surroundings, device_ray, find, for_rays, trace, trace_device};
use brickwalk::settings::Group;
use brickwalk_convert::build::{BuildSettings, build};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{IDENTITY, Mesh, Placement, Primitive, SourceScene};
use brickwalk_scenes::rotated_instances;
use glam::DVec3;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Squares of the hills along each side.
const SIDE: u32 = 40;

/// Distances of origins.
const DISTANCES: [f64; 6] = [1.0, 1e2, 1e4, 1e6, 1e9, 1e12];

fn random(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
    (*state >> 11) as f64 / (1u64 << 53) as f64
}

/// Gentle hills of 40 by 40 m that hide nothing of themselves from above, some way from the origin.
fn hills() -> SourceScene {
    let corner = [200.0, -300.0, 50.0];
    let point = |i: u32| {
        let [x, y] = [i % (SIDE + 1), i / (SIDE + 1)].map(f64::from);
        [corner[0] + x, corner[1] + y, corner[2] + 0.3 * (0.7 * x).sin() * (0.5 * y).cos()]
    };
    let square = |i: u32| {
        let a = i % SIDE + i / SIDE * (SIDE + 1);
        [a, a + 1, a + SIDE + 2, a, a + SIDE + 2, a + SIDE + 1]
    };
    let primitive = Primitive {
        positions: (0..(SIDE + 1).pow(2)).map(point).collect(),
        indices: (0..SIDE * SIDE).flat_map(square).collect(),
        ..Primitive::default()
    };
    SourceScene {
        meshes: vec![Mesh { name: "hills".into(), primitives: vec![primitive] }],
        placements: vec![Placement { name: "n".into(), world_from_mesh: IDENTITY, ..Placement::default() }],
        materials: vec![bricks::Material::DIFFUSE],
        sources: vec![bricks::Source { name: "hills".into(), bytes: 0, hash: "2d06800538d394c2".into() }],
        ..SourceScene::default()
    }
}

fn made(folder: &Path, source: SourceScene) -> PathBuf {
    let path = folder.join("scene.bricks");
    let settings = BuildSettings { brick_triangles: 200, ..BuildSettings::default() };
    build(source, &settings, &path, &Progress::hidden()).expect("a scene");
    path
}

fn opened(scene: &Path, adapter: &str) -> (Arc<SceneFile>, Opened) {
    let mut settings = for_rays(&common::settings("--cache 60%"));
    settings.set("adapter", adapter).expect("an adapter");
    let file = open_scene(scene).expect("the scene");
    let opened = Opened::open(file.clone(), scene, &settings).expect("a session");
    (file, opened)
}

/// A ray as truth takes it: nothing of it is rounded.
fn exact(ray: &Ray) -> TruthRay {
    TruthRay { reference: ray.origin, ..TruthRay::new([0.0; 3], ray.direction, ray.t_min, ray.t_max) }
}

/// Rays from above at points well within triangles, from `distance` away, of directions of all lengths.
fn aimed(truth: &Truth, distance: f64, count: usize) -> Vec<Ray> {
    let mut state = distance.to_bits();
    let ids: Vec<u32> = truth.ids().collect();
    let ray = |i: usize| {
        let [a, b, c] = truth.vertices(ids[i * 7919 % ids.len()]).expect("a triangle").map(DVec3::from_array);
        let [u, v] = [0.2 + 0.3 * random(&mut state), 0.2 + 0.3 * random(&mut state)];
        let to = a + (b - a) * u + (c - a) * v;
        let lean = DVec3::new(random(&mut state) - 0.5, random(&mut state) - 0.5, 1.0);
        let origin = to + lean.normalize() * distance;
        let direction = (to - origin).normalize() * [1.0, 1e-3, 731.0, 1e80][i % 4];
        Ray { origin: origin.to_array(), direction: direction.to_array(), t_min: 0.0, t_max: f64::INFINITY }
    };
    (0..count).map(ray).collect()
}

/// How far t is from truth, of what f64 can tell: a few roundings of t, and of what the scene's coordinates leave.
fn off(truth: f64, hit: f64, ray: &Ray) -> f64 {
    let length = DVec3::from_array(ray.direction).length();
    (hit - truth).abs() / (8.0 * f64::EPSILON * truth + 1e-11 / length)
}

#[test]
fn distances_and_hits_are_those_of_f64_from_any_distance() {
    let folder = folder();
    let scene = made(folder.path(), hills());
    for adapter in adapters() {
        let (file, mut opened) = opened(&scene, &adapter);
        let truth = Truth::load(&file).expect("truth");
        for distance in DISTANCES {
            let rays = aimed(&truth, distance, 1200);
            let (hits, _) = trace(&mut opened.traced(), &rays, false, &mut |_| ()).expect("hits");
            let place = format!("{adapter}, from {distance:e}");
            for (ray, hit) in rays.iter().zip(&hits) {
                let expected = truth.closest(&exact(ray)).expect("aimed at a triangle");
                assert_eq!(hit.triangle, expected.id, "{place}: {ray:?}");
                assert!(off(expected.t, hit.t, ray) <= 1.0, "{place}: {} is not {}", hit.t, expected.t);
                let error = (f64::from(hit.u) - expected.u).abs().max((f64::from(hit.v) - expected.v).abs());
                assert!(error < 1e-4, "{place}: {hit:?} is not {expected:?}");
                let [a, b, c] = truth.vertices(hit.triangle).expect("a triangle").map(DVec3::from_array);
                let normal = (b - a).cross(c - a).normalize();
                assert!(normal.z > 0.5, "counter-clockwise seen from above");
                assert!((DVec3::from_array(hit.normal.map(f64::from)) - normal).length() < 1e-6, "{place}");
            }
            // Control: the rays as f32 has them without being moved, and t in f32.
            let resident = file.resident();
            let frame = Frame::near(resident, DVec3::from_array(rays[0].origin));
            let device: Vec<_> = rays.iter().map(|ray| device_ray(ray, &frame)).collect();
            let asked: Vec<_> = device.iter().map(|ray| ray.ray).collect();
            let plain = trace_device(&mut opened.traced(), &frame, &asked, false, &mut Default::default());
            let wrong = |((ray, device), (hit, plain)): ((&Ray, &brickwalk::session::trace::DeviceRay), (&Hit, &_))| {
                let plain: &brickwalk::kernels::layout::Hit = plain;
                plain.id != hit.triangle || off(hit.t, f64::from(plain.t) * device.t_scale, ray) > 1.0
            };
            let plain = plain.expect("hits");
            let pairs = rays.iter().zip(&device).zip(hits.iter().zip(&plain));
            let wrong = pairs.filter(|pair| wrong(*pair)).count();
            assert!(wrong * 2 > rays.len(), "{place}: control: f32 alone is wrong for {wrong}");
            let others = hits.iter().zip(&plain).filter(|(hit, plain)| hit.triangle != plain.id).count();
            assert!(distance < 1e9 || others * 2 > rays.len(), "{place}: control: {others} other triangles");
        }
    }
}

/// Few rays take few rows of the block; many ones after them have all of theirs, and pictures are what they were.
#[test]
fn few_rays_take_few_rows() {
    let folder = folder();
    let scene = made(folder.path(), hills());
    for adapter in adapters() {
        let (file, mut opened) = opened(&scene, &adapter);
        let truth = Truth::load(&file).expect("truth");
        let rays = aimed(&truth, 10.0, 3000);
        let many = trace(&mut opened.traced(), &rays, false, &mut |_| ()).expect("hits").0;
        for count in [70, 1, 33] {
            let few = trace(&mut opened.traced(), &rays[..count], false, &mut |_| ()).expect("hits").0;
            assert!(few == many[..count], "{adapter}: {count} rays");
            let rows = opened.executor.read_hits(Pass::Primary).expect("hits").len() / EXTENT.width as usize;
            assert!(rows <= count.div_ceil(32), "{adapter}: {count} rays took {rows} rows");
        }
        let again = trace(&mut opened.traced(), &rays, false, &mut |_| ()).expect("hits").0;
        assert!(again == many, "{adapter}: many rays after few");

        let mut settings = common::settings("--size 40x24 --tile 8 --cache 60% --effects shadow,ao,diffuse");
        settings.set("adapter", &adapter).expect("an adapter");
        let mut session = Session::open(&scene, &settings).expect("a session");
        let camera = session.path().frame(0, 2);
        let picture = session.frame(&camera).expect("a frame").pixels.radiance;
        let few = session.trace(&rays[..5], false).expect("hits");
        assert!(few == many[..5], "{adapter}: rays between frames");
        let next = session.frame(&camera).expect("a frame").pixels.radiance;
        let mut fresh = Session::open(&scene, &settings).expect("a session");
        let of_fresh = [0; 2].map(|_| fresh.frame(&camera).expect("a frame").pixels.radiance);
        assert!([picture, next] == of_fresh, "{adapter}: rays between frames change the next");
    }
}

/// Intervals count from the given origin, to a part in 10^15 of the distance.
#[test]
fn intervals_of_rays_from_far_away_are_kept() {
    let folder = folder();
    let scene = made(folder.path(), hills());
    let (file, mut opened) = opened(&scene, "cpu");
    let truth = Truth::load(&file).expect("truth");
    for distance in [1e3, 1e6, 1e9, 1e12] {
        let rays: Vec<Ray> = aimed(&truth, distance, 400).into_iter().step_by(4).collect();
        let met = |change: &dyn Fn(f64) -> (f64, f64), opened: &mut Opened| {
            let changed = rays.iter().map(|ray| {
                let (t_min, t_max) = change(truth.closest(&exact(ray)).expect("a hit").t);
                Ray { t_min, t_max, ..*ray }
            });
            let changed: Vec<Ray> = changed.collect();
            let [hits, any] = [false, true].map(|any| {
                let (hits, _) = trace(&mut opened.traced(), &changed, any, &mut |_| ()).expect("hits");
                hits
            });
            let is_hit = |hit: &Hit| hit.triangle != NONE;
            assert!(hits.iter().zip(&any).all(|(hit, any)| is_hit(hit) == is_hit(any)));
            assert!(
                hits.iter().zip(&changed).all(|(hit, ray)| !is_hit(hit) || (ray.t_min..=ray.t_max).contains(&hit.t))
            );
            hits.iter().filter(|hit| is_hit(hit)).count()
        };
        assert_eq!(met(&|t| (t - 0.01, t + 0.01), &mut opened), rays.len(), "{distance:e}");
        assert_eq!(met(&|t| (0.0, t - 0.01), &mut opened), 0, "{distance:e}: ended before");
        assert_eq!(met(&|t| (t + 0.01, f64::INFINITY), &mut opened), 0, "{distance:e}: begun behind");
        assert_eq!(met(&|t| (-1.0, 0.5 * t), &mut opened), 0, "{distance:e}: ended far before");
        assert_eq!(met(&|t| (t + 1.0, t - 1.0), &mut opened), 0, "{distance:e}: empty");
        assert_eq!(met(&|_| (f64::NEG_INFINITY, f64::MAX), &mut opened), rays.len(), "{distance:e}: all");
        // Away from the scene, and past it.
        let away = rays.iter().map(|ray| Ray { direction: ray.direction.map(|d| -d), ..*ray });
        let past = rays.iter().map(|ray| {
            let [x, y, z] = ray.origin;
            Ray { origin: [x, y, z + 1.0], direction: [ray.direction[0], ray.direction[1], 0.0], ..*ray }
        });
        let others: Vec<Ray> = away.chain(past).collect();
        let (hits, _) = trace(&mut opened.traced(), &others, false, &mut |_| ()).expect("hits");
        assert!(hits.iter().all(|hit| hit.triangle == NONE && hit.t == f64::INFINITY), "{distance:e}");
    }
}

/// Rotated, scaled and overlapping instances: the device's hits of the moved rays by the judge, and t in f64.
#[test]
fn instances_are_hit_from_far_away() {
    let folder = folder();
    let scene = made(folder.path(), rotated_instances(5));
    let (file, mut opened) = opened(&scene, "cpu");
    let resident = file.resident();
    assert!(resident.instances.len() > 8, "they stay instances");
    let surroundings = Surroundings::new(resident).expect("there is something");
    let truth = Truth::load(&file).expect("truth");
    for distance in [3.0, 1e6, 1e12] {
        let rays = aimed(&truth, distance, 1500);
        let (found, _) = find(&mut opened.traced(), &rays, false, &mut |_| ()).expect("hits");
        let mut tally = Tally::default();
        let mut closest = vec![None; rays.len()];
        found.iter().for_each(|found| closest[found.ray] = Some(found));
        for (ray, found) in rays.iter().zip(&closest) {
            let near = surroundings.approach(ray).expect("it comes near").ray;
            let frame = Frame::near(resident, DVec3::from_array(near.origin));
            let device = device_ray(&near, &frame);
            let [o, d] = [device.ray.origin, device.ray.direction];
            let asked = TruthRay::from_f32(frame.origin.to_array(), frame.unit, o, d, device.ray.t_min, f32::INFINITY);
            tally.add(judge(&truth, &asked, found.map(|found| (found.id, found.t / device.t_scale))));
        }
        println!("instances, from {distance:e}: {tally}");
        assert_eq!(tally.mismatches, 0, "from {distance:e}: {tally}");
        let (hits, _) = trace(&mut opened.traced(), &rays, false, &mut |_| ()).expect("hits");
        let (mut same, mut fine, mut coarse) = (0, 0, 0);
        for ((ray, hit), found) in rays.iter().zip(&hits).zip(&closest) {
            let Some((expected, found)) = truth.closest(&exact(ray)).zip(*found) else { continue };
            if expected.id != hit.triangle {
                continue;
            }
            same += 1;
            // Grazing triangles magnify what is rounded.
            fine += usize::from(off(expected.t, hit.t, ray) <= 4.0);
            let start = surroundings.approach(ray).expect("it comes near").start;
            coarse += usize::from(off(expected.t, start + found.t, ray) <= 4.0);
        }
        assert!(same > 1300, "from {distance:e}: {same} of 1500 as truth has it");
        assert!(fine * 50 > same * 49, "from {distance:e}: {fine} of {same} distances");
        assert!(distance > 1e9 || coarse * 2 < same, "from {distance:e}: control: {coarse} of {same} by the device");
    }
}
