//! An image in memory.

use super::color::linear_from_srgb;

/// A picture in linear Rec. 709 RGB, rows top to bottom.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// `width * height` pixels, row by row; any value, NaN and infinities too.
    pub rgb: Vec<[f32; 3]>,
}

/// Two images do not fit together.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ImageError {
    /// The images differ in size.
    #[error("the images differ in size: {a_width}x{a_height} and {b_width}x{b_height}; compare images of one size")]
    Size {
        /// Width of the first image in pixels.
        a_width: usize,
        /// Height of the first image in pixels.
        a_height: usize,
        /// Width of the second image in pixels.
        b_width: usize,
        /// Height of the second image in pixels.
        b_height: usize,
    },
    /// The number of pixels is not width times height, or is zero.
    #[error("an image of {width}x{height} with {pixels} pixels; it must have width times height pixels, at least one")]
    Pixels {
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
        /// Pixels present.
        pixels: usize,
    },
}

impl Image {
    /// An image of `width * height` pixels, each what `pixel(x, y)` says.
    pub fn from_fn(width: usize, height: usize, mut pixel: impl FnMut(usize, usize) -> [f32; 3]) -> Self {
        let rgb = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| pixel(x, y)).collect();
        Self { width, height, rgb }
    }

    /// An image of sRGB bytes, row by row.
    pub fn from_srgb(width: usize, height: usize, pixels: &[[u8; 3]]) -> Self {
        let linear: Vec<f32> = (0..=255u8).map(|byte| linear_from_srgb(f64::from(byte) / 255.0) as f32).collect();
        Self { width, height, rgb: pixels.iter().map(|pixel| pixel.map(|byte| linear[usize::from(byte)])).collect() }
    }

    /// The pixel at column `x` of row `y`.
    pub fn get(&self, x: usize, y: usize) -> [f32; 3] {
        self.rgb[y * self.width + x]
    }

    fn check(&self) -> Result<(), ImageError> {
        if self.rgb.is_empty() || self.width.checked_mul(self.height) != Some(self.rgb.len()) {
            return Err(ImageError::Pixels { width: self.width, height: self.height, pixels: self.rgb.len() });
        }
        Ok(())
    }
}

/// Succeeds if both images are well formed and of one size.
pub fn check_same_size(a: &Image, b: &Image) -> Result<(), ImageError> {
    a.check()?;
    b.check()?;
    if (a.width, a.height) != (b.width, b.height) {
        let (a_width, a_height, b_width, b_height) = (a.width, a.height, b.width, b.height);
        return Err(ImageError::Size { a_width, a_height, b_width, b_height });
    }
    Ok(())
}

/// Per pixel, whether both images are finite there.
pub(crate) fn finite_in_both(a: &Image, b: &Image) -> Vec<bool> {
    let finite = |p: &[f32; 3]| p.iter().all(|c| c.is_finite());
    a.rgb.iter().zip(&b.rgb).map(|(a, b)| finite(a) && finite(b)).collect()
}
