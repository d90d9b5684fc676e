//! Scenes that are hard for arithmetic or for builders: extremes of size, shape, place and depth, each one mesh placed
//! once.

mod kind;

pub use kind::Stiff;

use crate::path::{CameraPath, around as path_around};
use crate::rng::Rng;
use crate::soup::{bumpy_sphere, inside, scene};
use brickwalk_convert::source::{IDENTITY, Mesh, Placement, Primitive, SourceScene};
use glam::DVec3;

/// The scene of a kind. It depends on the arguments alone.
pub fn stiff(kind: Stiff, n: u32, seed: u64) -> SourceScene {
    let mut rng = Rng::new(seed, &[22, kind as i64]);
    let primitive = match kind {
        Stiff::Shell => bumpy_sphere(&mut rng, n),
        Stiff::Fans => fans(n),
        Stiff::Cube => cube(n),
        Stiff::Slivers => soup_of((0..n).map(|_| sliver(&mut rng))),
        Stiff::Sheets => sheets(n),
        Stiff::Series => soup_of((0..n).map(|k| {
            let r = 1000.0 * 0.985f64.powi(k as i32);
            [DVec3::ZERO, DVec3::new(r, 0.5 * r, 0.0), DVec3::new(r, 0.0, 0.25 * r)]
        })),
        Stiff::EqualCentroids => soup_of((1..=n).map(|k| {
            let r = f64::from(k);
            [DVec3::new(-r, -r, 0.0), DVec3::new(r, -r, 0.0), DVec3::new(0.0, r, 0.0)]
        })),
        Stiff::Duplicates => {
            soup_of((0..n).map(|_| [DVec3::ZERO, DVec3::new(1.0, 0.0, 0.5), DVec3::new(0.0, 1.0, 0.25)]))
        }
        Stiff::Spanning => {
            let huge: Vec<_> = (0..32).map(|_| around(&mut rng, 3.0, 200.0)).collect();
            soup_of(huge.into_iter().chain((0..n).map(|_| around(&mut rng, 10.0, 0.3)).collect::<Vec<_>>()))
        }
        Stiff::FlatBoxes => soup_of((0..n).flat_map(|k| flat_box(&mut rng, k)).collect::<Vec<_>>()),
        Stiff::ScaleMix => scale_mix(&mut rng, n),
        Stiff::Triangle => {
            soup_of([[DVec3::new(-1.0, -1.0, 0.0), DVec3::new(1.0, -1.0, 0.0), DVec3::new(0.0, 1.0, 0.0)]])
        }
        Stiff::Empty => Primitive::default(),
        Stiff::FarOrigin => bumpy_sphere(&mut rng, n),
    };
    let made = one_mesh(&format!("stiff {kind} seed={seed} n={n}"), primitive);
    if kind == Stiff::FarOrigin { moved(made, 1.0 / 16384.0, 1.0, [1e7, 0.0, 0.0]) } else { made }
}

/// A path that has all of a scene in view, whose placements are all the identity; `None` of an empty one.
pub fn far_path(source: &SourceScene) -> Option<CameraPath> {
    let all = source.meshes.iter().flat_map(|mesh| &mesh.primitives).flat_map(|primitive| &primitive.positions);
    let [low, high] =
        all.map(|&p| DVec3::from(p)).map(|p| [p, p]).reduce(|[low, high], [p, _]| [low.min(p), high.max(p)])?;
    Some(path_around(0.5 * (low + high), &[[low, high]], 26f64.to_radians(), 0.7))
}

/// A scene of one mesh, placed once where it is.
pub fn one_mesh(name: &str, primitive: Primitive) -> SourceScene {
    let mesh = Mesh { name: name.into(), primitives: vec![primitive] };
    let placement =
        Placement { name: name.into(), mesh: 0, source: 0, world_from_mesh: IDENTITY, ..Placement::default() };
    scene(name.into(), vec![mesh], vec![placement])
}

/// The scene with every vertex moved to p · `scale` + `shift`, and moved onto multiples of `step` before, if that is
/// not 0. Meant for scenes whose placements are all the identity.
pub fn moved(mut source: SourceScene, step: f64, scale: f64, shift: [f64; 3]) -> SourceScene {
    let snapped = |x: f64| if step > 0.0 { (x / step).round() * step } else { x };
    for primitive in source.meshes.iter_mut().flat_map(|mesh| &mut mesh.primitives) {
        for p in &mut primitive.positions {
            *p = std::array::from_fn(|k| snapped(p[k]) * scale + shift[k]);
        }
    }
    source
}

