//! The second half of the start-up probe: do the pipelines that trace rays all find the same?
//!
//! What a kernel computes may depend on how its pipeline was compiled, and the hits of a scene must not. So the very
//! pipelines that a session goes on to use trace fixed rays through a small scene that is part of the program, for
//! closest and for any hits; what they write is compared bit for bit, and with brute force on the host.

use super::check::{Check, no_results};
use super::rays::{RAYS, rays};
use super::scene::scene;
use super::twin::{Twin, closest};
use crate::counters::Counters;
use crate::gpu::executor::GpuExecutor;
use crate::kernels::frame::Frame;
use crate::kernels::layout::{Hit, NONE, Params, Ray, Surface};
use crate::kernels::{Directions, Extent, FrameExecutor, Keep, Setup, View};
use crate::schedule::cache::{Cache, SceneBytes};
use crate::schedule::{Executor, ExecutorError, Lamp, Pass, Step, Tracing, chc, demand, plain};
use crate::stream::{HostCache, PayloadSource, Policy, Residency, ResidencyError, Workers};
use bricks::SceneFile;
use glam::DVec3;
use std::sync::Arc;

/// The rays, in tiles of so many that some leaves concern a part of them.
const EXTENT: Extent = Extent { width: 64, height: RAYS as u32 / 64, tile: 8 };

/// What a pipeline wrote for every ray.
struct Traced {
    name: &'static str,
    hits: Vec<Hit>,
    surfaces: Vec<Surface>,
}

/// Traces with the pipelines of `executor` and compares what they find.
///
/// A device that fails gives a check that says so.
pub fn compare_pipelines(executor: &GpuExecutor) -> Vec<Check> {
    compare(executor).unwrap_or_else(|error| vec![no_results("the traversal pipelines", error.to_string())])
}

fn compare(executor: &GpuExecutor) -> Result<Vec<Check>, Box<dyn std::error::Error>> {
    let scene = Arc::new(scene()?);
    let frame = Frame::near(scene.resident(), DVec3::ZERO);
    let twin = Twin::new(&scene, &frame)?;
    let rays = rays(&twin, frame.unit);
    let [closest, any] = trace(executor, scene, frame, &rays)?;
    let met: Vec<Vec<Hit>> = rays.iter().map(|ray| twin.hits(ray)).collect();
    let mut checks: Vec<Check> = closest.iter().map(|one| closest_against_twin(one, &rays, &met)).collect();
    checks.extend(any.iter().map(|one| any_against_twin(one, &rays, &met)));
    // The first of them are `intersect_all`'s.
    checks.extend(closest[1..].iter().map(|one| alike(one, &closest[0], &rays)));
    checks.extend(any[1..].iter().map(|one| occluded_alike(one, &any[0], &rays)));
    checks.extend(any.iter().zip(&closest).map(|(any, closest)| occluded_alike(any, closest, &rays)));
    Ok(checks)
}

/// How a pipeline is made to trace.
struct Way {
    closest: &'static str,
    any: &'static str,
    schedule: Schedule,
    /// Leaves of the longest list.
    list_most: u32,
    /// Whether nothing is resident at first, so that rays go by batches.
    is_cold: bool,
}

type Schedule = fn(&mut dyn Executor, &mut Cache, Pass, &[Step], &Tracing, &mut Counters) -> Result<(), ExecutorError>;

/// Every pipeline that intersects. The first makes everything resident for the second.
const WAYS: [Way; 5] = [
    Way {
        closest: "intersect_all (closest hit)",
        any: "intersect_all (any hit)",
        schedule: plain::trace,
        list_most: 0,
        is_cold: false,
    },
    Way {
        closest: "intersect_from_root_all (closest hit)",
        any: "intersect_from_root_all (any hit)",
        schedule: chc::trace,
        list_most: 0,
        is_cold: false,
    },
    Way {
        closest: "intersect_list (closest hit)",
        any: "intersect_list (any hit)",
        schedule: chc::trace,
        list_most: u32::MAX,
        is_cold: true,
    },
    Way {
        closest: "intersect_from_root (closest hit)",
        any: "intersect_from_root (any hit)",
        schedule: chc::trace,
        list_most: 0,
        is_cold: true,
    },
    Way {
        closest: "intersect_selected (closest hit)",
        any: "intersect_selected (any hit)",
        schedule: demand::trace,
        list_most: 0,
        is_cold: true,
    },
];

