//! Frames that may load so much only: which pixels show what they would with everything resident.

use super::{Engine, Moved};
use crate::counters::Counters;
use crate::kernels::layout::{GBUFFER_COARSER, GBuffer};
use crate::schedule::cut::{self, Cut};
use crate::schedule::{ExecutorError, Pass, Step, Tracer, attributes};
use bricks::Resident;

/// What a pixel shows: that of its worst ray.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum PixelState {
    /// What it shows with everything resident.
    #[default]
    Exact = 0,
    /// Something is missing, and a level of detail stands in for it, within the level's bound.
    Bounded = 1,
    /// Something is missing that nothing stands in for, or a texture is coarser than it should be.
    Unresolved = 2,
}

impl PixelState {
    /// Of a ray ([`crate::schedule::Report::states`]).
    fn of_ray(state: u32) -> Self {
        match state {
            0 => Self::Exact,
            1 => Self::Bounded,
            _ => Self::Unresolved,
        }
    }
}

/// What frames with a budget keep.
pub struct Budgeted {
    cut: Cut,
    /// Of each pixel of the frame.
    states: Vec<PixelState>,
}

impl Budgeted {
    /// Of a scene.
    pub fn new(resident: &Resident) -> Self {
        Self { cut: Cut::new(resident), states: Vec::new() }
    }

    /// Starts a frame of so many pixels.
    pub fn begin_frame(&mut self, pixels: usize) {
        self.cut.begin_frame();
        self.states.clear();
        self.states.resize(pixels, PixelState::Exact);
    }

    /// Traces the rays of a pass.
    ///
    /// # Errors
    /// A brick that cannot be read; the device's.
    pub fn trace(&mut self, t: &mut Tracer, first: &[Step]) -> Result<(), ExecutorError> {
        let states = cut::trace(t, &mut self.cut, first)?;
        let mut unresolved = 0;
        for (pixel, &state) in self.states.iter_mut().zip(&states) {
            let state = PixelState::of_ray(state);
            unresolved += u64::from(state == PixelState::Unresolved);
            *pixel = state.max(*pixel);
        }
        t.stats.unresolved_pixels += unresolved;
        Ok(())
    }

    /// What the pixels of the frame show.
    pub fn take_states(&mut self) -> Vec<PixelState> {
        std::mem::take(&mut self.states)
    }

    /// Notes the pixels whose textures were looked up in coarser levels. Which those of bounces are is not read back:
    /// any.
    fn note_textures(&mut self, hits: Option<&[GBuffer]>) {
        for (pixel, state) in self.states.iter_mut().enumerate() {
            if hits.is_none_or(|hits| hits[pixel].state & GBUFFER_COARSER != 0) {
                *state = PixelState::Unresolved;
            }
        }
    }
}

impl Engine {
    /// Starts a frame with its budget, if it has one. What has moved has other levels.
    pub(super) fn begin_budget(&mut self) {
        self.cache.begin_frame(self.settings.budget);
        if self.moved != Moved::default() {
            self.budgeted = self.budgeted.take().map(|_| Budgeted::new(self.scene.resident()));
        }
        let pixels = self.rays();
        if let Some(budgeted) = &mut self.budgeted {
            budgeted.begin_frame(pixels);
        }
    }

    /// Reads the attributes of all hits of `pass` and looks their textures up, as far as the frame's budget goes.
    ///
    /// # Errors
    /// A brick that cannot be read; the device's.
    pub(super) fn resolve(&mut self, pass: Pass, stats: &mut Counters) -> Result<(), ExecutorError> {
        let before = stats.unresolved_pixels;
        attributes::resolve(&mut *self.executor, &mut self.cache, pass, stats)?;
        if let Some(budgeted) = &mut self.budgeted
            && stats.unresolved_pixels > before
        {
            let hits = if pass == Pass::Primary { Some(self.executor.read_gbuffer()?) } else { None };
            budgeted.note_textures(hits.as_deref());
        }
        Ok(())
    }
}
