//! What a frame needs of an executor beside steps.

use super::layout::{DvfTriangle, GBuffer, Hit, Ray, Surface};
use super::{Keep, Lamps, Tuning, View};
use crate::schedule::{Executor, ExecutorError, Pass};
use crate::secondary::df::maps::FieldMaps;
use crate::secondary::dvf::maps::DvfMaps;
use crate::secondary::occupancy::Cascades;
use crate::secondary::roma::maps::RomaMaps;
use crate::secondary::rsm::maps::RsmMaps;
use crate::stream::WorkerPool;
use bricks::SceneFile;
use serde::Serialize;
use std::sync::Arc;

/// The device that an executor runs on, as summaries name it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct DeviceInfo {
    /// Its name.
    pub name: String,
    /// The driver's name.
    pub driver: String,
    /// The driver's version.
    pub driver_info: String,
    /// What it is reached through.
    pub backend: String,
    /// How payloads reach the cache.
    pub upload: &'static str,
    /// Whether phases are timed on the device.
    pub timestamps: bool,
}

/// An executor that renders frames: takes views and rays, gives back what passes left.
pub trait FrameExecutor: Executor {
    /// The device.
    fn device(&self) -> DeviceInfo;

    /// Largest number of bytes of one page of the cache.
    fn page_bytes(&self) -> u64;

    /// Bytes of the coarse levels of textures that are resident throughout.
    fn texture_bytes(&self) -> u64;

    /// The workers that read payloads.
    fn workers(&self) -> &dyn WorkerPool;

    /// What it leaves out where a scene does not need it, unless it was set up to keep it. On anything else its kernels
    /// decide as they run.
    fn leaves_out(&self) -> Keep;

    /// Makes room for the passes [`Pass::Diffuse`], [`Pass::Glossy`] and [`Pass::BounceShadow`], 160
    /// bytes a pixel; without it they must not be run.
    fn allow_bounces(&mut self);

    /// Makes what [`crate::schedule::Step::IntersectBinary`] needs; without it that step must not be run.
    ///
    /// # Errors
    /// A brick that cannot be read; more nodes than the device holds, with how much is needed.
    fn make_binary(&mut self) -> Result<(), ExecutorError>;

    /// What holds for submissions from now on.
    fn tuning(&mut self) -> &mut Tuning;

    /// Takes the environment and the emitters of the frames to come; the same ones again cost nothing.
    ///
    /// # Errors
    /// More emitters, or a larger environment, than the device holds in one buffer, with how many it does.
    fn set_lamps(&mut self, lamps: &Arc<Lamps>) -> Result<(), ExecutorError>;

    /// Takes base occupancy maps, and makes what [`crate::schedule::Step::RomaRotate`] and
    /// [`crate::schedule::Step::RomaTrace`] need; without it these must not be run. The same maps again cost nothing.
    ///
    /// # Errors
    /// More than the device holds in one buffer, with how much it does.
    fn set_cascades(&mut self, cascades: &Arc<Cascades>) -> Result<(), ExecutorError>;

    /// Places the ray-aligned maps that [`crate::schedule::Step::RomaRotate`] makes of these next, in the frame that
    /// has begun.
    ///
    /// # Errors
    /// As of [`FrameExecutor::set_cascades`].
    fn set_roma(&mut self, maps: &RomaMaps) -> Result<(), ExecutorError>;

    /// Takes base maps and where their distance fields lie in the frame that has begun, and makes what
    /// [`crate::schedule::Step::FieldMake`] and [`crate::schedule::Step::FieldTrace`] need; without it these must not
    /// be run. The fields that were made last stay as long as their maps do.
    ///
    /// # Errors
    /// As of [`FrameExecutor::set_cascades`].
    fn set_field(&mut self, field: &FieldMaps) -> Result<(), ExecutorError>;

    /// Takes reflective shadow maps as they lie in the frame that has begun, and makes what
    /// [`crate::schedule::Step::RsmWrite`] and [`crate::schedule::Step::RsmLight`] need; without it these must not be
    /// run. Texels keep what was written as long as there are as many.
    ///
    /// # Errors
    /// More than the device holds in one buffer, with how much it does; a device that binds too few buffers.
    fn set_rsm(&mut self, maps: &RsmMaps) -> Result<(), ExecutorError>;

