//! What rendering leaves out because a scene does not need it, and what that saves.

use super::opened::Opened;
use super::renderer::lit_renderer;
use crate::frame::{Light, Renderer};
use crate::kernels::{Keep, opacity, reflectance};
use crate::scene::Camera;
use crate::secondary::roma::answer::Roma;
use crate::session::Settings;
use anyhow::Result;
use bricks::SceneFile;
use serde_json::{Map, Value, json};
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// Times that a frame is rendered with and without each thing.
const REPETITIONS: usize = 5;

/// How a thing that is left out is kept.
type Keeper = fn(&mut Keep);

/// Something that is left out.
#[derive(Clone, Copy, Debug)]
pub struct LeftOut {
    what: &'static str,
    why: &'static str,
    /// What keeps it, where it can be kept.
    keep: Option<Keeper>,
}

/// What `renderer` leaves out.
pub fn left_out(renderer: &mut Renderer) -> Vec<LeftOut> {
    let has_short_rays = has_short_rays(renderer);
    let resident = renderer.scene.resident();
    let manifest = &resident.manifest;
    let fits = renderer.cache.residency.budget_bytes() >= renderer.cache.sizes.sum();
    let all: [(bool, &str, &str, Option<Keeper>); 8] = [
        (fits, "queries for missing bricks", "the cache holds every brick and tile", Some(|keep| keep.queries = true)),
        (!manifest.has_textures, "texture lookups", "no material has a texture", Some(|keep| keep.textures = true)),
        (
            !opacity::is_needed(resident),
            "alpha tests in traversal",
            "no ray passes through a triangle",
            Some(|keep| keep.opacity = true),
        ),
        (
            !reflectance::is_needed(resident),
            "reflections other than diffuse ones",
            "every surface is Lambertian",
            Some(|keep| keep.gloss = true),
        ),
        (!manifest.has_instances, "instance transforms", "everything is baked into the world", None),
        (has_short_rays, "occupancy maps for ao", "its rays are shorter than three cells of bricks", None),
        (resident.displacement.is_empty(), "displacement fields", "the scene has none", None),
        (!manifest.has_wide_bricks, "two-part vertices", "every brick is near", None),
    ];
    let all = all.into_iter().filter(|(is_left_out, ..)| *is_left_out);
    all.map(|(_, what, why, keep)| LeftOut { what, why, keep }).collect()
}

/// Whether maps would have spared rays of ao that are too short for it.
fn has_short_rays(renderer: &mut Renderer) -> bool {
    let Renderer { engine, methods } = renderer;
    let Some(roma) = methods.get_mut::<Roma>() else { return false };
    let is_help = roma.settings.is_some_and(|settings| settings.occlusion.is_some_and(|pass| pass.role.is_help()));
    let length = engine.settings.effects.occlusion.map(|occlusion| occlusion.length);
    is_help && length.is_some_and(|length| roma.is_short(&engine.scene, length))
}

/// As the summary lists them, with what `measured` found.
pub fn listed(all: &[LeftOut], measured: &[Map<String, Value>]) -> Vec<Value> {
    let one = |(i, one): (usize, &LeftOut)| {
        let mut entry = Map::new();
        entry.insert("what".into(), one.what.into());
        entry.insert("why".into(), one.why.into());
        entry.extend(measured.get(i).cloned().into_iter().flatten());
        Value::Object(entry)
    };
    all.iter().enumerate().map(one).collect()
}

/// What a frame of `camera`, of the scene in the file `path`, takes as it is rendered and with each of `all` kept, turn
/// by turn: medians of the milliseconds of five frames each, after one that is not counted. Nothing is stated of what
/// kernels decide as they run.
///
/// # Errors
/// The device's.
pub fn measure(
    all: &[LeftOut],
    scene: &Arc<SceneFile>,
    path: &Path,
    settings: &Settings,
    light: &Light,
    camera: &Camera,
) -> Result<Vec<Map<String, Value>>> {
    let settings = Settings { requests_out: None, ..settings.clone() };
    let open = |keep: Keep| -> Result<Renderer> {
        let opened = Opened::open_keeping(scene.clone(), path, &settings, keep)?;
        Ok(lit_renderer(opened, &settings, light.clone()))
    };
    let mut renderers = vec![open(Keep::default())?];
    let can = renderers[0].executor.leaves_out();
    let keep = |one: &LeftOut| {
        let mut keep = Keep::default();
        one.keep.iter().for_each(|set| set(&mut keep));
        keep
    };
    let kept: Vec<usize> = (0..all.len()).filter(|&i| all[i].keep.is_some() && keep(&all[i]).is_part_of(can)).collect();
    for &i in &kept {
        renderers.push(open(keep(&all[i]))?);
    }
    let mut times = vec![Vec::new(); renderers.len()];
    for repetition in 0..=REPETITIONS {
        for (renderer, times) in renderers.iter_mut().zip(&mut times) {
            let start = Instant::now();
            renderer.frame(0, camera)?;
            if repetition > 0 {
                times.push(start.elapsed().as_secs_f64() * 1e3);
            }
        }
    }
    let median = |times: &mut Vec<f64>| {
        times.sort_by(f64::total_cmp);
        times[times.len() / 2]
    };
    let medians: Vec<f64> = times.iter_mut().map(median).collect();
    let mut measured = vec![Map::new(); all.len()];
    for (&i, &with) in kept.iter().zip(&medians[1..]) {
        let values = json!({
            "ms_frame": medians[0],
            "ms_frame_kept": with,
            "ms_saved": with - medians[0],
            "repetitions": REPETITIONS,
        });
        measured[i].extend(values.as_object().cloned().into_iter().flatten());
    }
    Ok(measured)
}
