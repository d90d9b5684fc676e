//! Truth against itself, and the judge over f32 hits of the kernels' triangle test.

use super::bounds::assess;
use crate::math::exact::{intersect_triangle, ray_frame};
use crate::math::random::Rng;
use crate::reference::*;
use bricks::ORIGIN_STEPS;
use glam::{DMat3, DVec3};

mod exclusion;
mod padding;

impl Rng {
    /// In -1..1.
    fn real(&mut self) -> f64 {
        self.bits() as f64 / 2.0f64.powi(63) - 1.0
    }

    fn vector(&mut self) -> DVec3 {
        DVec3::new(self.real(), self.real(), self.real())
    }
}

/// Lattice of all test objects: 2^-14.
const STEP_LOG2: i32 = -14;
/// Object and world units of a device unit.
const UNIT: f64 = 4.0;
const STEP: f64 = 1.0 / 16_384.0;

/// What a kernel gets of a scene: f32 twins of what the device has.
struct Kernel<'a> {
    truth: &'a Truth,
    /// Reference point in lattice steps of the world.
    reference: [i64; 3],
    /// Low bits of every coordinate that are lost before the triangle test; 0 for the kernels' own arithmetic.
    lost_bits: u32,
}

/// A ray in device units.
#[derive(Clone, Copy, Debug)]
struct Ray32 {
    o: [f32; 3],
    d: [f32; 3],
    t_min: f32,
    t_max: f32,
}

impl Kernel<'_> {
    fn reference_world(&self) -> [f64; 3] {
        self.reference.map(|r| r as f64 * STEP)
    }

    fn truth_ray(&self, ray: &Ray32) -> TruthRay {
        TruthRay::from_f32(self.reference_world(), UNIT, ray.o, ray.d, ray.t_min, ray.t_max)
    }

    /// A ray from one world point toward another.
    fn ray(&self, from: DVec3, toward: DVec3) -> Ray32 {
        let reference = DVec3::from(self.reference_world());
        let o = ((from - reference) / UNIT).as_vec3();
        let d = (toward - reference - o.as_dvec3() * UNIT).normalize_or(DVec3::Z).as_vec3();
        Ray32 { o: o.into(), d: d.into(), t_min: 0.0, t_max: f32::MAX }
    }

    /// The closest hit by brute force in f32.
    fn closest(&self, ray: &Ray32) -> Option<(u32, f64)> {
        let mut best: Option<(u32, f32)> = None;
        for instance in &self.truth.instances {
            let object = &self.truth.objects[instance.object as usize];
            let (reference, o, d) = match &instance.world_from_object {
                None => (self.reference, ray.o, ray.d),
                Some(m) => self.transformed(m, object, ray),
            };
            let frame = ray_frame(d);
            for triangle in &object.triangles {
                let relative = |v: [i64; 3]| -> [f32; 3] {
                    std::array::from_fn(|k| {
                        let v = ((v[k] - reference[k]) as f64 * STEP / UNIT) as f32;
                        f32::from_bits(v.to_bits() >> self.lost_bits << self.lost_bits) - o[k]
                    })
                };
                let [a, b, c] = triangle.vertices.map(relative);
                let hit = intersect_triangle(&frame, a, b, c, ray.t_min);
                let id = instance.base + triangle.local_id;
                let nearer = |(best_id, t): (u32, f32)| hit.t < t || (hit.t == t && id < best_id);
                if hit.hit && hit.t <= ray.t_max && best.is_none_or(nearer) {
                    best = Some((id, hit.t));
                }
            }
        }
        best.map(|(id, t)| (id, t.into()))
    }

    /// The instance's reference point and the ray in its frame, as the device has them.
    fn transformed(&self, m: &[f64; 12], object: &TruthObject, ray: &Ray32) -> ([i64; 3], [f32; 3], [f32; 3]) {
        let linear =
            DMat3::from_cols(DVec3::new(m[0], m[4], m[8]), DVec3::new(m[1], m[5], m[9]), DVec3::new(m[2], m[6], m[10]));
        let inverse = linear.inverse();
        let offset = inverse * (DVec3::from(self.reference_world()) - DVec3::new(m[3], m[7], m[11]));
        let mut reference = [0i64; 3];
        for k in 0..3 {
            let [low, high] = object.bounds.map(|bound| bound[k].div_euclid(ORIGIN_STEPS));
            let cell = (offset[k] / (STEP * ORIGIN_STEPS as f64)).round() as i64;
            reference[k] = cell.clamp(low - 1, high + 1) * ORIGIN_STEPS;
        }
        let c = (offset - DVec3::from(reference.map(|r| r as f64)) * STEP) / UNIT;
        let row = |k: usize| inverse.row(k).as_vec3();
        let linear = |k: usize, v: [f32; 3]| (row(k).x * v[0] + row(k).y * v[1]) + row(k).z * v[2];
        (reference, std::array::from_fn(|k| linear(k, ray.o) + c[k] as f32), std::array::from_fn(|k| linear(k, ray.d)))
    }
}

