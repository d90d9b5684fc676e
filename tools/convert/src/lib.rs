//! Converts scenes of common formats into `.bricks`: importers and generators are a [`source::Source`],
//! the builder cuts it into bricks.

pub mod build;
pub mod import;
pub mod progress;
#[cfg(test)]
#[path = "../../../tests/skip.rs"]
mod skip;
pub mod source;
mod srgb;

pub use bricks::pattern;
