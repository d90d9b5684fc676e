//! Which points lie inside: how often the half-line along x leaves the surface more than it enters.
//!
//! A triangle is crossed where its projection along x holds the point. Who has a point of an edge that two triangles
//! share is decided by exact signs and by a rule of the edge alone, so that a closed surface is crossed as if the point
//! lay a hair beside it. Nothing depends on a tolerance. The sum of the directions of all crossings is the winding
//! number of a surface that is closed and turned one way; of one that is only closed, whether they are odd tells.

use super::room::Room;
use super::space::{AlongX, Placed};
use super::sweep::Sweep;
use super::{Queries, Watch};
use crate::kernels::simd::isa::Isa;
use anyhow::{Result, bail};
use glam::DVec3;
use rayon::prelude::*;
use robust::{Coord, Coord3D, orient2d, orient3d};

fn along_x(p: DVec3) -> Coord<f64> {
    Coord { x: p.y, y: p.z }
}

fn whole(p: DVec3) -> Coord3D<f64> {
    Coord3D { x: p.x, y: p.y, z: p.z }
}

/// Whether the half-line from `point` along x crosses a triangle: 1 from its back to its front, -1 the other way, else
/// 0. A triangle's front is where its vertices run counter-clockwise.
pub(super) fn crossed(point: DVec3, triangle: [DVec3; 3]) -> i32 {
    let at = along_x(point);
    let [a, b, c] = triangle;
    let mut is_within = false;
    for (from, to) in [(a, b), (b, c), (c, a)] {
        if (from.y <= point.y) == (to.y <= point.y) {
            continue;
        }
        // The lower end first, so that both triangles of an edge ask the same.
        let (low, high) = if from.y <= point.y { (from, to) } else { (to, from) };
        is_within ^= orient2d(along_x(low), along_x(high), at) < 0.0;
    }
    if !is_within {
        return 0;
    }
    let facing = orient2d(along_x(a), along_x(b), along_x(c));
    // Positive where the point lies behind the triangle, from where its vertices run clockwise.
    let side = orient3d(whole(a), whole(b), whole(c), whole(point));
    if facing > 0.0 && side > 0.0 {
        1
    } else if facing < 0.0 && side < 0.0 {
        -1
    } else {
        0
    }
}

/// Points that count what half-lines along x cross.
struct Crossed<'a> {
    points: &'a [[f64; 3]],
    by_id: bool,
}

impl Sweep for Crossed<'_> {
    /// The point, which way a triangle or how much several are crossed and how many, and the triangle's id.
    type Found = (usize, u32, i32, u32);

    type Asks = AlongX;

    fn asks(&self, item: usize) -> Option<AlongX> {
        Some(AlongX(DVec3::from_array(self.points[item])))
    }

    #[inline(always)]
    fn meet<I: Isa>(&self, _: I, item: usize, at: (u32, &Placed), room: &mut Room, found: &mut Vec<Self::Found>) {
        let brick = at.1;
        let point = DVec3::from_array(self.points[item]);
        let (mut sum, mut count) = (0, 0);
        brick.walk(&AlongX(point), &mut room.inner.nodes, |triangle| {
            let way = brick.handedness * crossed(point, brick.vertices(triangle));
            if way != 0 && self.by_id {
                found.push((item, brick.id(triangle), way, 1));
            }
            (sum, count) = (sum + way, count + u32::from(way != 0));
            true
        });
        if count > 0 && !self.by_id {
            found.push((item, 0, sum, count));
        }
    }
}

