//! How much two pictures differ: RMSE, relMSE, signed bias, greatest error, FLIP and HDR-FLIP, and ids that differ.
//!
//! All metrics take linear Rec. 709 RGB; [`load()`] decodes PNG from sRGB and takes EXR as it is. In every comparison
//! the second image is the reference. [`compare()`] computes them all at once; the functions are there one by one as
//! well.
//!
//! | metric | formula, over the compared pixels and channels | source |
//! | --- | --- | --- |
//! | RMSE | √ mean (a − b)² | |
//! | relMSE | mean (a − b)² / (b² + 0.01) | Rousselle, Knaus, Zwicker 2011 |
//! | bias | mean (a − b) | |
//! | greatest error | max abs(a − b) | |
//! | FLIP | [`flip_ldr`] | Andersson et al. 2020 |
//! | HDR-FLIP | [`flip_hdr`] | Andersson et al. 2021 |
//!
//! A pixel with a NaN or an infinity in either image is counted and left out of all of them.

mod color;
mod compare;
mod filter;
mod flicker;
mod flip;
mod hdr;
mod image;
mod load;
mod pixel;

#[cfg(test)]
mod oracle_tests;

pub use compare::{CompareError, Comparison, FlipKind, compare, count_differing};
pub use flicker::{Change, flicker};
pub use flip::{FlipMap, PIXELS_PER_DEGREE, flip_ldr};
pub use hdr::{Exposures, exposures, flip_hdr};
pub use image::{Image, ImageError, check_same_size};
pub use load::{Channel, Encoding, LoadError, Loaded, load};
pub use pixel::{PixelErrors, RELATIVE_EPSILON, pixel_errors};
