//! `brickwalk trace`: closest hits, or occlusion, of given rays.

use super::cached;
use super::options::render_args::TraceArgs;
use crate::cli::output::{print_json, warn};
use crate::kernels::Lod;
use crate::kernels::layout::NONE;
use crate::output::npy::{self, Rays};
use crate::session::trace::{Traced, check, for_rays, trace};
use crate::session::{Opened, levelled, open_scene};
use anyhow::{Context, Result, bail};
use brickwalk_convert::progress::Progress;

/// Runs the command.
///
/// # Errors
/// Bad rays, by their row; a bad scene, cache or output; a damaged brick; the device's.
pub fn run(args: &TraceArgs) -> Result<()> {
    let settings = for_rays(&args.settings()?);
    let Rays { rays, shape } = npy::read_rays(&args.rays)?;
    for (row, ray) in rays.iter().enumerate() {
        check(ray).with_context(|| format!("{}: row {row}", args.rays.display()))?;
    }
    let scene = &cached::scene(&args.scene)?;
    let (file, without_levels) = levelled(&open_scene(scene)?, &settings);
    let mut opened = Opened::open(file, scene, &settings)?;
    warn(std::mem::take(&mut opened.warnings).into_iter().chain(without_levels));
    if settings.lod == 0.0 && args.spread.is_some() {
        warn(["--spread has no effect: --lod is 0, which is exact"]);
    }
    let progress = Progress::new();
    progress.phase("rays", rays.len() as u64);
    let lod = Lod {
        pixels: settings.lod as f32,
        angle: args.spread.unwrap_or_default() as f32,
        given: true,
        ..Lod::default()
    };
    let mut traced = Traced { lod, ..opened.traced() };
    let traced = trace(&mut traced, &rays, args.any, &mut |rays| progress.advance(rays));
    let (hits, stats) = traced.with_context(|| scene.display().to_string())?;
    progress.finish();
    if let Some(row) = hits.iter().position(|hit| hit.t.is_nan() || hit.u.is_nan() || hit.v.is_nan()) {
        bail!(
            "the hit of row {row} is not a number: {:?}; this is a bug in brickwalk, see brickwalk selftest",
            hits[row]
        );
    }
    if args.any {
        let any: Vec<bool> = hits.iter().map(|h| h.triangle != NONE).collect();
        npy::write_any(&args.output, &any, &shape)?;
    } else {
        npy::write_hits(&args.output, &hits, &shape, args.normals)?;
    }
    Opened::write_requests(&settings, &opened.cache)?;
    if args.json {
        let hit = hits.iter().filter(|h| h.triangle != NONE).count();
        print_json(&serde_json::json!({
            "format": 1,
            "rays": rays.len(),
            "hits": hit,
            "ms": stats.ms,
            "round_trips": stats.round_trips,
            "bricks_loaded": stats.bricks_loaded,
            "bytes_bvh": stats.bytes_bvh,
            "bytes_geometry": stats.bytes_geometry,
            "bytes_attributes": stats.bytes_attributes,
        }))?;
    }
    Ok(())
}
