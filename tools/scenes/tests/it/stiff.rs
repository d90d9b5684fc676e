//! Stiff scenes are what they say: closed, flat, long, many.

use brickwalk_convert::source::SourceScene;
use brickwalk_scenes::{Stiff, far_path, moved, stiff};
use std::collections::HashMap;

fn triangles(scene: &SourceScene) -> Vec<[[f64; 3]; 3]> {
    let primitive = &scene.meshes[0].primitives[0];
    let corner = |&i: &u32| primitive.positions[i as usize];
    primitive.indices.chunks(3).map(|t| [corner(&t[0]), corner(&t[1]), corner(&t[2])]).collect()
}

/// Edges, by their ends' bits, that do not belong to exactly two triangles.
fn open_edges(triangles: &[[[f64; 3]; 3]]) -> usize {
    let mut uses: HashMap<[[u64; 3]; 2], u32> = HashMap::new();
    for t in triangles {
        for i in 0..3 {
            // Plus zero, so that both zeros have one pattern.
            let mut ends = [t[i], t[(i + 1) % 3]].map(|p| p.map(|x| (x + 0.0).to_bits()));
            ends.sort_unstable();
            *uses.entry(ends).or_default() += 1;
        }
    }
    uses.values().filter(|&&n| n != 2).count()
}

#[test]
fn closed_scenes_are_closed() {
    for (kind, n, count) in
        [(Stiff::Shell, 2, 320), (Stiff::Fans, 50, 100), (Stiff::Cube, 4, 192), (Stiff::ScaleMix, 1, 880)]
    {
        let all = triangles(&stiff(kind, n, 1));
        assert_eq!((all.len(), open_edges(&all)), (count, 0), "{kind}");
        assert_ne!(open_edges(&all[1..]), 0, "{kind}: a missing triangle shows");
    }
}

#[test]
fn every_kind_is_made_and_depends_on_its_seed_alone() {
    for kind in Stiff::ALL {
        let n = if kind == Stiff::Shell { 1 } else { 9 };
        let n = if kind == Stiff::ScaleMix { 0 } else { n };
        let scene = stiff(kind, n, 5);
        assert_eq!(triangles(&scene), triangles(&stiff(kind, n, 5)), "{kind}");
        assert_eq!(triangles(&scene).is_empty(), kind == Stiff::Empty, "{kind}");
    }
    let [a, b, c] = triangles(&stiff(Stiff::Slivers, 1, 3))[0].map(glam::DVec3::from);
    let aspect = a.distance(b).powi(2) / (b - a).cross(c - a).length();
    assert!((0.9e8..1.1e8).contains(&aspect), "{aspect}");
    let all = triangles(&stiff(Stiff::Sheets, 3, 0));
    assert_eq!(all[..18], all[18..36]);
    let flat = triangles(&stiff(Stiff::FlatBoxes, 9, 0));
    assert!(flat.iter().flatten().flatten().all(|x| (x * 64.0).fract() == 0.0));
}

#[test]
fn kinds_are_found_by_name_and_source_and_have_the_size_asked_for() {
    for kind in Stiff::ALL {
        assert_eq!(kind.name().parse::<Stiff>().expect("its name"), kind);
        let count = |triangles_asked: u64| {
            let scene = stiff(kind, kind.size_of(triangles_asked), 3);
            assert_eq!(Stiff::of_source(&scene.sources[0].name), Some((kind, kind.size_of(triangles_asked), 3)));
            triangles(&scene).len() as u64
        };
        let asked = kind.default_triangles().min(20_000);
        let made = count(asked);
        assert!(made <= asked && 10 * made >= 6 * asked, "{kind}: {made} of {asked}");
        if asked > 1 {
            let made = count(3 * asked);
            assert!(made <= 3 * asked && 4 * made >= 3 * asked, "{kind}: {made} of {}", 3 * asked);
        }
    }
    assert!("luck".parse::<Stiff>().unwrap_err().to_string().contains("slivers"));
    assert_eq!(Stiff::of_source("city seed=0 triangles=2000000"), None);
}

#[test]
fn far_paths_see_the_scene() {
    for kind in Stiff::ALL {
        let scene = stiff(kind, kind.size_of(500), 1);
        let Some(path) = far_path(&scene) else {
            assert_eq!(kind, Stiff::Empty);
            continue;
        };
        let all = triangles(&scene);
        let center =
            all.as_flattened().iter().map(|p| glam::DVec3::from(*p)).sum::<glam::DVec3>() / (3 * all.len()) as f64;
        for key in &path.keyframes {
            let [eye, target] = [key.position, key.target].map(glam::DVec3::from);
            let toward = (target - eye).normalize();
            assert!(toward.dot((center - eye).normalize()) > 0.6, "{kind}: {key:?}");
        }
    }
}

#[test]
fn scenes_move_exactly() {
    let [a, b] =
        [[0.0; 3], [1e7, -64.0, 0.0]].map(|shift| triangles(&moved(stiff(Stiff::Shell, 1, 2), 0.125, 2.0, shift)));
    assert!(a.iter().flatten().flatten().all(|x| (x * 4.0).fract() == 0.0));
    assert!(a.as_flattened().iter().zip(b.as_flattened()).all(|(p, q)| [p[0] + 1e7, p[1] - 64.0, p[2]] == *q));
}
