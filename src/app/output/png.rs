//! 8-bit sRGB PNG files.

use super::atomic;
use anyhow::{Context, Result, ensure};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use std::path::Path;

/// The sRGB value (IEC 61966-2-1), 0..=255, of a linear value: clamped to 0..=1, rounded to nearest; NaN is black.
pub fn srgb8(linear: f32) -> u8 {
    let x = f64::from(linear).clamp(0.0, 1.0);
    let encoded = if x <= 0.0031308 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
    // A NaN survives the clamp and becomes 0 in the cast.
    (encoded * 255.0 + 0.5) as u8
}

/// Writes `pixels` (sRGB, row by row from the top) as a PNG; the same pixels give the same bytes.
///
/// # Errors
/// The number of pixels is not `width` x `height`, or the file cannot be written.
pub fn write(path: &Path, width: u32, height: u32, pixels: &[[u8; 3]]) -> Result<()> {
    ensure!(
        pixels.len() as u64 == u64::from(width) * u64::from(height),
        "{}: {} pixels are no image of {width}x{height}",
        path.display(),
        pixels.len()
    );
    atomic::write_with(path, |out| {
        PngEncoder::new_with_quality(out, CompressionType::Fast, FilterType::Adaptive)
            .write_image(pixels.as_flattened(), width, height, ExtendedColorType::Rgb8)
            .with_context(|| format!("{}: cannot write this image", path.display()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_matches_the_standard() {
        for (linear, srgb) in [
            (0.0, 0),
            (1.0, 255),
            (0.5, 188),
            (0.18, 118),
            (0.0031308, 10),
            (-1.0, 0),
            (7.0, 255),
            (f32::NAN, 0),
            (f32::INFINITY, 255),
            (f32::NEG_INFINITY, 0),
        ] {
            assert_eq!(srgb8(linear), srgb, "{linear}");
        }
        // Decoding each byte and encoding it again is the identity.
        for byte in 0..=255u8 {
            let e = f64::from(byte) / 255.0;
            let linear = if e <= 0.04045 { e / 12.92 } else { ((e + 0.055) / 1.055).powf(2.4) };
            assert_eq!(srgb8(linear as f32), byte);
        }
    }

    #[test]
    fn round_trip_with_equal_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let (a, b) = (folder.path().join("a.png"), folder.path().join("b.png"));
        let pixels: Vec<[u8; 3]> = (0..37 * 11).map(|i| [i as u8, (i * 7) as u8, (i / 3) as u8]).collect();
        write(&a, 37, 11, &pixels).unwrap();
        write(&b, 37, 11, &pixels).unwrap();
        assert_eq!(std::fs::read(&a).unwrap(), std::fs::read(&b).unwrap());
        let read = image::open(&a).unwrap().into_rgb8();
        assert_eq!(read.dimensions(), (37, 11));
        assert_eq!(read.as_raw().as_slice(), pixels.as_flattened());
        assert!(write(&a, 37, 12, &pixels).is_err());
    }
}
