//! Who answered the secondary rays of each pixel: tracing, or a method of [`crate::secondary`].

use crate::kernels::FrameExecutor;
use crate::kernels::layout::{Hit, MET, NONE, Ray};
use crate::schedule::{ExecutorError, Pass};

/// Rays of a pixel: those that were traced to their end, and those that a method answered, wholly or in part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Answered {
    /// Traced.
    pub traced: u32,
    /// By a method.
    pub by_method: u32,
}

/// Of the pixels of a frame.
#[derive(Clone, Debug, Default)]
pub struct Answers {
    /// Pixel by pixel; empty before the first secondary rays.
    pub pixels: Vec<Answered>,
}

impl Answers {
    /// Notes the rays of a pass that has just been traced. `is_whole`: a method answered all of them.
    ///
    /// # Errors
    /// The device's.
    pub fn note(&mut self, executor: &mut dyn FrameExecutor, pass: Pass, is_whole: bool) -> Result<(), ExecutorError> {
        let rays: Vec<Ray> = executor.read_rays(pass)?;
        let hits: Vec<Hit> = executor.read_hits(pass)?;
        self.pixels.resize(rays.len(), Answered::default());
        for (pixel, (ray, hit)) in self.pixels.iter_mut().zip(rays.iter().zip(&hits)) {
            if ray.t_min > ray.t_max {
                continue;
            }
            // What a method says of a ray is a hit that is no triangle, or an end before the ray's.
            let by_method = is_whole || hit.id == MET || (hit.id == NONE && hit.t < ray.t_max);
            *(if by_method { &mut pixel.by_method } else { &mut pixel.traced }) += 1;
        }
        Ok(())
    }
}