impl Queries {
    /// Which points lie inside the scene's closed surfaces: those about which they wind, whichever way; or, where they
    /// are closed but not turned one way, those from which a half-line crosses them an odd number of times. Of points
    /// on a surface it is not said.
    ///
    /// # Errors
    /// A surface that is not closed, unless `is_open_allowed`: then points inside what is closed of it may be taken for
    /// outside and the other way round. A point that is not finite, by its number; a damaged brick; what `watch` says.
    pub fn occupancy(&self, points: &[[f64; 3]], is_open_allowed: bool, watch: &mut Watch) -> Result<Vec<bool>> {
        super::check_points(points)?;
        let surfaces = self.surfaces()?;
        if let (false, Some(open)) = (is_open_allowed, surfaces.iter().position(|surface| !surface.is_closed)) {
            let which = match surfaces.len() {
                1 => String::new(),
                count => format!(", by object {open} of {count}"),
            };
            bail!(
                "{}: its surface is not closed{which}, so that inside has no meaning; close it, or allow open surfaces",
                self.scene.path().display()
            );
        }
        let are_turned = surfaces.iter().all(|surface| surface.is_turned);
        let by_id = self.has_copies;
        let (mut sums, mut counts) = (vec![0i32; points.len()], vec![0u32; points.len()]);
        let mut copies = Vec::new();
        let mut take = |(item, id, way, count): (usize, u32, i32, u32)| {
            if by_id {
                copies.push((item, id, way));
            } else {
                sums[item] += way;
                counts[item] += count;
            }
        };
        self.sweep(points.len(), &Crossed { points, by_id }, &mut take, watch)?;
        copies.par_sort_unstable();
        copies.dedup();
        for (item, _, way) in copies {
            sums[item] += way;
            counts[item] += 1;
        }
        let inside = |(sum, count): (i32, u32)| if are_turned { sum != 0 } else { count % 2 == 1 };
        Ok(sums.into_iter().zip(counts).map(inside).collect())
    }

    /// The distance of each of `points` from the scene, negative inside.
    ///
    /// # Errors
    /// As of [`Queries::occupancy`].
    pub fn signed_distance(&self, points: &[[f64; 3]], is_open_allowed: bool, watch: &mut Watch) -> Result<Vec<f64>> {
        let mut told = 0;
        let mut half = |done: u64| {
            told += done;
            let whole = told / 2;
            told -= 2 * whole;
            watch(whole)
        };
        let inside = self.occupancy(points, is_open_allowed, &mut half)?;
        let distances = self.distance(points, &mut half)?;
        Ok(inside.into_iter().zip(distances).map(|(inside, d)| if inside { -d } else { d }).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Corners of a cube of edge 2 about the origin, by bits x, y, z.
    fn corner(bits: usize) -> DVec3 {
        DVec3::from_array([0, 1, 2].map(|k| if bits >> k & 1 == 1 { 1.0 } else { -1.0 }))
    }

    /// Twelve triangles, seen from outside counter-clockwise.
    fn cube() -> Vec<[DVec3; 3]> {
        let quads =
            [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]].map(|q| q.map(corner));
        quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect()
    }

    fn winding(point: DVec3, triangles: &[[DVec3; 3]]) -> i32 {
        triangles.iter().map(|&triangle| crossed(point, triangle)).sum()
    }

    #[test]
    fn a_cube_winds_once_about_what_is_in_it() {
        // Every point of a grid, most of which meets edges and corners along x.
        let at = |i: i32| f64::from(i) * 0.25;
        for (x, y, z) in (-8..=8).flat_map(|x| (-8..=8).flat_map(move |y| (-8..=8).map(move |z| (x, y, z)))) {
            let point = DVec3::new(at(x), at(y), at(z));
            if point.abs().max_element() != 1.0 {
                let truth = i32::from(point.abs().max_element() < 1.0);
                assert_eq!(winding(point, &cube()), truth, "{point}");
            }
        }
        // The control: without a triangle of the side that half-lines leave by it is wrong behind that.
        let mut open = cube();
        open.remove(2);
        let wrong = (-3..=3).flat_map(|y| (-3..=3).map(move |z| DVec3::new(0.0, at(y), at(z))));
        assert!((1..49).contains(&wrong.filter(|&point| winding(point, &open) != 1).count()));
    }

    #[test]
    fn mirrored_and_turned_surfaces_wind_the_other_way() {
        let turned: Vec<_> = cube().iter().map(|&[a, b, c]| [a, c, b]).collect();
        assert_eq!(winding(DVec3::splat(0.3), &turned), -1);
        let mirrored: Vec<_> = cube().iter().map(|t| t.map(|p| DVec3::new(-p.x, p.y, p.z))).collect();
        assert_eq!(winding(DVec3::splat(0.3), &mirrored), -1);
    }
}
