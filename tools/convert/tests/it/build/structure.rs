//! Boxes contain what is below them, in integers; ids are complete; attributes belong to their triangles.

use super::decode::{Decoded, DecodedBrick, decode, source_order};
use super::scenes::*;
use bricks::{BRICK_INDEX32, BRICK_WIDE, LATTICE_LIMIT, Node, TOP_LEAF, TopNode8};
use brickwalk_convert::source::IDENTITY;

type Corners = ([i64; 3], [i64; 3]);

fn contains(outer: &Corners, p: [i64; 3]) -> bool {
    (0..3).all(|k| outer.0[k] <= p[k] && p[k] <= outer.1[k])
}

/// The box of a child in lattice steps relative to the brick's origin.
fn child_box(brick: &DecodedBrick, node: &Node, slot: usize) -> Corners {
    let corner = |grid: &[[u8; 8]; 3]| {
        std::array::from_fn(|k| {
            let origin = f64::from(node.origin[k]) * 2f64.powi(-brick.step_unit_log2);
            assert_eq!(origin.fract(), 0.0, "node origins are on the lattice");
            let exponent = i32::from(node.exponent[k]) - 127 - brick.step_unit_log2;
            assert!(exponent >= 0, "grid steps are whole lattice steps");
            origin as i64 + (i64::from(grid[k][slot]) << exponent)
        })
    };
    (corner(&node.lo), corner(&node.hi))
}

/// Counts (triangle vertex, box on the way from the root) pairs where the vertex is outside.
fn violations(brick: &DecodedBrick) -> usize {
    let mut count = 0;
    let mut stack: Vec<(u32, Vec<Corners>)> = vec![(0, Vec::new())];
    while let Some((index, above)) = stack.pop() {
        let node = &brick.nodes[index as usize];
        for slot in (0..8).filter(|&slot| node.meta[slot] != 0) {
            let mut boxes = above.clone();
            boxes.push(child_box(brick, node, slot));
            if node.inner_mask >> slot & 1 != 0 {
                let before = (node.inner_mask & ((1u16 << slot) - 1) as u8).count_ones();
                stack.push((node.child_base + before, boxes));
                continue;
            }
            let first = node.triangle_base + u32::from(node.meta[slot] & 31);
            for triangle in first..first + (node.meta[slot] >> 5).count_ones() {
                for vertex in brick.indices[triangle as usize] {
                    let p = brick.vertices[vertex as usize];
                    count += boxes.iter().filter(|b| !contains(b, p)).count();
                }
            }
        }
    }
    count
}

/// Counts leaves of the top level that lie outside a box above them, in both trees.
fn top_violations(scene: &Decoded) -> usize {
    let resident = &scene.resident;
    if resident.leaves.is_empty() {
        return 0;
    }
    // Boxes of the leaves, and what is above them in the binary tree.
    let mut leaf_boxes = vec![([0; 3], [0; 3]); resident.leaves.len()];
    let mut count = 0;
    for node in &resident.top2 {
        if node.right == TOP_LEAF {
            leaf_boxes[node.left as usize] = (node.min, node.max);
            continue;
        }
        for child in [node.left, node.right].map(|child| &resident.top2[child as usize]) {
            count += [child.min, child.max].iter().filter(|p| !contains(&(node.min, node.max), **p)).count();
        }
    }
    let child_box = |node: &TopNode8, slot: usize| -> Corners {
        let corner = |grid: &[[u8; 8]; 3]| {
            std::array::from_fn(|k| node.origin[k] + (i64::from(grid[k][slot]) << node.exponent[k]))
        };
        (corner(&node.lo), corner(&node.hi))
    };
    let mut stack: Vec<(u32, Vec<Corners>)> = vec![(0, Vec::new())];
    while let Some((index, above)) = stack.pop() {
        let node = &resident.top8[index as usize];
        for slot in (0..8).filter(|&slot| node.meta[slot] != 0) {
            let mut boxes = above.clone();
            boxes.push(child_box(node, slot));
            if node.inner_mask >> slot & 1 != 0 {
                let before = (node.inner_mask & ((1u16 << slot) - 1) as u8).count_ones();
                stack.push((node.child_base + before, boxes));
            } else {
                let (min, max) = leaf_boxes[(node.leaf_base + u32::from(node.meta[slot] & 31)) as usize];
                count += boxes.iter().filter(|b| !contains(b, min) || !contains(b, max)).count();
            }
        }
    }
    count + world_violations(scene, &leaf_boxes)
}

