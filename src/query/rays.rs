//! All that rays meet: how many triangles, which, or whether any.

use super::aim::Aim;
use super::hits::Met;
use super::room::Room;
use super::space::{Placed, Slabs};
use super::sweep::Sweep;
use super::top::Top;
use super::{Intersections, Queries, Rays, Watch};
use crate::kernels::simd::isa::Isa;
use crate::math::crossing::Crossing;
use crate::output::npy::Ray;
use anyhow::{Result, ensure};
use glam::DVec3;
use rayon::prelude::*;

/// Of the greatest coordinate of a point that is to see another: how much of its surroundings is left out, so that a
/// point that was rounded to f32 does not hide behind its own surface.
const ROUNDED: f64 = 1.0 / (1u32 << 22) as f64;

/// How a ray asks boxes of the top level.
fn asks(ray: &Ray) -> Slabs {
    Slabs::new(ray.origin, ray.direction, ray.t_min.max(0.0), ray.t_max)
}

/// Calls `visit` with every triangle of a brick that a ray meets, its vertices and where.
#[inline(always)]
fn meet<I: Isa>(
    isa: I,
    (top, ray): (&Top, &Ray),
    brick: &Placed,
    room: &mut Room,
    mut visit: impl FnMut(u32, [DVec3; 3], &Crossing),
) {
    let Some(aim) = Aim::alone(top, ray) else { return };
    aim.triangles(
        isa,
        brick,
        (0.0, aim.t_max[0]),
        &mut room.inner,
        #[inline(always)]
        |triangle| {
            let vertices = brick.vertices(triangle);
            if let Some(met) = aim.meet(0, vertices) {
                visit(triangle, vertices, &met);
            }
            Some(aim.t_max[0])
        },
    );
}

/// Rays that list what they meet.
struct Listed<'a> {
    top: &'a Top,
    rays: Rays<'a>,
}

impl Sweep for Listed<'_> {
    type Found = Met;

    type Asks = Slabs;

    fn asks(&self, item: usize) -> Option<Slabs> {
        Some(asks(&self.rays.get(item)))
    }

    #[inline(always)]
    fn meet<I: Isa>(&self, isa: I, item: usize, at: (u32, &Placed), room: &mut Room, found: &mut Vec<Met>) {
        let (leaf, brick) = at;
        meet(isa, (self.top, &self.rays.get(item)), brick, room, |triangle, vertices, &Crossing { t, weights, .. }| {
            found.push(Met { item, t, id: brick.id(triangle), leaf, triangle, weights, vertices });
        });
    }
}

/// Rays that count what they meet.
struct Counted<'a> {
    top: &'a Top,
    rays: Rays<'a>,
    /// Whether ids are told, so that copies of a triangle in several bricks count once.
    by_id: bool,
}

impl Sweep for Counted<'_> {
    /// The ray, and how many triangles it met or the id of one.
    type Found = (usize, u32);

    type Asks = Slabs;

    fn asks(&self, item: usize) -> Option<Slabs> {
        Some(asks(&self.rays.get(item)))
    }

    #[inline(always)]
    fn meet<I: Isa>(&self, isa: I, item: usize, at: (u32, &Placed), room: &mut Room, found: &mut Vec<Self::Found>) {
        let (mut count, brick) = (0, at.1);
        meet(isa, (self.top, &self.rays.get(item)), brick, room, |triangle, _, _| {
            count += 1;
            if self.by_id {
                found.push((item, brick.id(triangle)));
            }
        });
        if !self.by_id && count > 0 {
            found.push((item, count));
        }
    }
}

impl Queries {
    /// How many triangles each ray meets, at any t of its interval.
    ///
    /// # Errors
    /// A ray that is none, by its number; a damaged brick; what `watch` says.
    pub fn count_intersections<'a>(&self, rays: impl Into<Rays<'a>>, watch: &mut Watch) -> Result<Vec<u32>> {
        let rays = rays.into();
        self.check_rays(rays)?;
        let mut counts = vec![0u32; rays.len()];
        let mut copies = Vec::new();
        let by_id = self.has_copies;
        let mut take = |(item, what): (usize, u32)| match by_id {
            true => copies.push((item, what)),
            false => counts[item] += what,
        };
        self.sweep(rays.len(), &Counted { top: self.top(), rays, by_id }, &mut take, watch)?;
        // A triangle that lies in several bricks counts once.
        copies.par_sort_unstable();
        copies.dedup();
        copies.iter().for_each(|&(item, _)| counts[item] += 1);
        Ok(counts)
    }

    /// All triangles that each ray meets, by increasing t and, at equal t, id. What rays pass through by its alpha is
    /// there as well.
    ///
    /// # Errors
    /// As of [`Queries::count_intersections`].
    pub fn list_intersections<'a>(&self, rays: impl Into<Rays<'a>>, watch: &mut Watch) -> Result<Intersections> {
        let rays = rays.into();
        self.check_rays(rays)?;
        let mut all = Vec::new();
        self.sweep(rays.len(), &Listed { top: self.top(), rays }, &mut |met| all.push(met), watch)?;
        all.par_sort_unstable_by(|a, b| (a.item, a.id).cmp(&(b.item, b.id)).then(a.t.total_cmp(&b.t)));
        all.dedup_by_key(|met| (met.item, met.id));
        all.par_sort_unstable_by(|a, b| a.item.cmp(&b.item).then(a.t.total_cmp(&b.t)).then(a.id.cmp(&b.id)));
        let mut starts = vec![0u64; rays.len() + 1];
        all.iter().for_each(|met| starts[met.item + 1] += 1);
        for ray in 0..rays.len() {
            starts[ray + 1] += starts[ray];
        }
        Ok(Intersections { starts, hits: self.hits(&all)? })
    }

    /// Whether the way from each point of `from` to the one of `to` at the same place is free. At either end 2^-22 of
    /// its greatest coordinate is left out, so that points on surfaces see what is before them.
    ///
    /// # Errors
    /// Points that are not as many or not finite, by their number; a damaged brick; what `watch` says.
    pub fn visibility(&self, from: &[[f64; 3]], to: &[[f64; 3]], watch: &mut Watch) -> Result<Vec<bool>> {
        ensure!(from.len() == to.len(), "{} points to see {}: they must be as many", from.len(), to.len());
        super::check_points(from)?;
        super::check_points(to)?;
        let ray = |(from, to): (&[f64; 3], &[f64; 3])| {
            let [a, b] = [from, to].map(|p| DVec3::from_array(*p));
            let [near, far] = [a, b].map(|end| ROUNDED * end.abs().max_element() / (b - a).length());
            // Of points that are one, or as good as one, nothing is left between them.
            let (t_min, t_max) = if near + far < 1.0 { (near, 1.0 - far) } else { (1.0, 0.0) };
            let direction = if a == b { DVec3::X } else { b - a };
            Ray { origin: *from, direction: direction.to_array(), t_min, t_max }
        };
        let rays: Vec<Ray> = from.par_iter().zip(to).map(ray).collect();
        let hides = self.meets_any((&rays).into(), false, watch)?;
        Ok(hides.into_iter().map(|hides| !hides).collect())
    }
}
