//! Who is right where hits differ: brute force in f64 over all triangles.

use super::NEAR;
use brickwalk::kernels::layout::Ray;
use glam::DVec3;
use rayon::prelude::*;

/// A triangle's corners, device units.
pub type Corners = [[f32; 3]; 3];

fn wide(v: [f32; 3]) -> DVec3 {
    DVec3::from_array(v.map(f64::from))
}

/// The distance at which a ray meets a triangle (Möller, Trumbore 1997), infinite where it does not.
fn distance(ray: &Ray, corners: &Corners) -> f64 {
    let (origin, direction) = (wide(ray.origin), wide(ray.direction));
    let [a, b, c] = corners.map(wide);
    let (ab, ac) = (b - a, c - a);
    let across = direction.cross(ac);
    let determinant = ab.dot(across);
    let to_origin = origin - a;
    let along = to_origin.cross(ab);
    let (u, v, t) = (to_origin.dot(across), direction.dot(along), ac.dot(along));
    let (u, v, t) = (u / determinant, v / determinant, t / determinant);
    let is_hit = u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= f64::from(ray.t_min) && t <= f64::from(ray.t_max);
    if is_hit { t } else { f64::INFINITY }
}

/// A ray on which two differ: its distance by ours and by the other's.
pub struct Case {
    pub ray: Ray,
    pub found: [f32; 2],
}

/// In how many cases either finds the closest hit. `any`: only whether there is one counts.
pub fn right(cases: &[Case], triangles: &[Corners], any: bool) -> [usize; 2] {
    let mut right = [0; 2];
    for Case { ray, found } in cases {
        let distances = triangles.par_iter().with_min_len(4096).map(|corners| distance(ray, corners));
        let truth = distances.reduce(|| f64::INFINITY, f64::min);
        for (right, found) in right.iter_mut().zip(found.map(f64::from)) {
            let is_near = any || truth.is_infinite() || (found - truth).abs() <= f64::from(NEAR) * truth;
            *right += usize::from(found.is_infinite() == truth.is_infinite() && is_near);
        }
    }
    right
}