fn lattice(p: DVec3) -> [i64; 3] {
    (p / STEP).round().to_array().map(|x| x as i64)
}

/// A bumpy closed surface of 4 n² triangles around `center`, ids from `first`.
fn closed_mesh(random: &mut Rng, n: usize, center: DVec3, size: f64, first: u32) -> Vec<TruthTriangle> {
    let point = |bumps: &[f64], i: usize, j: usize| {
        let (theta, phi) =
            (i as f64 / n as f64 * std::f64::consts::PI, (j % (2 * n)) as f64 / n as f64 * std::f64::consts::PI);
        let j = if i == 0 || i == n { 0 } else { j % (2 * n) };
        let radius = size * (1.0 + 0.3 * bumps[i * 2 * n + j]);
        let ring = if i == 0 || i == n { 0.0 } else { theta.sin() };
        lattice(center + radius * DVec3::new(ring * phi.cos(), ring * phi.sin(), theta.cos()))
    };
    let bumps: Vec<f64> = (0..(n + 1) * 2 * n).map(|_| random.real()).collect();
    let mut triangles = Vec::new();
    for i in 0..n {
        for j in 0..2 * n {
            let (a, b) = (point(&bumps, i, j), point(&bumps, i, j + 1));
            let (c, d) = (point(&bumps, i + 1, j + 1), point(&bumps, i + 1, j));
            for vertices in [[a, d, c], [a, c, b]] {
                let [p, q, r] = vertices;
                if p != q && q != r && r != p {
                    let local_id = first + triangles.len() as u32;
                    triangles.push(TruthTriangle { local_id, rotation: 0, vertices, opacity: None });
                }
            }
        }
    }
    triangles
}

/// Triangles of very different sizes and shapes, slivers and coplanar ones among them, near `center`.
fn soup(random: &mut Rng, count: u32, center: DVec3, first: u32) -> Vec<TruthTriangle> {
    let mut triangles: Vec<TruthTriangle> = Vec::new();
    while triangles.len() < count as usize {
        let size = 10.0 * 2.0f64.powf(6.0 * random.real() - 4.0);
        let p = center + 10.0 * random.vector();
        let [q, mut r] = [(); 2].map(|()| p + size * random.vector());
        if random.below(4) == 0 {
            r = p + (q - p) * random.real() + 2e-4 * random.vector();
        }
        let mut vertices = [p, q, r].map(lattice);
        if random.below(6) == 0 {
            vertices.iter_mut().for_each(|v| v[1] = lattice(center)[1]);
        }
        let cross = DVec3::from(sub(vertices[1], vertices[0])).cross(sub(vertices[2], vertices[0]).into());
        if cross != DVec3::ZERO {
            let local_id = first + triangles.len() as u32;
            triangles.push(TruthTriangle { local_id, rotation: random.below(3) as u32, vertices, opacity: None });
        }
    }
    triangles
}

fn sub(a: [i64; 3], b: [i64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| (a[k] - b[k]) as f64)
}

fn identity(base: u32) -> TruthInstance {
    TruthInstance { object: 0, base, world_from_object: None }
}

