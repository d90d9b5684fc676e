//! From radiance to pictures: denoising and anti-aliasing over frames, exposure, tone maps.

mod color;
pub mod denoise;
pub mod exposure;
pub mod tone_map;

pub use color::{error_heat, heat};
pub use exposure::{Exposure, MOST_STOPS, Meter};
pub use tone_map::ToneMap;
