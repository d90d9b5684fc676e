//! What rendering needs of all there is, what it leaves out, why, and what that saves.

use super::opened::Opened;
use super::renderer::lit_renderer;
use crate::frame::{FrameWatch, Light, RenderError, Renderer};
use crate::kernels::layout::{GBuffer, Hit, Ray, Surface};
use crate::kernels::shade::more;
use crate::kernels::{Keep, layer_tables, opacity, reflectance};
use crate::scene::Camera;
use crate::secondary::Method;
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
/// Bytes of a pixel of depth, normal, id and albedo.
const AOV_BYTES: u64 = 4 + 12 + 4 + 12;

/// How a thing that is left out is kept.
#[derive(Clone, Copy, Debug)]
enum Keeper {
    /// In kernels, and in what they work on.
    Kernels(fn(&mut Keep)),
    /// In a renderer that has been opened.
    Renderer(fn(&mut Renderer)),
}

/// Something that rendering may need.
#[derive(Clone, Debug)]
pub struct Component {
    what: &'static str,
    /// Whether it is there.
    is_in: bool,
    why: String,
    /// Where it is decided.
    how: How,
    /// Bytes that it takes, or would take, where that is known.
    bytes: Option<u64>,
    /// What keeps it, where it can be kept.
    keep: Option<Keeper>,
}

/// Where it is decided that a component is left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum How {
    /// When kernels are built, or chosen: nothing of it is there.
    Kernels,
    /// As kernels run: a branch that all rays take alike.
    Branch,
    /// Before a pass or a frame: it is not started, and nothing is allocated for it.
    Start,
}

impl How {
    fn name(self) -> &'static str {
        match self {
            Self::Kernels => "kernels are without it",
            Self::Branch => "kernels branch around it",
            Self::Start => "it is not started",
        }
    }
}

