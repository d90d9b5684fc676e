//! The point of the scene that is nearest to a given one.
//!
//! Points that lie together go together, along a Z-order curve. In a round each asks for the leaves that are nearest to
//! it and have not been looked at, as long as they are nearer than what it has; first one, then twice as many a round.
//! The bricks of a round are read once each.

use super::hits::normal;
use super::space::{Child, Placed, Top};
use super::sweep::Pair;
use super::{Closest, Queries, Watch};
use crate::kernels::layout::NONE;
use anyhow::Result;
use glam::DVec3;
use rayon::prelude::*;
use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Points that are looked for together.
const CHUNK: usize = 1 << 14;
/// Most leaves that a point asks for in a round.
const MOST_LEAVES: usize = 16;

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

    /// The best in a brick, or this.
    fn within(self, point: DVec3, leaf: u32, brick: &Placed, open: &mut Vec<(f64, Child)>) -> Self {
        let mut best = self;
        brick.walk_near(point, self.distance_squared, open, |triangle| {
            let vertices = brick.vertices(triangle);
            let on = nearest_on_triangle(vertices.map(|vertex| vertex - point));
            let distance_squared = on.offset.length_squared();
            if distance_squared <= best.distance_squared {
                let id = brick.id(triangle);
                let own = Self { distance_squared, id, leaf, triangle, on, normal: normal(vertices) };
                if own.is_before(&best) {
                    best = own;
                }
            }
            best.distance_squared
        });
        best
    }
}

/// A number that orders as it should.
#[derive(Clone, Copy, PartialEq)]
struct Ordered(f64);

impl Eq for Ordered {}

impl PartialOrd for Ordered {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Ordered {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl Top<'_> {
    /// The next `count` leaves by their distance from `point`, squared, after the one given, and no farther than
    /// `within`.
    fn nearest_leaves(&self, point: DVec3, after: (f64, u32), within: f64, count: usize) -> Vec<(f64, u32)> {
        let mut found = Vec::new();
        let mut open = BinaryHeap::new();
        if !self.is_empty() {
            open.push(Reverse((Ordered(0.0), false, 0)));
        }
        while let Some(Reverse((Ordered(distance), is_leaf, number))) = open.pop() {
            if distance > within || found.len() == count {
                break;
            }
            if is_leaf {
                if distance.total_cmp(&after.0).then(number.cmp(&after.1)) == Ordering::Greater {
                    found.push((distance, number));
                }
                continue;
            }
            // Never nearer than what holds them, so that leaves come in order.
            let own = self.boxes(number).distances_squared(point).map(|own| Ordered(own.max(distance)));
            match self.below(number) {
                Ok(leaf) => open.push(Reverse((own[0], true, leaf))),
                Err([left, right]) => {
                    open.extend([Reverse((own[0], false, left)), Reverse((own[1], false, right))]);
                }
            }
        }
        found
    }
}

/// A point that is looked for.
#[derive(Clone, Copy)]
struct Search {
    point: DVec3,
    best: Best,
    /// The leaf that was looked at last: its distance, squared, and its number.
    after: (f64, u32),
    is_done: bool,
}

impl Queries {
    /// The nearest point of the scene to each of `points`; of triangles equally near, to the last bit, that with the
    /// lowest id.
    ///
    /// # Errors
    /// A point that is not finite, by its number; a damaged brick; what `watch` says.
    pub fn closest_points(&self, points: &[[f64; 3]], watch: &mut Watch) -> Result<Vec<Closest>> {
        super::check_points(points)?;
        let nowhere =
            Closest { point: [f64::NAN; 3], distance: f64::INFINITY, triangle: NONE, u: 0.0, v: 0.0, normal: [0.0; 3] };
        let mut all = vec![nowhere; points.len()];
        // Attributes of bricks are read once at the end, so that they do not put geometry out of the cache.
        let (mut found, mut of) = (Vec::new(), Vec::new());
        for numbers in self.threads.install(|| z_order(points)).chunks(CHUNK) {
            let given: Vec<DVec3> = numbers.iter().map(|&number| DVec3::from_array(points[number])).collect();
            for ((&number, point), best) in numbers.iter().zip(&given).zip(self.search(&given, watch)?) {
                if best.id == NONE {
                    continue;
                }
                all[number] = Closest {
                    point: (point + best.on.offset).to_array(),
                    distance: best.distance_squared.sqrt(),
                    triangle: best.id,
                    normal: best.normal,
                    ..nowhere
                };
                found.push(number);
                of.push((best.leaf, best.triangle, best.on.weights));
            }
            watch(numbers.len() as u64)?;
        }
        for (number, [u, v]) in found.into_iter().zip(self.source_weights(&of)?) {
            (all[number].u, all[number].v) = (u, v);
        }
        Ok(all)
    }

