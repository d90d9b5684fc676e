//! Rays that leave a triangle do not meet it.

use crate::reference::tests::*;

#[test]
fn excluded_triangles_are_passed() {
    for (truth, reference) in [world(21, 3), instanced(22)] {
        let kernel = Kernel { truth: &truth, reference, lost_bits: 0 };
        let mut random = Rng(23);
        let (mut hits, mut behind, mut planted) = (0, 0, 0);
        for _ in 0..1000 {
            let ray = kernel.truth_ray(&adversarial_ray(&mut random, &kernel));
            let Some(first) = truth.closest(&ray) else { continue };
            hits += 1;
            let excluding = ray.excluding(first.id);
            let next = truth.closest(&excluding);
            assert_eq!(next, truth.closest_brute(&excluding));
            assert!(next.is_none_or(|next| next.id != first.id && next.t >= first.t));
            assert_eq!(truth.any(&excluding), next.is_some());
            behind += u32::from(next.is_some());
            // The triangle itself is neither required nor permitted, the next one both.
            let found = |hit: TruthHit| Some((hit.id, hit.t));
            assert_eq!(judge(&truth, &excluding, next.and_then(found)), Verdict::Equal);
            assert_eq!(judge_any(&truth, &excluding, next.is_some()), Verdict::Equal);
            let named = judge(&truth, &excluding, found(first));
            assert_eq!(named, Verdict::Mismatch(Fault::Excluded { id: first.id }));
            // Control: a ray that excludes nothing, or another triangle, must find it.
            let other = ray.excluding(first.id ^ 1);
            assert_eq!([judge(&truth, &ray, found(first)), judge(&truth, &other, found(first))], [Verdict::Equal; 2]);
            let missed = judge(&truth, &other, next.and_then(found));
            planted += u32::from(matches!(missed, Verdict::Mismatch(_)));
        }
        assert!(hits > 500 && behind > 100 && planted * 2 > hits, "{hits} hits, {behind} behind, {planted} noticed");
    }
}

#[test]
fn an_excluded_triangle_proves_no_gap() {
    // As in `a_gap_between_neighbours_is_no_excuse`: through the middle vertex of a closed fan. Without one of its
    // triangles the fan has a hole there.
    let truth = fan(7, true);
    let kernel = Kernel { truth: &truth, reference: [0; 3], lost_bits: 0 };
    let ray = Ray32 { o: [0.1, 0.05, 0.2], d: [-0.5, -0.25, -1.0], t_min: 0.0, t_max: 0.3 };
    let ray = kernel.truth_ray(&ray);
    let gap = |verdict| matches!(verdict, Verdict::Mismatch(Fault::Gap { id: 0..7 }));
    assert!(gap(judge(&truth, &ray, None)) && gap(judge_any(&truth, &ray, false)), "control: a closed fan");
    for id in 0..7 {
        let ray = ray.excluding(id);
        let passed = [judge(&truth, &ray, None), judge_any(&truth, &ray, false)];
        assert_eq!(passed, [Verdict::Excused(Excuse::Edge); 2], "{id}");
    }
    // The wall behind is no part of the fan.
    assert!(gap(judge(&truth, &ray.excluding(8), None)));
    // Well within a triangle: its exclusion opens the way, that of a neighbour does not.
    let inside = TruthRay { origin: [0.3, 0.1, 0.2], direction: [0.0, 0.0, -1.0], ..ray };
    let missed = Verdict::Mismatch(Fault::Missed { id: 0 });
    assert_eq!(judge(&truth, &inside.excluding(0), None), Verdict::Equal);
    assert_eq!([judge(&truth, &inside, None), judge(&truth, &inside.excluding(1), None)], [missed; 2]);
}
