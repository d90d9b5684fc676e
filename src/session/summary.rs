//! `summary.json`: what was asked for, on what it ran, and what came of it.

use super::auto::Auto;
use super::open::{LeftOut, Session};
use crate::counters::Record;
use crate::frame::Renderer;
use crate::remote;
use crate::session::Settings;
use crate::settings::{FrameBudget, Length, Schedule, Value as _};
use serde_json::{Map, Value, json};

/// Raised when a field changes its meaning.
const FORMAT: u32 = 2;

/// The summary of a session with the frames of `records`; `left_out` is what was there and what was not, `video` what
/// became of a video.
pub fn summary(session: &mut Session, records: &[Record], left_out: LeftOut, video: Value) -> Value {
    let host_cache = host_cache(&session.renderer);
    let Session { file, settings: s, renderer, lighting, resolve, field, stops, auto, .. } = session;
    let resident = renderer.scene.resident();
    let manifest = &resident.manifest;
    let sizes = &renderer.cache.sizes;
    let (streamed_bytes, tile_bytes) = (sizes.sum(), sizes.tiles.iter().sum::<u64>());
    let brick_bytes = streamed_bytes - tile_bytes;
    let mut reports: Map<String, Value> =
        renderer.methods.iter().flat_map(|method| method.report()).map(|(name, value)| (name.into(), value)).collect();
    let mut summary = json!({
        "format": FORMAT,
        "version": env!("CARGO_PKG_VERSION"),
        "commit": env!("BRICKWALK_COMMIT"),
        "adapter": renderer.executor.device(),
        "scene": {
            "file": file.file_name().map(|n| n.to_string_lossy()),
            "file_bytes": renderer.scene.file_bytes(),
            "resident_bytes": renderer.scene.resident_bytes(),
            "bricks": resident.bricks.len(),
            "brick_bytes": brick_bytes,
            "tile_bytes": tile_bytes,
            "leaves": resident.leaves.len(),
            "triangles": manifest.triangles_instanced,
            "motion": s.motion.as_ref().map(|file| file.file_name().map(|name| name.to_string_lossy())),
        },
        "settings": {
            "frames": s.frames,
            "width": s.size.width,
            "height": s.size.height,
            "effects": s.effects.to_string(),
            "ao_rays": s.ao_rays,
            "ao_length": match s.ao_length {
                Length::World(length) => Some(length),
                Length::Auto => None,
            },
            "diffuse_rays": s.diffuse_rays,
            "rotation_degrees": s.rotation.0,
            "schedule": renderer.settings.schedule.name(),
            "fronts": if s.has_fronts() { "on" } else { "off" },
            "without": without(s),
            "query_threshold": s.query_threshold,
            "tile": s.tile,
            "evict": renderer.cache.residency.policy().name(),
            "cache_bytes": renderer.cache.residency.budget_bytes(),
            "cache_percent": 100.0 * renderer.cache.residency.budget_bytes() as f64 / streamed_bytes.max(1) as f64,
            "host_cache_bytes": renderer.executor.workers().host_cache().budget_bytes(),
            "frame_budget": s.frame_budget().map(|budget| budget.to_string()),
            "interactive_bytes": s.frame_budget().and_then(FrameBudget::bytes),
            "secondary": s.secondary.to_string(),
            "roma": reports.remove("roma"),
            "df": reports.remove("df"),
            "displacement": reports.remove("displacement"),
            "dvf": field
                .as_ref()
                .and_then(Option::as_ref)
                .map(|note| note.report(renderer, &s.dvf, s.motion.is_some(), records)),
            "rsm": reports.remove("rsm"),
            "spp": s.samples(),
            "seed": s.seed,
            "sun": s.sun.unit().to_array(),
            "sun_angle_degrees": s.sun_angle,
            "sun_intensity": s.sun_intensity(),
            "sky_intensity": s.sky_intensity,
            "environment": s.environment.as_ref().map(ToString::to_string),
            "environment_rotation_degrees": s.environment_rotation,
            "environment_intensity": s.environment_intensity,
            "rect_light": s
                .rect_light
                .map(|light| [light.corner, light.edges[0], light.edges[1]].map(|v| v.to_array())),
        },
        "options": s,
        "lamps": {
            "emitters": renderer.light.lamps.emitters().len(),
            "environment": renderer.light.lamps.environment.as_ref().zip(lighting.environment).map(|(map, notes)| {
                json!({
                    "width": map.width,
                    "height": map.height,
                    "bad_texels": notes.bad_texels,
                    "energy_change": notes.energy_change,
                })
            }),
        },
        "frames": stops.len(),
        "bands": renderer.bands().len(),
        "pictures": {
            "exposure": s.exposure.plain(),
            "exposure_ev": stops,
            "tone_map": s.tone_map.name(),
            "samples_mean": samples_mean(s, stops.len(), records),
            "video": video,
        },
        "denoise": resolve.report(),
        "taa": resolve.taa.is_some(),
        "auto": (renderer.settings.schedule == Schedule::Auto).then(|| json!({
            "switches": renderer.auto.switches,
            "passes_last_by": renderer.auto.in_force().into_iter().collect::<std::collections::BTreeMap<_, _>>(),
        })),
        "secondary_auto": auto.as_ref().map(Auto::report),
        "kept": left_out.kept,
        "left_out": left_out.left_out,
        "left_out_together": left_out.together,
        "texture_bytes_resident": renderer.executor.texture_bytes(),
        "host_cache": host_cache,
        "error": s.measure_error.then(|| errors(records)),
        "memory": memory(),
        "passes": passes(records),
        "unresolved_pixels": records.iter().map(|r| r.unresolved_pixels).sum::<u64>(),
        "non_finite": records.iter().map(|r| r.non_finite).sum::<u64>(),
    });
    if let (Some(traffic), Some(summary)) = (remote::traffic(file), summary.as_object_mut()) {
        summary.insert("remote".into(), json!(traffic));
    }
    summary
}

