//! What holds for generated scenes of every kind: counts, parts, determinism, sound geometry, and the ways through
//! them.

use crate::common::{Near, clearance, filled, position, same_mesh, triangles};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{Mesh, PART_TRIANGLES, Source};
use brickwalk_scenes::{Kind, Scene, Settings, generate};
use glam::DVec3;

fn scene(kind: Kind, triangles: u64, seed: u64) -> Scene {
    let settings = Settings { kind, triangles, seed, ..Settings::default() };
    generate(&settings, &Progress::hidden()).expect("a count in range")
}

#[test]
fn counts_are_as_asked() {
    for kind in Kind::ALL {
        let least = *kind.triangles().start();
        for wanted in [least, 123_456.max(least + 7), 700_000, 1_500_000] {
            for seed in [0, 9] {
                let got = scene(kind, wanted, seed).placed_triangles();
                assert!(got <= wanted && 20 * got >= 19 * wanted, "{kind}, seed {seed}: {got} of {wanted}");
            }
        }
        for asked in [0, least - 1, kind.triangles().end() + 1, u64::MAX] {
            let settings = Settings { kind, triangles: asked, ..Settings::default() };
            let error = generate(&settings, &Progress::hidden()).err().expect("out of range").to_string();
            assert!(
                error.contains(&format!("{kind} of {asked} triangles")) && error.contains(&least.to_string()),
                "{error}"
            );
        }
    }
}

#[test]
fn copies_lie_apart_and_share_their_meshes() {
    let one = scene(Kind::Pipes, 20_000, 3);
    let settings = Settings { kind: Kind::Pipes, triangles: 20_000, seed: 3, copies: 5, ..Settings::default() };
    let five = generate(&settings, &Progress::hidden()).expect("a count in range");
    let (single, placed) = (&one.outline().placements, &five.outline().placements);
    assert_eq!(five.outline().meshes, one.outline().meshes);
    assert_eq!((placed.len(), five.placed_triangles()), (5 * single.len(), 5 * one.placed_triangles()));
    assert_eq!(five.near_path(30), one.near_path(30), "the first copy is where the one is");
    let shift = |copy: usize| [3, 7, 11].map(|k| placed[copy * single.len()].world_from_mesh[k]);
    for a in 0..5 {
        for b in 0..a {
            let apart = DVec3::from_array(shift(a)) - DVec3::from_array(shift(b));
            assert!(apart.length() > 10.0 && apart.y == 0.0, "copies {a} and {b}: {apart}");
        }
    }
    // Farther away, to see them all.
    let height = |scene: &Scene| scene.far_path().keyframes[0].position[1];
    assert!(height(&five) > height(&one));
    let name = &five.outline().sources[0].name;
    assert_eq!(Settings::of_source(name), Some(settings), "{name}");
}

#[test]
fn parts_are_what_the_outline_says() {
    for kind in Kind::ALL {
        let scene = scene(kind, 500_000, 2);
        let (outline, whole) = (scene.outline(), scene.whole());
        for (m, mesh) in outline.meshes.iter().enumerate() {
            let mut of_primitives = vec![0; whole.meshes[m].primitives.len()];
            for (p, said) in mesh.parts.iter().enumerate() {
                let part = scene.part(m, p).expect("a part");
                assert_eq!(said.triangles as usize, part.indices.len() / 3, "{kind}: {} {p}", mesh.name);
                assert!((1..=PART_TRIANGLES).contains(&said.triangles));
                of_primitives[said.primitive as usize] += part.indices.len();
            }
            let real: Vec<usize> = whole.meshes[m].primitives.iter().map(|p| p.indices.len()).collect();
            assert_eq!(of_primitives, real, "{kind}: {}", mesh.name);
        }
        assert!(outline.placements.iter().all(|p| (p.mesh as usize) < outline.meshes.len()));
        let mut used: Vec<u32> = outline.placements.iter().map(|p| p.mesh).collect();
        used.sort_unstable();
        used.dedup();
        assert_eq!(used.len(), outline.meshes.len(), "{kind}: every mesh is used");
    }
}

