//! The buffers that the twins work on.

use crate::kernels::layout::{DenoiseGiven, DenoiseLit, DenoiseOwn, DenoisePast, DenoiseSecond, DenoiseSeen};

/// Albedos below this are not divided by: light on them goes around the filter, so that black stays black and nothing
/// is divided by zero. What is left noisy there is less than 1/1024 of the light; dyes with one bright channel have
/// others of little more, which a long exposure shows.
pub const LEAST_ALBEDO: f32 = 1.0 / 1024.0;
/// Layers of light: of lamps, and all other.
pub const LAYERS: usize = 2;
/// Buffers of the kernels.
pub const BUFFERS: usize = 8;

/// Words of the tally.
pub const TALLIES: usize = 4;

/// The buffers in their order, as long as the picture has pixels.
pub struct Buffers<'a> {
    /// What pixels show.
    pub seen: &'a [DenoiseSeen],
    /// What they are given beside that.
    pub given: &'a [DenoiseGiven],
    /// Second surfaces.
    pub seconds: &'a [DenoiseSecond],
    /// Histories, by layer and pixel.
    pub past: &'a mut [DenoisePast],
    /// The same while a frame is filtered.
    pub known: &'a mut [DenoisePast],
    /// Light while it is filtered: two halves, in each by layer and pixel.
    pub lit: &'a mut [DenoiseLit],
    /// Radiance; what goes around the filter while that is at work, and the luminance that was cut off fireflies.
    pub picture: &'a mut [[f32; 4]],
    /// What is counted.
    pub tally: &'a mut [u32],
}

impl<'a> Buffers<'a> {
    /// Of these words, for the picture that a kernel is told.
    pub fn new(own: &DenoiseOwn, words: [&'a mut [u32]; BUFFERS]) -> Self {
        let [seen, given, seconds, past, known, lit, picture, tally] = words;
        let pixels = own.width as usize * own.height as usize;
        Self {
            seen: &bytemuck::cast_slice(seen)[..pixels],
            given: &bytemuck::cast_slice(given)[..pixels],
            seconds: bytemuck::cast_slice(seconds),
            past: &mut bytemuck::cast_slice_mut(past)[..LAYERS * pixels],
            known: &mut bytemuck::cast_slice_mut(known)[..LAYERS * pixels],
            lit: &mut bytemuck::cast_slice_mut(lit)[..2 * LAYERS * pixels],
            picture: &mut bytemuck::cast_slice_mut(picture)[..pixels],
            tally: &mut tally[..TALLIES],
        }
    }
}
