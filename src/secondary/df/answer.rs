//! Occlusion and shadow rays that distance fields answer: of which maps, and when they are made.

use super::FieldSettings;
use super::maps::FieldMaps;
use crate::frame::Renderer;
use crate::kernels::FrameExecutor;
use crate::schedule::{ExecutorError, Lamp, Pass, PassStats, Step};
use crate::secondary::occupancy::Cascades;
use crate::secondary::roma::answer::Roma;
use bricks::SceneFile;
use std::sync::Arc;

/// The distance fields that the executor has.
#[derive(Default)]
pub struct Field {
    /// What they were made of.
    made: Option<Arc<Cascades>>,
}

impl Field {
    /// Look-ups of a ray of `pass` at most; `None` where rays are traced.
    pub fn steps_of(settings: &FieldSettings, pass: Pass) -> Option<u32> {
        match pass {
            Pass::Occlusion(_) => Some(settings.occlusion_steps),
            Pass::Shadow(Lamp::Sun | Lamp::Emitter) | Pass::BounceShadow(Lamp::Sun | Lamp::Emitter) => {
                Some(settings.shadow_steps)
            }
            _ => None,
        }
    }

    /// Has the executor take the fields of the base maps of `roma`; the step that makes them, unless it has made them.
    ///
    /// # Errors
    /// The executor's.
    pub fn prepare(
        &mut self,
        roma: &mut Roma,
        executor: &mut dyn FrameExecutor,
        scene: &Arc<SceneFile>,
        settings: &FieldSettings,
    ) -> Result<Option<Step>, ExecutorError> {
        let Some((cascades, frame)) = roma.base_maps(scene, settings.size)? else { return Ok(None) };
        executor.set_field(&FieldMaps::new(&cascades, &frame, settings))?;
        if self.made.as_ref().is_some_and(|made| Arc::ptr_eq(made, &cascades)) {
            return Ok(None);
        }
        self.made = Some(cascades);
        Ok(Some(Step::FieldMake))
    }
}

impl Renderer {
    /// Has fields answer the rays of `pass`, if settings ask for it, and `add`s the light that comes through; whether
    /// they did.
    pub(crate) fn add_by_field(&mut self, pass: Pass, add: Step, stats: &mut PassStats) -> Result<bool, ExecutorError> {
        let Some(settings) = self.settings.field else { return Ok(false) };
        let Some(steps) = Field::steps_of(&settings, pass) else { return Ok(false) };
        let make = self.field.prepare(&mut self.roma, &mut *self.executor, &self.scene, &settings)?;
        let steps: Vec<Step> =
            std::iter::once(Step::Generate).chain(make).chain([Step::FieldTrace { steps }, add]).collect();
        stats.add(self.executor.run(pass, &steps, &self.cache.states)?);
        Ok(true)
    }
}
