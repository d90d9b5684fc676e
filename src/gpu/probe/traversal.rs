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
use crate::schedule::cache::Cache;
use crate::schedule::{self, Lamp, Pass, Step, Tracer, Tracing};
use crate::settings::Schedule;
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
    compare(executor).unwrap_or_else(|error| vec![no_results("the traversal pipelines", &error)])
}

fn compare(executor: &GpuExecutor) -> Result<Vec<Check>, Box<dyn std::error::Error>> {
    let scene = Arc::new(scene()?);
    let frame = Frame::near(scene.resident(), DVec3::ZERO);
    let twin = Twin::new(&scene, &frame)?;
    let rays = rays(&twin, frame.unit);
    let [closest, any] = trace(executor, scene, frame, &rays)?;
    let met: Vec<Vec<Hit>> = rays.iter().map(|ray| twin.hits(ray)).collect();
    let ways = [(false, &closest), (true, &any)];
    let mut checks = Vec::new();
    for (any, all) in ways {
        checks.extend(all.iter().map(|one| against_brute_force(one, any, &rays, &met)));
    }
    for (any, all) in ways {
        // The first of them are `intersect_all`'s.
        checks.extend(all[1..].iter().map(|one| alike(one, &all[0], any, &rays)));
    }
    checks.extend(any.iter().zip(&closest).map(|(any, closest)| alike(any, closest, true, &rays)));
    Ok(checks)
}

/// Every pipeline that intersects, for closest hits and for any: the schedule by which it does, leaves of the longest
/// list, and whether nothing is resident at first, so that rays go by batches. The first makes everything resident for
/// the second.
const WAYS: [([&str; 2], Schedule, u32, bool); 5] = [
    (["intersect_all (closest hit)", "intersect_all (any hit)"], Schedule::Plain, 0, false),
    (["intersect_from_root_all (closest hit)", "intersect_from_root_all (any hit)"], Schedule::Chc, 0, false),
    (["intersect_list (closest hit)", "intersect_list (any hit)"], Schedule::Chc, u32::MAX, true),
    (["intersect_from_root (closest hit)", "intersect_from_root (any hit)"], Schedule::Chc, 0, true),
    (["intersect_selected (closest hit)", "intersect_selected (any hit)"], Schedule::Demand, 0, true),
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
        Ok(Cache::new(residency, sizes.clone(), Vec::new(), None))
    };
    let mut cache = empty()?;
    let page_sizes: Vec<u64> = cache.residency.page_sizes().collect();
    let workers = Workers::new(scene.clone(), HostCache::new(0), 1)?;
    let setup = Setup {
        extent: EXTENT,
        threshold: 0,
        count: false,
        opaque: false,
        hides: false,
        flat_bytes: 0,
        keep: Keep::default(),
    };
    let (gpu, kernels) = (executor.gpu().clone(), executor.kernels().clone());
    let mut executor = GpuExecutor::with_kernels(gpu, kernels, scene, workers, &page_sizes, setup)?;
    executor.begin_frame(&View { frame, params: Params::default(), directions: Directions::default(), rays: None });
    let mut found = [Vec::new(), Vec::new()];
    for (any, pass) in [Pass::Primary, Pass::Shadow(Lamp::Sun)].into_iter().enumerate() {
        for (names, by, list_most, is_cold) in WAYS {
            if is_cold {
                cache = empty()?;
            }
            executor.tuning().list_most = list_most;
            executor.set_rays(pass, rays);
            cache.begin_pass("probe", 0);
            let (tracing, stats) = (&Tracing::default(), &mut Counters::default());
            let mut tracer = Tracer::new(&mut executor, &mut cache, pass, tracing, stats);
            schedule::trace(&mut tracer, by, &[Step::StartHits])?;
            let (hits, mut surfaces) = (executor.read_hits(pass)?, executor.read_surfaces(pass)?);
            // What a ray still asks for is no part of its hit.
            surfaces.iter_mut().for_each(|surface| surface.pending = 0);
            found[any].push(Traced { name: names[any], hits, surfaces });
        }
    }
    Ok(found)
}

/// Closest hits are those of brute force; any hit is one of those that there are, a miss if there are none.
fn against_brute_force(traced: &Traced, any: bool, rays: &[Ray], met: &[Vec<Hit>]) -> Check {
    let mut check = Check::new(traced.name, "brute force");
    for (i, (ray, met)) in rays.iter().zip(met).enumerate() {
        let found = traced.hits[i];
        let same = met.iter().copied().find(|hit| any && hit.id == found.id);
        let words = |hit: Hit| -> [u32; 4] { bytemuck::cast(hit) };
        let mut expected = same.unwrap_or_else(|| closest(ray, met));
        if any {
            (expected.u, expected.v) = (0.0, 0.0);
        }
        check.compare(&words(found), &words(expected), &format_args!("ray {i}, {ray:?}"));
    }
    check
}

impl Traced {
    /// Everything about ray `i`; of any hit there is only how far it is, and of what.
    fn words(&self, i: usize, any: bool) -> Vec<u32> {
        let (hit, surface) = (&self.hits[i], &self.surfaces[i]);
        if any {
            return vec![hit.t.to_bits(), hit.id, surface.leaf, surface.triangle, surface.source];
        }
        let hit: &[u32] = bytemuck::cast_slice(std::slice::from_ref(hit));
        [hit, bytemuck::cast_slice(std::slice::from_ref(surface))].concat()
    }
}

/// Everything is the same; of any hits, the same rays have some, and hits of the same triangle are the same: which of
/// its triangles a ray meets is open.
fn alike(a: &Traced, b: &Traced, any: bool, rays: &[Ray]) -> Check {
    let mut check = Check::new(a.name, b.name);
    for (i, ray) in rays.iter().enumerate() {
        let (x, y) = (a.hits[i].id, b.hits[i].id);
        let is_open = any && x != y && x != NONE && y != NONE;
        let [of_a, of_b] = [a, b].map(|traced| if is_open { Vec::new() } else { traced.words(i, any) });
        check.compare_bits(&of_a, &of_b, &format_args!("ray {i}, {ray:?}"));
    }
    check
}
