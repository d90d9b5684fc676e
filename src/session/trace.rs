//! Rays that are given: closest hits, or occlusion.

mod given;
mod refine;

pub use given::{Approach, DeviceRay, Scaled, Surroundings, check, device_ray};

use super::opened::Opened;
use crate::counters::Counters;
use crate::kernels::frame::Frame;
use crate::kernels::layout::{NONE, Params};
use crate::kernels::{Directions, Extent, FrameExecutor, Lod, View, layout};
use crate::output::npy::{Hit, Ray};
use crate::schedule::cache::Cache;
use crate::schedule::{self, Lamp, Pass, Step, Tracer, Tracing, attributes};
use crate::secondary::displacement::Bench;
use crate::session::Settings;
use crate::settings::{ImageSize, Schedule};
use anyhow::Result;
use bricks::SceneFile;
use glam::DVec3;
use std::collections::BTreeMap;

/// Rays of a dispatch where there is no picture; tiles are runs of 32 x 32 of them.
pub const EXTENT: Extent = Extent { width: 32, height: 2048, tile: 32 };

/// `settings` of a session that traces rays and renders no frames.
pub fn for_rays(settings: &Settings) -> Settings {
    let Extent { width, height, tile } = EXTENT;
    Settings { size: ImageSize { width, height }, tile, ..settings.clone() }
}

/// What rays are traced in.
pub struct Traced<'a> {
    /// The scene.
    pub scene: &'a SceneFile,
    /// The executor.
    pub executor: &'a mut dyn FrameExecutor,
    /// The cache.
    pub cache: &'a mut Cache,
    /// The schedule in force.
    pub schedule: Schedule,
    /// Most rays of a dispatch.
    pub most: usize,
    /// What levels of detail are selected by, in a scene that has them in use.
    pub lod: Lod,
}

impl Opened {
    /// For tracing.
    pub fn traced(&mut self) -> Traced<'_> {
        Traced {
            scene: &self.scene,
            executor: &mut *self.executor,
            cache: &mut self.cache,
            schedule: self.schedule,
            most: self.extent.rays(),
            lod: Lod::default(),
        }
    }
}

impl Opened {
    /// For making displacement fields; opened with settings of [`for_rays`].
    pub fn bench(&mut self) -> Bench<'_> {
        Bench {
            scene: &self.scene,
            executor: &mut *self.executor,
            cache: &mut self.cache,
            most: self.extent.rays(),
            // Tiles are as wide as the extent.
            tile: (self.extent.tile * self.extent.width) as usize,
        }
    }
}

/// What the device found for a ray.
#[derive(Clone, Copy, Debug)]
pub struct Found {
    /// The ray, of those given.
    pub ray: usize,
    /// Distance in lengths of the given direction, of f32 accuracy, from the origin that [`Surroundings::approach`]
    /// gives.
    pub t: f64,
    /// Global triangle id.
    pub id: u32,
    /// Leaf of the top level; [`NONE`] of any hit.
    pub leaf: u32,
    /// Triangle within the leaf's brick.
    pub triangle: u32,
    /// Weights of vertices 1 and 2 of the source's order.
    pub weights: [f32; 2],
}

/// Traces all rays; hits in their order. With `any` a hit says only that there is one. `watch` is told how many rays
/// have been traced since it was told last.
///
/// Rays are rounded to f32 relative to a point near their origin, or near the scene if that is far away, and what they
/// hit is decided so. `t` and the normal are then those of the given ray and the triangle in f64. The cone that levels
/// are selected by starts where [`Surroundings::approach`] has it start: of a ray from far away it is narrower than it
/// might be.
///
/// # Errors
/// A damaged brick, or the device's.
pub fn trace(traced: &mut Traced, rays: &[Ray], any: bool, watch: &mut dyn FnMut(u64)) -> Result<(Vec<Hit>, Counters)> {
    let start = std::time::Instant::now();
    let (found, mut stats) = find(traced, rays, any, watch)?;
    let miss = Hit { t: f64::INFINITY, triangle: NONE, u: 0.0, v: 0.0, normal: [0.0; 3] };
    let mut hits = vec![miss; rays.len()];
    for found in &found {
        let [u, v] = found.weights;
        hits[found.ray] = Hit { t: found.t, triangle: found.id, u, v, normal: [0.0; 3] };
    }
    if !any {
        refine::refine(traced, rays, found, &mut hits)?;
    }
    stats.ms = start.elapsed().as_secs_f64() * 1e3;
    Ok((hits, stats))
}

