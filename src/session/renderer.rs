//! The renderer that settings ask for.

use super::engine::Engine;
use super::lighting::lighting;
use crate::frame::{Effects, Light, Moved, Occlusion, RenderSettings, Renderer, Schedule};
use crate::schedule::Tracing;
use crate::schedule::auto::Auto;
use crate::schedule::fronts::Fronts;
use crate::secondary::df::answer::Field;
use crate::secondary::dvf::answer::Dvf;
use crate::secondary::roma::answer::Roma;
use crate::secondary::rsm::answer::Rsm;
use crate::settings::{Secondary, Settings};
use anyhow::Result;
use std::path::Path;

/// The renderer of the scene that `engine` has, the file `path`.
///
/// # Errors
/// Those of [`lighting`].
pub fn renderer(engine: Engine, path: &Path, settings: &Settings) -> Result<Renderer> {
    let light = lighting(settings, &engine.scene, path)?.light;
    Ok(lit_renderer(engine, settings, light))
}

/// The same with this light.
pub fn lit_renderer(engine: Engine, settings: &Settings, light: Light) -> Renderer {
    let Engine { scene, mut executor, cache, schedule, extent, .. } = engine;
    let render = render_settings(settings, schedule);
    if render.effects.has_bounces() {
        executor.allow_bounces();
    }
    Renderer {
        scene,
        executor,
        cache,
        settings: render,
        light,
        size: (extent.width, extent.height),
        tile: extent.tile,
        fronts: settings.fronts.then(Fronts::default),
        auto: Auto::default(),
        captures: None,
        moved: Moved::default(),
        roma: Roma::new(settings.roma.bom),
        field: Field::default(),
        rsm: Rsm::default(),
        dvf: Dvf::default(),
    }
}

/// How frames are rendered, with this schedule in force.
pub fn render_settings(settings: &Settings, schedule: Schedule) -> RenderSettings {
    let is_auto = settings.secondary == Secondary::Auto;
    let has_maps = is_auto || settings.secondary == Secondary::Roma;
    RenderSettings {
        schedule,
        effects: effects(settings),
        samples: settings.spp,
        // Both halves of the seed count.
        seed: (settings.seed ^ (settings.seed >> 32)) as u32,
        tracing: Tracing { measure_needed: settings.measure_needed, optimisations: settings.optimisations() },
        aov: settings.aov,
        guides: settings.denoise || settings.taa,
        taa: settings.taa,
        tile_bytes: settings.interactive,
        roma: has_maps.then(|| settings.roma.settings(settings.rsm.settings(), is_auto)),
        field: (settings.secondary == Secondary::Df).then(|| settings.df.settings()),
    }
}

/// The effects of every frame.
pub fn effects(settings: &Settings) -> Effects {
    let all = settings.effects;
    let occlusion = Occlusion { rays: settings.ao_rays, length: settings.ao_length };
    Effects {
        shadow: all.shadow,
        environment: all.environment,
        occlusion: (all.ao && !all.environment).then_some(occlusion),
        diffuse: all.diffuse.then_some(settings.diffuse_rays),
        glossy: all.glossy,
        turn_degrees: settings.rotation.0,
    }
}
