//! What a method of secondary visibility is to the frame loop.
//!
//! A method says, pass by pass, which kernels run before and after rays are traced and which rays they answer, and
//! learns from what came of it. It may have passes of its own in a frame. All of a method lies in one folder of
//! [`crate::secondary`]; the frame loop knows this trait and no method.

use super::{Engine, FrameRecords};
use crate::counters::Names;
use crate::kernels::View;
use crate::scene::Camera;
use crate::schedule::{ExecutorError, Pass, Report, Step};
use bricks::SceneFile;
use glam::DVec3;
use serde_json::Value;
use std::any::Any;
use std::sync::Arc;

/// How the rays of a pass are made, answered and used.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Makes the rays.
    pub generate: Step,
    /// Run after that, before rays are traced: rays that these answer are not.
    pub before: Vec<Step>,
    /// Whether they answer all rays: none is traced, and no brick is asked for.
    pub is_whole: bool,
    /// Run after rays have been traced.
    pub after: Vec<Step>,
    /// Adds the light that rays bring, of passes whose hits are not shaded.
    pub add: Step,
    /// Where all rays are answered and their hits are lit: what does that, in place of rays to lamps.
    pub light: Vec<Step>,
    /// The methods that have a part in this.
    pub methods: Names,
}

impl Plan {
    /// All rays of a pass are traced.
    pub fn exact(pass: Pass) -> Self {
        let add = if matches!(pass, Pass::Occlusion(_)) { Step::AddOcclusion } else { Step::AddLight };
        let (before, after, light) = (Vec::new(), Vec::new(), Vec::new());
        Self { generate: Step::Generate, before, is_whole: false, after, add, light, methods: Names::default() }
    }

    /// Makes the rays and runs what comes before tracing.
    pub fn first(&self) -> Vec<Step> {
        std::iter::once(self.generate).chain(self.before.iter().copied()).collect()
    }
}

/// What stands elsewhere than when the scene was opened.
pub struct Displaced<'a> {
    /// The scene as it was opened.
    pub still: &'a Arc<SceneFile>,
    /// Instances that stand elsewhere now, ascending.
    pub instances: &'a [u32],
    /// What was in some of these boxes then is in others of them now, world units.
    pub boxes: &'a [[DVec3; 2]],
    /// The boxes of what has moved since the frame before, before and after, world units.
    pub touched: &'a [[DVec3; 2]],
}

/// A method of secondary visibility.
pub trait Secondary: Any {
    /// What `--secondary` calls it.
    fn name(&self) -> &'static str;

    /// Begins a sample of a frame.
    fn begin(&mut self, _camera: &Camera, _view: &View) {}

    /// Passes of its own in a frame's first sample, before camera rays are traced.
    ///
    /// # Errors
    /// A brick that cannot be read, or the device's.
    fn before_camera_rays(
        &mut self,
        _engine: &mut Engine,
        _records: &mut FrameRecords,
        _view: &View,
    ) -> Result<(), ExecutorError> {
        Ok(())
    }

    /// The same after they have been.
    ///
    /// # Errors
    /// A brick that cannot be read, or the device's.
    fn after_camera_rays(
        &mut self,
        _engine: &mut Engine,
        _records: &mut FrameRecords,
        _view: &View,
    ) -> Result<(), ExecutorError> {
        Ok(())
    }

    /// Says what it does for the rays of a pass, which is about to begin; nothing where they are none of its own.
    ///
    /// # Errors
    /// Data that cannot be read, or the device's.
    fn plan(&mut self, engine: &mut Engine, pass: Pass, plan: &mut Plan) -> Result<(), ExecutorError>;

    /// Is told what the steps after tracing the rays of a pass reported.
    fn learn(&mut self, _pass: Pass, _report: &Report) {}

    /// Notes that instances have moved.
    fn scene_has_moved(&mut self, _displaced: &Displaced) {}

    /// Side of the finest cells that it knows, world units: shorter rays it tells nothing of.
    fn finest_cell(&self) -> Option<f64> {
        None
    }

    /// What summaries tell of it, by name.
    fn report(&self) -> Vec<(&'static str, Value)> {
        Vec::new()
    }
}

/// The methods of a renderer, at most one of each kind; each answers other rays.
#[derive(Default)]
pub struct Methods(Vec<Box<dyn Secondary>>);

impl Methods {
    /// All of them.
    pub fn iter(&self) -> impl Iterator<Item = &dyn Secondary> {
        self.0.iter().map(|method| &**method)
    }

    /// All of them.
    pub fn iter_mut(&mut self) -> impl Iterator<Item = &mut Box<dyn Secondary>> {
        self.0.iter_mut()
    }

    /// The method of a kind.
    pub fn get<M: Secondary>(&self) -> Option<&M> {
        self.0.iter().find_map(|method| (&**method as &dyn Any).downcast_ref())
    }

    /// The method of a kind.
    pub fn get_mut<M: Secondary>(&mut self) -> Option<&mut M> {
        self.0.iter_mut().find_map(|method| (&mut **method as &mut dyn Any).downcast_mut())
    }

    /// Takes a method, in place of the one of its kind.
    pub fn set<M: Secondary>(&mut self, method: M) {
        self.remove::<M>();
        self.0.push(Box::new(method));
    }

    /// Gives the method of a kind away.
    pub fn remove<M: Secondary>(&mut self) -> Option<M> {
        let index = self.0.iter().position(|method| (&**method as &dyn Any).is::<M>())?;
        let method: Box<dyn Any> = self.0.swap_remove(index);
        method.downcast().ok().map(|method| *method)
    }

    /// How the rays of a pass are answered.
    pub(super) fn plan(&mut self, engine: &mut Engine, pass: Pass) -> Result<Plan, ExecutorError> {
        let mut plan = Plan::exact(pass);
        for method in &mut self.0 {
            let before = (plan.before.len(), plan.is_whole);
            method.plan(engine, pass, &mut plan)?;
            if (plan.before.len(), plan.is_whole) != before {
                plan.methods.push(method.name());
            }
        }
        Ok(plan)
    }

    /// Tells all what was reported.
    pub(super) fn learn(&mut self, pass: Pass, report: &Report) {
        self.0.iter_mut().for_each(|method| method.learn(pass, report));
    }
}
