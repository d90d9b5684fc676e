//! How much memory the pictures of a session take. Of a picture that is rendered in bands, rays and what shading keeps
//! are those of one band; what is joined of all of them is on the host.

use crate::frame::{SampleNoise, Second, Seen};
use crate::kernels::denoise;
use crate::kernels::layout::{DenoiseGiven, DenoiseSecond, DenoiseSeen, GBuffer, Hit, Origin, Ray, Surface};
use crate::session::Settings;

/// Bytes that a pixel takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PictureBytes {
    /// On the device: rays, hits, surfaces, what shading keeps.
    pub device: u64,
    /// On the device beside that, of a picture that is rendered at once: what denoising keeps. That of a joined one is
    /// on the host.
    pub filter: u64,
    /// On the host at most, of a picture that is rendered at once: sums of samples, what guides filters, layers of
    /// images, all while a frame is finished.
    pub host: u64,
    /// On the host, of a pixel of the band that is rendered: sums of samples, what is read back.
    pub band: u64,
    /// On the host at most, of a pixel of a picture that is joined of bands: what the bands showed, and the same while
    /// a frame is finished.
    pub joined: u64,
}

/// Of the sums of a frame's samples in f64, of what is read back and of their mean.
const SUMS: u64 = 32 + 16 + 12;
/// Of the sums that guides keep, of radiance before and after the lamps, of second surfaces, and of what a sample saw.
const GUIDE_SUMS: u64 = 184 + 32 + 2 * size_of::<Option<Seen>>() as u64 + 12;
/// Of the noise of a pixel's samples, and of what is read back to find it.
const NOISE: u64 = 12 + 16;
/// Of the mean of the samples, and whether a surface was seen.
const MEAN: u64 = 12 + 1;
/// Of depth, normal, id and albedo.
const AOVS: u64 = 32;
/// Of the layers of an EXR, as values, by channel and compressed.
const AOV_LAYERS: u64 = 3 * 44;
/// Of what denoising is given of a frame, with a second surface, and of what it gives back.
const FILTER: u64 =
    (size_of::<DenoiseSeen>() + size_of::<DenoiseGiven>() + size_of::<DenoiseSecond>()) as u64 + 16 + 32;
/// Of radiance that is measured and sorted for an exposure; of a PNG, mapped, as bytes and compressed, no more.
const FINISH: u64 = 12 + 4 + 4;

impl PictureBytes {
    /// Those of a pixel; `has_more`: of a scene with further textures.
    pub fn of(settings: &Settings, has_more: bool) -> Self {
        let bytes = |sizes: &[usize]| sizes.iter().sum::<usize>() as u64;
        let set = bytes(&[size_of::<Ray>(), size_of::<Hit>(), size_of::<Surface>()]);
        let shading = (size_of::<GBuffer>() * if has_more { 2 } else { 1 }) as u64;
        // Light that comes by a bounce has a set of rays and what shading keeps more; a share and a density, where it
        // comes from, and a count for 64 of it.
        let carried = 16 + size_of::<Origin>() as u64 + 1;
        let bounces = if settings.effects.diffuse || settings.effects.glossy { set + shading + carried } else { 0 };
        let device = 2 * set + shading + 16 + bounces;
        let has_guides = settings.denoise || settings.taa;
        let guides = if has_guides {
            2 * (size_of::<Seen>() + size_of::<SampleNoise>() + size_of::<Option<Second>>() + 12) as u64
        } else {
            0
        };
        let (given, filter) = if settings.denoise { (FILTER, denoise::bytes_a_pixel()) } else { (0, 0) };
        let read = if settings.aov || has_guides { set + shading } else { 0 };
        let (aovs, layers) = if settings.aov { (AOVS, AOV_LAYERS) } else { (0, 0) };
        let sums = SUMS + if settings.noise.is_some() { NOISE } else { 0 };
        let sessions = if settings.measure_error { 2 } else { 1 };
        // Of the frame before, which is written meanwhile; joined ones are written before the next.
        let written = if settings.frames > 1 { MEAN + aovs } else { 0 };
        Self {
            device: sessions * device,
            filter,
            host: sessions * sums + guides + aovs + given.max(read).max(layers) + written,
            band: sums + read + if has_guides { GUIDE_SUMS } else { 0 },
            joined: MEAN + guides + aovs + (given + filter).max(layers).max(FINISH),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_takes_more_is_counted() {
        let of = |options: &str| PictureBytes::of(&Settings::from_options(options).unwrap(), false);
        let plain = of("--effects shadow");
        assert_eq!(of("--effects shadow --spp 100"), plain);
        assert!(of("--effects shadow,diffuse").device > plain.device);
        assert!(of("--effects shadow --denoise").filter > 0 && plain.filter == 0);
        for options in ["--aov", "--denoise", "--taa"] {
            let more = of(&format!("--effects shadow {options}"));
            assert!(more.host > plain.host && more.joined > plain.joined, "{options}");
        }
        let further = PictureBytes::of(&Settings::from_options("--effects shadow").unwrap(), true);
        assert_eq!(further.device, plain.device + size_of::<GBuffer>() as u64);
        assert_eq!(of("--effects shadow --measure-error").device, 2 * plain.device);
        // What bands are for.
        assert!(plain.joined * 8 < plain.device + plain.host);
    }
}
