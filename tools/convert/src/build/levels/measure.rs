//! How far a level is from what it stands for: a bound of the distance between both surfaces, and the error that
//! selection goes by.
//!
//! The distance to a convex set is convex, so over a triangle the distance to another is greatest at a corner, and one
//! that is mapped to it corner by corner is nowhere farther from it than there. That bounds most triangles by how far
//! their vertices moved. The others are bounded by branch and bound.

use super::cluster::{Clusters, Touching};
use super::fit::Fitted;
use super::merge::Merged;
use super::nearest::{Nearest, distance2};
use super::surface::Surface;
use super::vector::{Vec3, length, square, sub};
use bricks::NONE;

/// Share of the area whose error is not above [`Measured::error`].
const QUANTILE: f64 = 0.99;

/// Faces of a cell that a triangle counts as at most in the second of two shares.
const LARGEST_FACES: f64 = 16.0;

/// What an edge of colours that moves counts as, in cells.
const EDGE: f64 = 0.15;

/// Difference of square roots of colours from which on an edge counts as a whole: it shows, however far it moves.
const PLAIN: f64 = 0.1;

/// Rounding errors of distances, relative.
const ROUNDING: f64 = 1e-8;

/// What is bounded this much above what is sure to be reached is not looked at closer.
const TOLERANCE: f64 = 1.03;

/// Times that a triangle is cut in four.
const MOST_CUTS: u32 = 6;

/// Distances in steps of the object's lattice.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Measured {
    /// The largest distance, both ways, at most.
    pub bound: f64,
    /// What all but the worst hundredth of the area is away, differences of colour weighed in.
    pub error: f64,
    /// The largest difference of colours.
    pub color: f64,
}

/// Measures a level.
pub(super) fn measure(
    merged: &Merged,
    points: &[Vec3],
    (clusters, touching): (&Clusters, &Touching),
    surface: &Surface,
    fitted: &Fitted,
) -> Measured {
    let triangles: Vec<[Vec3; 3]> =
        clusters.outputs.iter().map(|output| output.corners.map(|corner| points[corner as usize])).collect();
    let mut search = Search { triangles: &triangles, tree: None, lower: 0.0, floor: clusters.size };
    let moved: Vec<f64> = points
        .iter()
        .zip(&clusters.cell_of)
        .map(|(&point, &cell)| length(sub(point, points[clusters.kept[cell as usize] as usize])))
        .collect();
    // How far a vertex is from the level, at most.
    let away = |search: &mut Search, vertex: u32| {
        let (point, moved) = (points[vertex as usize], moved[vertex as usize]);
        match touching.outputs(clusters.cell_of[vertex as usize]) {
            [] => search.exact(point),
            near => {
                let distances = near.iter().map(|&output| distance2(point, &triangles[output as usize]));
                distances.fold(f64::INFINITY, f64::min).sqrt().min(moved)
            }
        }
    };

    let mut bound = 0.0f64;
    let mut of_group = vec![f64::INFINITY; clusters.spread.len()];
    let mut open: Vec<(f64, u32)> = Vec::new();
    let mut errors: Vec<(f64, f64)> = Vec::with_capacity(merged.triangles.len());
    let mut color = 0.0f64;
    for (index, source) in (0u32..).zip(&merged.triangles) {
        let number = index as usize;
        let cells = source.corners.map(|corner| clusters.cell_of[corner as usize]);
        let moved = source.corners.iter().map(|&corner| moved[corner as usize]).fold(0.0, f64::max);
        let mut upper = f64::INFINITY;
        let group = clusters.group_of[number];
        if group != NONE {
            // Strands and specks hold the positions that stand for their cells only within their spread.
            upper = moved + clusters.spread[group as usize];
            of_group[group as usize] = of_group[group as usize].min(upper);
        } else if is_edge(cells, touching, clusters) {
            upper = moved;
        }
        if upper > search.floor {
            let away = source.corners.iter().map(|&corner| away(&mut search, corner)).fold(0.0, f64::max);
            upper = upper.min(away + reach(source.corners.map(|corner| points[corner as usize])));
        }
        if upper > search.floor {
            open.push((upper, index));
        } else {
            bound = bound.max(upper);
        }

        let (shown, albedo) = (fitted.shown[number], surface.albedo[number]);
        let difference = (0..3).map(|k| (f64::from(albedo[k]) - shown[k]).abs()).fold(0.0, f64::max);
        color = color.max(difference);
        let root = |x: f64| x.max(0.0).sqrt();
        let seen = (0..3).map(|k| (root(f64::from(albedo[k])) - root(shown[k])).abs()).fold(0.0, f64::max);
        let edge = EDGE * clusters.size * (seen / PLAIN).min(1.0);
        let distance = match fitted.distances[number] {
            f64::INFINITY => source.corners.iter().map(|&corner| away(&mut search, corner)).fold(0.0, f64::max),
            distance => distance,
        };
        errors.push((distance + edge, surface.area[number]));
    }
    open.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    for (upper, index) in open {
        let corners = merged.triangles[index as usize].corners.map(|corner| points[corner as usize]);
        bound = bound.max(search.refine(corners, upper, MOST_CUTS));
    }
    for (triangle, output) in triangles.iter().zip(&clusters.outputs) {
        // A strand is within its spread of its edge, which an edge of each of its sources becomes end by end.
        let (group, spread) = (output.group as usize, clusters.spread[output.group as usize]);
        bound = bound.max(of_group[group].min(reach(*triangle) + spread));
    }
    Measured {
        bound: bound * (1.0 + ROUNDING),
        error: quantile(errors, LARGEST_FACES * clusters.size * clusters.size),
        color,
    }
}

