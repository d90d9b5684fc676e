//! Rays of occlusion, to lamps and of diffuse light that occupancy maps answer: which maps, and when they are made.

use super::handover::{Handover, PILOTS, Trust};
use super::maps::RomaMaps;
use super::{Grid, LEAST_CELLS, LIFT, LONG_CELLS, Pilots, Role, RomaPart, RomaPass, RomaSettings, Sift};
use crate::frame::{Displaced, Effects, Engine, FrameRecords, Plan, Secondary};
use crate::kernels::View;
use crate::scene::Camera;
use crate::schedule::{ExecutorError, Lamp, Pass, Report, Step};
use crate::secondary::occupancy::{BaseMaps, BaseView, Bom, Cascades, Source};
use crate::secondary::rsm::answer::Rsm;
use bricks::{MATERIAL_UNLIT, SceneFile};
use serde_json::{Value, json};
use std::sync::Arc;

/// What ray-aligned maps were made of, in a frame.
struct Made {
    grid: Grid,
    levels: usize,
    sample: u32,
    cascades: Arc<Cascades>,
}

/// Rays answered by ray-aligned occupancy maps.
#[derive(Default)]
pub struct Roma {
    /// Which, and how; `None`: none.
    pub settings: Option<RomaSettings>,
    /// The base maps.
    pub base: BaseMaps,
    /// The reflective shadow maps that light what diffuse rays meet.
    pub rsm: Rsm,
    /// The ray-aligned maps that the executor was given last, of the present sample.
    maps: RomaMaps,
    made: Option<Made>,
    /// What was measured of the rays of ao, and of those from what is seen and from what that sees to lamps.
    handovers: [Handover; 3],
    /// Whether the pass at hand measures.
    is_measured: bool,
}

impl Roma {
    /// With base maps that are made of `source`.
    pub fn new(settings: RomaSettings, source: Source) -> Self {
        Self { settings: Some(settings), base: BaseMaps::new(source), ..Self::default() }
    }

    /// The ray-aligned maps that the executor was given last.
    pub fn maps(&self) -> &RomaMaps {
        &self.maps
    }

    /// Goes on with what another made of the same scene: base maps, and unless `is_cold` the maps of lamps.
    pub fn keep(&mut self, other: Self, is_cold: bool) {
        self.base = other.base;
        self.handovers = other.handovers;
        if !is_cold {
            self.rsm = other.rsm;
        }
    }

    /// What was measured of the rays of a pass that maps sift.
    fn handover(&mut self, pass: Pass) -> &mut Handover {
        let kind = match pass {
            Pass::Occlusion(_) => 0,
            Pass::BounceShadow(_) | Pass::PathShadow(_) => 2,
            _ => 1,
        };
        &mut self.handovers[kind]
    }

    /// Of rays of ao, of those from what is seen to lamps, and of those from what that sees.
    pub fn handovers(&self) -> &[Handover; 3] {
        &self.handovers
    }

    /// How the rays of `pass` are answered, whatever maps know of them; `None` where they are traced or
    /// [`Self::later`].
    fn pass_of(settings: &RomaSettings, pass: Pass) -> Option<RomaPass> {
        match pass {
            Pass::Occlusion(_) => settings.occlusion,
            Pass::Diffuse(_) => settings.diffuse,
            Pass::Shadow(Lamp::Sun | Lamp::Emitter)
            | Pass::BounceShadow(Lamp::Sun | Lamp::Emitter)
            | Pass::PathShadow(Lamp::Sun | Lamp::Emitter) => settings.shadow,
            _ => None,
        }
    }

    /// How those of the rays of `pass` are answered that start at the second hit of a path or at one after it, and that
    /// maps know.
    fn later(settings: &RomaSettings, pass: Pass, effects: &Effects) -> Option<RomaPass> {
        let is_later = match pass {
            Pass::Path(_) => true,
            Pass::BounceShadow(lamp) | Pass::PathShadow(lamp) => lamp != Lamp::Environment && effects.bounces > 1,
            _ => false,
        };
        settings.bounces.filter(|_| is_later && Self::pass_of(settings, pass).is_none())
    }

    /// What maps do for such rays. In a cell that is marked there may be something that lets a ray pass, and what maps of
    /// lamps know of a hit is what is lit by lamps that have one.
    fn later_part(&self, engine: &Engine, pass: Pass, roma: RomaPass) -> RomaPart {
        let RomaPass { grid, role, .. } = roma;
        let is_known = is_solid(engine) && (pass.is_any_hit() || (!shines(engine) && self.rsm.left_out() == [0; 2]));
        match role {
            Role::Answer if is_known => RomaPart::Known { near: LEAST_CELLS as u32 * grid.base_per_cell() },
            _ => RomaPart::Sift(Sift::default()),
        }
    }

