//! Rays that are given: closest hits, or occlusion.

use super::opened::Opened;
use crate::counters::Counters;
use crate::kernels::frame::Frame;
use crate::kernels::layout;
use crate::kernels::layout::{NONE, Params, T_INFINITE};
use crate::kernels::{Directions, Extent, FrameExecutor, View};
use crate::output::npy::{Hit, Ray};
use crate::schedule::cache::Cache;
use crate::schedule::{Lamp, Pass, Step, Tracing, attributes, chc, demand, plain};
use crate::session::Settings;
use crate::settings::{ImageSize, Schedule};
use anyhow::{Result, bail};
use bricks::Resident;
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
    /// The scene's resident part.
    pub resident: &'a Resident,
    /// The executor.
    pub executor: &'a mut dyn FrameExecutor,
    /// The cache.
    pub cache: &'a mut Cache,
    /// The schedule in force.
    pub schedule: Schedule,
    /// Most rays of a dispatch.
    pub most: usize,
}

impl Opened {
    /// For tracing.
    pub fn traced(&mut self) -> Traced<'_> {
        Traced {
            resident: self.scene.resident(),
            executor: &mut *self.executor,
            cache: &mut self.cache,
            schedule: self.schedule,
            most: self.extent.rays(),
        }
    }
}

/// Refuses a ray that has no direction or that is not all numbers.
///
/// # Errors
/// What is wrong with it.
pub fn check(ray: &Ray) -> Result<()> {
    if !ray.origin.iter().chain(&ray.direction).all(|x| x.is_finite()) {
        bail!("origin and direction must be finite");
    }
    if ray.direction == [0.0; 3] {
        bail!("the direction has no length");
    }
    if ray.t_min.is_nan() || ray.t_max.is_nan() {
        bail!("t_min and t_max must be numbers");
    }
    Ok(())
}

/// A given ray as the device gets it.
pub struct DeviceRay {
    /// In the frame's device units; the direction's largest component is in 1..2.
    pub ray: layout::Ray,
    /// Length of the device's direction in the given one, both in device units: given t = device t * `t_scale`.
    pub t_scale: f64,
}

/// Rounds a ray to f32 once, in `frame`. Distances are scaled by powers of two alone.
pub fn device_ray(ray: &Ray, frame: &Frame) -> DeviceRay {
    let largest = ray.direction.iter().fold(0.0f64, |m, d| m.max(d.abs()));
    // The exponent field, also of a subnormal: scaled into 1..2 by exact powers of two.
    let exponent = largest.log2().floor().clamp(-1074.0, 1023.0) as i32;
    let half = |e: i32| f64::from(e / 2).exp2() * f64::from(e - e / 2).exp2();
    let direction = ray
        .direction
        .map(|d| (d * f64::from(-(exponent / 2)).exp2() * f64::from(exponent / 2 - exponent).exp2()) as f32);
    let t_scale = frame.unit / half(exponent);
    let bound = |t: f64| {
        let t = t / t_scale;
        if t >= f64::from(T_INFINITE) { T_INFINITE } else { t as f32 }
    };
    let (t_min, t_max) = (bound(ray.t_min.max(0.0)), bound(ray.t_max));
    let origin = frame.point(DVec3::from_array(ray.origin));
    // The device's range is closed and starts at 0; an empty one is t_min above t_max.
    let empty = ray.t_min > ray.t_max || t_max < 0.0;
    let (t_min, t_max) = if empty { (1.0, 0.0) } else { (t_min, t_max) };
    DeviceRay { ray: layout::Ray { origin, t_min, direction, t_max }, t_scale }
}

/// Traces all rays; hits in their order. With `any` a hit says only that there is one. `watch` is told how many rays
/// have been traced since it was told last.
///
/// # Errors
/// A damaged brick, or the device's.
pub fn trace(traced: &mut Traced, rays: &[Ray], any: bool, watch: &mut dyn FnMut(u64)) -> Result<(Vec<Hit>, Counters)> {
    let start = std::time::Instant::now();
    let miss = Hit { t: f64::INFINITY, triangle: NONE, u: 0.0, v: 0.0 };
    let mut hits = vec![miss; rays.len()];
    let mut stats = Counters::default();
    // One reference point a cell: the rounding of an origin depends on the ray alone, not on its neighbours in the
    // file.
    let mut groups: BTreeMap<[i64; 3], (Frame, Vec<usize>)> = BTreeMap::new();
    for (i, ray) in rays.iter().enumerate() {
        let frame = Frame::near(traced.resident, DVec3::from_array(ray.origin));
        groups.entry(frame.reference).or_insert_with(|| (frame, Vec::new())).1.push(i);
    }
    for (frame, members) in groups.values() {
        for chunk in members.chunks(traced.most) {
            let given: Vec<DeviceRay> = chunk.iter().map(|&i| device_ray(&rays[i], frame)).collect();
            let found = trace_chunk(traced, frame, &given, any, &mut stats)?;
            for ((&i, given), (hit, weights)) in chunk.iter().zip(&given).zip(found) {
                if hit.id != NONE {
                    let t = f64::from(hit.t) * given.t_scale;
                    hits[i] = Hit { t, triangle: hit.id, u: weights[0], v: weights[1] };
                }
            }
            watch(chunk.len() as u64);
        }
    }
    stats.ms = start.elapsed().as_secs_f64() * 1e3;
    Ok((hits, stats))
}

fn trace_chunk(
    traced: &mut Traced,
    frame: &Frame,
    rays: &[DeviceRay],
    any: bool,
    stats: &mut Counters,
) -> Result<Vec<(layout::Hit, [f32; 2])>> {
    let device: Vec<layout::Ray> = rays.iter().map(|r| r.ray).collect();
    let hits = trace_device(traced, frame, &device, any, stats)?;
    if any {
        return Ok(hits.into_iter().map(|h| (h, [0.0; 2])).collect());
    }
    let (executor, cache) = (&mut *traced.executor, &mut *traced.cache);
    attributes::resolve(executor, cache, Pass::Primary, stats)?;
    let gbuffer = executor.read_gbuffer()?;
    Ok(hits.into_iter().zip(gbuffer).map(|(h, g)| (h, g.weights)).collect())
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
    executor.begin_frame(&View { frame: *frame, params: Params::default(), directions: Directions::default() });
    executor.set_rays(pass, rays);
    cache.begin_pass("trace", 0);
    let trace = match traced.schedule {
        // Rays that are given have nothing in common that tiles could use.
        Schedule::Demand | Schedule::Auto => demand::trace,
        Schedule::Chc => chc::trace,
        Schedule::Plain => plain::trace,
        Schedule::PlainBinary => plain::trace_binary,
    };
    trace(executor, cache, pass, &[Step::StartHits], &Tracing::default(), stats)?;
    let mut hits = executor.read_hits(pass)?;
    hits.truncate(rays.len());
    Ok(hits)
}
