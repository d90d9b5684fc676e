//! Frames that may load so much only: which pixels show what they would with everything resident.

use super::voxels::Voxels;
use super::{Engine, Moved, PixelState, Pixels};
use crate::counters::Counters;
use crate::kernels::FrameExecutor;
use crate::kernels::layout::{GBUFFER_COARSER, GBuffer};
use crate::scene::Camera;
use crate::schedule::cut::{self, Cut};
use crate::schedule::{BrickStates, ExecutorError, Pass, Step, Tracer, attributes};
use bricks::Resident;

/// What frames with a budget keep.
pub struct Budgeted {
    cut: Cut,
    stands_in: bool,
    /// What stands in where there are no levels.
    voxels: Option<Voxels>,
    /// Pixels whose camera rays, of the last sample, are not resolved.
    asks: Vec<bool>,
    /// Of each pixel of the frame.
    states: Vec<PixelState>,
}

impl Budgeted {
    /// Of a scene. `stands_in`: its levels of detail, if it has any, stand in for what is missing.
    pub fn new(resident: &Resident, stands_in: bool) -> Self {
        let voxels = if stands_in && !resident.has_levels_in_use() { Voxels::new(resident) } else { None };
        let cut = Cut::new(resident, stands_in);
        Self { cut, stands_in, voxels, asks: Vec::new(), states: Vec::new() }
    }

    /// Starts a frame of so many pixels.
    pub fn begin_frame(&mut self, pixels: usize) {
        self.cut.begin_frame();
        self.states.clear();
        self.states.resize(pixels, PixelState::Exact);
        self.asks.clear();
        self.asks.resize(pixels, false);
    }

    /// Traces the rays of a pass.
    ///
    /// # Errors
    /// A brick that cannot be read; the device's.
    pub fn trace(&mut self, t: &mut Tracer, first: &[Step]) -> Result<(), ExecutorError> {
        let states = cut::trace(t, &mut self.cut, first)?;
        let mut unresolved = 0;
        let is_camera = t.pass == Pass::Primary && self.voxels.is_some();
        for (index, (pixel, &state)) in self.states.iter_mut().zip(&states).enumerate() {
            let mut state = PixelState::of_ray(state);
            unresolved += u64::from(state == PixelState::Unresolved);
            if is_camera {
                self.asks[index] = state == PixelState::Unresolved;
                // What stands in is put there at the end of the frame.
                state = state.min(PixelState::Bounded);
            }
            *pixel = state.max(*pixel);
        }
        t.stats.unresolved_pixels += unresolved;
        Ok(())
    }

    /// Puts what stands in for missing bricks into the pixels of a frame, whose states are taken.
    ///
    /// # Errors
    /// The device's.
    fn stand_in(
        &mut self,
        (resident, states): (&Resident, &BrickStates),
        executor: &mut dyn FrameExecutor,
        view: (&Camera, (u32, u32)),
        pixels: &mut Pixels,
    ) -> Result<(), ExecutorError> {
        match &mut self.voxels {
            Some(voxels) => voxels.stand_in((resident, states), executor, view, &self.asks, pixels),
            None => Ok(()),
        }
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
            let resident = self.scene.resident();
            self.budgeted = self.budgeted.take().map(|own| Budgeted::new(resident, own.stands_in));
        }
        let pixels = self.rays();
        if let Some(budgeted) = &mut self.budgeted {
            budgeted.begin_frame(pixels);
        }
    }

    /// Takes the states of a frame's pixels, and shows what stands in for bricks that are missing.
    ///
    /// # Errors
    /// The device's.
    pub(super) fn end_budget(&mut self, camera: &Camera, pixels: &mut Pixels) -> Result<(), ExecutorError> {
        let Some(budgeted) = &mut self.budgeted else { return Ok(()) };
        pixels.state = budgeted.take_states();
        let scene = (self.scene.resident(), &self.cache.states);
        budgeted.stand_in(scene, &mut *self.executor, (camera, self.size), pixels)
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