    /// Has the executor take the maps of `pass` for rays that are `length` world units long at most, unless it has
    /// them; the step that then makes them. Levels are left out that such rays end in before they are off their
    /// surface. `is_lasting`: all samples of a frame share them.
    fn prepare(
        &mut self,
        engine: &mut Engine,
        pass: RomaPass,
        length: f64,
        is_lasting: bool,
    ) -> Result<Option<Step>, ExecutorError> {
        let Some(BaseView { frame, sample, seed, .. }) = self.base.view().copied() else { return Ok(None) };
        let sample = if is_lasting { 0 } else { sample };
        let grid = pass.grid;
        let cells = grid.base_cells();
        let cascades = self.base.assemble(&engine.scene, grid.size, cells)?.clone();
        let before = LIFT / grid.scale(cells);
        let is_of_use = |bom: &&Bom| before * bom.side() < length;
        let levels = cascades.levels.iter().take_while(is_of_use).count();
        let is_same = |made: &Made| {
            (made.grid, made.levels, made.sample) == (grid, levels, sample) && Arc::ptr_eq(&made.cascades, &cascades)
        };
        if self.made.as_ref().is_some_and(is_same) {
            return Ok(None);
        }
        self.maps = RomaMaps::new(&cascades, levels, &frame, pass, (sample, seed));
        self.maps.give(&mut *engine.executor, &cascades)?;
        self.made = Some(Made { grid, levels, sample, cascades });
        Ok(Some(self.maps.rotate()))
    }

    /// Whether rays of a length, world units, are too short for maps to help tracing them: what they meet is as near as
    /// what is overlooked.
    pub fn is_short(&mut self, scene: &SceneFile, length: f64) -> bool {
        self.base.brick_cell(scene).is_some_and(|cell| length < LEAST_CELLS * cell)
    }

    /// Whether rays of a length, world units, go so far that which way they go within a stratum counts for more than
    /// what cells add to things.
    fn is_long(&mut self, scene: &SceneFile, length: f64) -> bool {
        self.base.brick_cell(scene).is_some_and(|cell| length >= LONG_CELLS * cell)
    }
}

/// Whether no ray passes through any surface.
fn is_solid(engine: &Engine) -> bool {
    let manifest = &engine.scene.resident().manifest;
    !manifest.has_alpha_mask && !manifest.has_alpha_blend
}

/// Whether some surface shines by itself.
fn shines(engine: &Engine) -> bool {
    let resident = engine.scene.resident();
    resident.manifest.has_emission || resident.materials.iter().any(|m| m.flags & MATERIAL_UNLIT != 0)
}