/// What rays hit, as the device finds it, in no order; rays that hit nothing are left out.
///
/// # Errors
/// A damaged brick, or the device's.
pub fn find(
    traced: &mut Traced,
    rays: &[Ray],
    any: bool,
    watch: &mut dyn FnMut(u64),
) -> Result<(Vec<Found>, Counters)> {
    let mut all = Vec::new();
    let mut stats = Counters::default();
    // One reference point a cell: the rounding of an origin depends on the ray alone, not on its neighbours in the
    // file.
    let mut groups: BTreeMap<[i64; 3], (Frame, Vec<usize>)> = BTreeMap::new();
    let Some(surroundings) = Surroundings::new(traced.scene.resident()) else {
        watch(rays.len() as u64);
        return Ok((all, stats));
    };
    for (i, ray) in rays.iter().enumerate() {
        let Some(Approach { ray, .. }) = surroundings.approach(ray) else {
            watch(1);
            continue;
        };
        let frame = Frame::near(traced.scene.resident(), DVec3::from_array(ray.origin));
        groups.entry(frame.reference).or_insert_with(|| (frame, Vec::new())).1.push(i);
    }
    for (frame, members) in groups.values() {
        for chunk in members.chunks(traced.most) {
            let near = |&i: &usize| surroundings.approach(&rays[i]).map(|near| (i, device_ray(&near.ray, frame)));
            let (numbers, given): (Vec<usize>, Vec<DeviceRay>) = chunk.iter().filter_map(near).unzip();
            let found = trace_chunk(traced, frame, &given, any, &mut stats)?;
            for ((ray, given), found) in numbers.into_iter().zip(&given).zip(found) {
                if found.id != NONE {
                    all.push(Found { ray, t: found.t * given.t_scale, ..found });
                }
            }
            watch(chunk.len() as u64);
        }
    }
    Ok((all, stats))
}

/// What rays in `frame` hit, in their order, with `t` in lengths of the device's direction.
fn trace_chunk(
    traced: &mut Traced,
    frame: &Frame,
    rays: &[DeviceRay],
    any: bool,
    stats: &mut Counters,
) -> Result<Vec<Found>> {
    let device: Vec<layout::Ray> = rays.iter().map(|r| r.ray).collect();
    let hits = trace_device(traced, frame, &device, any, stats)?;
    let found = |hit: &layout::Hit, leaf, triangle, weights| {
        let t = f64::from(hit.t);
        Found { ray: 0, t, id: hit.id, leaf, triangle, weights }
    };
    if any {
        return Ok(hits.iter().map(|hit| found(hit, NONE, 0, [0.0; 2])).collect());
    }
    let (executor, cache) = (&mut *traced.executor, &mut *traced.cache);
    attributes::resolve(executor, cache, Pass::Primary, stats)?;
    let (gbuffer, surfaces) = (executor.read_gbuffer()?, executor.read_surfaces(Pass::Primary)?);
    let all = hits.iter().zip(&surfaces).zip(&gbuffer);
    Ok(all.map(|((hit, surface), g)| found(hit, surface.leaf, surface.triangle, g.weights)).collect())
}

/// Traces rays that are in `frame`, at most [`Traced::most`]; their hits in the same order.
///
/// # Errors
/// A damaged brick, or the device's.
pub fn trace_device(
    traced: &mut Traced,
    frame: &Frame,
    rays: &[layout::Ray],
    any: bool,
    stats: &mut Counters,
) -> Result<Vec<layout::Hit>> {
    let pass = if any { Pass::Shadow(Lamp::Sun) } else { Pass::Primary };
    let (executor, cache) = (&mut *traced.executor, &mut *traced.cache);
    let directions = Directions { lod: traced.lod, ..Directions::default() };
    executor.begin_frame(&View { frame: *frame, params: Params::default(), directions, rays: Some(rays.len()) });
    executor.set_rays(pass, rays);
    cache.begin_pass("trace", 0);
    let tracing = &Tracing::default();
    let mut tracer = Tracer::new(&mut *executor, cache, pass, tracing, stats);
    schedule::trace(&mut tracer, traced.schedule, &[Step::StartHits])?;
    let mut hits = executor.read_hits(pass)?;
    hits.truncate(rays.len());
    Ok(hits)
}