    /// What is nearest to each point of a chunk.
    fn search(&self, points: &[DVec3], watch: &mut Watch) -> Result<Vec<Best>> {
        let resident = self.scene.resident();
        let top = Top::new(resident);
        let begun = |&point: &DVec3| Search { point, best: NOTHING, after: (-1.0, 0), is_done: false };
        let mut searches: Vec<Mutex<Search>> = points.iter().map(begun).map(Mutex::new).collect();
        let mut count = 1;
        loop {
            let wanted = |(item, search): (usize, &mut Mutex<Search>)| {
                let search = search.get_mut().unwrap_or_else(PoisonError::into_inner);
                if search.is_done {
                    return Vec::new();
                }
                let leaves = top.nearest_leaves(search.point, search.after, search.best.distance_squared, count);
                search.is_done = leaves.len() < count;
                search.after = leaves.last().copied().unwrap_or(search.after);
                let pair = |(_, leaf)| Pair { brick: resident.leaves[leaf as usize].brick, leaf, item: item as u32 };
                leaves.into_iter().map(pair).collect()
            };
            let pairs = self.threads.install(|| {
                let mut pairs: Vec<Pair> = searches.par_iter_mut().enumerate().flat_map_iter(wanted).collect();
                pairs.par_sort_unstable();
                pairs
            });
            if pairs.is_empty() {
                return Ok(searches.iter().map(|search| locked(search).best).collect());
            }
            // What is nearest does not depend on the order in which bricks are looked at.
            let look = |item: u32, leaf, brick: &Placed, open: &mut Vec<(f64, Child)>, _: &mut Vec<()>| {
                let Search { point, best, .. } = *locked(&searches[item as usize]);
                let own = best.within(point, leaf, brick, open);
                let mut search = locked(&searches[item as usize]);
                if own.is_before(&search.best) {
                    search.best = own;
                }
            };
            self.at_leaves(&pairs, look, &mut |()| (), watch)?;
            count = (2 * count).min(MOST_LEAVES);
        }
    }
}

/// Every change of a search is complete, so that a poisoned lock guards a sound state.
fn locked(search: &Mutex<Search>) -> MutexGuard<'_, Search> {
    search.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Numbers of points along a Z-order curve through their box.
fn z_order(points: &[[f64; 3]]) -> Vec<usize> {
    let at = |point: &[f64; 3]| DVec3::from_array(*point);
    let min = points.par_iter().map(at).reduce(|| DVec3::INFINITY, DVec3::min);
    let max = points.par_iter().map(at).reduce(|| DVec3::NEG_INFINITY, DVec3::max);
    let extent = (0.5 * max - 0.5 * min).max_element();
    let spread = |x: f64| {
        // Casts saturate; without an extent it is no number, which is 0.
        let cell = (((x / extent) * 0.5 * 1023.0) as u64).min(1023);
        (0..10).fold(0, |bits, bit| bits | (cell >> bit & 1) << (3 * bit))
    };
    let code = |point: &[f64; 3]| {
        let from = 1.0 * at(point) - min;
        spread(from.x) << 2 | spread(from.y) << 1 | spread(from.z)
    };
    let mut order: Vec<(u64, usize)> = points.par_iter().map(code).zip(0..points.len()).collect();
    order.par_sort_unstable();
    order.into_iter().map(|(_, number)| number).collect()
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
    fn points_that_lie_together_come_together() {
        let points: Vec<[f64; 3]> = (0..4096u32).map(|i| [i % 16, i / 16 % 16, i / 256].map(f64::from)).collect();
        let way = |order: &[usize]| -> f64 {
            let at = |i: usize| DVec3::from_array(points[i]);
            order.windows(2).map(|pair| (at(pair[1]) - at(pair[0])).length()).sum()
        };
        let order = z_order(&points);
        let rows: Vec<usize> = (0..points.len()).collect();
        assert!(way(&order) < 0.95 * way(&rows), "{} {}", way(&order), way(&rows));
        assert_eq!(z_order(&[[f64::MAX; 3], [-f64::MAX; 3]]).len(), 2);
        assert_eq!(z_order(&[[1.0; 3]; 3]), [0, 1, 2]);
    }
}
