//! Scenes for tests: soups of random triangles, and overlapping instances under general matrices.

use crate::material::material;
use crate::rng::Rng;
use brickwalk_convert::source::{IDENTITY, Mesh, Placement, Primitive, SourceScene};
use glam::{DAffine3, DMat3, DQuat, DVec3};
use std::collections::HashMap;

/// Kinds of soups.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SoupKind {
    /// Triangles of about one size all over a cube of side 20.
    Uniform,
    /// Most triangles in a few small clusters, sizes over three orders of magnitude.
    Clustered,
    /// Triangles a thousand times longer than wide, in all directions.
    Slivers,
}

/// A soup of `n` triangles that depends on `seed` alone: one mesh, two materials by turns, placed once.
pub fn soup(kind: SoupKind, n: u32, seed: u64) -> SourceScene {
    let mut rng = Rng::new(seed, &[20, kind as i64]);
    let centers: Vec<DVec3> = (0..7).map(|_| inside(&mut rng, 9.0)).collect();
    let mut parts = [const { Vec::new() }; 2];
    for k in 0..n {
        let [a, b, c] = match kind {
            SoupKind::Uniform => {
                let p = inside(&mut rng, 10.0);
                [p, p + rng.direction() * rng.range(0.1, 0.7), p + rng.direction() * rng.range(0.1, 0.7)]
            }
            SoupKind::Clustered => {
                let center = rng.pick(&centers);
                let spread = 0.05 * 30f64.powf(rng.unit());
                let p = if rng.chance(0.9) {
                    center + rng.direction() * spread * rng.unit()
                } else {
                    inside(&mut rng, 10.0)
                };
                let size = 0.001 * 1000f64.powf(rng.unit());
                [p, p + rng.direction() * size, p + rng.direction() * size]
            }
            SoupKind::Slivers => {
                let p = inside(&mut rng, 10.0);
                let along = rng.direction() * rng.range(0.5, 6.0);
                let across = rng.direction() * (0.001 * along.length());
                [p, p + along, p + along * rng.unit() + across]
            }
        };
        parts[k as usize % 2].extend([a.to_array(), b.to_array(), c.to_array()]);
    }
    let primitives = parts.into_iter().enumerate().filter(|(_, p)| !p.is_empty()).map(|(m, positions)| Primitive {
        material: m as u32,
        indices: (0..positions.len() as u32).collect(),
        positions,
        ..Primitive::default()
    });
    let name = format!("soup {kind:?} seed={seed} triangles={n}").to_lowercase();
    let mesh = Mesh { name: "soup".into(), primitives: primitives.collect() };
    let placement =
        Placement { name: "soup".into(), mesh: 0, source: 0, world_from_mesh: IDENTITY, ..Placement::default() };
    scene(name, vec![mesh], vec![placement])
}

/// A point in the cube of half side `half`.
pub(crate) fn inside(rng: &mut Rng, half: f64) -> DVec3 {
    DVec3::new(rng.range(-half, half), rng.range(-half, half), rng.range(-half, half))
}

pub(crate) fn scene(name: String, meshes: Vec<Mesh>, placements: Vec<Placement>) -> SourceScene {
    SourceScene {
        meshes,
        placements,
        materials: vec![material([0.7, 0.6, 0.5], 0.8, 0), material([0.3, 0.45, 0.6], 0.8, 0)],
        sources: vec![crate::scene::source_of(name)],
        ..SourceScene::default()
    }
}

/// Sixteen overlapping instances of a bumpy sphere of 1280 triangles: turned, scaled (some unevenly), some mirrored.
pub fn rotated_instances(seed: u64) -> SourceScene {
    let mut rng = Rng::new(seed, &[21]);
    let mesh = Mesh { name: "bumpy sphere".into(), primitives: vec![bumpy_sphere(&mut rng, 3)] };
    let placements = (0..16)
        .map(|k| {
            let turn = DQuat::from_axis_angle(rng.direction(), rng.range(0.0, std::f64::consts::TAU));
            let size = 0.5 * 6f64.powf(rng.unit());
            let uneven =
                if k % 3 == 0 { DVec3::new(1.0, rng.range(0.3, 0.8), rng.range(1.2, 2.5)) } else { DVec3::ONE };
            let mirror = if k % 4 == 1 { DVec3::new(-1.0, 1.0, 1.0) } else { DVec3::ONE };
            let matrix = DMat3::from_quat(turn) * DMat3::from_diagonal(size * uneven * mirror);
            let at = inside(&mut rng, 2.5);
            let a = DAffine3::from_mat3_translation(matrix, at);
            Placement {
                name: format!("sphere {k}"),
                mesh: 0,
                source: 0,
                world_from_mesh: crate::scene::rows(&a),
                ..Placement::default()
            }
        })
        .collect();
    scene(format!("rotated instances seed={seed}"), vec![mesh], placements)
}

/// An icosahedron divided so many times, its radius between 0.8 and 1.2: closed, around the origin.
pub(crate) fn bumpy_sphere(rng: &mut Rng, divisions: u32) -> Primitive {
    let g = 0.5 * (1.0 + 5f64.sqrt());
    let mut points: Vec<DVec3> = [(-1.0, g), (1.0, g), (-1.0, -g), (1.0, -g)]
        .into_iter()
        .flat_map(|(a, b)| [DVec3::new(a, b, 0.0), DVec3::new(0.0, a, b), DVec3::new(b, 0.0, a)])
        .map(DVec3::normalize)
        .collect();
    // Faces are the triples of neighbours, turned outward.
    let edge = 1.1;
    let mut faces: Vec<[u32; 3]> = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                let (p, q, r) = (points[a], points[b], points[c]);
                if p.distance(q) < edge && q.distance(r) < edge && r.distance(p) < edge {
                    let outward = (q - p).cross(r - p).dot(p) > 0.0;
                    faces.push(if outward { [a as u32, b as u32, c as u32] } else { [a as u32, c as u32, b as u32] });
                }
            }
        }
    }
    for _ in 0..divisions {
        let mut middles: HashMap<(u32, u32), u32> = HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                points.push((points[a as usize] + points[b as usize]).normalize());
                points.len() as u32 - 1
            })
        };
        faces = faces
            .iter()
            .flat_map(|&[a, b, c]| {
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    let waves: Vec<(DVec3, f64)> =
        (0..5).map(|_| (rng.direction() * rng.range(2.0, 6.0), rng.range(0.0, 6.0))).collect();
    let radius = |p: DVec3| 1.0 + 0.04 * waves.iter().map(|(k, phase)| (k.dot(p) + phase).sin()).sum::<f64>();
    Primitive {
        material: 0,
        positions: points.iter().map(|p| (*p * radius(*p)).to_array()).collect(),
        indices: faces.into_iter().flatten().collect(),
        ..Primitive::default()
    }
}
