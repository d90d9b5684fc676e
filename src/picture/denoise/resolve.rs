//! Denoising and temporal anti-aliasing, one after the other, as far as they are on.

use super::{DenoiseReport, Denoiser, Taa};
use crate::frame::FrameOutput;

/// What is done to the radiance of frames.
#[derive(Clone, Debug, Default)]
pub struct Resolve {
    /// `--denoise`.
    pub denoiser: Option<Denoiser>,
    /// `--taa`.
    pub taa: Option<Taa>,
}

impl Resolve {
    /// Of what is on.
    pub fn new(denoise: bool, taa: bool) -> Self {
        Self { denoiser: denoise.then(Denoiser::default), taa: taa.then(Taa::default) }
    }

    /// Resolves the frame just rendered, which was asked for guides; without guides it stays as it is. What is not
    /// finite in histories counts for the frame.
    pub fn frame(&mut self, output: &mut FrameOutput) {
        let Some(guides) = output.guides.take() else { return };
        let radiance = &mut output.pixels.radiance;
        let kept = self.taa.is_some().then(|| guides.clone());
        let mut non_finite = self.denoiser.as_mut().map_or(0, |denoiser| denoiser.frame(guides, radiance));
        if let (Some(taa), Some(guides)) = (&mut self.taa, kept) {
            non_finite += taa.frame(&guides, radiance);
        }
        if let Some(primary) = output.records.first_mut() {
            primary.non_finite += non_finite;
        }
    }

    /// What denoising did, where it is on.
    pub fn report(&self) -> Option<DenoiseReport> {
        self.denoiser.as_ref().map(Denoiser::report)
    }
}
