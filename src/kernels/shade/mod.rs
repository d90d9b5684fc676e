//! Twins of the kernels that make rays and shade what they hit.

pub mod choose;
pub mod clip_rays;
pub mod cones;
mod directions;
mod film;
pub mod generate;
pub mod gloss;
pub mod halve_rays;
pub mod lamps;
mod layers;
#[cfg(test)]
mod layers_tests;
pub mod light;
pub mod more;
pub mod paths;
pub mod random;
pub mod resolve;
// A twin's file has the name of its kernel.
#[allow(clippy::module_inception)]
pub mod shade;
