//! Occlusion and shadow rays that distance fields answer: of which maps, and when they are made.

use super::Options;
use super::maps::DfMaps;
use crate::frame::{Displaced, Engine, Plan, Secondary};
use crate::kernels::View;
use crate::scene::Camera;
use crate::schedule::{ExecutorError, Lamp, Pass};
use crate::secondary::occupancy::{BaseMaps, Source};
use crate::secondary::{EffectMethods, Method};
use serde_json::{Value, json};

/// Rays answered by distance fields.
pub struct Df {
    settings: Options,
    /// Which method answers the rays of which effect.
    chosen: EffectMethods,
    /// The base maps.
    pub base: BaseMaps,
}

impl Df {
    /// With base maps that are made of `source`.
    pub fn new(settings: Options, chosen: EffectMethods, source: Source) -> Self {
        Self { settings, chosen, base: BaseMaps::new(source) }
    }

    /// Look-ups of a ray of `pass` at most; `None` where rays are traced.
    fn steps_of(&self, pass: Pass) -> Option<u32> {
        let (method, steps) = match pass {
            Pass::Occlusion(_) => (self.chosen.ao, self.settings.occlusion_steps()),
            Pass::Shadow(Lamp::Sun | Lamp::Emitter)
            | Pass::BounceShadow(Lamp::Sun | Lamp::Emitter)
            | Pass::PathShadow(Lamp::Sun | Lamp::Emitter) => (self.chosen.shadow, self.settings.shadow_steps()),
            _ => return None,
        };
        (method == Method::Df).then_some(steps)
    }
}

impl Secondary for Df {
    fn name(&self) -> &'static str {
        "df"
    }

    fn begin(&mut self, camera: &Camera, view: &View) {
        self.base.begin(camera.position, view);
    }

    fn plan(&mut self, engine: &mut Engine, pass: Pass, plan: &mut Plan) -> Result<(), ExecutorError> {
        let Some(steps) = self.steps_of(pass) else { return Ok(()) };
        let size = self.settings.size;
        let cascades = self.base.assemble(&engine.scene, size, size)?.clone();
        let Some(view) = self.base.view() else { return Ok(()) };
        let maps = DfMaps::new(&cascades, &view.frame, &self.settings);
        if maps.give(&mut *engine.executor)? {
            plan.before.extend(maps.make());
        }
        plan.before.push(maps.trace(steps));
        plan.is_whole = true;
        Ok(())
    }

    fn scene_has_moved(&mut self, _displaced: &Displaced) {
        self.base.scene_has_moved();
    }

    fn finest_cell(&self) -> Option<f64> {
        self.base.finest_cell()
    }

    fn report(&self) -> Vec<(&'static str, Value)> {
        let of = &self.settings;
        let report = json!({
            "bom": self.base.source().name(),
            "size": of.size,
            "steps": of.occlusion_steps(),
            "shadow_steps": of.shadow_steps(),
            "lift": of.lift,
            "hit": of.hit as f32,
            "finest_cell": self.finest_cell(),
        });
        vec![("df", report)]
    }
}
