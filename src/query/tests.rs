//! Queries against brute force over the triangles as truth decodes them, and against closed forms.

use super::aims::Aims;
use super::packet::Packet;
use super::*;
use crate::kernels::layout::NONE;
use crate::math::crossing::crossing;
use crate::math::random::Rng;
use crate::output::npy::Ray;
use crate::reference::{Truth, TruthRay};
use crate::settings::CacheSize;
use bricks::SceneFile;
use brickwalk_convert::build::{BuildSettings, LatticeStep, build};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{Mesh, Placement, Primitive, SourceScene};
use glam::DVec3;
use std::f64::consts::PI;
use std::sync::atomic::Ordering;

const IDENTITY: [f64; 12] = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
/// Turned about y and scaled; mirrored; far away and sheared.
const PLACES: [[f64; 12]; 3] = [
    [1.2, 0.0, 1.6, 10.0, 0.0, 2.0, 0.0, 0.5, -1.6, 0.0, 1.2, 2.0],
    [1.0, 0.0, 0.0, -7.0, 0.0, 1.0, 0.0, 0.25, 0.0, 0.0, -1.0, 4.0],
    [1.0, 0.25, 0.0, 500.0, 0.0, 2.0, 0.0, -300.0, 0.5, 0.0, 1.0, 20.0],
];

/// Middles of the spheres but for the one far away.
const CENTERS: [DVec3; 3] = [DVec3::ZERO, DVec3::new(10.0, 0.5, 2.0), DVec3::new(-7.0, 0.25, 4.0)];

