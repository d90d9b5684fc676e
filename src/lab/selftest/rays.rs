//! Rays aimed at what is hard to hit.

use crate::kernels::frame::Frame;
use crate::kernels::layout::{Ray, T_INFINITE};
use crate::reference::Truth;
use brickwalk_scenes::Rng;
use glam::DVec3;

/// What a ray is aimed at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aim {
    /// A vertex of a triangle.
    Vertex,
    /// A point of an edge.
    Edge,
    /// A point inside of a triangle.
    Inside,
}

impl Aim {
    /// Every kind.
    pub const ALL: [Self; 3] = [Self::Vertex, Self::Edge, Self::Inside];

    /// The first vertex of a triangle, a point of its first edge, or one inside.
    pub fn point(self, rng: &mut Rng, [a, b, c]: [DVec3; 3]) -> DVec3 {
        match self {
            Self::Vertex => a,
            Self::Edge => a + rng.unit() * (b - a),
            Self::Inside => {
                let (s, t) = (rng.unit(), rng.unit());
                let (s, t) = if s + t > 1.0 { (1.0 - s, 1.0 - t) } else { (s, t) };
                a + s * (b - a) + t * (c - a)
            }
        }
    }
}

/// Triangles in device units relative to a frame's reference point, where lattice points are exact in f64.
pub struct Targets(pub Vec<[DVec3; 3]>);

impl Targets {
    /// All triangles of a scene.
    pub fn of(truth: &Truth, frame: &Frame) -> Self {
        let relative = |p: [f64; 3]| (DVec3::from(p) - frame.origin) / frame.unit;
        Self(truth.ids().filter_map(|id| truth.vertices(id)).map(|t| t.map(relative)).collect())
    }

    /// A random triangle, from any of its vertices on.
    pub fn triangle(&self, rng: &mut Rng) -> [DVec3; 3] {
        let index = rng.int(0, self.0.len() as i64 - 1) as usize;
        let [a, b, c] = self.0[index];
        [[a, b, c], [b, c, a], [c, a, b]][rng.int(0, 2) as usize]
    }

    /// A point of a random triangle.
    pub fn point(&self, rng: &mut Rng, aim: Aim) -> DVec3 {
        let triangle = self.triangle(rng);
        aim.point(rng, triangle)
    }

    /// A ray from `origin` at a random target. Where origin and vertex are lattice points with at most 24 bits between
    /// them, the ray goes through the vertex exactly.
    pub fn ray(&self, rng: &mut Rng, origin: DVec3, aim: Aim) -> Ray {
        ray(origin, self.point(rng, aim))
    }

    /// `count` rays at random targets from the cube of half side `half` around `middle`: half of the origins on
    /// multiples of `step`, the others anywhere.
    pub fn aimed(&self, rng: &mut Rng, (middle, half): (DVec3, f64), step: f64, count: usize) -> Vec<Ray> {
        let aimed = |i: usize| {
            let fine = if i.is_multiple_of(2) { step } else { step / 1024.0 };
            let origin = lattice_point(rng, middle, half, fine);
            self.ray(rng, origin, Aim::ALL[i / 2 % 3])
        };
        (0..count).map(aimed).collect()
    }
}

/// The ray from a point through another, in device units; it begins at the point rounded to f32.
pub fn ray(origin: DVec3, to: DVec3) -> Ray {
    let origin = origin.as_vec3();
    let direction = (to - origin.as_dvec3()).as_vec3();
    let direction = if direction.abs().max_element() < 1e-9 { glam::Vec3::X } else { direction };
    Ray { origin: origin.to_array(), t_min: 0.0, direction: direction.to_array(), t_max: T_INFINITE }
}

/// A point with coordinates on multiples of `step` within the cube of half side `half` around `middle`.
pub fn lattice_point(rng: &mut Rng, middle: DVec3, half: f64, step: f64) -> DVec3 {
    let offset = DVec3::new(rng.range(-half, half), rng.range(-half, half), rng.range(-half, half));
    ((middle + offset) / step).round() * step
}
