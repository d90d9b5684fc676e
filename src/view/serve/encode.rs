//! Pictures as bytes: JPEG while the camera moves, lossless WebP when it rests.

use crate::view::studio::{Shown, Stage};
use anyhow::{Context, Result};
use image::codecs::webp::WebPEncoder;
use image::{ExtendedColorType, ImageEncoder};

/// Of JPEGs.
const QUALITY: u8 = 85;
/// Most pixels of a side that a JPEG has.
const MOST_JPEG: u32 = 65_535;

/// A picture, encoded, and its kind as browsers name it.
///
/// # Errors
/// A picture that the format does not hold.
pub fn encoded(shown: &Shown) -> Result<(Vec<u8>, &'static str)> {
    let (width, height) = shown.size;
    let rgb = shown.pixels.as_flattened();
    let mut bytes = Vec::new();
    if shown.stage == Stage::Moving && width.max(height) <= MOST_JPEG {
        let encoder = jpeg_encoder::Encoder::new(&mut bytes, QUALITY);
        let (width, height) = (width as u16, height as u16);
        encoder.encode(rgb, width, height, jpeg_encoder::ColorType::Rgb).context("a picture as JPEG")?;
        return Ok((bytes, "image/jpeg"));
    }
    let encoder = WebPEncoder::new_lossless(&mut bytes);
    encoder.write_image(rgb, width, height, ExtendedColorType::Rgb8).context("a picture as WebP")?;
    Ok((bytes, "image/webp"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Camera;
    use glam::DVec3;

    #[test]
    fn pictures_at_rest_are_lossless() {
        let camera = Camera { position: DVec3::Z, target: DVec3::ZERO, up: DVec3::Y, fov_y: 1.0 };
        let pixels: Vec<[u8; 3]> = (0..35 * 21u32).map(|i| [i as u8, (i * 7) as u8, (i / 35) as u8]).collect();
        let shown = |stage| Shown {
            legend: String::new(),
            number: 1,
            camera,
            size: (35, 21),
            pixels: pixels.clone(),
            depth: Vec::new(),
            stage,
            samples: 1,
            states: [735, 0, 0],
            ms: 1.0,
            records: Vec::new(),
            exposure_ev: 0.0,
        };
        let decoded = |stage| {
            let (bytes, kind) = encoded(&shown(stage)).unwrap();
            (image::load_from_memory(&bytes).unwrap().to_rgb8().into_raw(), kind)
        };
        let (still, kind) = decoded(Stage::Done);
        assert_eq!((still.as_slice(), kind), (pixels.as_flattened(), "image/webp"));
        let (moving, kind) = decoded(Stage::Moving);
        assert!(kind == "image/jpeg" && moving.len() == still.len() && moving != still);
    }
}