/// A world of a closed mesh around a soup, whole copies of some triangles under higher ids, `cells` reference cells
/// from the world's origin.
fn world(seed: u64, cells: i64) -> (Truth, [i64; 3]) {
    let mut random = Rng(seed);
    let reference = [cells * ORIGIN_STEPS, -cells * ORIGIN_STEPS, ORIGIN_STEPS];
    let center = DVec3::from(reference.map(|r| r as f64 * STEP)) + DVec3::new(3.0, -2.0, 5.0);
    let mut triangles = closed_mesh(&mut random, 6, center, 30.0, 0);
    triangles.extend(soup(&mut random, 60, center, triangles.len() as u32));
    for i in 0..20 {
        let local_id = triangles.len() as u32;
        triangles.push(TruthTriangle { local_id, ..triangles[7 * i] });
    }
    (Truth::new(vec![TruthObject::new(STEP_LOG2, triangles)], vec![identity(0)]).unwrap(), reference)
}

/// Closed meshes as rotated, scaled and mirrored instances in reach of each other.
fn instanced(seed: u64) -> (Truth, [i64; 3]) {
    let mut random = Rng(seed);
    let reference = [40 * ORIGIN_STEPS, 0, -20 * ORIGIN_STEPS];
    let center = DVec3::from(reference.map(|r| r as f64 * STEP));
    let mesh = closed_mesh(&mut random, 5, DVec3::new(100.0, 0.0, -70.0), 3.0, 0);
    let count = mesh.len() as u32;
    let objects = vec![TruthObject::new(STEP_LOG2, vec![]), TruthObject::new(STEP_LOG2, mesh)];
    let mut instances = vec![identity(0)];
    for i in 0..8 {
        let turn = DMat3::from_axis_angle(random.vector().normalize(), 3.0 * random.real());
        let scale = DVec3::new(1.0 + 0.9 * random.real(), 2.0, if i % 2 == 0 { 1.0 } else { -0.5 });
        let a = turn * DMat3::from_diagonal(scale);
        let place = center + 20.0 * random.vector() - a * DVec3::new(100.0, 0.0, -70.0);
        let rows: [DVec3; 3] = std::array::from_fn(|k| a.row(k));
        let matrix = std::array::from_fn(|i| if i % 4 == 3 { place[i / 4] } else { rows[i / 4][i % 4] });
        instances.push(TruthInstance { object: 1, base: i * count, world_from_object: Some(matrix) });
    }
    (Truth::new(objects, instances).unwrap(), reference)
}

/// Rays that look for trouble: aimed at vertices, edges and along surfaces, some with an interval that ends near the
/// hit.
fn adversarial_ray(random: &mut Rng, kernel: &Kernel) -> Ray32 {
    let truth = kernel.truth;
    let target = truth.world_vertices(random.below(truth.triangle_count() as u64) as usize).map(DVec3::from);
    let s = 0.5 + 0.5 * random.real();
    let aim = match random.below(4) {
        0 => target[0],
        1 => target[0].lerp(target[1], s),
        2 => (target[0] + target[1] + target[2]) / 3.0,
        _ => target[1].lerp(target[2], s) + 1e-6 * random.vector(),
    };
    let normal = (target[1] - target[0]).cross(target[2] - target[0]).normalize_or_zero();
    let mut direction = random.vector();
    if random.below(4) == 0 {
        // Grazing.
        direction -= direction.dot(normal) * normal * (1.0 - 1e-4 * random.real());
    }
    let from = aim + direction * 10.0f64.powf(1.5 * random.real() + 0.5);
    let mut ray = kernel.ray(from, aim);
    if random.below(8) == 0 {
        // Zero components.
        ray.d[random.below(3) as usize] = 0.0;
    }
    if ray.d == [0.0; 3] {
        ray.d = [0.0, 1.0, 0.0];
    }
    if random.below(8) == 0 {
        let t = ((aim - DVec3::from(kernel.reference_world())) / UNIT - DVec3::from(ray.o.map(f64::from))).length();
        if random.below(2) == 0 { ray.t_max = t as f32 } else { ray.t_min = t as f32 }
    }
    ray
}

