//! 8-bit sRGB PNG files.

use super::atomic;
use anyhow::{Context, Result, ensure};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use std::path::Path;

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
