//! Denoising and resolving: pictures of few samples without most of their noise. Off, nothing of this runs.
//!
//! *Theory.* Spatiotemporal variance-guided filtering (Schied et al., "Spatiotemporal Variance-Guided Filtering", HPG
//! 2017): light is divided by the albedo, averaged over frames where the same surface was seen, and what noise is left
//! is filtered in space by an edge-avoiding à-trous wavelet (Dammertz et al., HPG 2010) whose tolerance follows the
//! variance of each pixel. Light that changes is told from noise by a second, short average (Zhdan,
//! "ReBLUR", Ray Tracing Gems II, chapter 49).
//!
//! *What is changed.* The light of sun and emitters and what the other effects add are two layers, each with a history
//! of its own: edges of shadows, which have little noise, are not mixed with the noise of occlusion, of an
//! environment and of bounces. Distances and variances of light are those of all channels, not of luminance, by which
//! directions to an environment are drawn. The variance is Welford's, weighted (West 1979), and it is that of the mean,
//! which falls as samples come in, so that the filter narrows. The long average gives way to the short one as far as
//! their difference over a neighbourhood is more than chance; differences in pairs leave out what the signal itself
//! does there. Fireflies are cut at what their neighbours allow, and the energy cut off is reported. Light that comes
//! by a bounce may be
//! *sparse*: most samples of a pixel find none. So its variance is that of the samples of a neighbourhood, where they
//! are too few to tell it geometry alone weights neighbours, and a bright sample is no firefly if there was another
//! around it in the last frames.
//!
//! *Practice.* Every step of the filter is a kernel with a twin ([`crate::kernels::denoise`]): the executor that
//! rendered a frame filters it, and both executors give the same bits. Guides are read back and given to it again, in
//! f32 relative to the camera (`given`); where surfaces were before is found on the host in f64 (`reproject`).
//! Around the filter go the sky, emission, and light on albedos below [`LEAST_ALBEDO`], black among them. What is not
//! finite never enters a history and is counted. `--taa` ([`Taa`]) averages frames whose samples lie at different
//! points of the pixels, after or without denoising.

mod given;
mod grid;
mod reproject;
mod resolve;
mod taa;

pub use crate::kernels::denoise::LEAST_ALBEDO;
pub use crate::kernels::layout::DenoisePast;
pub use resolve::Resolve;
pub use taa::Taa;

use super::color::luminance;
use crate::frame::Guides;
use crate::kernels::FrameExecutor;
use crate::kernels::denoise::{self as kernels, FAMILY, PICTURE, TALLIES, TALLY, Twins};
use crate::kernels::layout::{DENOISE_FIREFLIES, DENOISE_LOST, DENOISE_UNSOUND};
use crate::schedule::{BrickStates, ExecutorError, Pass, Step};
use given::Given;
use reproject::Before;
use serde::Serialize;
use std::sync::atomic::{AtomicU64, Ordering};

/// What denoising did over all frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct DenoiseReport {
    /// Frames.
    pub frames: u64,
    /// Pixels whose light was cut as that of a firefly.
    pub fireflies: u64,
    /// Luminance cut off them, summed over pixels and frames.
    pub energy_lost: f64,
    /// The same as a share of the luminance of all frames.
    pub energy_lost_share: f64,
    /// Pixels without a usable history, the first frame's among them.
    pub disoccluded: u64,
    /// Values that were not finite: of frames, which are counted by the frame as well, and of histories.
    pub non_finite: u64,
    /// Luminance of all frames, summed over pixels.
    #[serde(skip)]
    energy: f64,
}

/// Filters frame after frame.
#[derive(Clone, Debug, Default)]
pub struct Denoiser {
    /// What the frame before saw; `None` before the first and after a change of size.
    before: Option<Before>,
    /// Filters on the host, and keeps histories there.
    twins: Twins,
    /// Where histories lie on an executor: the number that it has noted of them.
    noted: Option<u64>,
    /// Whether an executor has no room to filter.
    is_refused: bool,
    report: DenoiseReport,
}

/// Tells histories on executors apart.
static NUMBER: AtomicU64 = AtomicU64::new(0);

impl Denoiser {
    /// What was done so far.
    pub fn report(&self) -> DenoiseReport {
        self.report
    }