#[test]
fn one_seed_gives_one_scene_on_any_number_of_threads() {
    for kind in Kind::ALL {
        let on = |threads: usize, seed: u64| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| scene(kind, 150_000.max(*kind.triangles().start()), seed).whole())
        };
        let same = |a: &[Mesh], b: &[Mesh]| a.len() == b.len() && a.iter().zip(b).all(|(p, q)| same_mesh(p, q));
        let (one, three, other) = (on(1, 5), on(3, 5), on(3, 6));
        assert!(same(&one.meshes, &three.meshes), "{kind}");
        let matrices = |s: &brickwalk_convert::source::SourceScene| -> Vec<(u32, [f64; 12])> {
            s.placements.iter().map(|p| (p.mesh, p.world_from_mesh)).collect()
        };
        assert_eq!(matrices(&one), matrices(&three), "{kind}");
        let differs = !same(&one.meshes, &other.meshes) || matrices(&one) != matrices(&other);
        assert!(differs, "{kind}: another seed must give another scene");
    }
}

#[test]
fn geometry_is_sound() {
    for kind in Kind::ALL {
        let scene = scene(kind, 600_000, 4).whole();
        for mesh in &scene.meshes {
            for p in &mesh.primitives {
                let what = format!("{kind}: {} {}", mesh.name, p.material);
                assert!((p.material as usize) < scene.materials.len(), "{what}");
                let colors = p.colors.as_ref().expect("vertex colours");
                assert_eq!(colors.len(), p.positions.len(), "{what}");
                assert!(colors.iter().flatten().all(|c| (0.0..=1.0).contains(c)), "{what}");
                assert!(p.positions.iter().flatten().all(|x| x.is_finite() && x.abs() < 1e5), "{what}");
                assert!(p.indices.iter().all(|&i| (i as usize) < p.positions.len()), "{what}");
                let Some(normals) = &p.normals else { continue };
                assert_eq!(normals.len(), p.positions.len(), "{what}");
                // f32 normals of unit f64 vectors.
                let length = |n: &[f32; 3]| n.iter().map(|x| x * x).sum::<f32>().sqrt();
                assert!(normals.iter().all(|n| (length(n) - 1.0).abs() < 1e-5), "{what}");
                let agree = p.indices.chunks_exact(3).filter(|t| {
                    let [a, b, c] = [0, 1, 2].map(|k| DVec3::from_array(p.positions[t[k] as usize]));
                    let n: DVec3 = t.iter().map(|&k| DVec3::from_array(normals[k as usize].map(f64::from))).sum();
                    (b - a).cross(c - a).dot(n) > 0.0
                });
                // Normals of smooth surfaces agree with the winding, but for creases that the division does not
                // resolve.
                let (agree, all) = (agree.count(), p.indices.len() / 3);
                assert!(agree as f64 >= 0.97 * all as f64, "{what}: {agree} of {all} normals are on the outside");
            }
        }
        let mut thin = 0usize;
        let mut all = 0usize;
        for [a, b, c] in triangles(&scene) {
            let longest = (b - a).length().max((c - b).length()).max((a - c).length());
            let height = (b - a).cross(c - a).length() / longest;
            assert!(height > 0.0, "{kind}: a triangle without area at {a}");
            all += 1;
            thin += usize::from(height < 1e-4 * longest);
        }
        assert!(thin * 1000 <= all, "{kind}: {thin} of {all} triangles are slivers");
    }
}