#[test]
fn tree_agrees_with_brute_force() {
    for (truth, reference) in [world(1, 3), world(2, 100_000), instanced(3)] {
        let kernel = Kernel { truth: &truth, reference, lost_bits: 0 };
        let mut random = Rng(17);
        let mut hits = 0;
        for _ in 0..2000 {
            let ray = kernel.truth_ray(&adversarial_ray(&mut random, &kernel));
            let hit = truth.closest(&ray);
            assert_eq!(hit, truth.closest_brute(&ray), "{ray:?}");
            assert_eq!(truth.any(&ray), hit.is_some());
            hits += u32::from(hit.is_some());
        }
        assert!((1200..2000).contains(&hits), "{hits} of 2000 rays hit: both outcomes must occur");
    }
}

#[test]
fn no_gap_in_closed_meshes() {
    // From inside a closed mesh every ray hits, those through its vertices and edges too.
    let (truth, reference) = world(5, 1000);
    let kernel = Kernel { truth: &truth, reference, lost_bits: 0 };
    let center = DVec3::from(kernel.reference_world()) + DVec3::new(3.0, -2.0, 5.0);
    let mut random = Rng(6);
    for _ in 0..2000 {
        let corners = truth.world_vertices(random.below(100) as usize).map(DVec3::from);
        let aim = if random.below(2) == 0 { corners[0] } else { corners[0].midpoint(corners[2]) };
        let ray = kernel.truth_ray(&kernel.ray(center + random.vector(), aim));
        assert!(truth.closest(&ray).is_some(), "{ray:?}");
    }
}

#[test]
fn kernels_are_never_wrong() {
    for (name, (truth, reference)) in
        [("near", world(1, 0)), ("10^6 m away", world(2, 16_000)), ("instances", instanced(3)), ("more", instanced(4))]
    {
        let kernel = Kernel { truth: &truth, reference, lost_bits: 0 };
        let mut random = Rng(99);
        let tally: Tally = (0..6000)
            .map(|_| {
                let ray = adversarial_ray(&mut random, &kernel);
                judge(&truth, &kernel.truth_ray(&ray), kernel.closest(&ray))
            })
            .collect();
        println!("{name}: {tally}");
        assert_eq!(tally.mismatches, 0, "{name}: {tally}");
        // Rays aimed at edges cannot all be decided in f32; excusing them all would be no judgement.
        assert!(tally.excused() > 0 && tally.excused() < tally.total() * 2 / 5, "{name}: {tally}");

        // Rays that aim at nothing are hardly ever excused.
        let from = DVec3::from(kernel.reference_world());
        let tally: Tally = (0..2000)
            .map(|_| {
                let ray = kernel.ray(from + 10.0 * random.vector(), from + 10.0 * random.vector());
                judge(&truth, &kernel.truth_ray(&ray), kernel.closest(&ray))
            })
            .collect();
        println!("{name}, not aimed: {tally}");
        // What ties are left are overlapping triangles of one plane.
        assert!(tally.mismatches == 0 && tally.by_excuse[0] <= 2 && tally.by_excuse[1] <= 10, "{name}: {tally}");

        // Control: with coordinates of 16 bits, as watertight as before, the judge sees the difference.
        let coarse = Kernel { lost_bits: 8, ..kernel };
        let tally: Tally = (0..2000)
            .map(|_| {
                let ray = adversarial_ray(&mut random, &coarse);
                judge(&truth, &coarse.truth_ray(&ray), coarse.closest(&ray))
            })
            .collect();
        println!("{name}, 16 bits: {tally}");
        assert!(tally.mismatches > 100, "{name}: {tally}");
    }
}

#[test]
fn occlusion_is_judged() {
    let (truth, reference) = world(8, 2);
    let kernel = Kernel { truth: &truth, reference, lost_bits: 0 };
    let mut random = Rng(9);
    let (mut equal, mut wrong) = (0, 0);
    for _ in 0..3000 {
        let ray = adversarial_ray(&mut random, &kernel);
        let truth_ray = kernel.truth_ray(&ray);
        let occluded = kernel.closest(&ray).is_some();
        let verdict = judge_any(&truth, &truth_ray, occluded);
        assert!(!matches!(verdict, Verdict::Mismatch(_)), "{verdict:?} {ray:?}");
        equal += u32::from(verdict == Verdict::Equal);
        wrong += u32::from(matches!(judge_any(&truth, &truth_ray, !occluded), Verdict::Mismatch(_)));
    }
    // Control: the opposite answer is called wrong for nearly all.
    assert!(equal > 2700 && wrong > 2400, "{equal} equal, {wrong} wrong when turned round");
}

