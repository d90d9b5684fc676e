//! The renderer that settings ask for.

use super::lighting::lighting;
use super::opened::Opened;
use crate::frame::{Budgeted, Effects, Engine, Light, Methods, Moved, Occlusion, RenderSettings, Renderer};
use crate::kernels::Lod;
use crate::picture::Exposure;
use crate::schedule::Tracing;
use crate::schedule::auto::Auto;
#[cfg(feature = "lab")]
use crate::schedule::fronts::Fronts;
#[cfg(feature = "lab")]
use crate::secondary::df::answer::Df;
use crate::secondary::displacement::{Displacement, Library};
use crate::secondary::roma::RomaSettings;
use crate::secondary::roma::answer::Roma;
use crate::secondary::{EffectMethods, Method};
use crate::session::Settings;
use crate::settings::{Length, Schedule};
use anyhow::Result;
use bricks::Resident;
use std::path::Path;

/// The renderer of the scene that `opened` has, the file `path`.
///
/// # Errors
/// Those of [`lighting`].
pub fn renderer(opened: Opened, path: &Path, settings: &Settings) -> Result<Renderer> {
    let light = lighting(settings, &opened.scene, path)?.light;
    Ok(lit_renderer(opened, settings, light))
}

/// The same with this light.
pub fn lit_renderer(opened: Opened, settings: &Settings, light: Light) -> Renderer {
    let Opened { scene, mut executor, cache, schedule, extent, .. } = opened;
    let settings = &settings.suited(&scene.resident().manifest);
    let render = render_settings(settings, schedule);
    if render.effects.has_bounces() {
        executor.allow_bounces();
    }
    let methods = methods(settings, scene.resident());
    let budgeted = render.budget.map(|_| Budgeted::new(scene.resident(), !settings.hides()));
    let engine = Engine {
        scene,
        executor,
        cache,
        settings: render,
        light,
        size: (settings.size.width, settings.size.height),
        band_rows: extent.height,
        only_rows: None,
        tile: extent.tile,
        #[cfg(feature = "lab")]
        fronts: settings.fronts.then(Fronts::default),
        budgeted,
        auto: Auto::default(),
        captures: None,
        answers: None,
        moved: Moved::default(),
    };
    Renderer { engine, methods }
}

/// The methods that answer secondary rays of a scene; a field of visibility is made or read later.
pub fn methods(settings: &Settings, resident: &Resident) -> Methods {
    methods_of(std::slice::from_ref(settings), resident)
}

/// The same of several settings, which differ in what answers which effects: the first of them that has a method for an
/// effect counts.
pub fn methods_of(parts: &[Settings], resident: &Resident) -> Methods {
    let mut methods = Methods::default();
    let chosen = parts.iter().fold(EffectMethods::EXACT, |all, part| all.over(part.secondary));
    let with = |method| parts.iter().find(move |part| part.secondary.has(method));
    if let Some(first) = with(Method::Roma).or(with(Method::Sift)) {
        let of = |part: &Settings| part.roma.settings(part.rsm.settings(), part.secondary);
        let all = parts.iter().map(of).reduce(RomaSettings::or).unwrap_or_else(|| of(first));
        methods.set(Roma::new(all, first.roma.bom));
    }
    #[cfg(feature = "lab")]
    if let Some(part) = with(Method::Df) {
        methods.set(Df::new(part.df.clone(), chosen, part.roma.bom));
    }
    if let Some(part) = with(Method::Displacement) {
        methods.set(Displacement::new(part.displacement.clone(), chosen, Library::of(resident)));
    }
    methods
}

/// Side of the finest base map of a method that has some, world units.
pub fn finest_cell(methods: &Methods) -> Option<f64> {
    methods.iter().find_map(|method| method.finest_cell())
}

/// How frames are rendered, with this schedule in force.
pub fn render_settings(settings: &Settings, schedule: Schedule) -> RenderSettings {
    RenderSettings {
        schedule,
        effects: effects(settings),
        samples: settings.samples(),
        noise: settings.noise,
        // Both halves of the seed count.
        seed: (settings.seed ^ (settings.seed >> 32)) as u32,
        tracing: Tracing { measure_needed: settings.measure_needed, optimisations: settings.optimisations() },
        aov: settings.aov,
        guides: settings.denoise || settings.taa,
        coverage: matches!(settings.exposure, Exposure::Auto { .. }),
        taa: settings.taa,
        lod: Lod { pixels: settings.lod as f32, blend: settings.lod_blend, ..Lod::default() },
        correct_one_in: settings.lod_correct.unwrap_or(0),
        only_chosen: false,
        budget: settings.frame_budget(),
        half_rate: false,
        clip: settings.clip.map(|plane| (plane.point, plane.normal.unit())),
    }
}

/// The effects of every frame.
pub fn effects(settings: &Settings) -> Effects {
    let all = settings.effects;
    let length = match settings.ao_length {
        Length::World(length) => length,
        // Of a scene that settings have not been suited to.
        Length::Auto => 1.0,
    };
    let occlusion = Occlusion { rays: settings.ao_rays, length };
    Effects {
        shadow: all.shadow,
        environment: all.environment,
        occlusion: (all.ao && !all.environment).then_some(occlusion),
        diffuse: all.diffuse.then_some(settings.diffuse_rays),
        glossy: all.glossy,
        bounces: settings.bounces.of(all),
        turn_degrees: settings.rotation.0,
    }
}