/// Traces `rays` through `scene` in every way, for closest hits and for any.
fn trace(
    executor: &GpuExecutor,
    scene: Arc<SceneFile>,
    frame: Frame,
    rays: &[Ray],
) -> Result<[Vec<Traced>; 2], Box<dyn std::error::Error>> {
    let sizes = scene.sizes();
    let largest = sizes.largest().max(16);
    // Pages as small as their number allows, so that bricks lie in as many of them as the pipelines know.
    let pages = |page_bytes: u64| Residency::budget_for_all(&sizes, page_bytes).div_ceil(page_bytes);
    let most = executor.kernels().pages.cache as u64;
    let page_bytes = (1..).map(|k| k * largest).find(|&bytes| pages(bytes) <= most).unwrap_or(largest);
    let budget = Residency::budget_for_all(&sizes, page_bytes);
    let empty = || -> Result<Cache, ResidencyError> {
        let residency = Residency::new(&sizes, budget, page_bytes, Policy::RoundRobin)?;
        Ok(Cache::new(residency, SceneBytes::from(&sizes), None))
    };
    let mut cache = empty()?;
    let page_sizes: Vec<u64> = cache.residency.page_sizes().collect();
    let workers = Workers::new(scene.clone(), HostCache::new(0), 1)?;
    let setup = Setup { extent: EXTENT, threshold: 0, count: false, opaque: false, keep: Keep::default() };
    let (gpu, kernels) = (executor.gpu().clone(), executor.kernels().clone());
    let mut executor = GpuExecutor::with_kernels(gpu, kernels, scene, workers, &page_sizes, setup)?;
    executor.begin_frame(&View { frame, params: Params::default(), directions: Directions::default() });
    let mut found = [Vec::new(), Vec::new()];
    for (pass, found) in [Pass::Primary, Pass::Shadow(Lamp::Sun)].into_iter().zip(&mut found) {
        for way in WAYS {
            if way.is_cold {
                cache = empty()?;
            }
            executor.tuning().list_most = way.list_most;
            executor.set_rays(pass, rays);
            cache.begin_pass("probe", 0);
            let tracing = Tracing::default();
            (way.schedule)(&mut executor, &mut cache, pass, &[Step::StartHits], &tracing, &mut Counters::default())?;
            let name = if pass == Pass::Primary { way.closest } else { way.any };
            let (hits, mut surfaces) = (executor.read_hits(pass)?, executor.read_surfaces(pass)?);
            // What a ray still asks for is no part of its hit.
            surfaces.iter_mut().for_each(|surface| surface.pending = 0);
            found.push(Traced { name, hits, surfaces });
        }
    }
    Ok(found)
}

const TWIN: &str = "brute force";

fn closest_against_twin(traced: &Traced, rays: &[Ray], met: &[Vec<Hit>]) -> Check {
    let mut check = Check::new(traced.name, TWIN);
    for (i, (ray, met)) in rays.iter().zip(met).enumerate() {
        let expected = closest(ray, met);
        let words = |hit: &Hit| -> [u32; 4] { bytemuck::cast(*hit) };
        check.compare(&words(&traced.hits[i]), &words(&expected), &format_args!("ray {i}, {ray:?}"));
    }
    check
}

/// Any hit is one of those that there are; a miss, if there are none.
fn any_against_twin(traced: &Traced, rays: &[Ray], met: &[Vec<Hit>]) -> Check {
    let mut check = Check::new(traced.name, TWIN);
    for (i, (ray, met)) in rays.iter().zip(met).enumerate() {
        let found = traced.hits[i];
        let expected = met.iter().copied().find(|hit| hit.id == found.id).unwrap_or_else(|| closest(ray, met));
        let words = |hit: &Hit| -> [u32; 4] { bytemuck::cast(*hit) };
        check.compare(&words(&found), &words(&expected), &format_args!("ray {i}, {ray:?}"));
    }
    check
}

impl Traced {
    /// Everything about ray `i`.
    fn words(&self, i: usize) -> Vec<u32> {
        let hit: &[u32] = bytemuck::cast_slice(&self.hits[i..=i]);
        [hit, bytemuck::cast_slice(&self.surfaces[i..=i])].concat()
    }
}

/// Everything is the same.
fn alike(a: &Traced, b: &Traced, rays: &[Ray]) -> Check {
    let mut check = Check::new(a.name, b.name);
    for (i, ray) in rays.iter().enumerate() {
        check.compare_bits(&a.words(i), &b.words(i), &format_args!("ray {i}, {ray:?}"));
    }
    check
}

/// The same rays have hits, and hits of the same triangle are the same; which of its triangles a ray meets is open.
fn occluded_alike(a: &Traced, b: &Traced, rays: &[Ray]) -> Check {
    let mut check = Check::new(a.name, b.name);
    for (i, ray) in rays.iter().enumerate() {
        let case = &format_args!("ray {i}, {ray:?}");
        let (x, y) = (a.hits[i].id, b.hits[i].id);
        if x != y && x != NONE && y != NONE {
            check.compare_bits(&[], &[], case);
        } else {
            check.compare_bits(&a.words(i), &b.words(i), case);
        }
    }
    check
}