#[test]
fn planted_errors_are_found() {
    let (truth, reference) = world(11, 5);
    let kernel = Kernel { truth: &truth, reference, lost_bits: 0 };
    let mut random = Rng(12);
    let (mut planted, mut missed, mut moved, mut gone) = (0, 0, 0, 0);
    for _ in 0..1500 {
        let ray = adversarial_ray(&mut random, &kernel);
        let truth_ray = kernel.truth_ray(&ray);
        let Some((id, t)) = kernel.closest(&ray) else { continue };
        planted += 1;
        let wrong = |found| u32::from(matches!(judge(&truth, &truth_ray, found), Verdict::Mismatch(_)));
        missed += wrong(None);
        moved += wrong(Some((id, t * 1.001 + 1e-3)));
        // Another triangle, at the same distance.
        gone += wrong(Some(((id + 31) % truth.triangle_count() as u32, t)));
    }
    assert!(planted > 1000);
    // A distance is wrong by a thousandth unless the ray runs within the triangle's plane.
    assert!(missed * 10 > planted * 8, "{missed} of {planted}");
    assert!(moved * 10 > planted * 9, "{moved} of {planted}");
    assert!(gone * 100 > planted * 98, "{gone} of {planted}");
}

/// A fan of `n` triangles around (0, 0, 0) in the plane z = 0, radius 1, and a wall of two triangles at z = -1.
fn fan(n: u32, closed: bool) -> Truth {
    let corner = |i: u32| {
        let angle = f64::from(i % n) / f64::from(n) * std::f64::consts::TAU;
        lattice(DVec3::new(angle.cos(), angle.sin(), 0.0))
    };
    let count = if closed { n } else { n - 1 };
    let wall = [[-2.0, -2.0], [2.0, -2.0], [2.0, 2.0], [-2.0, 2.0]].map(|[x, y]| lattice(DVec3::new(x, y, -1.0)));
    let sides = (0..count).map(|i| [[0; 3], corner(i), corner(i + 1)]);
    let all = sides.chain([[wall[0], wall[1], wall[2]], [wall[0], wall[2], wall[3]]]);
    let triangle = |(local_id, vertices)| TruthTriangle { local_id, rotation: 0, vertices, opacity: None };
    Truth::new(vec![TruthObject::new(STEP_LOG2, (0..).zip(all).map(triangle).collect())], vec![identity(0)]).unwrap()
}

#[test]
fn a_gap_between_neighbours_is_no_excuse() {
    // Through the middle vertex of the fan to the wall behind: in f32 it may be any triangle of the fan, or a miss if
    // the fan is open there, but never the wall behind a closed one.
    let reference = [0; 3];
    let ray32 = Ray32 { o: [0.1, 0.05, 0.2], d: [-0.5, -0.25, -1.0], t_min: 0.0, t_max: f32::MAX };
    for closed in [true, false] {
        let truth = fan(7, closed);
        let kernel = Kernel { truth: &truth, reference, lost_bits: 0 };
        let ray = kernel.truth_ray(&ray32);
        let found = truth.closest(&ray).unwrap();
        assert!(found.id < 7 && (found.t - 0.2).abs() < 1e-6);
        let wall = (truth.triangle_count() as u32 - 2..).take(2).find_map(|id| {
            let at = assess(&truth, &ray, id).unwrap();
            at.inside.then_some((id, 0.5 * (at.t_low + at.t_high)))
        });
        let through = judge(&truth, &ray, wall);
        let other = judge(&truth, &ray, Some(((found.id + 2) % 6, found.t)));
        assert_eq!(other, Verdict::Excused(Excuse::Edge));
        if closed {
            assert!(matches!(through, Verdict::Mismatch(Fault::Gap { id: 0..7 })), "{through:?}");
            assert!(matches!(judge_any(&truth, &TruthRay { t_max: 0.3, ..ray }, false), Verdict::Mismatch(_)));
        } else {
            assert_eq!(through, Verdict::Excused(Excuse::Edge));
        }
        // Well within a triangle nothing is excused.
        let inside = TruthRay { origin: [0.3, 0.1, 0.2], direction: [0.0, 0.0, -1.0], ..ray };
        assert!(matches!(judge(&truth, &inside, Some((4, 0.2))), Verdict::Mismatch(Fault::NotMet { id: 4 })));
        assert!(matches!(judge(&truth, &inside, None), Verdict::Mismatch(Fault::Missed { id: 0 })));
        assert!(matches!(judge(&truth, &inside, Some((77, 0.2))), Verdict::Mismatch(Fault::NoSuchTriangle { id: 77 })));
    }
}

