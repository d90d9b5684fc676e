//! The second half of the start-up probe: do the pipelines that trace rays all find the same?
//!
//! What a kernel computes may depend on how its pipeline was compiled, and the hits of a scene must not. So the very
//! pipelines that a session goes on to use trace fixed rays through a small scene that is part of the program, for
//! closest and for any hits; what they write is compared bit for bit, and with brute force on the host.

use super::rays::{RAYS, rays};
use super::twin::{Twin, closest};
use super::{Check, no_results, scene};
use crate::gpu::executor::{Directions, GpuExecutor, Setup, View};
use crate::gpu::layout::{Hit, NONE, Params, Ray, Surface};
use crate::gpu::rays::Extent;
use crate::gpu::scene::Frame;
use crate::schedule::cache::{BrickBytes, Cache};
use crate::schedule::{ExecutorError, Lamp, Pass, PassStats, Step, Tracing, chc, plain};
use crate::stream::{HostCache, PayloadSource, Policy, Residency, Workers};
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
    let [list, all, any_list, any_all] = trace(executor, scene, frame, &rays)?;
    let met: Vec<Vec<Hit>> = rays.iter().map(|ray| twin.hits(ray)).collect();
    Ok(vec![
        closest_against_twin(&all, &rays, &met),
        closest_against_twin(&list, &rays, &met),
        any_against_twin(&any_all, &rays, &met),
        any_against_twin(&any_list, &rays, &met),
        alike(&list, &all, &rays),
        occluded_alike(&any_list, &any_all, &rays),
        occluded_alike(&any_all, &all, &rays),
        occluded_alike(&any_list, &list, &rays),
    ])
}

/// Traces `rays` through `scene` by `intersect_list` and `intersect_all`, for closest hits, then for any.
fn trace(
    executor: &GpuExecutor,
    scene: Arc<SceneFile>,
    frame: Frame,
    rays: &[Ray],
) -> Result<[Traced; 4], Box<dyn std::error::Error>> {
    let sizes = scene.sizes();
    let largest = sizes.iter().map(|s| s.0.max(s.1)).max().unwrap_or(0).max(16);
    // Pages as small as their number allows, so that bricks lie in as many of them as the pipelines know.
    let pages = |page_bytes: u64| Residency::budget_for_all(&sizes, page_bytes).div_ceil(page_bytes);
    let most = executor.kernels().pages.cache as u64;
    let page_bytes = (1..).map(|k| k * largest).find(|&bytes| pages(bytes) <= most).unwrap_or(largest);
    let budget = Residency::budget_for_all(&sizes, page_bytes);
    let residency = Residency::new(&sizes, budget, page_bytes, Policy::RoundRobin)?;
    let page_sizes: Vec<u64> = residency.page_sizes().collect();
    let weigh = |&(geometry, attributes): &(u64, u64)| BrickBytes { bvh: 0, geometry, attributes };
    let mut cache = Cache::new(residency, sizes.iter().map(weigh).collect(), None);
    let workers = Workers::new(scene.clone(), HostCache::new(0), 1, 0)?;
    let setup = Setup { extent: EXTENT, threshold: 0, count: false };
    let (gpu, kernels) = (executor.gpu().clone(), executor.kernels().clone());
    let mut executor = GpuExecutor::with_kernels(gpu, kernels, scene, workers, &page_sizes, setup)?;
    executor.begin_frame(&View { frame, params: Params::default(), directions: Directions::default() });
    let mut run = |name, pass, list: bool| -> Result<Traced, ExecutorError> {
        executor.set_rays(pass, rays);
        cache.begin_pass("probe", 0);
        let schedule = if list { chc::trace } else { plain::trace };
        schedule(&mut executor, &mut cache, pass, &[Step::StartHits], &Tracing::default(), &mut PassStats::default())?;
        Ok(Traced { name, hits: executor.read_hits(pass)?, surfaces: executor.read_surfaces(pass)? })
    };
    // The first finds nothing resident and goes by batches, the others find everything.
    Ok([
        run("intersect_list (closest hit)", Pass::Primary, true)?,
        run("intersect_all (closest hit)", Pass::Primary, false)?,
        run("intersect_list (any hit)", Pass::Shadow(Lamp::Sun), true)?,
        run("intersect_all (any hit)", Pass::Shadow(Lamp::Sun), false)?,
    ])
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
