//! Denoising and temporal anti-aliasing, one after the other, as far as they are on.

use super::{DenoiseReport, Denoiser, Taa};
use crate::frame::{Engine, FrameOutput, Guides};
use crate::schedule::ExecutorError;

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

    /// Resolves the frame just rendered, which was asked for guides, on the host; without guides it stays as it is.
    /// What is not finite in histories counts for the frame.
    pub fn frame(&mut self, output: &mut FrameOutput) {
        let Some(guides) = output.guides.take() else { return };
        let kept = self.taa.is_some().then(|| guides.clone());
        let non_finite = self.denoiser.as_mut().map(|denoiser| denoiser.frame(guides, &mut output.pixels.radiance));
        self.finish(output, kept, non_finite);
    }

    /// The same, denoised by the executor that rendered it. Pictures that are joined of bands are denoised on the host:
    /// a device that holds a band need not hold what all of it takes.
    ///
    /// # Errors
    /// The device's.
    pub fn frame_on(&mut self, engine: &mut Engine, output: &mut FrameOutput) -> Result<(), ExecutorError> {
        if engine.bands().len() > 1 {
            self.frame(output);
            return Ok(());
        }
        let Some(guides) = output.guides.take() else { return Ok(()) };
        let kept = self.taa.is_some().then(|| guides.clone());
        let radiance = &mut output.pixels.radiance;
        let non_finite = match &mut self.denoiser {
            Some(denoiser) => Some(denoiser.frame_on(&mut *engine.executor, &engine.cache.states, guides, radiance)?),
            None => None,
        };
        self.finish(output, kept, non_finite);
        Ok(())
    }

    fn finish(&mut self, output: &mut FrameOutput, guides: Option<Guides>, non_finite: Option<u64>) {
        let mut non_finite = non_finite.unwrap_or(0);
        if let (Some(taa), Some(guides)) = (&mut self.taa, guides) {
            non_finite += taa.frame(&guides, &mut output.pixels.radiance);
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