/// Counts vertices that, taken into the world, lie outside the box of their leaf.
fn world_violations(scene: &Decoded, leaf_boxes: &[Corners]) -> usize {
    let resident = &scene.resident;
    let world_step = scene.step(0);
    let mut count = 0;
    for (leaf, bounds) in resident.leaves.iter().zip(leaf_boxes) {
        let brick = &scene.bricks[leaf.brick as usize];
        let step = scene.step(brick.record.object);
        let m = resident.instances[leaf.instance as usize].world_from_object;
        for triangle in 0..brick.indices.len() {
            for corner in brick.corners(triangle) {
                let p = corner.map(|x| x as f64 * step);
                let q: [f64; 3] =
                    std::array::from_fn(|k| m[4 * k] * p[0] + m[4 * k + 1] * p[1] + m[4 * k + 2] * p[2] + m[4 * k + 3]);
                let inside =
                    (0..3).all(|k| bounds.0[k] as f64 * world_step <= q[k] && q[k] <= bounds.1[k] as f64 * world_step);
                count += usize::from(!inside);
            }
        }
    }
    count
}

/// Checks everything that holds for any scene.
pub fn check(scene: &Decoded) {
    for brick in &scene.bricks {
        assert_eq!(violations(brick), 0);
        let corners: Vec<[i64; 3]> = (0..brick.ids.len()).flat_map(|triangle| brick.corners(triangle)).collect();
        for k in 0..3 {
            assert_eq!(brick.record.min[k], corners.iter().map(|p| p[k]).min().unwrap());
            assert_eq!(brick.record.max[k], corners.iter().map(|p| p[k]).max().unwrap());
        }
        let reach = brick.vertices.iter().flatten().map(|x| x.abs()).max().unwrap();
        assert_eq!(brick.record.flags & BRICK_WIDE != 0, reach > bricks::NEAR_STEPS, "wide where it must be");
        assert_eq!(brick.vertices.iter().collect::<std::collections::HashSet<_>>().len(), brick.vertices.len());
    }
    assert_eq!(top_violations(scene), 0);
    let manifest = &scene.resident.manifest;
    assert_eq!(
        manifest.triangle_ids,
        manifest.triangles_instanced + manifest.dropped_zero_area + manifest.dropped_non_finite
    );
    assert!(scene.resident.top2.iter().flat_map(|node| node.min).all(|x| x.abs() < LATTICE_LIMIT));
}

#[test]
fn boxes_contain_their_triangles_down_the_tree() {
    let scene = decode(&built(&plain(vec![sheet(60, 10.0)]), &settings(1000)).path());
    assert!(scene.bricks.len() >= 8);
    check(&scene);
}

#[test]
fn the_check_of_boxes_sees_one_grid_step() {
    let mut scene = decode(&built(&plain(vec![sheet(30, 10.0)]), &settings(1000)).path());
    let mut seen = 0;
    let node = &mut scene.bricks[0].nodes[0];
    let slot = (0..8).find(|&slot| node.meta[slot] != 0 && node.hi[0][slot] > 0).unwrap();
    node.hi[0][slot] -= 1;
    seen += usize::from(violations(&scene.bricks[0]) > 0);
    let node = &mut scene.bricks[1].nodes[0];
    let slot = (0..8).find(|&slot| node.meta[slot] != 0 && node.lo[2][slot] < 255).unwrap();
    node.lo[2][slot] += 1;
    seen += usize::from(violations(&scene.bricks[1]) > 0);
    assert_eq!(seen, 2);

    assert_eq!(top_violations(&scene), 0);
    let slot = (0..8).find(|&slot| scene.resident.top8[0].meta[slot] != 0).unwrap();
    scene.resident.top8[0].hi[1][slot] -= 1;
    assert!(top_violations(&scene) > 0);
}