impl Secondary for Roma {
    fn name(&self) -> &'static str {
        let passes = self.settings.map(|own| [own.occlusion, own.shadow, own.diffuse, own.bounces]).unwrap_or_default();
        if passes.iter().flatten().any(|pass| pass.role.is_help()) { "sift" } else { "roma" }
    }

    fn begin(&mut self, camera: &Camera, view: &View) {
        self.base.begin(camera.position, view);
        // Another may have used the executor between frames.
        self.made.take_if(|_| view.params.sample == 0);
    }

    fn before_camera_rays(
        &mut self,
        engine: &mut Engine,
        records: &mut FrameRecords,
        view: &View,
    ) -> Result<(), ExecutorError> {
        let Some(settings) = self.settings else { return Ok(()) };
        let effects = &engine.settings.effects;
        let is_lit = effects.bounces > 1 && effects.has_bounces() && is_solid(engine) && !shines(engine);
        let diffuse = settings.diffuse.filter(|_| effects.diffuse.is_some());
        let later = settings.bounces.filter(|pass| pass.role == Role::Answer && is_lit);
        let Some(RomaPass { grid, .. }) = diffuse.or(later) else { return Ok(()) };
        let cascades = self.base.assemble(&engine.scene, grid.size, grid.base_cells())?;
        self.rsm.prepare(engine, records, view, &settings.rsm, cascades)
    }

    fn plan(&mut self, engine: &mut Engine, pass: Pass, plan: &mut Plan) -> Result<(), ExecutorError> {
        self.is_measured = false;
        let Some(settings) = self.settings else { return Ok(()) };
        let later = Self::later(&settings, pass, &engine.settings.effects);
        if let Some(roma) = later.filter(|roma| roma.role == Role::Answer || !pass.is_any_hit()) {
            // They keep their own directions, whatever those of maps are.
            plan.before.extend(self.prepare(engine, roma, f64::INFINITY, true)?);
            let part = self.later_part(engine, pass, roma);
            if pass.is_any_hit() {
                plan.before.push(self.maps.trace(roma.steps, part));
            } else {
                plan.before.push(self.maps.trace_path(roma.steps, part));
                plan.light = if matches!(part, RomaPart::Known { .. }) { self.rsm.light() } else { Vec::new() };
            }
            return Ok(());
        }
        let Some(roma) = Self::pass_of(&settings, pass).or(later) else { return Ok(()) };
        let length = match (pass, engine.settings.effects.occlusion) {
            (Pass::Occlusion(_), Some(occlusion)) => occlusion.length,
            _ => f64::INFINITY,
        };
        let RomaPass { grid, steps, role } = roma;
        if role.is_help() && self.is_short(&engine.scene, length) {
            return Ok(());
        }
        plan.before.extend(self.prepare(engine, roma, length, later.is_some())?);
        let trust = match role {
            Role::Sift { most_wrong: Some(most_wrong) } => Some(self.handover(pass).trust(most_wrong)),
            _ => None,
        };
        let is_long = matches!(pass, Pass::Diffuse(_)) || self.is_long(&engine.scene, length);
        let maps = &self.maps;
        match role {
            Role::Answer => {
                plan.before.push(maps.trace(steps, RomaPart::answering(pass, steps, is_long)));
                plan.is_whole = true;
                plan.light = self.rsm.light();
            }
            Role::Correct(one_in) => {
                plan.before.push(maps.pilots(one_in));
                plan.after.push(maps.trace(steps, RomaPart::Correct { one_in }));
            }
            Role::Sift { most_wrong: None } => plan.before.push(maps.trace(steps, RomaPart::Sift(Sift::default()))),
            Role::Sift { most_wrong: Some(_) } => {
                let trust = trust.unwrap_or(Trust::Nothing);
                let near = match trust {
                    Trust::Beyond(cells) => Some(cells * grid.base_per_cell()),
                    Trust::Free | Trust::Nothing => None,
                };
                if trust != Trust::Nothing {
                    plan.before.push(maps.trace(steps, RomaPart::Sift(Sift { near, pilots: PILOTS })));
                }
                plan.after.push(maps.measure(steps, PILOTS, grid.base_per_cell()));
                if near.is_some() {
                    plan.after.push(maps.trace(steps, RomaPart::Far));
                }
                self.is_measured = true;
            }
        }
        Ok(())
    }

    fn learn(&mut self, pass: Pass, report: &Report) {
        if self.is_measured {
            self.handover(pass).note(Pilots::of(report));
        }
    }

    fn scene_has_moved(&mut self, displaced: &Displaced) {
        self.base.scene_has_moved();
        self.rsm.scene_has_moved(displaced.touched);
    }

    fn finest_cell(&self) -> Option<f64> {
        self.base.finest_cell()
    }

    fn report(&self) -> Vec<(&'static str, Value)> {
        let of = |roma: &RomaSettings| {
            let RomaSettings { occlusion, shadow, diffuse, bounces, .. } = *roma;
            let [role, shadow_role] = [occlusion, shadow].map(|pass| pass.map(|pass| pass.role));
            let [k, shadow_k, diffuse_k] = [occlusion, shadow, diffuse].map(|pass| pass.map(|pass| pass.grid.k));
            let [steps, shadow_steps, diffuse_steps] =
                [occlusion, shadow, diffuse].map(|pass| pass.map(|pass| pass.steps));
            let most_wrong =
                |role| if let Role::Sift { most_wrong: Some(n) } = role { 1e-6 * f64::from(n) } else { 0.0 };
            let first = occlusion.or(shadow).or(diffuse).or(bounces);
            json!({
                "bom": self.base.source().name(),
                "k": k,
                "shadow_k": shadow_k,
                "size": first.map(|pass| pass.grid.size),
                "samples": first.map(|pass| pass.grid.samples),
                "steps": steps,
                "shadow_steps": shadow_steps,
                "diffuse_k": diffuse_k,
                "diffuse_steps": diffuse_steps,
                "bounces_k": bounces.map(|pass| pass.grid.k),
                "bounces_steps": bounces.map(|pass| pass.steps),
                "one_in": if let Some(Role::Correct(one_in)) = role { one_in } else { 1 },
                "most_wrong": role.or(shadow_role).map_or(0.0, most_wrong),
                "ao_handover": role.map(|role| self.handovers[0].report(role)),
                "shadow_handover": shadow_role.map(|role| self.handovers[1].report(role)),
                "finest_cell": self.finest_cell(),
            })
        };
        let rsm = self.rsm.report().map(|report| ("rsm", report));
        self.settings.as_ref().map(|roma| ("roma", of(roma))).into_iter().chain(rsm).collect()
    }
}
