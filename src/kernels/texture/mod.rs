//! Twins of the kernels that look textures up.

pub mod bc5;
pub mod bc7;
pub mod look_up;
pub mod more;
pub mod sample;
pub mod texels;
// A twin's file has the name of its kernel.
#[allow(clippy::module_inception)]
pub mod texture;

#[cfg(test)]
mod texture_tests;