#[test]
fn every_id_is_stored_once() {
    let built = built(&plain(vec![sheet(40, 1.0), sheet(20, 3.0)]), &settings(500));
    let scene = decode(&built.path());
    let ids: Vec<u32> = scene.triangles(0).into_keys().collect();
    assert_eq!(ids, (0..3200 + 800).collect::<Vec<_>>());
    assert_eq!(scene.resident.objects[0].triangle_ids, 4000);
    let summary = &built.summary;
    assert_eq!((summary.triangle_ids, summary.triangles_stored), (4000, 4000));
    assert_eq!((summary.bricks, summary.leaves), (scene.bricks.len() as u64, scene.bricks.len() as u64));
    assert_eq!(summary.bytes_geometry, scene.bricks.iter().map(|brick| brick.record.geometry.bytes).sum::<u64>());
    assert_eq!(summary.bytes_file, built.bytes().len() as u64);
    let provenance: Vec<_> =
        scene.resident.manifest.provenance.iter().map(|p| (p.first_id, p.count, p.primitive)).collect();
    assert_eq!(provenance, [(0, 3200, 0), (3200, 800, 1)]);
}

#[test]
fn positions_and_attributes_are_those_of_the_source() {
    let source = sheet(40, 16.0);
    let scene = decode(&built(&plain(vec![source.clone()]), &settings(300)).path());
    let (step, mut rotated) = (scene.step(0), [0; 3]);
    for (id, triangle) in scene.triangles(0) {
        assert!(triangle.corners[0] < triangle.corners[1] && triangle.corners[0] < triangle.corners[2]);
        rotated[triangle.rotation as usize] += 1;
        let corners = source_order(triangle.corners, triangle.rotation);
        let attributes = source_order(triangle.attributes, triangle.rotation);
        for i in 0..3 {
            let vertex = source.indices[id as usize * 3 + i] as usize;
            for (found, expected) in corners[i].iter().zip(source.positions[vertex]) {
                let error = *found as f64 * step - expected;
                assert!(error.abs() <= step / 2.0, "at most half a step");
            }
            assert_eq!(attributes[i].uv, source.uvs.as_ref().unwrap()[vertex]);
            assert_eq!(attributes[i].color, u32::MAX);
        }
    }
    assert!(rotated.iter().filter(|&&count| count > 0).count() >= 2, "{rotated:?}");
}

#[test]
fn large_bricks_have_wide_indices() {
    let scene = decode(&built(&plain(vec![sheet(260, 10.0)]), &settings(200_000)).path());
    assert_eq!(scene.bricks.len(), 1);
    assert_eq!(scene.bricks[0].record.vertex_count, 261 * 261);
    assert!(scene.bricks[0].record.flags & BRICK_INDEX32 != 0);
    check(&scene);
    assert_eq!(scene.triangles(0).len(), 135_200);
}

#[test]
fn mean_colours_are_weighted_by_area() {
    let big = soup(&[[[0.0; 3], [3.0, 0.0, 0.0], [0.0, 0.0, 1.0]]]);
    let mut small = soup(&[[[0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 1.0]]]);
    small.material = 1;
    let mut scene = scene(vec![mesh("m", vec![big, small])], vec![placement("n", 0, IDENTITY)]);
    scene.materials[1].emission = [4.0, 0.0, 8.0];
    let built = decode(&built(&scene, &settings(10)).path());
    let mean = built.bricks[0].record.mean_albedo;
    for (mean, expected) in mean.iter().zip([0.625, 0.4375, 1.0]) {
        assert!((mean - expected).abs() < 1e-6, "{mean} against {expected}");
    }
    assert_eq!(built.bricks[0].record.mean_emission, [1.0, 0.0, 2.0]);
    assert!(built.resident.manifest.has_emission && !built.resident.manifest.has_textures);
}