#[test]
fn lowest_id_at_equal_distance_and_ties() {
    let vertices = [[0, 0, 0], [40_000, 0, 0], [0, 50_000, 0]];
    // A copy, a triangle one step behind, and one far behind.
    let at = |local_id, z: i64, rotation: usize| {
        let mut vertices = vertices.map(|[x, y, _]| [x, y, z]);
        vertices.rotate_left(rotation);
        TruthTriangle { local_id, rotation: rotation as u32, vertices, opacity: None }
    };
    let triangles = [at(9, 0, 0), at(4, 0, 0), at(2, -1, 0), at(6, -16_384, 0), at(1, 0, 1)];
    let truth = |without: &[u32]| {
        let kept = triangles.iter().filter(|t| !without.contains(&t.local_id)).copied().collect();
        Truth::new(vec![TruthObject::new(STEP_LOG2, kept)], vec![identity(100)]).unwrap()
    };
    let far = Ray32 { o: [0.1, 0.1, 900.0], d: [0.0, 0.0, -1.0], t_min: 0.0, t_max: f32::MAX };
    let near = Ray32 { o: [0.1, 0.1, 0.25], ..far };
    let all = truth(&[]);
    let ray = |ray| Kernel { truth: &all, reference: [0; 3], lost_bits: 0 }.truth_ray(ray);
    assert_eq!(all.closest(&ray(&far)).map(|hit| (hit.t, hit.id)), Some((900.0, 101)));
    // Another rotation may have another t: excused. A copy of the same rotation has the same.
    assert_eq!(judge(&all, &ray(&far), Some((104, 900.0))), Verdict::Excused(Excuse::Tie));
    assert_eq!(judge(&all, &ray(&far), Some((109, 900.0))), Verdict::Mismatch(Fault::HigherId { id: 104 }));
    // One step behind: 1.5e-5 device units are within f32 at a distance of 900, not at 0.25.
    assert_eq!(judge(&all, &ray(&far), Some((102, 900.0))), Verdict::Excused(Excuse::Tie));
    let behind = 0.25 + STEP / UNIT;
    let missed = judge(&truth(&[1, 9]), &ray(&near), Some((102, behind)));
    assert_eq!(missed, Verdict::Mismatch(Fault::Missed { id: 104 }));
    assert_eq!(judge(&truth(&[1, 4, 9]), &ray(&near), Some((102, behind))), Verdict::Equal);
    assert!(matches!(judge(&all, &ray(&far), Some((106, 900.25))), Verdict::Mismatch(Fault::Missed { .. })));

    // The ends of the interval are closed, and as far as f32 tells.
    let ends = |t_min: f64, t_max: f64| TruthRay { t_min, t_max, ..ray(&far) };
    assert_eq!(all.closest(&ends(0.0, 900.0)).map(|hit| hit.id), Some(101));
    assert_eq!(all.closest(&ends(0.0, 899.999)), None);
    assert_eq!(judge(&all, &ends(0.0, 900.0), None), Verdict::Excused(Excuse::IntervalEnd));
    assert!(matches!(judge(&all, &ends(0.0, 901.0), None), Verdict::Mismatch(Fault::Missed { .. })));
    let all_behind = all.closest(&ends(900.1, 1000.0));
    assert_eq!(all_behind.map(|hit| (hit.t, hit.id)), Some((900.25, 106)));
}

