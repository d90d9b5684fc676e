//! The soups and instances that other tests render.

use brickwalk_convert::source::SourceScene;
use brickwalk_scenes::{SoupKind, rotated_instances, soup};
use glam::{DMat3, DVec3};
use std::collections::HashMap;

fn corners(scene: &SourceScene) -> Vec<[DVec3; 3]> {
    let primitives = scene.meshes.iter().flat_map(|m| &m.primitives);
    primitives
        .flat_map(|p| {
            p.indices.chunks_exact(3).map(|t| [0, 1, 2].map(|k| DVec3::from_array(p.positions[t[k] as usize])))
        })
        .collect()
}

#[test]
fn soups_have_their_shapes() {
    for kind in [SoupKind::Uniform, SoupKind::Clustered, SoupKind::Slivers] {
        for n in [1, 2, 1001] {
            let scene = soup(kind, n, 3);
            assert_eq!(corners(&scene).len(), n as usize);
            assert_eq!(corners(&scene), corners(&soup(kind, n, 3)), "{kind:?}");
            assert_ne!(corners(&scene), corners(&soup(kind, n, 4)), "{kind:?}");
            assert!(corners(&scene).iter().flatten().all(|p| p.is_finite() && p.length() < 60.0));
        }
    }
    assert!(corners(&soup(SoupKind::Uniform, 0, 1)).is_empty());
    // Longest edge against height over it.
    let thin = |kind| {
        let all = corners(&soup(kind, 1000, 1));
        let count = all.iter().filter(|[a, b, c]| {
            let longest = (*b - *a).length().max((*c - *b).length()).max((*a - *c).length());
            (*b - *a).cross(*c - *a).length() / longest < 0.0015 * longest
        });
        count.count()
    };
    assert!(thin(SoupKind::Slivers) > 990 && thin(SoupKind::Uniform) < 10);
}

#[test]
fn instances_overlap_and_some_are_mirrored() {
    let scene = rotated_instances(1);
    assert_eq!(scene.meshes.len(), 1);
    assert_eq!(scene.meshes[0].triangle_count(), 1280);
    let p = &scene.meshes[0].primitives[0];
    // Closed: every directed edge once, and its reverse once. Outward: a positive volume.
    let mut edges: HashMap<(u32, u32), i32> = HashMap::new();
    for t in p.indices.chunks_exact(3) {
        for k in 0..3 {
            *edges.entry((t[k], t[(k + 1) % 3])).or_default() += 1;
        }
    }
    assert!(edges.iter().all(|(&(a, b), &n)| n == 1 && edges.get(&(b, a)) == Some(&1)));
    assert!(corners(&scene).iter().map(|[a, b, c]| a.cross(*b).dot(*c)).sum::<f64>() > 0.0);
    let matrices: Vec<(DMat3, DVec3)> = scene
        .placements
        .iter()
        .map(|p| {
            let m = p.world_from_mesh;
            let column = |c: usize| DVec3::new(m[c], m[4 + c], m[8 + c]);
            (DMat3::from_cols(column(0), column(1), column(2)), column(3))
        })
        .collect();
    let mirrored = matrices.iter().filter(|m| m.0.determinant() < 0.0).count();
    assert!(mirrored > 0 && mirrored < matrices.len());
    let overlapping = matrices.iter().enumerate().any(|(k, a)| {
        matrices[..k].iter().any(|b| (a.1 - b.1).length() < 0.8 * (a.0.x_axis.length() + b.0.x_axis.length()))
    });
    assert!(overlapping);
}
