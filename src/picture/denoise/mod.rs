//! Denoising and resolving: pictures of few samples without most of their noise. Off, nothing of this runs.
//!
//! *Theory.* Spatiotemporal variance-guided filtering (Schied et al., "Spatiotemporal Variance-Guided Filtering", HPG
//! 2017): light is divided by the albedo, averaged over frames where the same surface was seen, and what noise is left
//! is filtered in space by an edge-avoiding à-trous wavelet (Dammertz et al., HPG 2010) whose tolerance follows the
//! variance of each pixel. Light that changes is told from noise by a second, short average (Zhdan,
//! "ReBLUR", Ray Tracing Gems II, chapter 49).
//!
//! *What is changed.* The light of sun and emitters and what the other effects add are two layers, each with a history
//! of its own ([`Layer`]): edges of shadows, which have little noise, are not mixed with the noise of occlusion, of an
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
//! *Practice.* The filter runs on the host: one code for every device, with the same result for any number of threads.
//! Around it go the sky, emission, and light on albedos below [`demodulate::LEAST_ALBEDO`], black among them. The order
//! of a frame is that of [`Denoiser::frame`]. What is not finite never enters a history and is counted. `--taa`
//! ([`Taa`]) averages frames whose samples lie at different points of the pixels, after or without denoising.

mod antilag;
mod atrous;
mod demodulate;
mod firefly;
mod grid;
mod layer;
mod moments;
mod reproject;
mod resolve;
mod taa;

pub use demodulate::LEAST_ALBEDO;
pub use layer::{Kind, Layer, LayerReport, Past};
pub use moments::Moments;
pub use resolve::Resolve;
pub use taa::Taa;

use super::color::luminance;
use crate::frame::Guides;
use demodulate::{demodulate, recompose};
use grid::Grid;
use reproject::reproject;
use serde::Serialize;

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
    before: Option<Guides>,
    /// The light of sun and emitters, and all other light.
    layers: [Layer; 2],
    report: DenoiseReport,
}

impl Denoiser {
    /// What was done so far.
    pub fn report(&self) -> DenoiseReport {
        self.report
    }

    /// The histories, of the lamps' light and of other light: to look at, and to plant what must not stay there.
    pub fn layers_mut(&mut self) -> &mut [Layer; 2] {
        &mut self.layers
    }

    /// Filters `radiance`, the mean of a frame's samples, for which `guides` were taken. Returns the number of values
    /// in histories that were not finite.
    pub fn frame(&mut self, guides: Guides, radiance: &mut [[f32; 3]]) -> u64 {
        let grid = Grid::new(guides.size);
        if self.before.as_ref().is_some_and(|before| before.size != guides.size) {
            *self = Self { report: self.report, ..Self::default() };
        }
        let parts = demodulate(&guides, radiance);
        let taps = reproject(&grid, &guides, self.before.as_ref());
        let mut done = LayerReport::default();
        let mut lit = [Vec::new(), Vec::new()];
        let kinds = [Kind::LAMPS, Kind::OTHER];
        for (k, (layer, light)) in self.layers.iter_mut().zip(parts.layers).enumerate() {
            let (filtered, of_layer) = layer.frame(&grid, &guides.seen, &taps, light, kinds[k]);
            lit[k] = filtered;
            done.add(&of_layer);
        }
        let report = &mut self.report;
        report.frames += 1;
        report.fireflies += done.fireflies;
        report.energy_lost += done.energy_lost;
        report.energy += radiance.iter().map(|c| f64::from(luminance(*c))).filter(|l| l.is_finite()).sum::<f64>();
        report.energy_lost_share = if report.energy > 0.0 { report.energy_lost / report.energy } else { 0.0 };
        report.disoccluded += taps.iter().zip(&guides.seen).filter(|(t, s)| t.is_none() && s.is_hit()).count() as u64;
        report.non_finite += parts.non_finite + done.non_finite;
        recompose(&grid, &guides, &parts.around, &lit, radiance);
        self.before = Some(guides);
        done.non_finite
    }
}