/// Whether a triangle in at most two cells becomes an edge or vertex of the level.
fn is_edge([a, b, c]: [u32; 3], touching: &Touching, clusters: &Clusters) -> bool {
    let other = if a != b { b } else { c };
    if a != b && a != c && b != c {
        return false;
    }
    touching.outputs(a).iter().any(|&output| clusters.outputs[output as usize].cells.contains(&other))
}

/// The largest distance of a point of a triangle from its nearest corner, at most.
fn reach([a, b, c]: [Vec3; 3]) -> f64 {
    let longest = square(sub(b, a)).max(square(sub(c, b))).max(square(sub(a, c)));
    (longest / 3.0).sqrt() * (1.0 + ROUNDING)
}

/// The error that is not exceeded by a share of the area, and not where what is larger than `most` counts as that: what
/// is large must neither hide what lies on it nor be hidden by how many small things there are.
fn quantile(mut errors: Vec<(f64, f64)>, most: f64) -> f64 {
    let sums = |sums: [f64; 2], area: f64| [sums[0] + area, sums[1] + area.min(most)];
    let all = errors.iter().fold([0.0; 2], |all, (_, area)| sums(all, *area));
    let descending = |a: &(f64, f64), b: &(f64, f64)| b.0.total_cmp(&a.0).then(b.1.total_cmp(&a.1));
    let mut above = [0.0; 2];
    let mut rest = errors.as_mut_slice();
    while !rest.is_empty() {
        // Few triangles are above it, so that the others need no order.
        let last = rest.len() / 32;
        rest.select_nth_unstable_by(last, descending);
        let (some, below) = rest.split_at_mut(last + 1);
        some.sort_unstable_by(descending);
        for (error, area) in &*some {
            above = sums(above, *area);
            if (0..2).any(|k| above[k] > (1.0 - QUANTILE) * all[k]) {
                return *error;
            }
        }
        rest = below;
    }
    0.0
}

/// Branch and bound for the point that is farthest from a level.
struct Search<'a> {
    triangles: &'a [[Vec3; 3]],
    /// Made when it is first asked for.
    tree: Option<Nearest<'a>>,
    /// A distance that is reached.
    lower: f64,
    /// Below which nothing is looked at closer.
    floor: f64,
}

impl Search<'_> {
    /// The nearest triangle of the level.
    fn nearest(&mut self, p: Vec3) -> (f64, u32) {
        let (distance2, triangle) = self.tree.get_or_insert_with(|| Nearest::over(self.triangles)).of(p);
        let distance = distance2.sqrt();
        self.lower = self.lower.max(distance);
        (distance, triangle)
    }

    fn exact(&mut self, p: Vec3) -> f64 {
        self.nearest(p).0
    }

    /// What is small enough.
    fn enough(&self) -> f64 {
        self.floor.max(TOLERANCE * self.lower)
    }

    /// The largest distance of a point of a triangle from the level, at most, where `upper` is such a bound.
    fn refine(&mut self, corners: [Vec3; 3], mut upper: f64, cuts: u32) -> f64 {
        if upper <= self.enough() {
            return upper;
        }
        let [a, b, c] = corners;
        let center: Vec3 = std::array::from_fn(|k| (a[k] + b[k] + c[k]) / 3.0);
        let (distance, nearest) = self.nearest(center);
        let spread = corners.iter().map(|&corner| square(sub(corner, center))).fold(0.0, f64::max).sqrt();
        let target = &self.triangles[nearest as usize];
        let flat = corners.iter().map(|&corner| distance2(corner, target)).fold(0.0, f64::max).sqrt();
        upper = upper.min(flat).min(distance + spread);
        if cuts == 0 || upper <= self.enough() {
            return upper;
        }
        let middle = |p: Vec3, q: Vec3| std::array::from_fn(|k| 0.5 * (p[k] + q[k]));
        let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
        let quarters = [[ab, bc, ca], [a, ab, ca], [ab, b, bc], [ca, bc, c]];
        quarters.into_iter().map(|quarter| self.refine(quarter, upper, cuts - 1)).fold(0.0, f64::max)
    }
}