/// A sphere of radius 1 of `n` rings, closed and seen from outside counter-clockwise. The first vertex of a triangle is
/// any corner. `without` leaves out so many triangles.
fn sphere(n: u32, without: usize) -> Mesh {
    let m = 2 * n;
    let mut positions = vec![[0.0, 1.0, 0.0]];
    for (ring, k) in (1..n).flat_map(|ring| (0..m).map(move |k| (ring, k))) {
        let (theta, phi) = (PI * f64::from(ring) / f64::from(n), 2.0 * PI * f64::from(k) / f64::from(m));
        positions.push([theta.sin() * phi.cos(), theta.cos(), -theta.sin() * phi.sin()]);
    }
    positions.push([0.0, -1.0, 0.0]);
    let at = |ring: u32, k: u32| 1 + (ring - 1) * m + k % m;
    let last = positions.len() as u32 - 1;
    let mut triangles = Vec::new();
    for k in 0..m {
        triangles.push([0, at(1, k), at(1, k + 1)]);
        triangles.push([at(n - 1, k + 1), at(n - 1, k), last]);
        for ring in 1..n - 1 {
            let [a, b, c, d] = [at(ring, k), at(ring + 1, k), at(ring + 1, k + 1), at(ring, k + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    for (number, triangle) in triangles.iter_mut().enumerate() {
        triangle.rotate_left(number % 3);
    }
    let kept = triangles.len() - without;
    let indices = triangles.into_iter().take(kept).flatten().collect();
    let primitive = Primitive { material: 0, positions, indices, ..Primitive::default() };
    Mesh { name: "sphere".into(), primitives: vec![primitive] }
}

/// Spheres: one baked into the world, others placed.
fn spheres(places: &[[f64; 12]], without: usize) -> SourceScene {
    let place = |matrix: &[f64; 12]| Placement { mesh: 0, world_from_mesh: *matrix, ..Placement::default() };
    SourceScene {
        meshes: vec![sphere(24, without)],
        placements: places.iter().map(place).collect(),
        materials: vec![bricks::Material::DIFFUSE],
        sources: vec![bricks::Source { name: "spheres".into(), bytes: 0, hash: "2d06800538d394c2".into() }],
        ..SourceScene::default()
    }
}

pub(super) fn convert(source: SourceScene, brick_triangles: u32) -> (tempfile::TempDir, Arc<SceneFile>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.bricks");
    let settings = BuildSettings {
        brick_triangles,
        threads: Some(1),
        lattice: Some(LatticeStep::Log2(-20)),
        instance_min_triangles: 1,
        ..BuildSettings::default()
    };
    build(source, &settings, &path, &Progress::hidden()).unwrap();
    let file = Arc::new(SceneFile::open(path).unwrap());
    (folder, file)
}

/// A point of the unit ball.
fn in_ball(rng: &mut Rng) -> DVec3 {
    loop {
        let point = DVec3::from_array([0; 3].map(|_| f64::from(rng.signed())));
        if point.length() <= 1.0 {
            return point;
        }
    }
}

pub(super) fn all_spheres() -> SourceScene {
    let places: Vec<[f64; 12]> = [IDENTITY].into_iter().chain(PLACES).collect();
    spheres(&places, 0)
}

/// Rays from about the spheres to about them; some along axes, some that end early or begin late.
pub(super) fn rays(count: usize) -> Vec<Ray> {
    let mut rng = Rng(7);
    let mut point = |spread: f64| CENTERS[rng.below(3) as usize] + spread * in_ball(&mut rng);
    let mut rays: Vec<Ray> = (0..count)
        .map(|i| {
            let (from, to) = (point(6.0), point(1.0));
            let (t_min, t_max) = [(0.0, f64::INFINITY), (0.25, 1.0), (0.0, 0.5), (-3.0, 4.0)][i % 4];
            Ray { origin: from.to_array(), direction: (to - from).to_array(), t_min, t_max }
        })
        .collect();
    // Through poles and along meridians, where vertices and edges are met exactly.
    for (origin, direction) in [([0.0, 5.0, 0.0], [0.0, -1.0, 0.0]), ([-4.0, 0.0, 0.0], [1.0, 0.0, 0.0])] {
        rays.push(Ray { origin, direction, t_min: 0.0, t_max: f64::INFINITY });
    }
    rays
}

/// Rays by eight that are much the same, or not so much.
fn bundles(count: usize) -> Vec<Ray> {
    let mut rng = Rng(11);
    let mut bundles = Vec::new();
    for (i, ray) in rays(count).iter().enumerate() {
        let spread = [0.0, 1e-6, 1e-3, 0.02][i % 4];
        bundles.extend((0..packet::MANY).map(|_| {
            let [origin, direction] = [ray.origin, ray.direction].map(|of| {
                let off = spread * in_ball(&mut rng);
                (DVec3::from_array(of) + off).to_array()
            });
            Ray { origin, direction, ..*ray }
        }));
    }
    bundles
}

/// Queries that have seen so many rays that they make the scene one tree, if they have room for it.
fn after_many(file: Arc<SceneFile>, cache: CacheSize, threads: usize) -> Queries {
    let queries = Queries::new(file, cache, threads).unwrap();
    queries.rays.store(1 << 40, Ordering::Relaxed);
    queries
}

fn has_tree(queries: &Queries) -> bool {
    queries.flat.get().is_some_and(Option::is_some)
}

fn brute(truth: &Truth, ray: &Ray) -> Vec<(f64, u32)> {
    let line = TruthRay::new(ray.origin, ray.direction, 0.0, 0.0).line();
    let met = |id| Some((crossing(&line, truth.vertices(id)?)?.t, id));
    let within = |&(t, _): &(f64, u32)| t >= ray.t_min.max(0.0) && t <= ray.t_max;
    let mut all: Vec<(f64, u32)> = truth.ids().filter_map(met).filter(within).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    all
}

#[test]
fn all_that_rays_meet_is_what_brute_force_finds() {
    let rays = rays(600);
    let mut lists = Vec::new();
    for (brick_triangles, cache) in [(1 << 14, 64 << 20), (128, 64 << 20), (128, 0)] {
        let (_folder, file) = convert(all_spheres(), brick_triangles);
        let truth = Truth::load(&file).unwrap();
        let queries = Queries::new(file, CacheSize::Bytes(cache), 2).unwrap();
        let found = queries.list_intersections(&rays, &mut |_| Ok(())).unwrap();
        let counts = queries.count_intersections(&rays, &mut |_| Ok(())).unwrap();
        for (number, ray) in rays.iter().enumerate() {
            let own = &found.hits[found.starts[number] as usize..found.starts[number + 1] as usize];
            let truth_of_all = brute(&truth, ray);
            let ids: Vec<(f64, u32)> = own.iter().map(|hit| (hit.t, hit.triangle)).collect();
            assert_eq!(ids, truth_of_all, "ray {number}");
            assert_eq!(counts[number] as usize, truth_of_all.len());
            let closest = truth.closest(&TruthRay::new(ray.origin, ray.direction, ray.t_min.max(0.0), ray.t_max));
            let first = own.first().map(|hit| (hit.t, [hit.u, hit.v]));
            assert_eq!(first.map(|f| f.0), closest.map(|hit| hit.t));
            if let (Some((_, [u, v])), Some(truth)) = (first, closest.filter(|truth| truth.id == own[0].triangle)) {
                assert!((f64::from(u) - truth.u).abs() < 1e-6 && (f64::from(v) - truth.v).abs() < 1e-6, "ray {number}");
            }
        }
        lists.push(found);
    }
    assert!(lists.windows(2).all(|pair| pair[0] == pair[1]), "bricks and caches do not show");
    assert!(lists[0].hits.len() > 600, "{}", lists[0].hits.len());
    let most = lists[0].starts.windows(2).map(|pair| pair[1] - pair[0]).max();
    assert!(most > Some(20), "the pole is met: {most:?}");
}

/// What brute force finds first.
fn first(truth: &Truth, ray: &Ray) -> Option<(f64, u32)> {
    brute(truth, ray).first().copied()
}

fn met(hit: &Hit) -> Option<(f64, u32)> {
    (hit.triangle != NONE).then_some((hit.t, hit.triangle))
}

#[test]
fn the_closest_hit_is_what_brute_force_finds() {
    let bundles = bundles(120);
    let mut rays = [bundles.clone(), rays(900)].concat();
    // From far away, where f64 knows less of them than a step of the lattice.
    let from_afar = |ray: &Ray| {
        let origin = [0, 1, 2].map(|k| ray.origin[k] - 1e9 * ray.direction[k]);
        Ray { origin, t_min: 0.0, t_max: f64::INFINITY, ..*ray }
    };
    let afar: Vec<Ray> = rays.iter().skip(bundles.len() / 2).take(60 + bundles.len() / 2).map(from_afar).collect();
    rays.extend(afar);
    let mut expected: Vec<Option<(f64, u32)>> = Vec::new();
    let mut all = Vec::new();
    let all_bricks = 1 << 20;
    let cases = [(1 << 14, 64 << 20, 1), (128, 64 << 20, 2), (128, all_bricks, 2), (128, 0, 2), (64, 0, 1)];
    for (brick_triangles, cache, threads) in cases {
        let (_folder, file) = convert(all_spheres(), brick_triangles);
        let truth = Truth::load(&file).unwrap();
        if expected.is_empty() {
            expected = rays.iter().map(|ray| first(&truth, ray)).collect();
        }
        let queries = after_many(file, CacheSize::Bytes(cache), threads);
        let hits = queries.cast(&rays, &mut |_| Ok(())).unwrap();
        let any = queries.any(&rays, &mut |_| Ok(())).unwrap();
        assert_eq!(has_tree(&queries), cache > all_bricks);
        let go_together = |first: &usize| {
            let aims = Aims::new(queries.top(), &Rays::from(&rays).columns(*first));
            Packet::new(queries.top(), &aims).is_some()
        };
        let together = (0..rays.len() - packet::MANY).step_by(packet::MANY).filter(go_together).count();
        assert!(together > bundles.len() / packet::MANY * 3 / 5, "{together} went together");
        let mut told = 0;
        for (number, ray) in rays.iter().enumerate() {
            let own = met(&hits[number]);
            assert_eq!(own, expected[number], "ray {number} {ray:?}");
            assert_eq!(any[number], own.is_some(), "ray {number}");
            if let Some((t, id)) = own {
                let [a, b, c] = truth.vertices(id).unwrap().map(DVec3::from_array);
                let normal = DVec3::from_array(hits[number].normal.map(f64::from));
                assert!((normal - (b - a).cross(c - a).normalize()).length() < 1e-6);
                let given = TruthRay::new(ray.origin, ray.direction, ray.t_min.max(0.0), ray.t_max);
                let expected = if number % 8 == 0 { truth.closest(&given) } else { None };
                if let Some(truth) = expected.filter(|truth| truth.id == id) {
                    assert_eq!(t, truth.t);
                    let [u, v] = [hits[number].u, hits[number].v].map(f64::from);
                    assert!((u - truth.u).abs() < 1e-6 && (v - truth.v).abs() < 1e-6, "ray {number}");
                    told += 1;
                }
            }
        }
        assert!(told > rays.len() / 24, "{told}");
        all.push(hits);
    }
    assert!(all.windows(2).all(|pair| pair[0] == pair[1]), "bricks, caches and threads do not show");
    let hits = all[0].iter().filter(|hit| hit.triangle != NONE).count();
    assert!((rays.len() / 3..rays.len() * 9 / 10).contains(&hits), "{hits}");
}

#[test]
fn short_rays_are_those_that_they_stand_for() {
    let (_folder, file) = convert(all_spheres(), 128);
    let queries = after_many(file, CacheSize::Auto, 2);
    let mut short: Vec<[f32; 6]> = [rays(900), bundles(60)]
        .concat()
        .iter()
        .enumerate()
        .map(|(number, ray)| {
            let [[a, b, c], way] = [ray.origin, ray.direction].map(|of| of.map(|x| x as f32));
            // Some bundles go elsewhere.
            let [d, e, f] = if (number / packet::MANY).is_multiple_of(3) { way.map(|x| -x) } else { way };
            [a, b, c, d, e, f]
        })
        .collect();
    // No whole number of eights.
    short.truncate(1381);
    let whole: Vec<Ray> = (0..short.len()).map(|number| Rays::from(short.as_slice()).get(number)).collect();
    let given = short.as_slice();
    let hits = queries.cast(given, &mut |_| Ok(())).unwrap();
    assert_eq!(hits, queries.cast(&whole, &mut |_| Ok(())).unwrap());
    assert_eq!(queries.any(given, &mut |_| Ok(())).unwrap(), queries.any(&whole, &mut |_| Ok(())).unwrap());
    let counts = queries.count_intersections(given, &mut |_| Ok(())).unwrap();
    assert_eq!(counts, queries.count_intersections(&whole, &mut |_| Ok(())).unwrap());
    let list = queries.list_intersections(given, &mut |_| Ok(())).unwrap();
    assert_eq!(list, queries.list_intersections(&whole, &mut |_| Ok(())).unwrap());
    assert!((300..1300).contains(&hits.iter().filter(|hit| hit.triangle != NONE).count()));
    // The control: a hair beside, hits are others.
    let beside: Vec<Ray> = whole.iter().map(|ray| Ray { origin: ray.origin.map(|x| x + 1e-6), ..*ray }).collect();
    assert_ne!(hits, queries.cast(&beside, &mut |_| Ok(())).unwrap());
    for (number, bad) in [(7, [f32::NAN, 0.0, 0.0, 1.0, 0.0, 0.0]), (1300, [0.0; 6]), (1380, [f32::INFINITY; 6])] {
        let mut short = short.clone();
        short[number] = bad;
        let error = queries.cast(short.as_slice(), &mut |_| Ok(())).unwrap_err();
        assert!(format!("{error:#}").starts_with(&format!("ray {number}: ")), "{error:#}");
    }
}

#[test]
fn instances_that_f32_does_not_know_are_asked_in_f64() {
    // A sphere that is a disc of a thousandth of a millionth of its radius, one that is as small as a step of its own
    // lattice where it lies, and one that is plain.
    let places = [
        [1.0, 0.0, 0.0, 0.0, 0.0, 1e-9, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0],
        [1e-7, 0.0, 0.0, 900.0, 0.0, 1e-7, 0.0, 1e5, 0.0, 0.0, 1e-7, -3e4],
        PLACES[0],
    ];
    let (_folder, file) = convert(spheres(&places, 0), 128);
    let truth = Truth::load(&file).unwrap();
    let queries = Queries::new(file.clone(), CacheSize::Bytes(0), 2).unwrap();
    let mut rng = Rng(11);
    let centers = [DVec3::ZERO, DVec3::new(900.0, 1e5, -3e4), CENTERS[1]];
    let rays: Vec<Ray> = (0..900)
        .map(|i| {
            let center = centers[i % 3];
            let size = [1.0, 1e-7, 1.0][i % 3];
            let (from, to) = (center + 4.0 * in_ball(&mut rng), center + size * in_ball(&mut rng));
            Ray { origin: from.to_array(), direction: (to - from).to_array(), t_min: 0.0, t_max: f64::INFINITY }
        })
        .collect();
    let hits = queries.cast(&rays, &mut |_| Ok(())).unwrap();
    let counts = queries.count_intersections(&rays, &mut |_| Ok(())).unwrap();
    for (number, ray) in rays.iter().enumerate() {
        let truth = brute(&truth, ray);
        assert_eq!(met(&hits[number]), truth.first().copied(), "ray {number} {ray:?}");
        assert_eq!(counts[number] as usize, truth.len(), "ray {number}");
    }
    let met = |which: usize| hits.iter().skip(which).step_by(3).filter(|hit| hit.triangle != NONE).count();
    assert!([0, 1, 2].iter().all(|&which| met(which) > 100), "{:?}", [0, 1, 2].map(met));
    // In one frame f32 does not tell the boxes of the small one apart, so that the scene stays in bricks.
    let queries = after_many(file, CacheSize::Bytes(64 << 20), 2);
    assert_eq!(queries.cast(&rays, &mut |_| Ok(())).unwrap(), hits);
    assert!(queries.flat.get().is_some_and(Option::is_none));
}

#[test]
fn the_scene_becomes_one_tree_where_it_pays_and_there_is_room() {
    let (_folder, file) = convert(all_spheres(), 128);
    let (rays, triangles) = (rays(400), file.resident().instances.len() * 48 * 46);
    let tree = flat::bytes(file.resident()).unwrap();
    assert!(tree as usize > triangles * 48, "{tree}");
    let cast = |queries: &Queries| queries.cast(&rays, &mut |_| Ok(())).unwrap();

    // Few rays do not pay for it.
    let queries = Queries::new(file.clone(), CacheSize::Auto, 2).unwrap();
    let hits = cast(&queries);
    assert!(!has_tree(&queries));
    queries.rays.store(triangles as u64 / 2, Ordering::Relaxed);
    let held = queries.stats().most_bytes;
    // Who stops it leaves all as it was.
    assert!(queries.cast(&rays, &mut |_| anyhow::bail!("enough")).is_err());
    assert!(!has_tree(&queries));
    assert_eq!(cast(&queries), hits);
    assert!(has_tree(&queries));
    assert!(queries.stats().most_bytes >= held.max(tree), "what it takes is told");

    let bricks = all_bytes(&file);
    let bricks = bricks + bricks / 2 + BESIDE;
    for (cache, has_one) in [
        (CacheSize::Percent(100.0), true),
        (CacheSize::Percent(99.0), false),
        (CacheSize::Bytes(bricks + tree), true),
        (CacheSize::Bytes(bricks + tree - 1), false),
    ] {
        let queries = after_many(file.clone(), cache, 2);
        assert_eq!(cast(&queries), hits);
        assert_eq!(has_tree(&queries), has_one, "{cache:?}");
    }
}

#[test]
fn rays_pass_through_what_is_cut_out() {
    let mut source = all_spheres();
    source.meshes.push(sphere(12, 0));
    source.placements.push(Placement {
        mesh: 1,
        world_from_mesh: [3.0, 0.0, 0.0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.0, 0.0, 3.0, 0.0],
        ..Placement::default()
    });
    source.meshes[1].primitives[0].material = 1;
    let masked = bricks::Material {
        flags: bricks::MATERIAL_MASK,
        base_color: [1.0, 1.0, 1.0, 0.25],
        alpha_cutoff: 0.5,
        ..bricks::Material::DIFFUSE
    };
    source.materials.push(masked);
    let rays = rays(400);
    let (_folder, file) = convert(source.clone(), 128);
    let truth = Truth::load(&file).unwrap();
    let queries = after_many(file, CacheSize::Bytes(64 << 20), 2);
    let hits = queries.cast(&rays, &mut |_| Ok(())).unwrap();
    assert!(!has_tree(&queries), "what rays pass through is in bricks alone");
    for (number, ray) in rays.iter().enumerate() {
        let truth = truth.closest(&TruthRay::new(ray.origin, ray.direction, ray.t_min.max(0.0), ray.t_max));
        assert_eq!(met(&hits[number]), truth.map(|hit| (hit.t, hit.id)), "ray {number}");
    }
    let listed = queries.list_intersections(&rays, &mut |_| Ok(())).unwrap();
    let differ = (0..rays.len()).filter(|&number| {
        let own = listed.hits[listed.starts[number] as usize..listed.starts[number + 1] as usize].first();
        own.and_then(met) != met(&hits[number])
    });
    assert!(differ.count() > 100, "the control: as geometry the sphere is there");
    // Blended, some rays pass and some do not, and the same ones whatever is asked beside.
    source.materials[1] =
        bricks::Material { flags: bricks::MATERIAL_BLEND, base_color: [1.0, 1.0, 1.0, 0.5], ..masked };
    let (_folder, file) = convert(source, 128);
    let queries = Queries::new(file, CacheSize::Bytes(0), 2).unwrap();
    let blended = queries.cast(&rays, &mut |_| Ok(())).unwrap();
    let own = |hits: &[Hit]| (0..rays.len()).filter(|&i| hits[i].triangle != blended[i].triangle).count();
    let whole: Vec<Hit> =
        (0..rays.len()).map(|i| listed.hits.get(listed.starts[i] as usize).copied().unwrap_or(hits[i])).collect();
    assert!(own(&hits) > 50 && own(&whole) > 50, "{} {}", own(&hits), own(&whole));
    assert_eq!(queries.cast(&rays[200..], &mut |_| Ok(())).unwrap(), blended[200..]);
}

#[test]
fn of_a_batch_no_brick_is_read_twice_and_none_that_is_not_needed() {
    let (_folder, file) = convert(all_spheres(), 64);
    let bricks = file.resident().exact_bricks() as u64;
    let read = |rays: &[Ray], cache: u64| {
        let queries = Queries::new(file.clone(), CacheSize::Bytes(cache), 2).unwrap();
        queries.any(rays, &mut |_| Ok(())).unwrap();
        queries.stats().payloads_read
    };
    let rays = rays(2000);
    let all = read(&rays, 0);
    assert!(all > bricks / 2 && all <= bricks, "{all} of {bricks}");
    // A bundle that meets one side of the first sphere.
    let bundle: Vec<Ray> = (0..100u32)
        .map(|i| {
            let at = |i: u32| 0.001 * f64::from(i);
            let origin = [at(i % 10), 5.0, at(i / 10)];
            Ray { origin, direction: [0.0, -1.0, 0.0], t_min: 0.0, t_max: f64::INFINITY }
        })
        .collect();
    let few = read(&bundle, 0);
    assert!(few <= 4, "{few}");
    let both: Vec<Ray> = bundle.iter().map(|ray| Ray { t_min: 4.5, ..*ray }).collect();
    assert!(read(&both, 0) > 0, "the control: the other side is there");
}

/// The nearest point of a triangle by regions of its plane (Ericson, Real-Time Collision Detection, 5.1.5).
fn nearest_by_regions(p: DVec3, [a, b, c]: [DVec3; 3]) -> DVec3 {
    let (ab, ac) = (b - a, c - a);
    let (d1, d2) = (ab.dot(p - a), ac.dot(p - a));
    let (d3, d4) = (ab.dot(p - b), ac.dot(p - b));
    let (d5, d6) = (ab.dot(p - c), ac.dot(p - c));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    } else if d3 >= 0.0 && d4 <= d3 {
        return b;
    } else if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let (va, vb, vc) = (d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2);
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        a + ab * (d1 / (d1 - d3))
    } else if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        a + ac * (d2 / (d2 - d6))
    } else if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)))
    } else {
        a + (ab * vb + ac * vc) / (va + vb + vc)
    }
}

