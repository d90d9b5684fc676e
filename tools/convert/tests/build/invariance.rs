//! What must not change: bytes with the number of threads; ids and positions with the size of bricks; anything with where
//! a scene lies.

use crate::decode::decode;
use crate::scenes::*;
use crate::structure::check;
use brickwalk_convert::build::BuildSettings;
use brickwalk_convert::source::{IDENTITY, SourceScene};

fn mixed() -> SourceScene {
    let meshes = vec![mesh("sheet", vec![sheet(50, 10.0)]), mesh("part", vec![sheet(30, 1.0), sheet(10, 2.0)])];
    let turned = matrix(rotation(0.7, [1.0, 2.0, 1.5]), [3.0, 1.0, -2.0]);
    let mirrored = matrix(rotation(2.1, [-1.0, 1.0, 1.0]), [-3.0, 4.0, 1.0]);
    let placements = vec![placement("a", 1, turned), placement("b", 0, IDENTITY), placement("c", 1, mirrored)];
    scene(meshes, placements)
}

#[test]
fn bytes_do_not_depend_on_threads() {
    let bytes = |threads, brick_triangles| {
        let settings = BuildSettings { threads: Some(threads), ..settings(brick_triangles) };
        built(&mixed(), &settings).bytes()
    };
    let one = bytes(1, 400);
    assert!(one == bytes(2, 400));
    assert!(one == bytes(5, 400));
    assert!(one != bytes(2, 401));
}

#[test]
fn ids_and_positions_do_not_depend_on_bricks() {
    let build = |settings: BuildSettings| decode(&built(&mixed(), &settings).path());
    let (small, large) = (build(settings(256)), build(settings(4096)));
    check(&small);
    check(&large);
    assert!(small.bricks.len() > 3 * large.bricks.len());
    assert_eq!(small.resident.instances, large.resident.instances);
    assert_eq!(small.resident.objects.len(), 2);
    for object in 0..2 {
        let lattice = |scene: &crate::decode::Decoded| {
            let object = scene.resident.objects[object as usize];
            (object.step_log2, object.unit_log2)
        };
        assert_eq!(lattice(&small), lattice(&large));
        let triangles = small.triangles(object);
        assert!(triangles == large.triangles(object));
        let other = build(BuildSettings { lattice_log2: Some(lattice(&small).0 + 3), ..settings(256) });
        assert!(triangles != other.triangles(object), "another lattice has other positions");
    }
}

#[test]
fn moving_a_scene_by_whole_steps_moves_its_positions_only() {
    let at = |shift: f64| {
        let moved = matrix([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], [shift, -shift, shift]);
        let mut primitive = sheet(40, 30.0);
        // As in a file of f32: rounded before it is moved, so that nothing is lost at 10^7.
        primitive.positions.iter_mut().flatten().for_each(|x| *x = f64::from(*x as f32));
        decode(&built(&scene(vec![mesh("m", vec![primitive])], vec![placement("n", 0, moved)]), &settings(500)).path())
    };
    let origin = at(0.0);
    // A multiple of 2^20 steps near 10^7 m.
    let grain = origin.step(0) * (1u64 << 20) as f64;
    let shift = (1e7 / grain).round() * grain;
    let far = at(shift);
    check(&far);
    assert_eq!(origin.resident.objects[0].step_log2, far.resident.objects[0].step_log2);
    assert_eq!(origin.resident.objects[0].unit_log2, far.resident.objects[0].unit_log2);
    let steps = (shift / origin.step(0)) as i64;
    let mut moved = far.triangles(0);
    for triangle in moved.values_mut() {
        for corner in &mut triangle.corners {
            *corner = [corner[0] - steps, corner[1] + steps, corner[2] - steps];
        }
    }
    assert!(moved == origin.triangles(0));
    assert!(moved != at(shift + origin.step(0) * 0.3).triangles(0));
}

#[test]
fn scaling_by_a_power_of_two_changes_exponents_only() {
    let scaled = |scale: f64| {
        let mut primitive = sheet(20, 3.0);
        primitive.positions.iter_mut().flatten().for_each(|x| *x *= scale);
        decode(&built(&plain(vec![primitive]), &settings(100)).path())
    };
    let one = scaled(1.0);
    for log2 in [-40, -1, 7, 40] {
        let other = scaled(2f64.powi(log2));
        assert_eq!(other.resident.objects[0].step_log2, one.resident.objects[0].step_log2 + log2);
        assert_eq!(other.resident.objects[0].unit_log2, one.resident.objects[0].unit_log2 + log2);
        assert!(other.bricks.iter().zip(&one.bricks).all(|(a, b)| a.nodes == b.nodes && a.vertices == b.vertices));
        assert_eq!(other.bricks.len(), one.bricks.len());
    }
    let third = scaled(3.0);
    assert!(third.bricks.iter().zip(&one.bricks).any(|(a, b)| a.vertices != b.vertices));
}
