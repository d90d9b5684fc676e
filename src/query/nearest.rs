//! The point of the scene that is nearest to a given one: each looks into bricks, about the nearest first.

use super::hits::normal;
use super::room::{Inner, Room};
use super::rounds::{Bricks, Seek, State};
use super::space::Placed;
use super::{Closest, Queries, Watch};
use crate::kernels::layout::NONE;
use crate::kernels::simd::isa::Isa;
use anyhow::Result;
use glam::DVec3;
use rayon::prelude::*;

/// A point of a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OnTriangle {
    /// Relative to the given point.
    pub(super) offset: DVec3,
    /// Weights of the vertices; they sum to 1.
    pub(super) weights: [f64; 3],
}

/// The point of the edge from `p` to `q` that is nearest to the origin, and how far along the edge it lies, 0 to 1.
#[inline(always)]
fn nearest_on_edge(p: DVec3, q: DVec3) -> (f64, DVec3) {
    let along = q - p;
    let length = along.length_squared();
    let t = if length > 0.0 { (-p.dot(along) / length).clamp(0.0, 1.0) } else { 0.0 };
    // From the nearer end, so that an end is met exactly.
    (t, if t < 0.5 { p + along * t } else { q - along * (1.0 - t) })
}

/// The point of a triangle that is nearest to the origin. What lies within the triangle is found by its plane, and the
/// points of its edges are candidates in any case, so that needles and triangles without area have one.
#[inline(always)]
pub(super) fn nearest_on_triangle([a, b, c]: [DVec3; 3]) -> OnTriangle {
    let (ab, bc, ca) = (nearest_on_edge(a, b), nearest_on_edge(b, c), nearest_on_edge(c, a));
    let mut best = OnTriangle { offset: ab.1, weights: [1.0 - ab.0, ab.0, 0.0] };
    if bc.1.length_squared() < best.offset.length_squared() {
        best = OnTriangle { offset: bc.1, weights: [0.0, 1.0 - bc.0, bc.0] };
    }
    if ca.1.length_squared() < best.offset.length_squared() {
        best = OnTriangle { offset: ca.1, weights: [ca.0, 0.0, 1.0 - ca.0] };
    }
    let across = (b - a).cross(c - a);
    let area = across.length_squared();
    let offset = across * (a.dot(across) / area);
    if area.is_normal() && offset.length_squared() < best.offset.length_squared() {
        let (a, b, c) = (a - offset, b - offset, c - offset);
        let parts = [b.cross(c).dot(across), c.cross(a).dot(across), a.cross(b).dot(across)];
        if parts[0] >= 0.0 && parts[1] >= 0.0 && parts[2] >= 0.0 {
            let sum = parts[0] + parts[1] + parts[2];
            best = OnTriangle { offset, weights: [parts[0] / sum, parts[1] / sum, parts[2] / sum] };
        }
    }
    best
}

/// What a point has found.
#[derive(Clone, Copy)]
struct Best {
    distance_squared: f64,
    id: u32,
    leaf: u32,
    triangle: u32,
    /// Of the vertices as they are stored.
    weights: [f64; 3],
    point: DVec3,
    normal: [f32; 3],
}

const NOTHING: Best = Best {
    distance_squared: f64::INFINITY,
    id: NONE,
    leaf: NONE,
    triangle: 0,
    weights: [1.0, 0.0, 0.0],
    point: DVec3::NAN,
    normal: [0.0; 3],
};

impl Best {
    /// Farther, or as far with a higher id.
    #[inline(always)]
    fn is_after(&self, distance_squared: f64, id: u32) -> bool {
        (distance_squared, id) < (self.distance_squared, self.id)
    }

    /// Has it be the best in a brick, if that is better.
    #[inline(always)]
    fn look_into<I: Isa>(&mut self, isa: I, point: DVec3, (leaf, brick): (u32, &Placed), room: &mut Inner) {
        brick.walk_near(
            isa,
            point,
            self.distance_squared,
            room,
            #[inline(always)]
            |triangle| {
                let [a, b, c] = brick.vertices(triangle);
                let on = nearest_on_triangle([a - point, b - point, c - point]);
                let distance_squared = on.offset.length_squared();
                if distance_squared <= self.distance_squared {
                    let id = brick.id(triangle);
                    if self.is_after(distance_squared, id) {
                        // By weights, for the offset of a point that is far away is rounded by much.
                        let weights = on.weights;
                        let point = a * weights[0] + b * weights[1] + c * weights[2];
                        let normal = normal([a, b, c]);
                        *self = Self { distance_squared, id, leaf, triangle, weights, point, normal };
                    }
                }
                self.distance_squared
            },
        );
    }
}

/// Points that look for what is nearest.
struct Nearest<'a> {
    queries: &'a Queries,
    points: &'a [[f64; 3]],
}