fn points(count: usize) -> Vec<[f64; 3]> {
    let mut rng = Rng(3);
    let point = |i: usize| (CENTERS[i % 3] + [0.9, 1.1, 4.0, 300.0][i % 4] * in_ball(&mut rng)).to_array();
    let mut all: Vec<[f64; 3]> = (0..count).map(point).collect();
    all.extend([[0.0; 3], [0.0, 1.0, 0.0], [1e9, 0.0, 0.0], [1e25, 3e24, 0.0], [0.0, -1e90, 0.0]]);
    all
}

#[test]
fn the_nearest_point_is_what_brute_force_finds() {
    let points = points(300);
    let mut all = Vec::new();
    for (brick_triangles, cache) in [(1 << 14, 64 << 20), (128, 0)] {
        let (_folder, file) = convert(all_spheres(), brick_triangles);
        let truth = Truth::load(&file).unwrap();
        let queries = Queries::new(file, CacheSize::Bytes(cache), 2).unwrap();
        let found = queries.closest_points(&points, &mut |_| Ok(())).unwrap();
        for (point, found) in points.iter().zip(&found) {
            let p = DVec3::from_array(*point);
            let of = |id| truth.vertices(id).unwrap().map(DVec3::from_array);
            let near = |id: u32| (nearest_by_regions(p, of(id)) - p).length();
            let least = truth.ids().map(near).fold(f64::INFINITY, f64::min);
            let error = 1e-12 * (1.0 + p.abs().max_element());
            assert!((found.distance - least).abs() < error, "{point:?}: {} {least}", found.distance);
            assert!((near(found.triangle) - least).abs() < error, "the triangle is that of the point");
            let at = DVec3::from_array(found.point);
            assert!(
                ((at - p).length() - least).abs() < error
                    && (nearest_by_regions(at, of(found.triangle)) - at).length() < 1e-9,
                "{point:?}: {at} is on the triangle, however far the given point lies"
            );
        }
        all.push(found);
    }
    for (a, b) in all[0].iter().zip(&all[1]) {
        assert_eq!((a.point, a.distance, a.triangle, a.u, a.v), (b.point, b.distance, b.triangle, b.u, b.v));
    }
    // The control: of other points it is something else.
    assert_ne!(all[0][0].distance, all[0][1].distance);
}

