//! Rays of occlusion, to lamps and of diffuse light that occupancy maps answer: which maps, and when they are made.

use super::handover::{Handover, PILOTS, Trust};
use super::maps::RomaMaps;
use super::{Grid, LEAST_CELLS, LIFT, LONG_CELLS, Pilots, Role, RomaPart, RomaPass, RomaSettings, Sift};
use crate::frame::{Displaced, Engine, FrameRecords, Plan, Secondary};
use crate::kernels::View;
use crate::scene::Camera;
use crate::schedule::{ExecutorError, Lamp, Pass, Report, Step};
use crate::secondary::occupancy::{BaseMaps, BaseView, Bom, Source};
use crate::secondary::rsm::answer::Rsm;
use bricks::SceneFile;
use serde_json::{Value, json};

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
    made: Option<(Grid, Role, usize)>,
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

    /// How the rays of `pass` are answered; `None` where they are traced.
    pub fn pass_of(settings: &RomaSettings, pass: Pass) -> Option<RomaPass> {
        match pass {
            Pass::Occlusion(_) => settings.occlusion,
            Pass::Diffuse(_) => settings.diffuse,
            Pass::Shadow(Lamp::Sun | Lamp::Emitter)
            | Pass::BounceShadow(Lamp::Sun | Lamp::Emitter)
            | Pass::PathShadow(Lamp::Sun | Lamp::Emitter) => settings.shadow,
            _ => None,
        }
    }

    /// Has the executor take the maps of `pass` for rays that are `length` world units long at most, unless it has
    /// them; the step that then makes them. Levels are left out that such rays end in before they are off their
    /// surface.
    fn prepare(&mut self, engine: &mut Engine, pass: RomaPass, length: f64) -> Result<Option<Step>, ExecutorError> {
        let Some(BaseView { frame, sample, seed, .. }) = self.base.view().copied() else { return Ok(None) };
        let RomaPass { grid, role, .. } = pass;
        let cells = grid.base_cells();
        let cascades = self.base.assemble(&engine.scene, grid.size, cells)?.clone();
        let before = LIFT / grid.scale(cells);
        let is_of_use = |bom: &&Bom| before * bom.side() < length;
        let levels = cascades.levels.iter().take_while(is_of_use).count();
        if self.made == Some((grid, role, levels)) {
            return Ok(None);
        }
        self.maps = RomaMaps::new(&cascades, levels, &frame, pass, (sample, seed));
        self.maps.give(&mut *engine.executor, &cascades)?;
        self.made = Some((grid, role, levels));
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

impl Secondary for Roma {
    fn name(&self) -> &'static str {
        let passes = self.settings.map(|own| [own.occlusion, own.shadow, own.diffuse]).unwrap_or_default();
        if passes.iter().flatten().any(|pass| pass.role.is_help()) { "sift" } else { "roma" }
    }

    fn begin(&mut self, camera: &Camera, view: &View) {
        self.base.begin(camera.position, view);
        self.made = None;
    }

    fn before_camera_rays(
        &mut self,
        engine: &mut Engine,
        records: &mut FrameRecords,
        view: &View,
    ) -> Result<(), ExecutorError> {
        let diffuse = self.settings.and_then(|settings| Some((settings.rsm, settings.diffuse?)));
        let Some((settings, diffuse)) = diffuse.filter(|_| engine.settings.effects.diffuse.is_some()) else {
            return Ok(());
        };
        let cascades = self.base.assemble(&engine.scene, diffuse.grid.size, diffuse.grid.base_cells())?;
        self.rsm.prepare(engine, records, view, &settings, cascades)
    }

    fn plan(&mut self, engine: &mut Engine, pass: Pass, plan: &mut Plan) -> Result<(), ExecutorError> {
        self.is_measured = false;
        let Some(roma) = self.settings.and_then(|settings| Self::pass_of(&settings, pass)) else { return Ok(()) };
        let length = match (pass, engine.settings.effects.occlusion) {
            (Pass::Occlusion(_), Some(occlusion)) => occlusion.length,
            _ => f64::INFINITY,
        };
        let RomaPass { grid, steps, role } = roma;
        if role.is_help() && self.is_short(&engine.scene, length) {
            return Ok(());
        }
        plan.before.extend(self.prepare(engine, roma, length)?);
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
            let RomaSettings { occlusion, shadow, diffuse, .. } = *roma;
            let [role, shadow_role] = [occlusion, shadow].map(|pass| pass.map(|pass| pass.role));
            let [k, shadow_k, diffuse_k] = [occlusion, shadow, diffuse].map(|pass| pass.map(|pass| pass.grid.k));
            let [steps, shadow_steps, diffuse_steps] =
                [occlusion, shadow, diffuse].map(|pass| pass.map(|pass| pass.steps));
            let most_wrong =
                |role| if let Role::Sift { most_wrong: Some(n) } = role { 1e-6 * f64::from(n) } else { 0.0 };
            let first = occlusion.or(shadow).or(diffuse);
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
