//! Scenes of unpleasant shape: huge beside tiny, duplicates, equal centroids, nothing.

use super::decode::decode;
use super::scenes::*;
use super::structure::check;
use bricks::{BRICK_WIDE, MAX_BRICK_HEIGHT};
use brickwalk_convert::build::{BuildSettings, LatticeStep};

#[test]
fn a_huge_triangle_beside_tiny_ones_makes_wide_bricks() {
    let mut triangles = vec![[[-4e5, -1.0, -3e5], [5e5, -1.0, 2e5], [1e5, -1.0, 6e5]]];
    let mut random = Random(3);
    for _ in 0..3000 {
        let p = random.point(2.0);
        triangles.push([p, p, p].map(|p| std::array::from_fn(|k| p[k] + random.point(0.01)[k])));
    }
    // Far enough from the huge one's middle that both ends of a brick's range are in use.
    let scene = decode(
        &built(
            &plain(vec![soup(&triangles)]),
            &BuildSettings { lattice: Some(LatticeStep::Log2(-20)), ..settings(100) },
        )
        .path(),
    );
    check(&scene);
    let wide = scene.bricks.iter().filter(|brick| brick.record.flags & BRICK_WIDE != 0).count();
    assert_eq!(wide, 1);
    assert!(scene.resident.manifest.has_wide_bricks);
    assert_eq!(scene.triangles(0).len(), 3001);
    let corners = scene.triangles(0)[&0].corners;
    assert!(corners.contains(&[-4e5, -1.0, -3e5].map(|x: f64| (x * 1048576.0) as i64)), "{corners:?}");
}

#[test]
fn duplicates_make_bricks_of_bounded_height() {
    let triangles = vec![[[0.0, 0.0, 0.0], [1.0, 0.0, 0.5], [0.0, 1.0, 0.25]]; 100_000];
    let scene = decode(&built(&plain(vec![soup(&triangles)]), &settings(16384)).path());
    check(&scene);
    assert_eq!(scene.triangles(0).len(), 100_000);
    assert!(scene.bricks.iter().all(|brick| brick.record.height <= MAX_BRICK_HEIGHT && brick.vertices.len() == 3));
    assert_eq!(scene.bricks.len(), 8);
}

#[test]
fn equal_centroids_make_bricks() {
    let triangles: Vec<_> = (1..5000)
        .map(|i| {
            let r = f64::from(i);
            // Boxes of all of them are centred on the origin.
            [[-r, -r, 0.0], [r, -r, 0.0], [0.0, r, 0.0]]
        })
        .collect();
    let scene = decode(&built(&plain(vec![soup(&triangles)]), &settings(700)).path());
    check(&scene);
    assert_eq!(scene.triangles(0).len(), 4999);
    assert!(scene.bricks.iter().all(|brick| brick.ids.len() <= 700));
}

#[test]
fn a_geometric_series_has_bounded_height() {
    let triangles: Vec<_> = (0..2000)
        .map(|i| {
            let r = 0.985f64.powi(i) * 1000.0;
            [[0.0, 0.0, 0.0], [r, r * 0.5, 0.0], [r, 0.0, r * 0.25]]
        })
        .collect();
    let scene = decode(&built(&plain(vec![soup(&triangles)]), &settings(2000)).path());
    check(&scene);
    assert!(scene.bricks.iter().all(|brick| brick.record.height <= MAX_BRICK_HEIGHT));
    let manifest = &scene.resident.manifest;
    assert_eq!(scene.triangles(0).len() as u64 + manifest.dropped_zero_area, 2000);
    assert!(scene.triangles(0).len() > 800);
}

#[test]
fn triangles_without_area_are_dropped_and_keep_their_number() {
    let good = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let line = [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [2.0, 2.0, 0.0]];
    let point = [[0.5; 3]; 3];
    // A triangle with area that rounding takes away.
    let thin = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 1e-9, 0.0]];
    let scene = decode(&built(&plain(vec![soup(&[good, line, good, point, thin, good])]), &settings(2)).path());
    check(&scene);
    assert_eq!(scene.triangles(0).into_keys().collect::<Vec<_>>(), [0, 2, 5]);
    assert_eq!(scene.resident.manifest.dropped_zero_area, 3);
    assert_eq!(scene.resident.manifest.triangle_ids, 6);
    assert_eq!(scene.resident.manifest.warnings.len(), 1);
    let fine = BuildSettings { lattice: Some(LatticeStep::Log2(-40)), ..settings(2) };
    let scene = decode(&built(&plain(vec![soup(&[good, thin])]), &fine).path());
    assert_eq!(scene.triangles(0).len(), 2, "on a finer lattice it has area");
}

#[test]
fn empty_scenes_are_files_without_bricks() {
    let line = [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [2.0, 2.0, 0.0]];
    for scene in [scene(vec![], vec![]), plain(vec![]), plain(vec![soup(&[])]), plain(vec![soup(&[line])])] {
        let built = decode(&built(&scene, &settings(100)).path());
        check(&built);
        assert!(built.resident.bricks.is_empty() && built.resident.top8.is_empty() && built.resident.leaves.is_empty());
        assert_eq!((built.resident.objects.len(), built.resident.instances.len()), (1, 1));
        assert!((0..3).all(|k| built.resident.manifest.min[k] > built.resident.manifest.max[k]));
    }
}

#[test]
fn one_triangle_is_one_brick() {
    let triangle = [[1.0, 2.0, 3.0], [2.0, 2.0, 3.0], [1.0, 3.0, 3.5]];
    let scene = decode(&built(&plain(vec![soup(&[triangle])]), &settings(16384)).path());
    check(&scene);
    assert_eq!((scene.bricks.len(), scene.resident.top8.len(), scene.resident.top2.len()), (1, 1, 1));
    assert_eq!(scene.resident.objects[0].step_log2, -20);
    assert_eq!(scene.resident.manifest.min, [1.0, 2.0, 3.0]);
    assert_eq!(scene.resident.manifest.max, [2.0, 3.0, 3.5]);
    assert_eq!(scene.bricks[0].record.height, 1);
}
