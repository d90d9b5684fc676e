//! The point of the scene that is nearest to a given one: each looks into bricks, about the nearest first.

use super::hits::normal;
use super::room::Room;
use super::rounds::{Bricks, Seek, State};
use super::space::Placed;
use super::{Closest, Queries, Watch};
use crate::kernels::layout::NONE;
use crate::kernels::simd::isa::Isa;
use anyhow::Result;
use glam::DVec3;
use rayon::prelude::*;
use std::cmp::Ordering;

/// Of squared distances: how much farther something has to be.
const SLACK: f64 = 1.0 / (1u64 << 20) as f64;
/// Of squared coordinates: with [`SLACK`] more than all roundings of distances and of heights over planes.
const ROUNDED: f64 = 1.0 / (1u64 << 55) as f64;
/// The least squared sine between two edges of a triangle by whose plane it is judged.
const LEAST_SINE: f64 = 1.0 / (1u64 << 26) as f64;

/// A point of a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OnTriangle {
    /// Relative to the given point.
    pub(super) offset: DVec3,
    /// Weights of the vertices; they sum to 1.
    pub(super) weights: [f64; 3],
}

/// The point of a triangle that is nearest to the origin. What lies within the triangle is found by its plane, and the
/// points of its edges are candidates in any case, so that needles and triangles without area have one.
pub(super) fn nearest_on_triangle([a, b, c]: [DVec3; 3]) -> OnTriangle {
    let on_edge = |p: DVec3, q: DVec3| {
        let along = q - p;
        let length = along.length_squared();
        let t = if length > 0.0 { (-p.dot(along) / length).clamp(0.0, 1.0) } else { 0.0 };
        // From the nearer end, so that an end is met exactly.
        (t, if t < 0.5 { p + along * t } else { q - along * (1.0 - t) })
    };
    let (ab, bc, ca) = (on_edge(a, b), on_edge(b, c), on_edge(c, a));
    let mut best = OnTriangle { offset: ab.1, weights: [1.0 - ab.0, ab.0, 0.0] };
    let mut offer = |offset: DVec3, weights: [f64; 3]| {
        if offset.length_squared() < best.offset.length_squared() {
            best = OnTriangle { offset, weights };
        }
    };
    offer(bc.1, [0.0, 1.0 - bc.0, bc.0]);
    offer(ca.1, [ca.0, 0.0, 1.0 - ca.0]);
    let across = (b - a).cross(c - a);
    let area = across.length_squared();
    if area > 0.0 && area.is_finite() {
        let offset = across * (a.dot(across) / area);
        let [a, b, c] = [a, b, c].map(|vertex| vertex - offset);
        let parts = [b.cross(c), c.cross(a), a.cross(b)].map(|part| part.dot(across) / area);
        if parts.iter().all(|&part| part >= 0.0) {
            let sum: f64 = parts.iter().sum();
            offer(offset, parts.map(|part| part / sum));
        }
    }
    best
}

/// Whether a triangle is farther from the origin than the square root of `within` for certain: by its box, and by its
/// plane. False says nothing.
#[inline(always)]
fn is_surely_farther([a, b, c]: [DVec3; 3], within: f64) -> bool {
    let reach = a.length_squared().max(b.length_squared()).max(c.length_squared());
    let within = within * (1.0 + SLACK) + reach * ROUNDED;
    let gap = a.min(b).min(c).max(-a.max(b).max(c)).max(DVec3::ZERO);
    if gap.length_squared() > within {
        return true;
    }
    let (u, v) = (b - a, c - a);
    let across = u.cross(v);
    let (area, height) = (across.length_squared(), across.dot(a));
    area > LEAST_SINE * u.length_squared() * v.length_squared() && height * height > within * area
}

/// What a point has found.
#[derive(Clone, Copy)]
struct Best {
    distance_squared: f64,
    id: u32,
    leaf: u32,
    triangle: u32,
    on: OnTriangle,
    normal: [f32; 3],
}

const NOTHING: Best = Best {
    distance_squared: f64::INFINITY,
    id: NONE,
    leaf: NONE,
    triangle: 0,
    on: OnTriangle { offset: DVec3::ZERO, weights: [1.0, 0.0, 0.0] },
    normal: [0.0; 3],
};

impl Best {
    /// Nearer, or as near with a lower id.
    fn is_before(&self, other: &Self) -> bool {
        let by_distance = self.distance_squared.total_cmp(&other.distance_squared);
        by_distance.then(self.id.cmp(&other.id)) == Ordering::Less
    }