    /// Takes the scene with instances placed anew ([`SceneFile::place`]), for frames that begin from now on. All else
    /// of it is as it was.
    fn set_scene(&mut self, scene: &Arc<SceneFile>);

    /// Places a field of visibility in the frame that has begun, and makes what the steps
    /// [`crate::schedule::Step::DvfAreas`] to [`crate::schedule::Step::DvfSift`] need; without it these must not be
    /// run. Masks and labels are those that it gives; where it gives none, those that are there, unless it says
    /// otherwise or they are not as many: then empty ones.
    ///
    /// # Errors
    /// More than the device holds in one buffer, with how much it does; a device that binds too few buffers.
    fn set_dvf(&mut self, maps: &DvfMaps) -> Result<(), ExecutorError>;

    /// Takes the triangles of which areas, numbers and rays are made next, and the number of points on all of them once
    /// it is known.
    ///
    /// # Errors
    /// As of [`FrameExecutor::set_dvf`], which has been called.
    fn set_dvf_triangles(&mut self, triangles: &[DvfTriangle], points: u32) -> Result<(), ExecutorError>;

    /// Takes what [`crate::schedule::Step::DvfSeen`] and [`crate::schedule::Step::DvfPoints`] count on, or the numbers
    /// of the points that rays of cells that are made anew start from ([`crate::secondary::dvf::Fresh`]).
    ///
    /// # Errors
    /// As of [`FrameExecutor::set_dvf`], which has been called.
    fn set_dvf_tally(&mut self, words: &[u32]) -> Result<(), ExecutorError>;

    /// Reads what these steps have made of them.
    ///
    /// # Errors
    /// The device's.
    fn read_dvf_tally(&mut self) -> Result<Vec<u32>, ExecutorError>;

    /// Reads the masks and labels of all cells back; where some cells are made anew, the masks of these.
    ///
    /// # Errors
    /// The device's.
    fn read_dvf(&mut self) -> Result<(Vec<u32>, Vec<u32>), ExecutorError>;

    /// Reads the sums of areas or points back, level by level ([`crate::secondary::dvf::maps::sweep_levels`]).
    ///
    /// # Errors
    /// The device's.
    fn read_dvf_sums(&mut self) -> Result<Vec<[u32; 2]>, ExecutorError>;

    /// Starts a frame: moves the scene to its reference point, takes its camera and lights.
    fn begin_frame(&mut self, view: &View);

    /// Writes rays from outside into `pass`; fewer than the extent holds leave the rest untraced.
    fn set_rays(&mut self, pass: Pass, rays: &[Ray]);

    /// Reads the rays of a pass back, row by row.
    ///
    /// # Errors
    /// The device's.
    fn read_rays(&mut self, pass: Pass) -> Result<Vec<Ray>, ExecutorError>;

    /// Reads the hits of a pass back.
    ///
    /// # Errors
    /// The device's.
    fn read_hits(&mut self, pass: Pass) -> Result<Vec<Hit>, ExecutorError>;

    /// Reads the surfaces of a pass back.
    ///
    /// # Errors
    /// The device's.
    fn read_surfaces(&mut self, pass: Pass) -> Result<Vec<Surface>, ExecutorError>;

    /// Reads the G-buffer of the primary hits back.
    ///
    /// # Errors
    /// The device's.
    fn read_gbuffer(&mut self) -> Result<Vec<GBuffer>, ExecutorError>;

    /// Reads the radiance summed over the samples of a batch back ([`super::layout::BATCH_SAMPLES`] of a frame in a
    /// row); w counts them.
    ///
    /// # Errors
    /// The device's.
    fn read_radiance(&mut self) -> Result<Vec<[f32; 4]>, ExecutorError>;
}

/// `rays`, and behind them untraced ones up to `count` in all.
pub fn padded(rays: &[Ray], count: usize) -> Vec<Ray> {
    let untraced = Ray { t_min: 1.0, t_max: 0.0, direction: [1.0, 0.0, 0.0], ..Default::default() };
    let mut all = rays.to_vec();
    all.resize(count, untraced);
    all
}
