//! Prefetching: the predicted view, the frustum against sampled points, the order of bricks, what is left out.

use glam::{DMat3, DQuat, DVec3};

use super::model::Random;
use crate::scene::Camera;
use crate::stream::{BrickBox, Frustum, HostCache, Item, Prefetcher, nearest_in_view, predict};

fn camera(position: DVec3, forward: DVec3) -> Camera {
    Camera { position, target: position + forward, up: DVec3::Y, fov_y: 60f64.to_radians() }
}

fn unit(random: &mut Random) -> f64 {
    random.below(1 << 30) as f64 / f64::from(1 << 30)
}

fn vector(random: &mut Random, range: f64) -> DVec3 {
    DVec3::from_array([(); 3].map(|()| (2.0 * unit(random) - 1.0) * range))
}

#[test]
fn a_steady_motion_is_predicted() {
    // A step and a turn about +Y: three views of one steady motion.
    let view = |k: f64| camera(DVec3::new(1e3 + 2.0 * k, 1.7, -0.5 * k), DQuat::from_rotation_y(0.1 * k) * DVec3::X);
    let next = predict(&view(3.0), &view(4.0)).unwrap();
    let truth = view(5.0);
    // A few roundings of numbers up to 1e3, and of unit vectors.
    assert!((next.position - truth.position).length() < 1e-12);
    let (expected, found) = (truth.frame(), next.frame());
    for (a, b) in [(expected.0, found.0), (expected.1, found.1), (expected.2, found.2)] {
        assert!((a - b).length() < 1e-12, "{a} {b}");
    }
    // Control: standing still is another answer.
    assert!((next.position - view(4.0).position).length() > 1.0);
    assert!((found.2 - view(4.0).frame().2).length() > 0.09);
}

#[test]
fn rest_and_nonsense_predict_nothing() {
    let still = camera(DVec3::ONE, DVec3::NEG_Z);
    assert_eq!(predict(&still, &still), None);
    // A farther target on the same axis is the same view.
    assert_eq!(predict(&still, &Camera { target: still.position - 7.0 * DVec3::Z, ..still }), None);
    // Control: a turn alone, and a step alone.
    assert!(predict(&still, &camera(DVec3::ONE, DVec3::X)).is_some());
    assert!(predict(&still, &camera(DVec3::ZERO, DVec3::NEG_Z)).is_some());
    let far = camera(DVec3::splat(1.5e308), DVec3::NEG_Z);
    assert_eq!(predict(&camera(-far.position, DVec3::NEG_Z), &far), None, "beyond f64");
}

#[test]
fn the_frustum_loses_no_box_that_shows() {
    let mut missed = 0;
    for seed in 0..200 {
        let mut random = Random(seed);
        let view =
            Camera { up: vector(&mut random, 1.0), ..camera(vector(&mut random, 50.0), vector(&mut random, 1.0)) };
        let aspect = 0.5 + 2.0 * unit(&mut random);
        let frustum = Frustum::new(&view, aspect);
        let (width, height) = ((1000.0 * aspect) as u32, 1000);
        let rays = view.ray_basis(width, height);
        for _ in 0..50 {
            // A box around a point that a pixel shows, well inside the picture.
            let pixel = [f64::from(width), f64::from(height)].map(|side| side * (0.01 + 0.98 * unit(&mut random)));
            let shown = view.position + rays.direction(pixel[0], pixel[1]) * 100.0 * unit(&mut random);
            let (low, high) = (vector(&mut random, 5.0).abs(), vector(&mut random, 5.0).abs());
            let aspect = f64::from(width) / f64::from(height);
            assert!(Frustum::new(&view, aspect).meets(shown - low, shown + high), "seed {seed}");
            // Control: what lies behind, and what lies far outside of the picture, does not meet it.
            let behind = view.position - (shown - view.position);
            missed += u32::from(!frustum.meets(behind, behind));
        }
        let (right, up, forward) = view.frame();
        let y = (0.5 * view.fov_y).tan();
        for (inside, x) in [(true, 0.99), (false, 1.01)] {
            for side in [right * y * aspect, -right * y * aspect, up * y, -up * y] {
                let point = view.position + 10.0 * (forward + side * x);
                assert_eq!(frustum.meets(point, point), inside, "seed {seed}");
            }
        }
    }
    assert_eq!(missed, 200 * 50);
}

fn cube(brick: u32, centre: DVec3) -> BrickBox {
    BrickBox { brick, min: centre - 0.5, max: centre + 0.5 }
}

