//! Rays that displacement fields answer: of which passes, by which fields.

use super::Options;
use super::carriers::Carriers;
use super::kernels::{ASKED, CARRIERS, FAMILY, NODES, sift};
use super::library::Library;
use crate::frame::{Displaced, Engine, FrameRecords, Plan, Secondary};
use crate::kernels::View;
use crate::kernels::frame::Frame;
use crate::kernels::layout::DisplacementOwn;
use crate::scene::Camera;
use crate::schedule::{ExecutorError, Lamp, Pass};
use crate::secondary::{EffectMethods, Method};
use serde_json::{Value, json};
use std::sync::Arc;

/// Of how many rays asked in a frame so much is left in the next.
const FADE: f64 = 0.5;
/// Fields are exchanged where that makes what they are worth so many times as much.
const GAIN: f64 = 1.1;

/// Rays answered by displacement fields.
pub struct Displacement {
    settings: Options,
    /// Which method answers the rays of which effect.
    chosen: EffectMethods,
    library: Library,
    /// Fields that the executor has; `None`: it has not been given any.
    held: Option<Vec<usize>>,
    /// Rays that asked each field, those of the last frames most.
    asked: Vec<f64>,
    /// The frame of what is rendered, and where carriers stand in it, once they do.
    frame: Option<Frame>,
    placed: Option<(Frame, Carriers)>,
    /// How often fields were exchanged.
    exchanges: u64,
    /// What the executor holds when all that is there is this one's.
    mark: Arc<()>,
}

impl Displacement {
    /// By the fields of `library`.
    pub fn new(settings: Options, chosen: EffectMethods, library: Library) -> Self {
        let asked = vec![0.0; library.fields.len()];
        Self {
            settings,
            chosen,
            library,
            held: None,
            asked,
            frame: None,
            placed: None,
            exchanges: 0,
            mark: Arc::default(),
        }
    }

    /// Whether fields answer the rays of a pass.
    fn answers(&self, pass: Pass) -> bool {
        let method = match pass {
            Pass::Occlusion(_) => self.chosen.ao,
            Pass::Diffuse(_) => self.chosen.diffuse,
            Pass::Shadow(lamp) | Pass::BounceShadow(lamp) | Pass::PathShadow(lamp) => match lamp {
                Lamp::Environment => self.chosen.environment,
                Lamp::Sun | Lamp::Emitter => self.chosen.shadow,
            },
            Pass::Primary | Pass::Glossy | Pass::Path(_) => return false,
        };
        method == Method::Displacement
    }

    /// Gives the executor what it lacks; what the kernel is told.
    fn give(&mut self, engine: &mut Engine) -> Result<DisplacementOwn, ExecutorError> {
        let Self { settings, library, .. } = self;
        // Another may have used the executor since.
        let held = engine.executor.held(&FAMILY);
        let mark = held.as_ref().and_then(|held| held.downcast_ref::<Arc<()>>());
        if mark.is_none_or(|mark| !Arc::ptr_eq(mark, &self.mark)) {
            *held = Some(Box::new(self.mark.clone()));
            (self.held, self.placed) = (None, None);
        }
        if self.held.is_none() {
            let chosen = library.most_useful(&self.asked, settings.memory);
            library.give(&engine.scene, &chosen, &mut *engine.executor)?;
            self.held = Some(chosen);
        }
        if let Some(frame) = self.frame
            && self.placed.as_ref().is_none_or(|(placed, _)| *placed != frame)
        {
            let carriers = Carriers::new(engine.scene.resident(), library, &frame);
            let executor = &mut *engine.executor;
            executor.reserve(&FAMILY, &[carriers.nodes.len(), carriers.carriers.len(), 0, 0, 0, 0])?;
            executor.write(&FAMILY, NODES, 0, bytemuck::cast_slice(&carriers.nodes));
            executor.write(&FAMILY, CARRIERS, 0, bytemuck::cast_slice(&carriers.carriers));
            self.placed = Some((frame, carriers));
        }
        let nodes = self.placed.as_ref().map_or(0, |(_, carriers)| carriers.nodes.len() as u32);
        let fields = self.library.fields.len() as u32;
        Ok(DisplacementOwn { fields, nodes, look: self.settings.look(), near: self.settings.near as f32 })
    }

    /// Exchanges fields for more useful ones, if not all are there.
    fn exchange(&mut self, engine: &mut Engine) -> Result<(), ExecutorError> {
        let count = self.library.fields.len();
        let Some(held) = self.held.as_ref().filter(|held| held.len() < count) else { return Ok(()) };
        let asked = engine.executor.read(&FAMILY, ASKED, count)?;
        engine.executor.write(&FAMILY, ASKED, 0, &vec![0; 4 * count]);
        for (sum, &rays) in self.asked.iter_mut().zip(&asked) {
            *sum = FADE * *sum + f64::from(rays);
        }
        let chosen = self.library.most_useful(&self.asked, self.settings.memory);
        let worth = |fields: &[usize]| -> f64 {
            fields.iter().map(|&number| self.asked[number] * self.library.fields[number].saved as f64).sum()
        };
        if worth(&chosen) > GAIN * worth(held) {
            self.library.give(&engine.scene, &chosen, &mut *engine.executor)?;
            self.held = Some(chosen);
            self.exchanges += 1;
        }
        Ok(())
    }
}

impl Secondary for Displacement {
    fn name(&self) -> &'static str {
        "displacement"
    }

    fn begin(&mut self, _: &Camera, view: &View) {
        self.frame = Some(view.frame);
    }

    fn before_camera_rays(&mut self, engine: &mut Engine, _: &mut FrameRecords, _: &View) -> Result<(), ExecutorError> {
        self.exchange(engine)
    }

    fn plan(&mut self, engine: &mut Engine, pass: Pass, plan: &mut Plan) -> Result<(), ExecutorError> {
        if self.answers(pass) {
            plan.before.push(sift(&self.give(engine)?));
        }
        Ok(())
    }

    fn scene_has_moved(&mut self, _: &Displaced) {
        self.placed = None;
    }

    fn report(&self) -> Vec<(&'static str, Value)> {
        let held = self.held.as_deref().unwrap_or_default();
        let bytes = |fields: &mut dyn Iterator<Item = usize>| -> u64 {
            fields.map(|number| self.library.fields[number].bytes).sum()
        };
        let of = &self.settings;
        let report = json!({
            "fields": self.library.fields.len(),
            "bytes": bytes(&mut (0..self.library.fields.len())),
            "fields_held": held.len(),
            "bytes_held": bytes(&mut held.iter().copied()),
            "exchanges": self.exchanges,
            "carriers": self.placed.as_ref().map(|(_, carriers)| carriers.carriers.len()),
            "memory": of.memory,
            "near": of.near as f32,
            "against": of.against.name(),
            "interpolate": of.interpolate.name(),
        });
        vec![("displacement", report)]
    }
}
