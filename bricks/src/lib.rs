//! The `.bricks` scene file: records, reader, writer, validation. See `FORMAT.md` for the byte maps.
//!
//! One file holds a whole scene: a header, the payloads (geometry, attributes, texels), and the resident part that says
//! where they lie. Whatever is read is checked once, at the file's edge, and may be indexed freely from then on:
//!
//! * [`SceneFile::open`] checks the header, the directory and every section of the resident part (checksums, then
//!   [`validate::resident`]). Its cost does not depend on the payloads.
//! * [`SceneFile::copy`] checks a payload while it is copied out: its checksum, then every index in it. Geometry and
//!   texels are used as they lie in the file, attributes are decoded ([`attributes`]), displacement fields unpacked
//!   ([`pack`]).
//! * [`verify_file`] reads every byte of the file, padding included, and lists all that is wrong.
//!
//! Numbers on disk are little-endian and of fixed width; offsets and lengths are `u64`.

#[cfg(target_endian = "big")]
compile_error!("the records of a scene file are used as they lie on disk, which is little-endian");
#[cfg(not(target_pointer_width = "64"))]
compile_error!("scene files are mapped whole, which takes a 64-bit address space");

pub mod attributes;
mod corners;
mod displacement;
pub mod ending;
mod error;
mod file;
mod layers;
pub mod layout;
mod level_use;
mod levels;
pub mod manifest;
mod occupancy;
pub mod pack;
pub mod pattern;
mod payload;
mod place;
pub mod planted;
mod reader;
pub mod records;
mod resident;
mod source;
pub mod texture;
pub mod validate;
mod verify;
mod writer;

pub use corners::Corners;
pub use displacement::*;
pub use error::{Error, Flaw, Part, one_line};
pub use file::{Access, SceneFile};
pub use layers::*;
pub use layout::Section;
pub use levels::*;
pub use manifest::{Manifest, Provenance, Source};
pub use occupancy::*;
pub use payload::Payload;
pub use place::{Bounds, Grid, PlaceError, REACH_STEPS, ceil_shift, image_bounds, world_box};
pub use records::*;
pub use resident::Resident;
pub use source::ByteSource;
pub use texture::{BLOCK_TEXELS, TILE_TEXELS, TilePlace};
pub use verify::{VerifyReport, verify_file};
pub use writer::{Partial, Writer, Written};