#[test]
fn points_inside_are_those_of_the_spheres() {
    let (_folder, file) = convert(all_spheres(), 128);
    let queries = Queries::new(file, CacheSize::Bytes(0), 2).unwrap();
    assert!(queries.surfaces().unwrap().iter().all(|surface| surface.is_turned));
    let points = points(3000);
    let inside = queries.occupancy(&points, false, &mut |_| Ok(())).unwrap();
    let signed = queries.signed_distance(&points, false, &mut |_| Ok(())).unwrap();
    let matrices: Vec<glam::DAffine3> = [IDENTITY].iter().chain(&PLACES).map(crate::scene::placement::affine).collect();
    let (mut told, mut full) = (0, 0);
    for ((point, inside), signed) in points.iter().zip(inside).zip(signed) {
        // Of the least sphere, in radii: the mesh lies between cos² (π/48) and 1.
        let radius = |m: &glam::DAffine3| m.inverse().transform_point3(DVec3::from_array(*point)).length();
        let least = matrices.iter().map(radius).fold(f64::INFINITY, f64::min);
        if !(0.99..=1.001).contains(&least) {
            assert_eq!(inside, least < 1.0, "{point:?}");
            assert_eq!(signed < 0.0, inside);
            told += 1;
            full += u32::from(inside);
        }
    }
    assert!(told > 2900 && full > 500, "{told} {full}");
    // About the first sphere the distance is known.
    let signed = queries.signed_distance(&[[0.0, 0.5, 0.0], [0.0, 3.0, 0.0]], false, &mut |_| Ok(())).unwrap();
    assert!((signed[0] + 0.5).abs() < 0.005 && (signed[1] - 2.0).abs() < 1e-6, "{signed:?}");
}

