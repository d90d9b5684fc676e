//! Boxes are grown enough, and no more are visited than the ray comes near.

use crate::reference::bounds::padding;
use crate::reference::bvh::{Bounds, Padding};
use crate::reference::instance::stretch;
use crate::reference::tests::*;

/// `instanced`, every instance stretched by 60 along an axis of its own before it is turned.
fn stretched(seed: u64) -> (Truth, [i64; 3]) {
    let (truth, reference) = instanced(seed);
    let mut instances = truth.instances;
    for (i, instance) in instances.iter_mut().enumerate() {
        for row in instance.world_from_object.iter_mut().flat_map(|m| m.chunks_exact_mut(4)) {
            // The mesh stays where it is: its center has the coordinates (100, 0, -70).
            row[3] -= 59.0 * row[i % 3] * [100.0, 0.0, -70.0][i % 3];
            row[i % 3] *= 60.0;
        }
    }
    (Truth::new(truth.objects, instances).unwrap(), reference)
}

#[test]
fn boxes_are_padded_enough() {
    for (name, (truth, reference)) in [
        ("near", world(1, 0)),
        ("10^6 m away", world(2, 16_000)),
        ("instances", instanced(3)),
        ("stretched", stretched(3)),
    ] {
        let kernel = Kernel { truth: &truth, reference, lost_bits: 0 };
        let mut random = Rng(31);
        // Greatest part of the pad that 4 ε_edge takes.
        let mut used = 0.0f64;
        for _ in 0..300 {
            let ray = kernel.truth_ray(&adversarial_ray(&mut random, &kernel));
            let pad = padding(&truth, &ray);
            let mut visited = vec![false; truth.triangle_count()];
            truth.bvh.visit(&ray, pad, ray.t_max, |index| {
                visited[index as usize] = true;
                ray.t_max
            });
            for (index, visited) in visited.into_iter().enumerate() {
                let at = assess(&truth, &ray, truth.placed[index].id).unwrap();
                let needed = 4.0 * at.edge_epsilon * stretch(truth.stored(index).0);
                used = used.max(needed / pad.of(&ray, &Bounds::of(&truth.world_vertices(index))));
                let in_interval = ray.t_min <= at.t_low && at.t_high <= ray.t_max;
                let near = at.inside || at.edge_distance <= 4.0 * at.edge_epsilon;
                assert!(visited || !(near && in_interval), "{name}: {index} {at:?} {ray:?}");
            }
        }
        println!("{name}: {used} of the pad is used");
        // Control: a pad of a hundredth is not enough for any scene, so that the bound is one that can be missed.
        assert!(used <= 1.0 && used > 0.01, "{name}: {used}");
    }
}

#[test]
fn a_ray_that_passes_by_visits_nothing() {
    let (truth, _) = world(1, 0);
    let visits = |direction: [f64; 3]| {
        let mut count = 0;
        let ray = TruthRay::new([3.0, -2.0, 500.0], direction, 0.0, f64::INFINITY);
        truth.bvh.visit(&ray, Padding::NONE, ray.t_max, |_| {
            count += 1;
            ray.t_max
        });
        count
    };
    assert_eq!([visits([0.0, 0.0, 1.0]), visits([0.0, 1.0, -0.1])], [0, 0]);
    // Control: one through the middle visits some, not all.
    assert!((1..truth.triangle_count() / 2).contains(&visits([0.0, 0.0, -1.0])));
}
