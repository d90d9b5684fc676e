//! What tests of generated scenes measure.

use brickwalk_convert::source::{Mesh, SourceScene};
use brickwalk_scenes::CameraPath;
use glam::{DAffine3, DMat3, DVec3};
use std::collections::HashMap;

/// Whether two meshes are equal to the bit.
pub fn same_mesh(a: &Mesh, b: &Mesh) -> bool {
    a.name == b.name
        && a.primitives.len() == b.primitives.len()
        && a.primitives.iter().zip(&b.primitives).all(|(p, q)| {
            p.material == q.material
                && p.positions == q.positions
                && p.normals == q.normals
                && p.colors == q.colors
                && p.indices == q.indices
        })
}

/// Every triangle in world space.
pub fn triangles(scene: &SourceScene) -> impl Iterator<Item = [DVec3; 3]> {
    scene.placements.iter().flat_map(|placement| {
        let m = placement.world_from_mesh;
        let column = |c: usize| DVec3::new(m[c], m[4 + c], m[8 + c]);
        let a = DAffine3 { matrix3: DMat3::from_cols(column(0), column(1), column(2)), translation: column(3) };
        scene.meshes[placement.mesh as usize].primitives.iter().flat_map(move |p| {
            p.indices
                .chunks_exact(3)
                .map(move |t| [0, 1, 2].map(|k| a.transform_point3(DVec3::from_array(p.positions[t[k] as usize]))))
        })
    })
}

/// How much of a picture of 4 by 3 points fill at the most, as a share of its width or height, whichever is more.
/// Checks that all of them are within it in every keyframe. `what` names them.
pub fn filled(path: &CameraPath, points: &[DVec3], what: &str) -> f64 {
    let slope = (0.5 * path.fov_y_degrees).to_radians().tan();
    let mut widest = 0.0f64;
    for k in 0..path.keyframes.len() {
        let eye = position(path, k);
        let forward = (DVec3::from_array(path.keyframes[k].target) - eye).normalize();
        let right = forward.cross(DVec3::Y).normalize();
        let up = right.cross(forward);
        for p in points {
            let d = *p - eye;
            let (x, y) = (d.dot(right) / d.dot(forward) / slope, d.dot(up) / d.dot(forward) / slope);
            assert!(d.dot(forward) > 0.0 && x.abs() <= 4.0 / 3.0 && y.abs() <= 1.0, "{what}: {p} is at {x} {y}");
            widest = widest.max(0.75 * x.abs()).max(y.abs());
        }
    }
    widest
}

/// Distance from a point to a triangle (Ericson, Real-Time Collision Detection, 5.1.5).
pub fn distance(p: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let n = ab.cross(ac);
    let inside = |u: DVec3, v: DVec3| (v - u).cross(p - u).dot(n) >= 0.0;
    if inside(a, b) && inside(b, c) && inside(c, a) {
        return ap.dot(n).abs() / n.length();
    }
    let edge = |u: DVec3, v: DVec3| {
        let t = ((p - u).dot(v - u) / (v - u).length_squared()).clamp(0.0, 1.0);
        (p - u - (v - u) * t).length()
    };
    edge(a, b).min(edge(b, c)).min(edge(c, a))
}

/// Triangles by the columns of space that they are near to, so that few of them are looked at from a point.
pub struct Near {
    all: Vec<[DVec3; 3]>,
    columns: HashMap<[i64; 2], Vec<u32>>,
}

impl Near {
    /// Metres to which triangles are near to a column.
    const MOST: f64 = 1.0;

    pub fn new(all: impl IntoIterator<Item = [DVec3; 3]>) -> Self {
        let all: Vec<_> = all.into_iter().collect();
        let mut columns: HashMap<_, Vec<u32>> = HashMap::new();
        for (number, [a, b, c]) in (0..).zip(&all) {
            let [low, high] = [a.min(*b).min(*c) - Self::MOST, a.max(*b).max(*c) + Self::MOST].map(Self::column);
            for place in (low[0]..=high[0]).flat_map(|x| (low[1]..=high[1]).map(move |z| [x, z])) {
                columns.entry(place).or_default().push(number);
            }
        }
        Self { all, columns }
    }

    /// The column of 4 m by 4 m with a point.
    fn column(p: DVec3) -> [i64; 2] {
        [p.x, p.z].map(|x| (x / 4.0).floor() as i64)
    }

    /// [`clearance`] from all of them.
    pub fn clearance(&self, p: DVec3, radius: f64) -> f64 {
        assert!(radius <= Self::MOST);
        let near = self.columns.get(&Self::column(p)).into_iter().flatten();
        clearance(near.map(|number| &self.all[*number as usize]), p, radius)
    }
}

/// Distance from `p` to the nearest of `all`, infinite beyond `radius`.
pub fn clearance<'a>(all: impl IntoIterator<Item = &'a [DVec3; 3]>, p: DVec3, radius: f64) -> f64 {
    all.into_iter()
        .filter(|t| {
            let (low, high) = (t[0].min(t[1]).min(t[2]) - radius, t[0].max(t[1]).max(t[2]) + radius);
            p.cmpge(low).all() && p.cmple(high).all()
        })
        .map(|t| distance(p, *t))
        .fold(f64::INFINITY, f64::min)
}

/// Where the camera is in keyframe `k`.
pub fn position(path: &CameraPath, k: usize) -> DVec3 {
    DVec3::from_array(path.keyframes[k].position)
}