/// Samples that pixels took on average: camera rays of a pixel.
fn samples_mean(settings: &Settings, frames: usize, records: &[Record]) -> f64 {
    let rays: u64 = records.iter().filter(|record| record.pass == "primary").map(|record| record.rays_traced).sum();
    let pixels = u64::from(settings.size.width) * u64::from(settings.size.height) * frames.max(1) as u64;
    rays as f64 / pixels as f64
}

/// Names of the optimisations that are off, in one order, each once.
fn without(settings: &Settings) -> Vec<&'static str> {
    let mut list = settings.without.clone();
    list.sort_unstable();
    list.dedup();
    list.into_iter().map(|which| which.name()).collect()
}

/// What the host cache did.
fn host_cache(renderer: &Renderer) -> Value {
    let host = renderer.executor.workers().host_cache().stats();
    json!({ "hits": host.hits, "misses": host.misses, "evicted": host.evicted, "used_bytes": host.used_bytes })
}

/// The errors of the effects that `--measure-error` measured: means over the frames, and the greatest.
fn errors(records: &[Record]) -> Value {
    let mut effects: Map<String, Value> = Map::new();
    for name in records.iter().map(|r| r.pass) {
        let rows: Vec<&Record> = records.iter().filter(|r| r.pass == name).collect();
        let most = |of: fn(&Record) -> f64| rows.iter().map(|r| of(r)).fold(0.0, f64::max);
        effects.entry(name).or_insert_with(|| {
            json!({
                "mean": rows.iter().map(|r| r.error_mean).sum::<f64>() / rows.len() as f64,
                "mean_most": most(|r| r.error_mean),
                "worst_tile_most": most(|r| r.error_worst_tile),
                "pixels_mean": rows.iter().map(|r| r.error_pixels).sum::<u64>() as f64 / rows.len() as f64,
                "pixels_most": rows.iter().map(|r| r.error_pixels).max(),
            })
        });
    }
    Value::Object(effects)
}

/// Totals, medians and 95th percentiles of every numeric field, per pass.
fn passes(records: &[Record]) -> Value {
    let mut names: Vec<&str> = records.iter().map(|r| r.pass).collect();
    names.sort_unstable();
    names.dedup();
    let mut out = Map::new();
    for name in names {
        let rows: Vec<Value> =
            records.iter().filter(|r| r.pass == name).filter_map(|r| serde_json::to_value(r).ok()).collect();
        out.insert(name.to_string(), statistics(&rows));
    }
    Value::Object(out)
}

fn statistics(rows: &[Value]) -> Value {
    let (mut totals, mut medians, mut p95) = (Map::new(), Map::new(), Map::new());
    let Some(Value::Object(first)) = rows.first() else { return Value::Null };
    for key in first.keys().filter(|key| *key != "frame" && first[*key].is_number()) {
        if rows.iter().all(|row| row[key].is_u64()) {
            let total: u64 = rows.iter().filter_map(|row| row[key].as_u64()).sum();
            totals.insert(key.clone(), total.into());
        } else {
            totals.insert(key.clone(), rows.iter().filter_map(|row| row[key].as_f64()).sum::<f64>().into());
        }
        let mut values: Vec<f64> = rows.iter().filter_map(|row| row[key].as_f64()).collect();
        values.sort_by(f64::total_cmp);
        medians.insert(key.clone(), quantile(&values, 0.5).into());
        p95.insert(key.clone(), quantile(&values, 0.95).into());
    }
    json!({ "total": totals, "median": medians, "p95": p95 })
}

/// The quantile `q` of ascending values, between neighbours linearly. 0 of none.
fn quantile(values: &[f64], q: f64) -> f64 {
    let Some(last) = values.len().checked_sub(1) else { return 0.0 };
    let at = q * last as f64;
    let (low, high) = (at.floor() as usize, at.ceil() as usize);
    values[low] + (values[high] - values[low]) * (at - low as f64)
}

/// Memory of the process in bytes at its peak, mapped pages apart; null where the system does not tell.
fn memory() -> Value {
    let Ok(status) = std::fs::read_to_string("/proc/self/status") else { return Value::Null };
    let field = |name: &str| -> Option<u64> {
        let line = status.lines().find(|l| l.starts_with(name))?;
        Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? * 1024)
    };
    match (field("VmHWM:"), field("RssFile:")) {
        (Some(peak), Some(mapped)) => json!({
            "peak_bytes": peak.saturating_sub(mapped),
            "mapped_bytes": mapped,
        }),
        _ => Value::Null,
    }
}

#[cfg(test)]
mod tests {
    use super::quantile;

    #[test]
    fn quantiles_are_exact_on_small_sets() {
        assert_eq!(quantile(&[], 0.5), 0.0);
        assert_eq!(quantile(&[3.0], 0.95), 3.0);
        assert_eq!(quantile(&[1.0, 2.0, 4.0], 0.5), 2.0);
        assert_eq!(quantile(&[1.0, 2.0], 0.5), 1.5);
    }
}
