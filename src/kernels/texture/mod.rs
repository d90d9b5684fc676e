//! Twins of the kernels that look textures up.

pub mod bc5;
pub mod bc7;
pub mod sample;
pub mod texture;

#[cfg(test)]
mod texture_tests;
