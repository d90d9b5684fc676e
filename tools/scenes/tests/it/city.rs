//! The generated city as a whole: counts, determinism, the fixed centre, sound geometry, and the way through it.

use crate::common::{Near, filled, position, same_mesh, triangles};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{Mesh, PART_TRIANGLES, Source, SourceScene};
use brickwalk_scenes::{CameraPath, Error, Kind, Scene, Settings, generate, write_paths};
use glam::DVec3;

fn lazy(triangles: u64, seed: u64, instanced: bool) -> Scene {
    let settings = Settings { kind: Kind::City, triangles, seed, instanced, ..Settings::default() };
    generate(&settings, &Progress::hidden()).expect("a count in range")
}

fn city(triangles: u64, seed: u64, instanced: bool) -> SourceScene {
    lazy(triangles, seed, instanced).whole()
}

fn near_path(seed: u64, frames: u32) -> CameraPath {
    lazy(10_000, seed, false).near_path(frames)
}

#[test]
fn counts_are_as_asked() {
    for (wanted, least) in [(10_000, 0.97), (30_000, 0.97), (100_000, 0.95), (333_333, 0.95), (1_000_000, 0.97)] {
        for seed in [0, 1, 77] {
            let scene = lazy(wanted, seed, false);
            let got = scene.placed_triangles();
            assert!(got <= wanted && got as f64 >= least * wanted as f64, "seed {seed}: {got} of {wanted}");
            let sources = &scene.outline().sources;
            assert_eq!(sources.len(), 1);
            assert_eq!(sources[0].name, format!("city seed={seed} triangles={wanted}"));
        }
    }
}

#[test]
fn parts_are_what_the_outline_says_in_any_order() {
    for instanced in [false, true] {
        let scene = lazy(150_000, 6, instanced);
        let (outline, whole) = (scene.outline(), scene.whole());
        let mut parts: Vec<(usize, usize)> = outline
            .meshes
            .iter()
            .enumerate()
            .flat_map(|(m, mesh)| (0..mesh.parts.len()).map(move |p| (m, p)))
            .collect();
        // Every third first, so that meshes leave the few that are kept and come back.
        parts.sort_by_key(|(m, p)| ((m + p) % 3, *p, *m));
        for (m, p) in parts {
            let (said, part) = (outline.meshes[m].parts[p], scene.part(m, p).expect("a part"));
            assert_eq!((said.triangles, said.primitive), (part.indices.len() as u32 / 3, p as u32));
            assert!((1..=PART_TRIANGLES).contains(&said.triangles));
            let one = |primitive| Mesh { name: String::new(), primitives: vec![primitive] };
            assert!(same_mesh(&one(part.into_owned()), &one(whole.meshes[m].primitives[p].clone())), "{m} {p}");
        }
        assert!(scene.texture(0).is_err());
    }
}

#[test]
fn counts_out_of_range_name_the_range() {
    for triangles in [0, 9_999, 150_000_001, u64::MAX] {
        let settings = Settings { triangles, ..Settings::default() };
        let error = generate(&settings, &Progress::hidden()).err().expect("out of range");
        assert!(matches!(error, Error::Triangles { asked, .. } if asked == triangles));
        assert!(error.to_string().contains("10000 to 150000000"), "{error}");
    }
    assert!("town".parse::<Kind>().expect_err("no such kind").to_string().contains("city"));
    assert_eq!("city".parse::<Kind>().expect("a kind").to_string(), "city");
}

#[test]
fn one_seed_gives_one_city_on_any_number_of_threads() {
    let on = |threads: usize, seed: u64| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| city(300_000, seed, false))
    };
    let (one, three, other) = (on(1, 5), on(3, 5), on(3, 6));
    let same = |a: &SourceScene, b: &SourceScene| {
        a.meshes.len() == b.meshes.len() && a.meshes.iter().zip(&b.meshes).all(|(p, q)| same_mesh(p, q))
    };
    assert!(same(&one, &three));
    assert!(!same(&one, &other), "another seed must give another city");
}

#[test]
fn a_larger_city_has_the_same_centre() {
    let (small, large) = (city(400_000, 3, false), city(1_200_000, 3, false));
    // The last block of the small city is cut to the budget, and the surroundings follow it.
    let whole = small.meshes.len() - 2;
    assert!(whole >= 5, "only {whole} whole blocks");
    for k in 0..whole {
        assert!(same_mesh(&small.meshes[k], &large.meshes[k]), "block {k}");
    }
    assert!(!same_mesh(&small.meshes[whole], &large.meshes[whole]), "the cut block must differ");
}

#[test]
fn geometry_is_sound() {
    let scene = city(1_000_000, 2, false);
    for mesh in &scene.meshes {
        assert!(!mesh.primitives.is_empty(), "{}", mesh.name);
        for p in &mesh.primitives {
            assert!((p.material as usize) < scene.materials.len());
            let colors = p.colors.as_ref().expect("vertex colours");
            assert_eq!(colors.len(), p.positions.len());
            assert!(p.positions.iter().flatten().all(|x| x.is_finite()), "{}", mesh.name);
            assert!(colors.iter().flatten().all(|c| (0.0..=1.0).contains(c)), "{} {}", mesh.name, p.material);
            assert!(p.indices.len() % 3 == 0 && p.indices.iter().all(|&i| (i as usize) < p.positions.len()));
        }
    }
    for [a, b, c] in triangles(&scene) {
        let area = 0.5 * (b - a).cross(c - a).length();
        assert!(area > 1e-8, "a triangle of {area} m² at {a}");
    }
    for m in &scene.materials {
        assert!(m.base_color.iter().all(|c| (0.0..=1.0).contains(c)));
    }
}