/// All that a frame of `renderer` with `settings` may need.
pub fn components(renderer: &mut Renderer, settings: &Settings) -> Vec<Component> {
    let has_short_rays = has_short_rays(renderer);
    let can = renderer.executor.leaves_out();
    let resident = renderer.scene.resident();
    let (manifest, effects) = (&resident.manifest, renderer.settings.effects);
    let rays = renderer.rays() as u64;
    let pixels = u64::from(renderer.size.0) * u64::from(renderer.size.1);
    let (cache, all) = (renderer.cache.residency.budget_bytes(), renderer.cache.sizes.sum());
    let of = |is_in: bool, what, [why_in, why_out]: [&str; 2], how, bytes| Component {
        what,
        is_in,
        why: if is_in { why_in } else { why_out }.into(),
        how,
        bytes,
        keep: None,
    };
    let by = |leaves_out: bool| if leaves_out { How::Kernels } else { How::Branch };
    let mut list = Vec::new();
    let fits = ["the cache does not hold every brick and tile", "the cache holds every brick and tile"];
    list.push(Component {
        keep: Some(Keeper::Kernels(|keep| keep.queries = true)),
        ..of(cache < all, "queries for missing bricks", fits, How::Start, None)
    });
    let textures = ["materials have textures", "no material has a texture"];
    let texture_bytes = Some(renderer.executor.texture_bytes()).filter(|&bytes| bytes > 0);
    list.push(Component {
        keep: Some(Keeper::Kernels(|keep| keep.textures = true)),
        ..of(manifest.has_textures, "texture lookups", textures, by(can.textures), texture_bytes)
    });
    let alpha = ["rays pass through some triangles", "no ray passes through a triangle"];
    list.push(Component {
        keep: Some(Keeper::Kernels(|keep| keep.opacity = true)),
        ..of(opacity::is_needed(resident), "alpha tests in traversal", alpha, by(can.opacity), None)
    });
    let gloss = ["some surfaces are not Lambertian", "every surface is Lambertian"];
    list.push(Component {
        keep: Some(Keeper::Kernels(|keep| keep.gloss = true)),
        ..of(reflectance::is_needed(resident), "reflections other than diffuse ones", gloss, by(can.gloss), None)
    });
    let layers = ["some surfaces have layers or further textures", "no surface has layers or further textures"];
    let has_more = more::is_needed(resident);
    let of_hits = has_more.then_some(2 * rays * size_of::<GBuffer>() as u64);
    list.push(of(layer_tables::is_needed(resident), "layers of materials", layers, by(can.gloss), of_hits));
    let instances = ["instances place objects", "everything is baked into the world"];
    list.push(of(manifest.has_instances, "instance transforms", instances, How::Branch, None));
    let wide = ["some bricks are far from their object's origin", "every brick is near"];
    list.push(of(manifest.has_wide_bricks, "two-part vertices", wide, How::Branch, None));
    let has_levels = renderer.settings.lod.pixels > 0.0 && !resident.levels.is_empty();
    let cones = ["--lod selects levels by them", "--lod is 0, or the scene has no levels"];
    list.push(of(has_levels, "ray cones and levels of detail", cones, How::Kernels, None));
    let emitters = ["lamps or surfaces shine", "nothing but the sun and the sky shines"];
    list.push(of(!renderer.light.lamps.emitters().is_empty(), "rays to emitters", emitters, How::Start, None));
    let environment = ["an environment lights the scene", "no environment lights the scene by rays"];
    list.push(of(renderer.draws_environment(), "rays to an environment", environment, How::Start, None));
    let bounces = ["--effects has diffuse or glossy", "--effects has neither diffuse nor glossy"];
    let of_rays = rays * (size_of::<Ray>() + size_of::<Hit>() + size_of::<Surface>() + size_of::<GBuffer>()) as u64;
    list.push(Component {
        keep: Some(Keeper::Renderer(|renderer| renderer.executor.allow_bounces())),
        ..of(effects.has_bounces(), "rays from hits of rays", bounces, How::Start, Some(of_rays))
    });
    let aov = ["--aov asks for them", "--aov does not ask for them"];
    list.push(Component {
        keep: Some(Keeper::Renderer(|renderer| renderer.settings.aov = true)),
        ..of(settings.aov, "depth, normals, ids, albedo", aov, How::Start, Some(pixels * AOV_BYTES))
    });
    let denoiser = ["--denoise asks for it", "--denoise does not ask for it"];
    list.push(of(settings.denoise, "denoiser", denoiser, How::Start, None));
    let taa = ["--taa asks for it", "--taa does not ask for it"];
    list.push(of(settings.taa, "temporal anti-aliasing", taa, How::Start, None));
    for &method in Method::ALL.iter().filter(|method| !matches!(method, Method::Exact | Method::Auto)) {
        let is_in = settings.secondary.has(method);
        let why = match method {
            Method::Displacement if resident.displacement.is_empty() => "the scene has none",
            Method::Roma | Method::Sift if is_in && has_short_rays => "its rays are shorter than three cells of bricks",
            _ if is_in => "--secondary asks for it",
            _ if settings.secondary.has(Method::Auto) => "secondary_auto says what is chosen, and why",
            _ => "--secondary does not ask for it",
        };
        let is_in = is_in && !has_short_rays && !(method == Method::Displacement && resident.displacement.is_empty());
        list.push(of(is_in, named(method), [why, why], How::Start, None));
    }
    list
}

/// What a method is made of.
fn named(method: Method) -> &'static str {
    match method.name() {
        "roma" => "occupancy maps",
        "sift" => "occupancy maps for ao",
        "df" => "distance fields",
        "dvf" => "a field of visibility",
        _ => "displacement fields",
    }
}

/// Whether maps would have spared rays of ao that are too short for it.
fn has_short_rays(renderer: &mut Renderer) -> bool {
    let Renderer { engine, methods } = renderer;
    let Some(roma) = methods.get_mut::<Roma>() else { return false };
    let is_help = roma.settings.is_some_and(|settings| settings.occlusion.is_some_and(|pass| pass.role.is_help()));
    let length = engine.settings.effects.occlusion.map(|occlusion| occlusion.length);
    is_help && length.is_some_and(|length| roma.is_short(&engine.scene, length))
}

/// Those that are there, or those that are left out, as the summary lists them; with what `measured` found of each.
pub fn listed(all: &[Component], is_in: bool, measured: &[Map<String, Value>]) -> Vec<Value> {
    let one = |(i, one): (usize, &Component)| {
        let mut entry = Map::new();
        entry.insert("what".into(), one.what.into());
        entry.insert("why".into(), one.why.clone().into());
        if !one.is_in {
            entry.insert("how".into(), one.how.name().into());
        }
        entry.extend(one.bytes.map(|bytes| ("bytes".to_owned(), bytes.into())));
        entry.extend(measured.get(i).cloned().into_iter().flatten());
        Value::Object(entry)
    };
    all.iter().enumerate().filter(|(_, one)| one.is_in == is_in).map(one).collect()
}