#[test]
fn open_surfaces_have_no_inside() {
    let (_folder, file) = convert(spheres(&[IDENTITY], 1), 128);
    let queries = Queries::new(file, CacheSize::Bytes(0), 1).unwrap();
    assert!(!queries.surfaces().unwrap()[0].is_closed);
    let error = queries.occupancy(&[[0.0; 3]], false, &mut |_| Ok(())).unwrap_err().to_string();
    assert!(error.contains("scene.bricks: its surface is not closed"), "{error}");
    assert!(queries.occupancy(&[[0.0; 3]], true, &mut |_| Ok(())).is_ok());
}

#[test]
fn what_lies_between_hides() {
    let (_folder, file) = convert(spheres(&[IDENTITY], 0), 128);
    let queries = Queries::new(file.clone(), CacheSize::Bytes(0), 2).unwrap();
    let from = [[-3.0, 0.1, 0.2], [-3.0, 0.1, 0.2], [-3.0, 2.0, 0.0], [-3.0, 0.1, 0.2], [0.0, 0.0, 0.0]];
    let to = [[3.0, 0.1, 0.2], [-2.0, 0.1, 0.2], [3.0, 2.0, 0.0], [-3.0, 0.1, 0.2], [0.5, 0.0, 0.0]];
    let free = queries.visibility(&from, &to, &mut |_| Ok(())).unwrap();
    assert_eq!(free, [false, true, true, true, true]);
    // Points of the surface see what is above them, also when rounded to f32, and nothing beyond.
    // From very far away f64 has one distance for all of it.
    let is_above = |p: &[f64; 3]| (1.5..1e12).contains(&DVec3::from_array(*p).length());
    let above: Vec<[f64; 3]> = points(200).into_iter().filter(is_above).collect();
    let on = queries.closest_points(&above, &mut |_| Ok(())).unwrap();
    let rounded: Vec<[f64; 3]> = on.iter().map(|on| on.point.map(|x| f64::from(x as f32))).collect();
    assert!(queries.visibility(&rounded, &above, &mut |_| Ok(())).unwrap().iter().all(|&free| free));
    let beyond: Vec<[f64; 3]> = above.iter().map(|p| p.map(|x| -x)).collect();
    assert!(queries.visibility(&rounded, &beyond, &mut |_| Ok(())).unwrap().iter().all(|&free| !free));
}

