//! What is baked and what is instanced, and where either lies.

use super::decode::{Decoded, decode, source_order};
use super::scenes::*;
use super::structure::check;
use bricks::{INSTANCE_IDENTITY, INSTANCE_MIRRORED, NO_NORMAL, NONE};
use brickwalk_convert::build::BuildSettings;
use brickwalk_convert::source::{IDENTITY, Primitive, SourceScene, SourceTexture};

fn apply(m: &[f64; 12], p: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| m[4 * k] * p[0] + m[4 * k + 1] * p[1] + m[4 * k + 2] * p[2] + m[4 * k + 3])
}

pub fn octahedral(bits: u32) -> [f64; 3] {
    let [x, y] = [bits as u16 as i16, (bits >> 16) as u16 as i16].map(|x| f64::from(x) / 32767.0);
    let z = 1.0 - x.abs() - y.abs();
    let t = (-z).max(0.0);
    let v = [x - t.copysign(x), y - t.copysign(y), z];
    let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    v.map(|x| x / length)
}

/// Placements of mesh 1 around one of mesh 0, in this order of ids: 1, 0, 1, 1.
fn placed(part: u32) -> SourceScene {
    let meshes = vec![mesh("ground", vec![sheet(20, 50.0)]), mesh("part", vec![sheet(part, 2.0)])];
    let turned = matrix(rotation(0.7, [1.0, 2.0, 1.5]), [3.0, 1.0, -2.0]);
    let mirrored = matrix(rotation(2.1, [-1.0, 1.0, 1.0]), [-13.0, 4.0, 1.0]);
    let placements = vec![
        placement("turned", 1, turned),
        placement("ground", 0, IDENTITY),
        placement("mirrored", 1, mirrored),
        placement("plain", 1, IDENTITY),
    ];
    scene(meshes, placements)
}

/// World positions in source order by global id, however they are stored.
fn world_triangles(scene: &Decoded) -> std::collections::BTreeMap<u32, [[f64; 3]; 3]> {
    let mut all = std::collections::BTreeMap::new();
    for instance in &scene.resident.instances {
        let step = scene.step(instance.object);
        for (id, triangle) in scene.triangles(instance.object) {
            let corners = triangle.corners.map(|p| apply(&instance.world_from_object, p.map(|x| x as f64 * step)));
            let old = all.insert(instance.base + id, source_order(corners, triangle.rotation));
            assert!(old.is_none(), "global id {} twice", instance.base + id);
        }
    }
    all
}

/// The source's triangles in world space by global id.
fn expected_triangles(source: &SourceScene) -> Vec<[[f64; 3]; 3]> {
    let mut all = Vec::new();
    for placement in &source.placements {
        for primitive in &source.meshes[placement.mesh as usize].primitives {
            for triangle in primitive.indices.chunks_exact(3) {
                let corner = |i: usize| apply(&placement.world_from_mesh, primitive.positions[triangle[i] as usize]);
                all.push([corner(0), corner(1), corner(2)]);
            }
        }
    }
    all
}

fn check_positions(source: &SourceScene, scene: &Decoded) {
    let expected = expected_triangles(source);
    let found = world_triangles(scene);
    assert_eq!(found.len(), expected.len());
    // Half a step on each axis, times the largest scale, 2.
    let step = (0..scene.resident.objects.len() as u32).map(|object| scene.step(object)).fold(0.0, f64::max);
    for ((id, found), (index, expected)) in found.iter().zip((0u32..).zip(&expected)) {
        assert_eq!(*id, index);
        for (p, q) in found.iter().flatten().zip(expected.iter().flatten()) {
            assert!((p - q).abs() <= 2.0 * step, "triangle {id}: {p} against {q}");
        }
    }
}

#[test]
fn meshes_placed_often_are_stored_once() {
    let source = placed(30);
    let scene = decode(&built(&source, &settings(300)).path());
    check(&scene);
    check_positions(&source, &scene);
    let resident = &scene.resident;
    assert_eq!((resident.objects.len(), resident.instances.len()), (2, 4));
    let flags: Vec<u32> = resident.instances.iter().map(|instance| instance.flags).collect();
    assert_eq!(flags, [INSTANCE_IDENTITY, 0, INSTANCE_MIRRORED, 0]);
    let bases: Vec<u32> = resident.instances.iter().map(|instance| instance.base).collect();
    assert_eq!(bases, [0, 0, 1800 + 800, 2 * 1800 + 800]);
    assert_eq!(scene.triangles(0).into_keys().collect::<Vec<_>>(), (1800..2600).collect::<Vec<_>>());
    assert_eq!(resident.manifest.triangles_stored, 2600);
    assert_eq!(resident.manifest.triangles_instanced, 3 * 1800 + 800);
    assert!((resident.manifest.instance_scale_ratio - 2.0).abs() < 1e-12);
    let nodes: Vec<&str> = resident.manifest.provenance.iter().map(|p| p.node.as_str()).collect();
    assert_eq!(nodes, ["turned", "ground", "mirrored", "plain"]);
}