#[test]
fn weights_follow_the_source_order() {
    let source = [[0, 0, 0], [16_384, 0, 0], [0, 16_384, 0]];
    for rotation in 0..3 {
        let mut vertices = source;
        vertices.rotate_left(rotation);
        let triangle = TruthTriangle { local_id: 3, rotation: rotation as u32, vertices, opacity: None };
        let truth = Truth::new(vec![TruthObject::new(STEP_LOG2, vec![triangle])], vec![identity(5)]).unwrap();
        let hit = truth.closest(&TruthRay::new([0.25, 0.5, 1.0], [0.0, 0.0, -1.0], 0.0, 10.0)).unwrap();
        assert_eq!((hit.id, hit.t, hit.u, hit.v), (8, 1.0, 0.25, 0.5), "rotation {rotation}");
        // Control: a rotation that does not belong to the vertices gives other weights.
        let other = TruthTriangle { rotation: (rotation as u32 + 1) % 3, ..triangle };
        let truth = Truth::new(vec![TruthObject::new(STEP_LOG2, vec![other])], vec![identity(5)]).unwrap();
        let hit = truth.closest(&TruthRay::new([0.25, 0.5, 1.0], [0.0, 0.0, -1.0], 0.0, 10.0)).unwrap();
        assert_ne!((hit.u, hit.v), (0.25, 0.5));
    }
}

#[test]
fn bounds_are_of_the_order_of_f32() {
    let (truth, reference) = world(1, 16_000);
    let kernel = Kernel { truth: &truth, reference, lost_bits: 0 };
    let mut random = Rng(5);
    for _ in 0..300 {
        let ray = adversarial_ray(&mut random, &kernel);
        let truth_ray = kernel.truth_ray(&ray);
        let Some(hit) = truth.closest(&truth_ray) else { continue };
        let at = assess(&truth, &truth_ray, hit.id).unwrap();
        assert!(at.t_low <= hit.t && hit.t <= at.t_high, "{at:?} {hit:?}");
        // u times the extent of 100 m, times the constants of a few operations.
        assert!(at.edge_epsilon > 1e-8 && at.edge_epsilon < 16.0 * 100.0 / 16_777_216.0, "{at:?}");
    }
}

#[test]
fn ids_are_unique_and_invalid_rays_miss() {
    let triangle =
        |local_id| TruthTriangle { local_id, rotation: 0, vertices: [[0, 0, 0], [9, 0, 0], [0, 9, 0]], opacity: None };
    let object = |id| TruthObject::new(0, vec![triangle(id)]);
    let at = |object, base| TruthInstance { object, base, world_from_object: None };
    let build = |second: TruthInstance| Truth::new(vec![object(7), object(5)], vec![at(0, 0), second]);
    assert!(matches!(build(at(1, 2)), Err(DecodeError::Id { id: 7 })));
    assert!(matches!(build(at(1, u32::MAX - 5)), Err(DecodeError::Id { id: 4_294_967_295 })));
    let truth = build(at(1, u32::MAX - 6)).unwrap();
    assert_eq!(truth.ids().collect::<Vec<_>>(), [7, u32::MAX - 1]);
    let ray = |direction: [f64; 3], t_max: f64| TruthRay::new([1.0, 1.0, 1.0], direction, 0.0, t_max);
    assert_eq!(truth.closest(&ray([0.0, 0.0, -1.0], 2.0)).unwrap().id, 7);
    for bad in [ray([0.0; 3], 2.0), ray([f64::NAN, 0.0, -1.0], 2.0), ray([0.0, 0.0, -1.0], -1.0)] {
        assert!(truth.closest(&bad).is_none() && !truth.any(&bad) && truth.closest_brute(&bad).is_none());
    }
    let empty = Truth::new(vec![], vec![]).unwrap();
    assert_eq!(judge(&empty, &ray([0.0, 0.0, -1.0], 2.0), None), Verdict::Equal);
    assert!(matches!(judge(&empty, &ray([0.0, 0.0, -1.0], 2.0), Some((0, 1.0))), Verdict::Mismatch(_)));
}