#[test]
fn bad_input_is_named_and_work_can_be_stopped() {
    let (_folder, file) = convert(spheres(&[IDENTITY], 0), 128);
    let queries = Queries::new(file, CacheSize::Bytes(0), 1).unwrap();
    let text = |error: anyhow::Error| format!("{error:#}");
    let error = queries.closest_points(&[[0.0; 3], [0.0, f64::NAN, 0.0]], &mut |_| Ok(())).unwrap_err();
    assert!(text(error).starts_with("point 1: [0.0, NaN, 0.0] is not finite"));
    let ray = Ray { origin: [0.0; 3], direction: [0.0; 3], t_min: 0.0, t_max: 1.0 };
    let error = queries.count_intersections(&[ray], &mut |_| Ok(())).unwrap_err();
    assert_eq!(text(error), "ray 0: the direction has no length");
    assert!(queries.visibility(&[[0.0; 3]], &[], &mut |_| Ok(())).is_err());
    let stop = || -> Box<Watch> { Box::new(|_| anyhow::bail!("enough")) };
    let rays = rays(100);
    assert_eq!(text(queries.list_intersections(&rays, &mut *stop()).unwrap_err()), "enough");
    assert_eq!(text(queries.closest_points(&points(10), &mut *stop()).unwrap_err()), "enough");
    let mut told = 0;
    let mut count = |done: u64| {
        told += done;
        Ok(())
    };
    queries.count_intersections(&rays, &mut count).unwrap();
    queries.closest_points(&points(10), &mut count).unwrap();
    queries.signed_distance(&points(10), false, &mut count).unwrap();
    assert_eq!(told, (rays.len() + 2 * points(10).len()) as u64, "all items are told");
}

#[test]
fn nothing_is_asked_for_twice_and_an_empty_scene_answers() {
    let (_folder, file) = convert(all_spheres(), 64);
    let bricks = file.resident().exact_bricks() as u64;
    let queries = Queries::new(file, CacheSize::Bytes(64 << 20), 2).unwrap();
    queries.count_intersections(&rays(400), &mut |_| Ok(())).unwrap();
    let read = queries.stats().payloads_read;
    assert!(read > bricks / 2 && read <= bricks, "{read} of {bricks}");
    let (_folder, file) = convert(SourceScene { meshes: vec![], placements: vec![], ..all_spheres() }, 64);
    let queries = Queries::new(file, CacheSize::Bytes(0), 1).unwrap();
    let ray = Ray { origin: [0.0; 3], direction: [1.0, 0.0, 0.0], t_min: 0.0, t_max: 1.0 };
    assert_eq!(queries.count_intersections(&[ray], &mut |_| Ok(())).unwrap(), [0]);
    assert_eq!(queries.closest_points(&[[0.0; 3]], &mut |_| Ok(())).unwrap()[0].distance, f64::INFINITY);
    assert_eq!(queries.occupancy(&[[0.0; 3]], false, &mut |_| Ok(())).unwrap(), [false]);
}
