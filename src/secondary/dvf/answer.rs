//! Which rays of frames a field of visibility answers.

use super::maps::DvfMaps;
use super::plan::Renewal;
use super::renew::{Marked, renew};
use super::{DvfField, DvfUse, kernels};
use crate::frame::{Displaced, Engine, FrameRecords, Plan, Secondary};
use crate::kernels::View;
use crate::kernels::frame::Frame;
use crate::scene::Camera;
use crate::schedule::{ExecutorError, Lamp, Pass};
use std::sync::Arc;

/// The field of visibility of a walk.
#[derive(Default)]
pub struct Dvf {
    field: Option<Arc<DvfField>>,
    /// The same, with what has moved since it was made; `None`: nothing has.
    marked: Option<Marked>,
    renewal: Option<Renewal>,
    how: DvfUse,
    frame: Option<Frame>,
    sample: u32,
}

impl Dvf {
    /// Has `field` answer the rays to the environment.
    pub fn new(field: Arc<DvfField>, how: DvfUse) -> Self {
        Self { field: Some(field), how, ..Self::default() }
    }

    /// Has cells that what moves concerns be made anew; the field is that of the renewal.
    pub fn renewed_by(self, renewal: Renewal) -> Self {
        Self { renewal: Some(renewal), ..self }
    }

    /// The field.
    pub fn field(&self) -> Option<&Arc<DvfField>> {
        self.field.as_ref()
    }

    /// The field with what has moved, where something has.
    pub fn moved_field(&self) -> Option<&DvfField> {
        self.marked.as_ref().map(|marked| &*marked.field)
    }

    /// The cells of it that have been made anew since, ascending.
    pub fn renewed_cells(&self) -> impl Iterator<Item = u32> {
        self.marked.iter().flat_map(|marked| marked.renewed.iter().copied())
    }

    /// Whether the rays of `pass` are made and light is added as in the paper.
    fn is_paper(&self, pass: Pass) -> bool {
        self.how.paper && self.field.is_some() && pass == Pass::Shadow(Lamp::Environment)
    }
}

impl Secondary for Dvf {
    fn name(&self) -> &'static str {
        "dvf"
    }

    fn begin(&mut self, _camera: &Camera, view: &View) {
        (self.frame, self.sample) = (Some(view.frame), view.params.sample);
    }

    fn after_camera_rays(
        &mut self,
        engine: &mut Engine,
        records: &mut FrameRecords,
        view: &View,
    ) -> Result<(), ExecutorError> {
        let (Some(renewal), Some(marked)) = (&self.renewal, &mut self.marked) else { return Ok(()) };
        renew(engine, records, view, renewal, marked, (self.field.as_ref(), self.how))
    }

    fn plan(&mut self, engine: &mut Engine, pass: Pass, plan: &mut Plan) -> Result<(), ExecutorError> {
        let is_of_pass = pass.lamp() == Some(Lamp::Environment);
        let (Some(field), Some(frame), true) = (&self.field, &self.frame, is_of_pass) else { return Ok(()) };
        let how = DvfUse { paper: self.is_paper(pass), ..self.how };
        let field = self.marked.as_ref().map_or(field, |marked| &marked.field);
        DvfMaps::to_answer(field, frame, how).give(&mut *engine.executor)?;
        if how.paper {
            (plan.generate, plan.add) = (kernels::cosine(self.sample), kernels::light());
        }
        plan.before.push(kernels::sift());
        Ok(())
    }

    fn scene_has_moved(&mut self, displaced: &Displaced) {
        let Displaced { still, instances, boxes, .. } = displaced;
        let field = self.field.as_ref().filter(|_| !boxes.is_empty());
        self.marked = field.map(|field| Marked::new(field, still, instances, boxes));
    }
}
