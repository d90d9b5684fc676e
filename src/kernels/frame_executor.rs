//! What a frame needs of an executor beside steps.

use super::layout::{GBuffer, Hit, Ray, Surface};
use super::table::Family;
use super::{Extent, Keep, Lamps, Tuning, View};
use crate::schedule::{Executor, ExecutorError, Pass};
use crate::stream::Workers;
use bricks::SceneFile;
use serde::Serialize;
use std::any::Any;
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
    fn workers(&self) -> &Workers;

    /// What it leaves out where a scene does not need it, unless it was set up to keep it. On anything else its kernels
    /// decide as they run.
    fn leaves_out(&self) -> Keep;

    /// Takes pictures, or blocks of rays, of another size from now on. What passes have left is lost; the cache, lamps
    /// and buffers of methods stay.
    ///
    /// # Errors
    /// More rays than the device holds.
    fn set_extent(&mut self, extent: Extent) -> Result<(), ExecutorError>;

    /// Makes room for the passes [`Pass::Diffuse`], [`Pass::Glossy`], [`Pass::Path`] and those from their hits: a set
    /// of rays more, and what shading keeps of its hits. Without it they must not be run.
    fn allow_bounces(&mut self);

    /// Hides triangles from all rays from now on. `bounds`: global ids, ascending, at which hiding begins and ends in
    /// turns.
    ///
    /// # Errors
    /// A cache of as many pages as the device binds, with how large it may be.
    fn set_hidden(&mut self, bounds: &[u32]) -> Result<(), ExecutorError>;

    /// Makes what [`crate::schedule::Step::IntersectBinary`] needs; without it that step must not be run.
    ///
    /// # Errors
    /// A brick that cannot be read; more nodes than the device holds, with how much is needed.
    fn make_binary(&mut self) -> Result<(), ExecutorError>;

    /// Loses the device, as drivers do when they fail: what is asked of it from now on fails. The processor is not
    /// lost.
    fn lose_device(&mut self);

    /// What holds for submissions from now on.
    fn tuning(&mut self) -> &mut Tuning;

    /// Takes the environment and the emitters of the frames to come; the same ones again cost nothing.
    ///
    /// # Errors
    /// More emitters, or a larger environment, than the device holds in one buffer, with how many it does.
    fn set_lamps(&mut self, lamps: &Arc<Lamps>) -> Result<(), ExecutorError>;

    /// Makes room for so many elements in each buffer of a family, and its kernels, when it is first asked to; without
    /// it these must not be run. A buffer that has room keeps what it holds.
    ///
    /// # Errors
    /// More than the device holds in one buffer, with how much it does; a device that binds too few buffers.
    fn reserve(&mut self, family: &'static Family, elements: &[usize]) -> Result<(), ExecutorError>;

    /// Writes into a buffer of a family, from byte `at` on, for which there is room.
    fn write(&mut self, family: &'static Family, buffer: usize, at: usize, bytes: &[u8]);

    /// Reads the first words of a buffer of a family back.
    ///
    /// # Errors
    /// The device's.
    fn read(&mut self, family: &'static Family, buffer: usize, words: usize) -> Result<Vec<u32>, ExecutorError>;

    /// What a method has noted of what the buffers of its family hold; it lives as long as they do.
    fn held(&mut self, family: &'static Family) -> &mut Option<Box<dyn Any>>;

    /// Takes the scene with instances placed anew ([`SceneFile::place`]), for frames that begin from now on. All else
    /// of it is as it was.
    fn set_scene(&mut self, scene: &Arc<SceneFile>);

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