impl Seek for Nearest<'_> {
    /// Where they begin.
    type Ready = usize;

    type Found = Best;

    #[inline(always)]
    fn ready<I: Isa>(&self, _: I, first: usize) -> usize {
        first
    }

    #[inline(always)]
    fn go<I: Isa>(
        &self,
        isa: I,
        (&first, i): (&usize, usize),
        best: &mut Best,
        bricks: &Bricks,
        room: &mut Room,
    ) -> Option<u32> {
        let (resident, point) = (self.queries.scene.resident(), DVec3::from_array(self.points[first + i]));
        let Room { top, inner, .. } = room;
        // The nearest brick that is away, and how near it is at least.
        let mut next = (f64::INFINITY, NONE);
        self.queries.top().near_leaves(
            isa,
            point,
            best.distance_squared,
            top,
            #[inline(always)]
            |leaf, distance| {
                let number = resident.leaves[leaf as usize].brick;
                match bricks.get(number) {
                    State::AtHand(geometry) => {
                        best.look_into(isa, point, (leaf, &Placed::new(resident, leaf, geometry)), inner);
                    }
                    State::Away if distance < next.0 => next = (distance, number),
                    _ => (),
                }
                best.distance_squared
            },
        );
        (next.1 != NONE && next.0 <= best.distance_squared).then_some(next.1)
    }
}

impl Queries {
    fn nearest(&self, points: &[[f64; 3]], watch: &mut Watch) -> Result<Vec<Best>> {
        super::check_points(points)?;
        self.seek(&Nearest { queries: self, points }, points.len(), || NOTHING, &[], watch)
    }

    /// The distance of each of `points` from the scene, world units; +inf in a scene without triangles.
    ///
    /// # Errors
    /// As of [`Queries::closest_points`].
    pub fn distance(&self, points: &[[f64; 3]], watch: &mut Watch) -> Result<Vec<f64>> {
        Ok(self.nearest(points, watch)?.iter().map(|best| best.distance_squared.sqrt()).collect())
    }

    /// The nearest point of the scene to each of `points`; of triangles equally near, to the last bit, that with the
    /// lowest id.
    ///
    /// # Errors
    /// A point that is not finite, by its number; a damaged brick; what `watch` says.
    pub fn closest_points(&self, points: &[[f64; 3]], watch: &mut Watch) -> Result<Vec<Closest>> {
        let all = self.nearest(points, watch)?;
        let of: Vec<_> = all.iter().map(|best| (best.leaf, best.triangle, best.weights)).collect();
        let nowhere =
            Closest { point: [f64::NAN; 3], distance: f64::INFINITY, triangle: NONE, u: 0.0, v: 0.0, normal: [0.0; 3] };
        let closest = |(best, [u, v]): (Best, [f32; 2])| match best.id {
            NONE => nowhere,
            triangle => Closest {
                point: best.point.to_array(),
                distance: best.distance_squared.sqrt(),
                triangle,
                u,
                v,
                normal: best.normal,
            },
        };
        let weights = self.source_weights(&of)?;
        Ok(self.threads.install(|| all.into_par_iter().zip(weights).map(closest).collect()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRIANGLE: [DVec3; 3] = [DVec3::ZERO, DVec3::new(4.0, 0.0, 0.0), DVec3::new(0.0, 4.0, 0.0)];

    fn nearest(point: DVec3) -> DVec3 {
        point + nearest_on_triangle(TRIANGLE.map(|vertex| vertex - point)).offset
    }

    #[test]
    fn every_region_of_a_triangle() {
        for (point, truth) in [
            ([1.0, 1.0, 3.0], [1.0, 1.0, 0.0]),
            ([1.0, 1.0, -3.0], [1.0, 1.0, 0.0]),
            ([1.0, -2.0, 1.0], [1.0, 0.0, 0.0]),
            ([-5.0, 2.0, 1.0], [0.0, 2.0, 0.0]),
            ([4.0, 4.0, 7.0], [2.0, 2.0, 0.0]),
            ([-1.0, -1.0, 0.5], [0.0, 0.0, 0.0]),
            ([9.0, -1.0, 0.5], [4.0, 0.0, 0.0]),
            ([-1.0, 9.0, 0.5], [0.0, 4.0, 0.0]),
            ([1.0, 2.0, 0.0], [1.0, 2.0, 0.0]),
        ] {
            let found = nearest(DVec3::from_array(point));
            assert!((found - DVec3::from_array(truth)).length() < 1e-15, "{point:?}: {found}");
        }
    }

    #[test]
    fn needles_and_points_have_a_nearest_point() {
        let point = DVec3::new(1.0, 2.0, 3.0);
        let line = [0.0, 5.0, 10.0].map(|x| DVec3::new(x, 0.0, 0.0) - point);
        assert_eq!(point + nearest_on_triangle(line).offset, DVec3::new(1.0, 0.0, 0.0));
        let one = nearest_on_triangle([DVec3::ONE - point; 3]);
        assert_eq!((point + one.offset, one.weights.iter().sum::<f64>()), (DVec3::ONE, 1.0));
    }
}