#[test]
fn near_paths_keep_clear_and_go_on() {
    // The last: how far beside the way there are things.
    for (kind, step, free, aside) in
        [(Kind::City, 0.5, 0.5, 4.1), (Kind::Pipes, 0.5, 0.35, 1.8), (Kind::Terrain, 0.5, 0.35, 4.5)]
    {
        for seed in [0, 1] {
            let small = scene(kind, *kind.triangles().start(), seed);
            let large = scene(kind, 1_500_000, seed);
            let (short, long) = (large.near_path(30), large.near_path(300));
            assert_eq!(short.keyframes[..], long.keyframes[..30], "{kind}: the short path begins the long one");
            assert_eq!(long, small.near_path(300), "{kind}: the path does not depend on the count");
            let start = [DVec3::INFINITY, DVec3::NEG_INFINITY];
            let [low, high] = (0..300).fold(start, |[a, b], k| [a.min(position(&long, k)), b.max(position(&long, k))]);
            let by_the_way = |t: &[DVec3; 3]| {
                (0..3).all(|c| t.iter().any(|p| p[c] > low[c] - 6.0) && t.iter().any(|p| p[c] < high[c] + 6.0))
            };
            let all = Near::new(triangles(&large.whole()).filter(by_the_way));
            for k in (0..300).step_by(2) {
                let p = position(&long, k);
                let near = all.clearance(p, free);
                assert!(near > free, "{kind}, seed {seed}, frame {k} at {p}: something within {near} m");
                if k > 0 {
                    let went = p.distance(position(&long, k - 1));
                    // Chords are shorter than arcs; terrain adds rise.
                    assert!(went > 0.95 * step && went < 1.35 * step, "{kind}: {went} m at {k}");
                }
            }
            // The same test must see what the way passes by.
            let beside = (0..300).step_by(4).filter(|&k| {
                let p = position(&long, k);
                let side = (DVec3::from_array(long.keyframes[k].target) - p).cross(DVec3::Y).normalize();
                [-aside, aside].iter().any(|s| all.clearance(p + side * *s - DVec3::Y * 0.7, 0.8) < 0.8)
            });
            assert!(beside.count() > 3, "{kind}: nothing beside the way");
        }
    }
}

#[test]
fn the_path_around_the_teapot_is_near_and_clear() {
    let small = scene(Kind::Stadium, 500_000, 3);
    let large = scene(Kind::Stadium, 1_200_000, 3);
    let (short, long) = (large.near_path(30), large.near_path(300));
    assert_eq!(short.keyframes[..], long.keyframes[..30]);
    assert_eq!(long, small.near_path(300));
    let middle = DVec3::new(0.0, 1.15, 0.0);
    let all: Vec<[DVec3; 3]> =
        triangles(&large.whole()).filter(|t| t.iter().any(|p| p.distance(middle) < 1.0)).collect();
    let extent = triangles(&large.whole()).flatten().filter(|p| p.y > 0.5).map(|p| p.length()).fold(0.0, f64::max);
    assert!(extent > 100.0, "a stadium of {extent} m");
    for k in (0..300).step_by(3) {
        let near = clearance(&all, position(&long, k), 0.5);
        assert!(near > 0.1 && near < 0.5, "frame {k}: the nearest thing is {near} m away");
    }
    // What more triangles go into: the teapot's become smaller.
    let smallest = |scene: &Scene| {
        let whole = scene.whole();
        let edges = triangles(&whole).filter(|t| t[0].distance(middle) < 0.25).map(|t| t[0].distance(t[1]));
        edges.fold(f64::INFINITY, f64::min)
    };
    assert!(smallest(&large) < 0.8 * smallest(&small));
}

#[test]
fn far_paths_see_everything() {
    for kind in Kind::ALL {
        let scene = scene(kind, 500_000, 1);
        let path = scene.far_path();
        let mut points: Vec<DVec3> = triangles(&scene.whole()).map(|t| t[0]).collect();
        if kind != Kind::Terrain {
            // The land around is meant to reach out of the picture.
            points.retain(|p| p.y > 0.5);
        }
        let widest = filled(&path, &points, &kind.to_string());
        assert!(widest > 0.7, "{kind} fills the picture to {widest} only");
    }
}