#[test]
fn small_meshes_are_baked_until_the_budget_is_spent() {
    let source = placed(10);
    let baked = decode(&built(&source, &settings(300)).path());
    check(&baked);
    check_positions(&source, &baked);
    assert_eq!((baked.resident.objects.len(), baked.resident.instances.len()), (1, 1));
    assert!(!baked.resident.manifest.has_instances);

    let spent = BuildSettings { bake_budget_triangles: 599, ..settings(300) };
    let instanced = decode(&built(&source, &spent).path());
    check_positions(&source, &instanced);
    assert_eq!((instanced.resident.objects.len(), instanced.resident.instances.len()), (2, 4));
    let enough = BuildSettings { bake_budget_triangles: 600, ..settings(300) };
    assert_eq!(decode(&built(&source, &enough).path()).resident.objects.len(), 1);
}

#[test]
fn singular_and_single_placements_are_baked() {
    let mut source = placed(30);
    // Flattens onto a plane: area remains, an inverse does not.
    source.placements[2].world_from_mesh = matrix([[1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]], [0.0, 3.0, 0.0]);
    let scene = decode(&built(&source, &settings(300)).path());
    check(&scene);
    check_positions(&source, &scene);
    assert_eq!(scene.resident.instances.len(), 3);
    assert_eq!(scene.triangles(0).len(), 800 + 1800);

    source.placements[0].world_from_mesh = [0.0; 12];
    let scene = decode(&built(&source, &settings(300)).path());
    check(&scene);
    assert_eq!(scene.resident.instances.len(), 1, "one invertible placement is no reason for an object");
    assert_eq!(scene.resident.manifest.dropped_zero_area, 1800);
}

#[test]
fn a_world_of_instances_has_a_lattice() {
    let mut source = placed(30);
    source.placements.remove(1);
    let scene = decode(&built(&source, &settings(300)).path());
    check(&scene);
    check_positions(&source, &scene);
    let world = scene.resident.objects[0];
    assert_eq!((world.brick_count, world.triangle_count), (0, 0));
    let manifest = &scene.resident.manifest;
    let diagonal = (0..3).map(|k| (manifest.max[k] - manifest.min[k]).powi(2)).sum::<f64>().sqrt();
    let units = diagonal / 2f64.powi(world.unit_log2);
    assert!((1024.0..2100.0).contains(&units), "{units}");
}

#[test]
fn baked_normals_point_out_of_mirrored_placements() {
    // A closed tetrahedron whose faces are counter-clockwise from outside, with smooth normals or none.
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let indices = vec![0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3];
    let normals = corners.map(|p| p.map(|x| (x - 0.25) as f32)).to_vec();
    for normals in [None, Some(normals)] {
        let flat = normals.is_none();
        let primitive =
            Primitive { positions: corners.to_vec(), indices: indices.clone(), normals, ..Primitive::default() };
        for scale in [[1.0, 3.0, 0.5], [-1.0, 3.0, 0.5]] {
            let placed = matrix(rotation(0.9, scale), [5.0, 6.0, 7.0]);
            let source = scene(vec![mesh("m", vec![primitive.clone()])], vec![placement("n", 0, placed)]);
            let scene = decode(&built(&source, &settings(10)).path());
            let centre = apply(&placed, [0.25; 3]);
            for triangle in scene.triangles(0).values() {
                for (corner, attribute) in triangle.corners.iter().zip(&triangle.attributes) {
                    assert_eq!(attribute.normal == NO_NORMAL, flat);
                    if flat {
                        continue;
                    }
                    let normal = octahedral(attribute.normal);
                    let out: f64 = (0..3).map(|k| normal[k] * (corner[k] as f64 * scene.step(0) - centre[k])).sum();
                    assert!(out > 0.1, "normal {normal:?} points inward");
                }
            }
        }
    }
}

#[test]
fn textures_in_use_are_written_with_all_levels() {
    let mut source = plain(vec![sheet(5, 1.0)]);
    let texture = |value: u8, width, height| SourceTexture {
        name: "t".to_owned(),
        width,
        height,
        wrap: 0,
        rgba: vec![value; (width * height * 4) as usize],
    };
    source.textures = vec![texture(1, 4, 4), texture(255, 5, 3)];
    source.materials[0].base_color_texture = 1;
    let scene = decode(&built(&source, &settings(10)).path());
    assert_eq!(scene.resident.textures.len(), 1);
    assert_eq!((scene.resident.textures[0].width, scene.resident.textures[0].levels), (5, 3));
    assert_eq!(scene.resident.materials[0].base_color_texture, 0);
    assert_eq!(scene.resident.materials[1].base_color_texture, NONE);
    assert!(scene.resident.manifest.has_textures);
    let mean = scene.bricks[0].record.mean_albedo;
    assert!((0..3).all(|k| (mean[k] - [0.5, 0.25, 1.0][k]).abs() < 1e-5), "{mean:?}");
}