    /// The history on the host of a layer, 0 of the lamps' light, 1 of other light: to look at, and to plant what must
    /// not stay there. Empty before the first frame.
    pub fn past(&mut self, layer: usize) -> &mut [DenoisePast] {
        let pixels = self.before.as_ref().map_or(0, |before| before.seen.len());
        let all: &mut [DenoisePast] = bytemuck::cast_slice_mut(self.twins.words(kernels::PAST));
        &mut all[layer * pixels..(layer + 1) * pixels]
    }

    /// Filters `radiance`, the mean of a frame's samples, for which `guides` were taken, on the host. Returns the
    /// number of values in histories that were not finite.
    pub fn frame(&mut self, guides: Guides, radiance: &mut [[f32; 3]]) -> u64 {
        let is_here = self.noted.take().is_none();
        let given = self.begin(&guides, radiance, is_here);
        self.twins.reserve(&given.elements());
        let tally = [0u32; TALLIES];
        for (buffer, bytes) in given.writes(&tally) {
            self.twins.write(buffer, bytes);
        }
        self.twins.run(&kernels::steps(guides.size.into(), self.before.is_some()));
        let picture = self.twins.words(PICTURE)[..4 * radiance.len()].to_vec();
        let tally = self.twins.words(TALLY).to_vec();
        self.finish(guides, radiance, &given, [&picture, &tally])
    }

    /// The same, by an executor and its bricks, which keeps the histories. One that has no room for them leaves it to
    /// the host.
    ///
    /// # Errors
    /// The device's.
    pub fn frame_on(
        &mut self,
        executor: &mut dyn FrameExecutor,
        bricks: &BrickStates,
        guides: Guides,
        radiance: &mut [[f32; 3]],
    ) -> Result<u64, ExecutorError> {
        if self.is_refused {
            return Ok(self.frame(guides, radiance));
        }
        let noted = executor.held(&FAMILY).as_ref().and_then(|held| held.downcast_ref::<u64>()).copied();
        let is_here = self.noted.is_some() && self.noted == noted;
        let given = self.begin(&guides, radiance, is_here);
        if executor.reserve(&FAMILY, &given.elements()).is_err() {
            self.is_refused = true;
            return Ok(self.frame(guides, radiance));
        }
        for (buffer, bytes) in given.writes(&[0; TALLIES]) {
            executor.write(&FAMILY, buffer, 0, bytes);
        }
        let steps = kernels::steps(guides.size.into(), self.before.is_some());
        let steps: Vec<Step> = steps.into_iter().map(Step::from).collect();
        executor.run(Pass::Primary, &steps, bricks)?;
        let picture = executor.read(&FAMILY, PICTURE, 4 * radiance.len())?;
        let tally = executor.read(&FAMILY, TALLY, TALLIES)?;
        // Who filters with another history on this executor, or went on from a copy of this one, ends it.
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        *executor.held(&FAMILY) = Some(Box::new(number));
        self.noted = Some(number);
        Ok(self.finish(guides, radiance, &given, [&picture, &tally]))
    }

    /// What kernels are given of a frame. `is_here`: the history lies where it is filtered.
    fn begin(&mut self, guides: &Guides, radiance: &[[f32; 3]], is_here: bool) -> Given {
        self.before = self.before.take().filter(|before| is_here && before.size == guides.size);
        Given::new(guides, radiance, self.before.as_ref())
    }

    /// Takes the words of the picture and what was counted.
    fn finish(
        &mut self,
        guides: Guides,
        radiance: &mut [[f32; 3]],
        given: &Given,
        [picture, tally]: [&[u32]; 2],
    ) -> u64 {
        let picture: &[[f32; 4]] = bytemuck::cast_slice(picture);
        let counted = |which: u32| u64::from(tally[which as usize]);
        let report = &mut self.report;
        report.frames += 1;
        report.fireflies += counted(DENOISE_FIREFLIES);
        report.energy_lost += picture.iter().map(|pixel| f64::from(pixel[3])).sum::<f64>();
        report.energy += radiance.iter().map(|c| f64::from(luminance(*c))).filter(|l| l.is_finite()).sum::<f64>();
        report.energy_lost_share = if report.energy > 0.0 { report.energy_lost / report.energy } else { 0.0 };
        report.disoccluded += given.disoccluded();
        report.non_finite += counted(DENOISE_UNSOUND) + counted(DENOISE_LOST);
        for (radiance, &[r, g, b, _]) in radiance.iter_mut().zip(picture) {
            *radiance = [r, g, b];
        }
        let Guides { size, projection, jitter, seen, .. } = guides;
        self.before = Some(Before { size, projection, jitter, seen });
        counted(DENOISE_LOST)
    }
}
