//! Converts scenes of common formats into `.bricks`: importers produce a [`source::SourceScene`], the builder cuts it into bricks.

pub mod build;
pub mod import;
pub mod progress;
pub mod source;