/// What a frame takes as it is, and with everything that can be kept.
#[derive(Clone, Debug, Default)]
pub struct Measured {
    /// Of each component.
    pub each: Vec<Map<String, Value>>,
    /// Of all together.
    pub together: Value,
}

/// What a frame of `camera`, of the scene in the file `path`, takes as it is rendered, with each of `all` kept, and
/// with all of them, turn by turn: medians of the milliseconds of five frames each, after one that is not counted.
/// Nothing is stated of what kernels decide as they run, nor where `watch` says that it is to come to an end.
///
/// # Errors
/// The device's.
pub fn measure(
    all: &[Component],
    scene: &Arc<SceneFile>,
    path: &Path,
    settings: &Settings,
    light: &Light,
    camera: &Camera,
    watch: &mut dyn FrameWatch,
) -> Result<Measured> {
    let settings = Settings { requests_out: None, ..settings.clone() };
    let open = |keepers: &[Keeper]| -> Result<Renderer> {
        let mut keep = Keep::default();
        for keeper in keepers {
            if let Keeper::Kernels(set) = keeper {
                set(&mut keep);
            }
        }
        let opened = Opened::open_keeping(scene.clone(), path, &settings, keep)?;
        let mut renderer = lit_renderer(opened, &settings, light.clone());
        for keeper in keepers {
            if let Keeper::Renderer(set) = keeper {
                set(&mut renderer);
            }
        }
        Ok(renderer)
    };
    let mut renderers = vec![open(&[])?];
    let can = renderers[0].executor.leaves_out();
    let can_keep = |keeper: &Keeper| match keeper {
        Keeper::Kernels(set) => {
            let mut keep = Keep::default();
            set(&mut keep);
            keep.is_part_of(can)
        }
        Keeper::Renderer(_) => true,
    };
    let keeper = |one: &Component| one.keep.filter(|keeper| !one.is_in && can_keep(keeper));
    let kept: Vec<(usize, Keeper)> = (0..).zip(all).filter_map(|(i, one)| Some((i, keeper(one)?))).collect();
    let every: Vec<Keeper> = kept.iter().map(|(_, keeper)| *keeper).collect();
    for keepers in every.chunks(1).chain([&every[..]]) {
        if !watch.passes(0, 1) {
            return Ok(Measured::default());
        }
        renderers.push(open(keepers)?);
    }
    let mut times = vec![Vec::new(); renderers.len()];
    let mut pictures = vec![Vec::new(); renderers.len()];
    for repetition in 0..=REPETITIONS {
        for ((renderer, times), picture) in renderers.iter_mut().zip(&mut times).zip(&mut pictures) {
            let start = Instant::now();
            let output = match renderer.frame_watched(0, camera, &[], watch) {
                Err(RenderError::Interrupted) => return Ok(Measured::default()),
                output => output?,
            };
            if repetition > 0 {
                times.push(start.elapsed().as_secs_f64() * 1e3);
            }
            *picture = output.pixels.radiance;
        }
    }
    let median = |times: &mut Vec<f64>| {
        times.sort_by(f64::total_cmp);
        times[times.len() / 2]
    };
    let medians: Vec<f64> = times.iter_mut().map(median).collect();
    let of = |index: usize| {
        json!({
            "ms_frame": medians[0],
            "ms_frame_kept": medians[index],
            "ms_saved": medians[index] - medians[0],
            "same_picture": pictures[index] == pictures[0],
            "repetitions": REPETITIONS,
        })
    };
    let mut each = vec![Map::new(); all.len()];
    for (at, &(i, _)) in kept.iter().enumerate() {
        each[i].extend(of(at + 1).as_object().cloned().into_iter().flatten());
    }
    let mut together = of(kept.len() + 1);
    together["bytes_saved"] = kept.iter().filter_map(|&(i, _)| all[i].bytes).sum::<u64>().into();
    Ok(Measured { each, together })
}
