//! Queries on a scene's thread: what rays meet, nearest points, what is inside.

use crate::held::{Held, lock};
use crate::rows::Rays;
use crate::worker::Task;
use anyhow::{Result, bail};
use brickwalk::query::{Closest, Intersections};
use brickwalk::session::Hit;

/// Tells a task how far a query is, and ends it when nobody waits for it any more.
fn watch(task: &Task) -> impl FnMut(u64) -> Result<()> + '_ {
    |items| {
        task.advance(items);
        if task.is_stopped() {
            bail!("interrupted");
        }
        Ok(())
    }
}

/// What each ray meets first.
pub fn cast(held: &mut Held, rays: &Rays, task: &Task) -> Result<Vec<Hit>> {
    let hits = held.ask(|queries| queries.cast(rays.given(), &mut watch(task)))?;
    let mut done = lock(&held.done);
    done.rays += hits.len() as u64;
    done.hits += hits.iter().filter(|hit| hit.triangle != u32::MAX).count() as u64;
    Ok(hits)
}

/// Whether each ray meets anything.
pub fn any(held: &mut Held, rays: &Rays, task: &Task) -> Result<Vec<bool>> {
    let hits = held.ask(|queries| queries.any(rays.given(), &mut watch(task)))?;
    let mut done = lock(&held.done);
    done.occlusion_rays += hits.len() as u64;
    done.hits += hits.iter().filter(|&&hit| hit).count() as u64;
    Ok(hits)
}

/// How many triangles each ray meets.
pub fn count(held: &mut Held, rays: &Rays, task: &Task) -> Result<Vec<u32>> {
    held.ask(|queries| queries.count_intersections(rays.given(), &mut watch(task)))
}

/// All that rays meet.
pub fn list(held: &mut Held, rays: &Rays, task: &Task) -> Result<Intersections> {
    held.ask(|queries| queries.list_intersections(rays.given(), &mut watch(task)))
}

/// The nearest points.
pub fn closest(held: &mut Held, points: &[[f64; 3]], task: &Task) -> Result<Vec<Closest>> {
    held.ask(|queries| queries.closest_points(points, &mut watch(task)))
}

/// Distances.
pub fn distance(held: &mut Held, points: &[[f64; 3]], task: &Task) -> Result<Vec<f64>> {
    held.ask(|queries| queries.distance(points, &mut watch(task)))
}

/// Which points are inside.
pub fn occupancy(held: &mut Held, points: &[[f64; 3]], open: bool, task: &Task) -> Result<Vec<bool>> {
    held.ask(|queries| queries.occupancy(points, open, &mut watch(task)))
}

/// Distances, negative inside.
pub fn signed_distance(held: &mut Held, points: &[[f64; 3]], open: bool, task: &Task) -> Result<Vec<f64>> {
    held.ask(|queries| queries.signed_distance(points, open, &mut watch(task)))
}

/// Whether the ways between pairs of points are free.
pub fn visibility(held: &mut Held, pairs: &[[[f64; 3]; 2]], task: &Task) -> Result<Vec<bool>> {
    let (from, to): (Vec<_>, Vec<_>) = pairs.iter().map(|&[from, to]| (from, to)).unzip();
    held.ask(|queries| queries.visibility(&from, &to, &mut watch(task)))
}

/// All intersections of all rays, job by job.
#[derive(Default)]
pub struct Listed {
    /// Where the hits of each ray begin, and where the last end.
    pub starts: Vec<i64>,
    /// Distances.
    pub t: Vec<f64>,
    /// Triangles.
    pub triangle: Vec<u32>,
    /// Weights of vertices 1 and 2.
    pub uv: Vec<[f32; 2]>,
    /// Normals.
    pub normal: Vec<[f32; 3]>,
}

impl Listed {
    /// Of no rays.
    pub fn new() -> Self {
        Self { starts: vec![0], ..Self::default() }
    }

    /// Appends those of more rays.
    pub fn extend(&mut self, found: &Intersections) {
        let before = self.t.len() as i64;
        self.starts.extend(found.starts.iter().skip(1).map(|&start| before + start as i64));
        for Hit { t, triangle, u, v, normal } in &found.hits {
            self.t.push(*t);
            self.triangle.push(*triangle);
            self.uv.push([*u, *v]);
            self.normal.push(*normal);
        }
    }
}
