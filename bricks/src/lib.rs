//! The `.bricks` scene file: records, reader, writer, validation. See `FORMAT.md` for the byte maps.

pub mod manifest;
pub mod records;

pub use manifest::{Manifest, Provenance, Source};
pub use records::*;
