//! What must not change: bytes with the number of threads; ids and positions with the size of bricks; anything with
//! where a scene lies.

use super::decode::decode;
use super::scenes::*;
use super::structure::check;
use brickwalk_convert::build::{BuildSettings, LatticeStep};
use brickwalk_convert::progress::Progress;
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
        let lattice = |scene: &super::decode::Decoded| {
            let object = scene.resident.objects[object as usize];
            (object.step_log2, object.unit_log2)
        };
        assert_eq!(lattice(&small), lattice(&large));
        let triangles = small.triangles(object);
        assert!(triangles == large.triangles(object));
        let other = build(BuildSettings { lattice: Some(LatticeStep::Log2(lattice(&small).0 + 3)), ..settings(256) });
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

/// Expected cost of a ray that meets a brick, summed over bricks: areas of the boxes over those of the roots, a
/// triangle at
/// 0.3 of a node.
fn surface_area_cost(path: &std::path::Path) -> f64 {
    let file = bricks::SceneFile::open(path).unwrap();
    let of_brick = |(index, record): (u32, &bricks::Brick)| {
        let mut bytes = vec![0; record.geometry.bytes as usize];
        file.copy(bricks::Payload::Geometry(index), &mut bytes).unwrap();
        let nodes = bytes.chunks_exact(size_of::<bricks::Node>()).take(record.node_count as usize);
        let area_of = |node: &bricks::Node, slot: usize| {
            let size = |k: usize| {
                f64::from(i32::from(node.hi[k][slot]) - i32::from(node.lo[k][slot]))
                    * 2f64.powi(i32::from(node.exponent[k]) - 127)
            };
            size(0) * size(1) + size(1) * size(2) + size(2) * size(0)
        };
        let sum: f64 = nodes
            .map(|node| {
                let node: bricks::Node = bytemuck::pod_read_unaligned(node);
                let weight = |slot: usize| match node.meta[slot] {
                    inner if inner & 0x18 == 0x18 => 1.0,
                    leaf => 0.3 * f64::from((leaf >> 5).count_ones()),
                };
                (0..8).map(|slot| weight(slot) * area_of(&node, slot)).sum::<f64>()
            })
            .sum();
        let [x, y, z]: [f64; 3] = std::array::from_fn(|k| (record.max[k] - record.min[k]) as f64);
        let step = 2f64.powi(file.resident().objects[0].step_log2 - file.resident().objects[0].unit_log2);
        sum / ((x * y + y * z + z * x) * step * step)
    };
    (0..).zip(&file.resident().bricks).map(of_brick).sum()
}

#[test]
fn fast_trees_cost_a_little_more_and_hold_the_same() {
    let build = |fast| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bricks");
        let settings = BuildSettings { fast, ..settings(4000) };
        brickwalk_convert::build::build(mixed(), &settings, &path, &Progress::hidden()).unwrap();
        let decoded = decode(&path);
        check(&decoded);
        (surface_area_cost(&path), decoded.triangles(0))
    };
    let ((good, triangles), (fast, same)) = (build(false), build(true));
    assert!(triangles == same);
    assert!(fast > good && fast < 1.2 * good, "{fast} against {good}");
}
