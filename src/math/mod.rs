//! Arithmetic that the rest builds on: the exact ray-triangle test, sampling patterns, encodings of directions.

pub mod alias;
pub mod angles;
pub mod blue_noise;
pub mod crossing;
pub mod exact;
pub mod median;
pub mod octahedral;
pub mod random;
pub mod sampling;
pub mod sines;
pub mod welford;
