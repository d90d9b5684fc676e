//! How much memory the pictures of a session take, and whether that is there: found before anything is made.

use super::device::Device;
use crate::cpu;
use crate::frame::Seen;
use crate::kernels::layout::{GBuffer, Hit, Ray, Surface};
use crate::picture::denoise::Past;
use crate::session::Settings;
use crate::settings::sizes::human_bytes;
use anyhow::{Result, bail};

/// Bytes that a pixel takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PictureBytes {
    /// On the device: rays, hits, surfaces, what shading keeps.
    pub device: u64,
    /// On the host at most: sums of samples, what guides filters, layers of images, all while a frame is finished.
    pub host: u64,
}

/// Of the sums of a frame's samples in f64, of what is read back and of their mean.
const SUMS: u64 = 32 + 16 + 12;
/// Of depth, normal, id and albedo.
const AOVS: u64 = 32;
/// Of the layers of an EXR, as values, by channel and compressed.
const AOV_LAYERS: u64 = 3 * 44;
/// Of the light of lamps, of parts of light and of pictures between the levels of a filter.
const FILTER: u64 = 16 + 24 + 2 * 160;

impl PictureBytes {
    /// Those of a pixel.
    pub fn of(settings: &Settings) -> Self {
        let bytes = |sizes: &[usize]| sizes.iter().sum::<usize>() as u64;
        let set = bytes(&[size_of::<Ray>(), size_of::<Hit>(), size_of::<Surface>()]);
        let shading = size_of::<GBuffer>() as u64;
        // Light that comes by a bounce has a set of rays, what shading keeps, a share and a density more.
        let bounces = if settings.effects.diffuse || settings.effects.glossy { set + shading + 20 } else { 0 };
        let device = 2 * set + shading + 16 + bounces;
        let guides = if settings.denoise || settings.taa { 2 * size_of::<Seen>() as u64 } else { 0 };
        let filter = if settings.denoise { 2 * size_of::<Past>() as u64 + FILTER } else { 0 };
        let read = if settings.aov || guides > 0 { set + shading } else { 0 };
        let (aovs, layers) = if settings.aov { (AOVS, AOV_LAYERS) } else { (0, 0) };
        let sessions = if settings.measure_error { 2 } else { 1 };
        Self { device: sessions * device, host: sessions * SUMS + guides + aovs + filter.max(read).max(layers) }
    }

    /// Refuses a size of pictures for which there is too little memory.
    ///
    /// # Errors
    /// How much is needed, how much there is, and the largest size that it is enough for.
    pub fn check(settings: &Settings, device: &Device) -> Result<()> {
        let Self { device: on_device, host } = Self::of(settings);
        let available = cpu::available_memory();
        match device {
            Device::Cpu => refuse(settings, on_device + host, "memory", available),
            Device::Gpu(gpu) => {
                refuse(settings, on_device, "memory of the device", gpu.local_memory)?;
                refuse(settings, host, "memory", available)
            }
        }
    }
}

fn refuse(settings: &Settings, a_pixel: u64, what: &str, available: Option<u64>) -> Result<()> {
    let (width, height) = (u64::from(settings.size.width), u64::from(settings.size.height));
    let needed = width * height * a_pixel;
    let Some(available) = available.filter(|&available| available < needed) else { return Ok(()) };
    let share = (available as f64 / needed as f64).sqrt();
    let [width, height] = [width, height].map(|edge| ((edge as f64 * share) as u64).max(1));
    bail!(
        "--size {}: pictures take {} of {what}, {a_pixel} bytes a pixel, and {} are available; give at most \
         --size {width}x{height}, or render without {}",
        settings.size,
        human_bytes(needed),
        human_bytes(available),
        "--aov, --denoise, --taa, and diffuse and glossy in --effects"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_size_that_is_named_is_accepted() {
        let settings = |options: &str| Settings::from_options(options).unwrap();
        for options in ["--size 16384x16384", "--size 16384x8000 --aov --effects diffuse --denoise"] {
            let settings = settings(options);
            let PictureBytes { device, host } = PictureBytes::of(&settings);
            let has = |settings: &Settings| refuse(settings, device + host, "memory", Some(3 << 30));
            let says = has(&settings).unwrap_err().to_string();
            assert!(says.contains("3.0 GiB are available"), "{says}");
            let named = says.split("at most ").nth(1).unwrap().split(',').next().unwrap();
            let smaller = Settings { size: Settings::from_options(named).unwrap().size, ..settings.clone() };
            assert!(has(&smaller).is_ok() && smaller.size.width > 1000, "{named}");
            assert!(refuse(&settings, device, "memory", None).is_ok(), "what is not known is no reason");
        }
    }

    #[test]
    fn what_takes_more_is_counted() {
        let of = |options: &str| PictureBytes::of(&Settings::from_options(options).unwrap());
        let plain = of("--effects shadow");
        assert_eq!(of("--effects shadow --spp 100"), plain);
        assert!(of("--effects shadow,diffuse").device > plain.device);
        for options in ["--aov", "--denoise", "--taa"] {
            assert!(of(&format!("--effects shadow {options}")).host > plain.host, "{options}");
        }
        assert_eq!(of("--effects shadow --measure-error").device, 2 * plain.device);
    }
}