    /// Has it be the best in a brick, if that is better.
    #[inline(always)]
    fn look_into(&mut self, point: DVec3, (leaf, brick): (u32, &Placed), room: &mut Room) {
        brick.walk_near(point, self.distance_squared, &mut room.open, |triangle| {
            let vertices = brick.vertices(triangle);
            let relative = [vertices[0] - point, vertices[1] - point, vertices[2] - point];
            if is_surely_farther(relative, self.distance_squared) {
                return self.distance_squared;
            }
            let on = nearest_on_triangle(relative);
            let distance_squared = on.offset.length_squared();
            if distance_squared <= self.distance_squared {
                let id = brick.id(triangle);
                let own = Self { distance_squared, id, leaf, triangle, on, normal: [0.0; 3] };
                if own.is_before(self) {
                    *self = Self { normal: normal(vertices), ..own };
                }
            }
            self.distance_squared
        });
    }
}

/// Points that look for what is nearest.
struct Nearest<'a>(&'a Queries);

impl Seek for Nearest<'_> {
    type Item = [f64; 3];

    type Found = Best;

    #[inline(always)]
    fn go<I: Isa>(&self, _: I, point: &[f64; 3], best: &mut Best, bricks: &Bricks, room: &mut Room) -> Option<u32> {
        let (resident, point) = (self.0.scene.resident(), DVec3::from_array(*point));
        let exact = resident.exact_bricks() as u32;
        let brick = |leaf: u32| resident.leaves[leaf as usize].brick;
        let counts = |leaf: u32| brick(leaf) < exact;
        // The nearest brick that is away, and how near it is at least.
        let mut next = (f64::INFINITY, NONE);
        self.0.top().near_leaves(point, best.distance_squared, room, counts, |room, leaf, distance| {
            match bricks.get(brick(leaf)) {
                State::AtHand(geometry) => best.look_into(point, (leaf, &Placed::new(resident, leaf, geometry)), room),
                State::Away if distance < next.0 => next = (distance, brick(leaf)),
                _ => (),
            }
            best.distance_squared
        });
        (next.1 != NONE && next.0 <= best.distance_squared).then_some(next.1)
    }
}

impl Queries {
    /// The nearest point of the scene to each of `points`; of triangles equally near, to the last bit, that with the
    /// lowest id.
    ///
    /// # Errors
    /// A point that is not finite, by its number; a damaged brick; what `watch` says.
    pub fn closest_points(&self, points: &[[f64; 3]], watch: &mut Watch) -> Result<Vec<Closest>> {
        super::check_points(points)?;
        let all = self.seek(&Nearest(self), points, || NOTHING, &[], watch)?;
        let of: Vec<_> = all.iter().map(|best| (best.leaf, best.triangle, best.on.weights)).collect();
        let nowhere =
            Closest { point: [f64::NAN; 3], distance: f64::INFINITY, triangle: NONE, u: 0.0, v: 0.0, normal: [0.0; 3] };
        let closest = |((point, best), [u, v]): ((&[f64; 3], Best), [f32; 2])| match best.id {
            NONE => nowhere,
            triangle => Closest {
                point: (DVec3::from_array(*point) + best.on.offset).to_array(),
                distance: best.distance_squared.sqrt(),
                triangle,
                u,
                v,
                normal: best.normal,
            },
        };
        let weights = self.source_weights(&of)?;
        Ok(self.threads.install(|| points.par_iter().zip(all).zip(weights).map(closest).collect()))
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

    #[test]
    fn what_is_surely_farther_is_farther() {
        let mut rng = crate::math::random::Rng(9);
        let (mut farther, mut told) = (0, 0);
        for i in 0..20_000 {
            let mut point = |scale: f64| DVec3::from_array([0; 3].map(|_| scale * f64::from(rng.signed())));
            // Plain ones, needles, and such as are far away.
            let (spread, away) = [(1.0, 1.0), (1e-7, 1.0), (1.0, 1e7)][i % 3];
            let a = point(away);
            let b = a + point(1.0);
            let triangle = [a, b, a + 0.5 * (b - a) + point(spread)];
            let nearest = nearest_on_triangle(triangle).offset.length_squared();
            let within = nearest * (1.0 + 1e-3 * f64::from(rng.signed()));
            let is_told = is_surely_farther(triangle, within);
            assert!(!is_told || nearest > within, "{triangle:?} {within}");
            (farther, told) = (farther + u32::from(nearest > within), told + u32::from(is_told));
        }
        assert!(farther > 8000 && told > 500, "{told} of {farther}");
    }
}
