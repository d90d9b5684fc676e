//! What kernels are given of a frame: guides in f32, relative to the camera.
//!
//! *Error.* A point is off by at most 2^-24 of its distance from the camera on each axis, and a pixel is about as wide
//! as its share of the distance: of pictures 1000 pixels wide a plane is off by 0.0002 pixels, of 16384 by 0.003, where
//! the least tolerance is 0.06. Where a surface was in the frame before is found on the host, in f64.

use super::reproject::{Before, Taps, reproject};
use crate::frame::{Guides, Second, Seen};
use crate::kernels::denoise::{GIVEN, PICTURE, SECONDS, SEEN, TALLY, elements};
use crate::kernels::layout::{DenoiseGiven, DenoiseSecond, DenoiseSeen, NONE};
use glam::DVec3;
use rayon::prelude::*;

/// A frame as kernels take it, pixel by pixel.
pub struct Given {
    pub seen: Vec<DenoiseSeen>,
    pub given: Vec<DenoiseGiven>,
    pub seconds: Vec<DenoiseSecond>,
    pub picture: Vec<[f32; 4]>,
}

fn relative(seen: &Seen, camera: DVec3) -> [f32; 3] {
    if seen.is_hit() { (seen.point - camera).as_vec3().to_array() } else { [0.0; 3] }
}

fn second(second: &Second, camera: DVec3) -> DenoiseSecond {
    let Second { seen, light } = second;
    DenoiseSecond {
        point: relative(seen, camera),
        footprint: seen.footprint,
        normal: seen.normal.to_array(),
        id: seen.id,
        albedo: seen.albedo,
        light: *light,
        ..DenoiseSecond::default()
    }
}

impl Given {
    /// Of a frame with this radiance, the mean of its samples.
    pub fn new(guides: &Guides, radiance: &[[f32; 3]], before: Option<&Before>) -> Self {
        let camera = guides.projection.position();
        let shown = guides.second.iter().enumerate().filter_map(|(pixel, second)| Some((pixel, second.as_ref()?)));
        let shown: Vec<(usize, &Second)> = shown.collect();
        let mut seen: Vec<DenoiseSeen> =
            guides.seen.par_iter().with_min_len(1024).map(|seen| of(seen, camera)).collect();
        for (number, (pixel, _)) in (0..).zip(&shown) {
            seen[*pixel].second = number;
        }
        let light = guides.direct.par_iter().zip(&guides.around).zip(&guides.noise);
        let pixels = guides.seen.par_iter().zip(light).enumerate().with_min_len(1024);
        let given = pixels.map(|(pixel, (seen, ((direct, around), noise)))| {
            let taps = before.and_then(|before| reproject(guides, pixel, before));
            let Taps { before, shares } = taps.unwrap_or_default();
            DenoiseGiven {
                albedo: seen.albedo,
                before,
                direct: *direct,
                polish: seen.polish,
                around: *around,
                samples: noise.samples as f32,
                shares,
                spreads: noise.spreads,
                ..Default::default()
            }
        });
        Self {
            given: given.collect(),
            seconds: shown.par_iter().map(|(_, shown)| second(shown, camera)).collect(),
            picture: radiance.par_iter().map(|&[r, g, b]| [r, g, b, 0.0]).collect(),
            seen,
        }
    }

    /// Elements of each of the kernels' buffers.
    pub fn elements(&self) -> [usize; 8] {
        elements(self.seen.len(), self.seconds.len())
    }

    /// What is written into which buffers, `tally` among it.
    pub fn writes<'a>(&'a self, tally: &'a [u32]) -> [(usize, &'a [u8]); 5] {
        let Self { seen, given, seconds, picture } = self;
        [
            (SEEN, bytemuck::cast_slice(seen)),
            (GIVEN, bytemuck::cast_slice(given)),
            (SECONDS, bytemuck::cast_slice(seconds)),
            (PICTURE, bytemuck::cast_slice(picture)),
            (TALLY, bytemuck::cast_slice(tally)),
        ]
    }

    /// Surfaces that the frame before did not show.
    pub fn disoccluded(&self) -> u64 {
        let is_new = |(given, seen): &(&DenoiseGiven, &DenoiseSeen)| given.before == NONE && seen.is_hit();
        self.given.iter().zip(&self.seen).filter(is_new).count() as u64
    }
}

fn of(seen: &Seen, camera: DVec3) -> DenoiseSeen {
    DenoiseSeen {
        point: relative(seen, camera),
        footprint: seen.footprint,
        plane: seen.plane.to_array(),
        id: seen.id,
        normal: seen.normal.to_array(),
        second: NONE,
    }
}