#[test]
fn instances_are_the_same_triangles() {
    let (baked, instanced) = (lazy(500_000, 4, false), lazy(500_000, 4, true));
    assert_eq!(baked.placed_triangles(), instanced.placed_triangles());
    let (baked, instanced) = (baked.whole(), instanced.whole());
    assert!(instanced.placements.len() > 10 * baked.placements.len());
    let stored = |s: &SourceScene| s.meshes.iter().map(Mesh::triangle_count).sum::<u64>();
    assert!(stored(&instanced) < stored(&baked) * 9 / 10);
    let moments = |s: &SourceScene| {
        triangles(s)
            .fold([DVec3::ZERO; 2], |[sum, squares], [a, b, c]| [sum + a + b + c, squares + a * a + b * b + c * c])
    };
    let (p, q) = (moments(&baked), moments(&instanced));
    for k in 0..2 {
        // Half a million vertices of up to 400 m, added in another order: 10⁻⁹ of the sum of squares is far above it.
        assert!((p[k] - q[k]).abs().max_element() < 1e-9 * p[1].max_element(), "{} {}", p[k], q[k]);
    }
}

#[test]
fn the_walk_keeps_clear_of_everything() {
    for seed in [0, 1, 2] {
        let path = near_path(seed, 300);
        let scene = city(900_000, seed, false);
        let all = Near::new(triangles(&scene));
        for k in 0..300 {
            let p = position(&path, k);
            let near = all.clearance(p, 0.5);
            assert!(near > 0.5, "seed {seed}, frame {k} at {p}: something within {near} m");
        }
        // Beside the way, where cars stand, it would not be.
        let beside = (0..300).filter(|&k| {
            let (p, t) = (position(&path, k), DVec3::from_array(path.keyframes[k].target));
            let side = (t - p).cross(DVec3::Y).normalize();
            all.clearance(p + side * 4.1 - DVec3::Y * 0.7, 0.5) < 0.5
        });
        assert!(beside.count() > 10, "the test does not see cars");
    }
}

#[test]
fn the_walk_goes_half_a_metre_a_frame() {
    let (short, long) = (near_path(9, 30), near_path(9, 300));
    assert_eq!((short.keyframes.len(), long.keyframes.len()), (30, 300));
    assert_eq!(short.keyframes[..], long.keyframes[..30], "the short walk is the beginning of the long one");
    for k in 1..300 {
        let step = (position(&long, k) - position(&long, k - 1)).length();
        // Chords of the turns are shorter than their arcs, corner pieces between them more so.
        assert!((0.49..=0.5 + 1e-9).contains(&step), "step {step} at {k}");
        assert_eq!(long.keyframes[k].position[1], 1.7);
        assert!(long.keyframes[k].time > long.keyframes[k - 1].time);
    }
    let heading = |k: usize| DVec3::from_array(long.keyframes[k].target) - position(&long, k);
    let turned = (1..300).filter(|&k| heading(k).angle_between(heading(k - 1)) > 0.01).count();
    assert!(turned > 30, "the walk has turns");
    assert!((1..300).all(|k| heading(k).angle_between(heading(k - 1)) < 0.2), "and none is abrupt");
}

#[test]
fn the_path_above_sees_the_whole_city() {
    let scene = lazy(600_000, 1, false);
    let path = scene.far_path();
    let scene = scene.whole();
    let blocks = scene.meshes.iter().filter(|m| m.name.starts_with("block"));
    let points: Vec<DVec3> =
        blocks.flat_map(|m| &m.primitives).flat_map(|p| &p.positions).map(|p| DVec3::from_array(*p)).collect();
    let roofs = points.iter().map(|p| p.y).fold(0.0, f64::max);
    for k in &path.keyframes {
        assert!(k.position[1] > roofs, "{} above {roofs}", k.position[1]);
    }
    let widest = filled(&path, &points, "city");
    assert!(widest > 0.85, "the city fills the picture to {widest} only");
}

#[test]
fn paths_are_written_whole_and_read_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = lazy(20_000, 8, false);
    let files = write_paths(&scene, &folder.path().join("A.bricks")).expect("paths");
    let mut names: Vec<String> = std::fs::read_dir(folder.path())
        .expect("the folder")
        .map(|e| e.expect("an entry").file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    assert_eq!(names, ["A.far.json", "A.near-300.json", "A.near.json"]);
    let text = std::fs::read_to_string(folder.path().join("A.near.json")).expect("the near path");
    let read: CameraPath = serde_json::from_str(&text).expect("a camera path");
    assert_eq!(read, near_path(8, 30));
    let value: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let keys = |v: &serde_json::Value| v.as_object().expect("an object").keys().cloned().collect::<Vec<_>>();
    assert_eq!(keys(&value), ["fov_y_degrees", "up", "keyframes"]);
    assert_eq!(keys(&value["keyframes"][0]), ["time", "position", "target"]);
    write_paths(&lazy(60_000, 8, false), &folder.path().join("B")).expect("paths");
    let same = |name: &str| {
        let read = |stem: &str| std::fs::read(folder.path().join(format!("{stem}.{name}.json"))).expect("a file");
        read("A") == read("B")
    };
    assert!(same("near") && !same("far"), "near is the same for every size, far is not");
    assert_eq!(files.len(), 3);
    let nowhere = folder.path().join("missing/A");
    assert!(matches!(write_paths(&scene, &nowhere), Err(Error::Write { .. })));
}