#[test]
fn bricks_come_near_to_far_each_once() {
    let view = camera(DVec3::ZERO, DVec3::NEG_Z);
    let ahead = |z: f64| DVec3::new(0.0, 0.0, -z);
    let boxes = [
        cube(5, ahead(30.0)),
        cube(2, ahead(10.0)),
        cube(9, ahead(-10.0)),
        cube(7, DVec3::new(50.0, 0.0, -10.0)),
        cube(1, ahead(10.0)),
        // The second instance of brick 5 is nearer than the first; the camera is inside of brick 3.
        cube(5, ahead(20.0)),
        cube(3, DVec3::ZERO),
    ];
    assert_eq!(nearest_in_view(&boxes, &view, 1.0), [3, 1, 2, 5]);
    // Control: looking back shows others.
    assert_eq!(nearest_in_view(&boxes, &camera(DVec3::ZERO, DVec3::Z), 1.0), [3, 9]);
    // A wide picture shows what lies to the side: 49.5 at distance 10.5 needs tan(30°)·aspect above 4.7.
    assert!(nearest_in_view(&boxes, &view, 9.0).contains(&7));
}

#[test]
fn the_prefetcher_asks_for_what_comes_into_view() {
    let boxes: Vec<BrickBox> =
        (0..40).map(|brick| cube(brick, DVec3::new(3.0 * f64::from(brick), 0.0, -10.0))).collect();
    let mut prefetcher = Prefetcher::new(boxes.clone(), 1.0, 4);
    let at = |x: f64| camera(DVec3::new(x, 0.0, 0.0), DVec3::NEG_Z);
    // At x it shows bricks of about x ± 6: 10.5·tan 30° and half a cube.
    let held = |item: Item| item == Item::attributes(33);
    assert!(prefetcher.after_frame(&at(0.0), held).is_empty(), "one view is no motion");
    let items = prefetcher.after_frame(&at(50.0), held);
    // Predicted: x = 100; the nearest cubes are 33 (at 99) and 34 (at 102), then 32 (at 96).
    assert_eq!(items, [Item::geometry(33), Item::geometry(34), Item::attributes(34), Item::geometry(32)]);
    assert!(prefetcher.after_frame(&at(50.0), held).is_empty(), "at rest");
    // Control: another motion, other bricks; and with everything at hand none.
    assert_eq!(prefetcher.after_frame(&at(30.0), held)[0], Item::geometry(3));
    assert!(prefetcher.after_frame(&at(40.0), |_| true).is_empty());
    assert!(Prefetcher::new(boxes, 1.0, 0).after_frame(&at(0.0), held).is_empty());
}

#[test]
fn a_turn_of_the_predicted_view_stays_orthonormal() {
    for seed in 0..500 {
        let mut random = Random(seed);
        let mut view =
            || Camera { up: vector(&mut random, 1.0), ..camera(vector(&mut random, 1e6), vector(&mut random, 1.0)) };
        let (before, now) = (view(), view());
        let next = predict(&before, &now).unwrap();
        let (r, u, f) = next.frame();
        let axes = DMat3::from_cols(r, u, f);
        let error = axes * axes.transpose() - DMat3::IDENTITY;
        // The target is rounded beside a position of up to 3e6: 3e6 · 2⁻⁵² · a few.
        assert!(error.to_cols_array().iter().all(|e| e.abs() < 1e-8), "seed {seed}");
        assert_eq!(next.fov_y, now.fov_y);
    }
}

#[test]
fn what_is_brought_ahead_displaces_nothing_in_use() {
    let cache = HostCache::new(64);
    let item = Item::geometry;
    let put = |brick: u32| cache.reserve(item(brick), 16).map(|room| room.fill(&[0; 16])).is_some();
    let bring = |brick: u32| cache.reserve_ahead(item(brick), 16).map(|room| room.fill(&[0; 16])).is_some();
    cache.begin_round();
    assert!((0..4).all(put));
    assert!(!bring(10), "all was used in this round");
    cache.begin_round();
    assert!(cache.get(item(3)).is_some() && cache.get(item(2)).is_some());
    assert!(!bring(10), "or in the one before");
    cache.begin_round();
    // 0 and 1 rested for a round: they go, and 2 and 3 stay.
    assert!(bring(10) && bring(11) && !bring(12));
    assert!([2, 3, 10, 11].iter().all(|&brick| cache.contains(item(brick))));
    // A load may displace everything.
    assert!(put(20) && !cache.contains(item(3)));
    assert!(cache.get(item(10)).is_some() && cache.get(item(10)).is_some());
    let stats = cache.stats();
    assert_eq!((stats.prefetched, stats.prefetched_bytes), (2, 32));
    assert_eq!((stats.prefetched_used, stats.prefetched_used_bytes), (1, 16), "a second look-up counts no second use");
}

#[test]
fn a_prefetch_that_a_load_overtakes_was_not_ahead() {
    for overtaken in [true, false] {
        let cache = HostCache::new(64);
        let room = cache.reserve_ahead(Item::geometry(0), 16).unwrap();
        if overtaken {
            assert!(cache.get(Item::geometry(0)).is_none(), "still on the way");
        }
        room.fill(&[0; 16]);
        assert!(cache.get(Item::geometry(0)).is_some());
        let stats = cache.stats();
        let ahead = u64::from(!overtaken);
        assert_eq!((stats.inserted, stats.prefetched, stats.prefetched_used), (1, ahead, ahead));
    }
}
