//! The error of frames after chosen numbers of samples, against references.
//!
//! A reference is an EXR of radiance: one file for frame 0, or a folder with a file for each frame. What is measured is
//! the mean of the samples so far, as [`crate::metrics::compare()`] measures the EXR of as many samples. Seconds are
//! those of rendering; what measuring takes is not counted.

use super::Settings;
use crate::frame::Accumulation;
use crate::metrics::{Encoding, Image, Loaded, compare, load};
use anyhow::{Context, Result, ensure};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::{Duration, Instant};
use tracing::info;

/// The error of a frame after so many samples; a line of `checkpoints.jsonl`.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
pub struct Checkpoint {
    /// The frame.
    pub frame: u32,
    /// Samples per pixel.
    pub samples: u32,
    /// Seconds of rendering that they took.
    pub seconds: f64,
    /// Root of the mean squared error.
    pub rmse: f64,
    /// Mean squared error relative to the squared reference.
    pub rel_mse: f64,
    /// Mean difference.
    pub bias: f64,
    /// The same of each channel.
    pub bias_rgb: [f64; 3],
    /// Mean HDR-FLIP.
    pub flip: f64,
}

/// Where the references of a walk are.
pub struct References {
    place: PathBuf,
    size: (usize, usize),
    /// Numbers of samples, ascending.
    samples: Vec<u32>,
}

impl References {
    /// Those that settings name, all of which are read once; `None` where no checkpoints are asked for.
    ///
    /// # Errors
    /// One is missing, no EXR, or of another size than the frames.
    pub fn open(settings: &Settings) -> Result<Option<Self>> {
        let Some(place) = settings.reference.clone().filter(|_| !settings.checkpoints.is_empty()) else {
            return Ok(None);
        };
        let mut samples = settings.checkpoints.clone();
        samples.sort_unstable();
        samples.dedup();
        let size = (settings.size.width as usize, settings.size.height as usize);
        let references = Self { place, size, samples };
        let frames = if references.is_of_all() { settings.frames } else { 1 };
        (0..frames).try_for_each(|frame| references.read(frame).map(drop))?;
        Ok(Some(references))
    }

    /// Whether every frame has one.
    pub fn is_of_all(&self) -> bool {
        self.place.is_dir()
    }

    /// The meter of a frame; `None` where it has no reference.
    ///
    /// # Errors
    /// The reference cannot be read.
    pub fn meter(&self, frame: u32) -> Result<Option<ErrorMeter<'_>>> {
        if frame > 0 && !self.is_of_all() {
            return Ok(None);
        }
        let reference = self.read(frame)?;
        let (start, measuring) = (Instant::now(), Duration::ZERO);
        Ok(Some(ErrorMeter { frame, samples: &self.samples, reference, start, measuring, found: Vec::new() }))
    }

    /// The reference of a frame: a folder has them by number, as `walk --aov` writes them.
    fn read(&self, frame: u32) -> Result<Loaded> {
        let file = match self.is_of_all() {
            true => {
                let name = format!("{frame:04}.exr");
                let inner = self.place.join("frames").join(&name);
                if inner.is_file() { inner } else { self.place.join(name) }
            }
            false => self.place.clone(),
        };
        let name = file.display();
        let loaded = load(&file).context("--reference")?;
        ensure!(
            loaded.encoding == Encoding::Exr,
            "{name}: --reference needs linear radiance; give an EXR, as walk --aov writes it"
        );
        let found = (loaded.image.width, loaded.image.height);
        ensure!(
            found == self.size,
            "{name}: the reference has {}x{} pixels, frames have {}x{}; render it with the same --size",
            found.0,
            found.1,
            self.size.0,
            self.size.1
        );
        Ok(loaded)
    }
}

/// Measures a frame while it is rendered.
pub struct ErrorMeter<'a> {
    frame: u32,
    samples: &'a [u32],
    reference: Loaded,
    start: Instant,
    measuring: Duration,
    found: Vec<Checkpoint>,
}

impl ErrorMeter<'_> {
    /// Measures the samples so far, if they are as many as at a checkpoint.
    ///
    /// # Errors
    /// Nothing of it is finite.
    pub fn note(&mut self, samples: u32, sum: &Accumulation) -> Result<()> {
        if self.samples.binary_search(&samples).is_err() {
            return Ok(());
        }
        let start = Instant::now();
        let seconds = (start.duration_since(self.start) - self.measuring).as_secs_f64();
        let Image { width, height, .. } = self.reference.image;
        let image = Image { width, height, rgb: sum.mean() };
        let path = format!("frame {} after {samples} samples", self.frame).into();
        let loaded = Loaded { path, encoding: Encoding::Exr, image, channels: BTreeMap::new() };
        let compared = compare(&loaded, &self.reference)?;
        let (errors, flip) = (compared.pixels, compared.flip);
        info!("frame {}: {samples} samples, {seconds:.2} s: RMSE {:.6}, FLIP {flip:.6}", self.frame, errors.rmse);
        self.found.push(Checkpoint {
            frame: self.frame,
            samples,
            seconds,
            rmse: errors.rmse,
            rel_mse: errors.rel_mse,
            bias: errors.bias,
            bias_rgb: errors.bias_rgb,
            flip,
        });
        self.measuring += start.elapsed();
        Ok(())
    }

    /// What was measured.
    pub fn finish(self) -> Vec<Checkpoint> {
        self.found
    }
}