/// Triangles that share no vertices.
fn soup_of(triangles: impl IntoIterator<Item = [DVec3; 3]>) -> Primitive {
    let positions: Vec<[f64; 3]> = triangles.into_iter().flatten().map(|p| p.to_array()).collect();
    Primitive { indices: (0..positions.len() as u32).collect(), positions, ..Primitive::default() }
}

fn fans(n: u32) -> Primitive {
    let turn = |k: u32| std::f64::consts::TAU * f64::from(k) / f64::from(n);
    let mut positions: Vec<[f64; 3]> = (0..n).map(|k| [turn(k).cos(), 0.0, turn(k).sin()]).collect();
    positions.extend([[0.013, 1.0, -0.021], [-0.017, -1.0, 0.011]]);
    let indices = (0..n).flat_map(|k| [k, n, (k + 1) % n, k, (k + 1) % n, n + 1]).collect();
    Primitive { positions, indices, ..Primitive::default() }
}

fn cube(n: u32) -> Primitive {
    let at = |i: u32| 2.0 * f64::from(i) / f64::from(n) - 1.0;
    let mut triangles = Vec::new();
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let point = |i: u32, j: u32| {
                let mut p = DVec3::ZERO;
                (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (side, at(i), at(j));
                p
            };
            for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                let [a, b, c, d] = [point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1)];
                triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
    soup_of(triangles)
}

fn sliver(rng: &mut Rng) -> [DVec3; 3] {
    let p = inside(rng, 0.5);
    let along = rng.direction();
    let across = along.any_orthonormal_vector() * 1e-8;
    [p - 0.5 * along, p + 0.5 * along, p + rng.range(-0.4, 0.4) * along + across]
}

fn sheets(n: u32) -> Primitive {
    let at = |i: u32, j: u32| {
        let (x, z) = (f64::from(i) / f64::from(n) - 0.5, f64::from(j) / f64::from(n) - 0.5);
        DVec3::new(x, 0.375 * x + 0.25 * z, z)
    };
    let square = move |i: u32, j: u32| {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [[a, b, c], [a, c, d]]
    };
    let sheet = (0..n).flat_map(move |i| (0..n).flat_map(move |j| square(i, j)));
    soup_of((0..4).flat_map(|_| sheet.clone()))
}

/// A triangle of about the given size near a point within the cube of half side `half`.
fn around(rng: &mut Rng, half: f64, size: f64) -> [DVec3; 3] {
    let p = inside(rng, half);
    [p + size * rng.direction(), p + size * rng.direction(), p + size * rng.direction()]
}

fn flat_box(rng: &mut Rng, k: u32) -> Vec<[DVec3; 3]> {
    let mut grid = |most: i64| rng.int(0, most) as f64 / 64.0;
    let low = DVec3::new(grid(448) - 4.0, grid(448) - 4.0, grid(448) - 4.0);
    let mut size = DVec3::new(grid(63), grid(63), grid(63)) + 1.0 / 64.0;
    if !k.is_multiple_of(3) {
        size[k as usize / 3 % 3] = 0.0;
    }
    let corner = |i: u32| low + size * DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2));
    let faces = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
    faces
        .into_iter()
        .flat_map(|face| {
            let [a, b, c, d] = face.map(corner);
            [[a, b, c], [a, c, d]]
        })
        // Faces across the flat axis have no area, and the two others lie in one place.
        .filter(|[a, b, c]| (b - a).cross(c - a) != DVec3::ZERO)
        .collect()
}

fn scale_mix(rng: &mut Rng, n: u32) -> Primitive {
    let mut all = Primitive::default();
    for decade in -4..=6 {
        let size = 10f64.powi(decade);
        let shell = bumpy_sphere(rng, n);
        let first = all.positions.len() as u32;
        // About as wide as the size says.
        let place = |p: [f64; 3]| p.map(|x| 0.4 * size * x);
        all.positions.extend(shell.positions.into_iter().map(place));
        all.indices.extend(shell.indices.into_iter().map(|i| first + i));
    }
    all
}
