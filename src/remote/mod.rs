//! Scenes by URL: buckets (`s3://`, `gs://`, `az://`) and web servers (`http://`, `https://`), through the crate
//! `object_store`.
//!
//! Theory: what a round asks for is known before any of it is read, and a far source costs a round trip whatever is
//! asked. So the spans of a round are announced together ([`bricks::ByteSource::announce`]), joined where hardly
//! anything lies between them, and fetched at the same time. Opening takes the header and the resident part: two
//! requests. An object is pinned by its ETag, so bytes of two versions never mix, and payloads are checked by their
//! checksums as those of files are.
//!
//! Practice: a scene goes by its *name*, the URL without user, password and query. What is secret stays in a table of
//! this module; names are what is printed and recorded.

#[cfg(feature = "remote")]
mod batch;
mod disk;
#[cfg(feature = "remote")]
mod entries;
#[cfg(feature = "remote")]
mod fetch;
#[cfg(feature = "remote")]
mod held;
mod names;
#[cfg(feature = "remote")]
mod source;
#[cfg(feature = "remote")]
mod store;
#[cfg(all(test, feature = "remote"))]
mod tests;
mod traffic;

pub use disk::DiskCache;
pub use names::{is_url, keep_on_disk, name, name_with, refuse, take_warnings, traffic};
pub use traffic::Traffic;

use anyhow::Result;
use bricks::SceneFile;
use std::path::Path;

/// Opens the scene that a URL or the name of one stands for.
///
/// # Errors
/// There is none, no access, no answer; it is no scene, or damaged; this program is built without the feature `remote`.
#[cfg(feature = "remote")]
pub fn open(url: &Path) -> Result<SceneFile> {
    let place = names::place(url);
    source::open(&place, &fetch::Limits::default())
}

/// Refuses: this program is built without the feature `remote`.
///
/// # Errors
/// Always.
#[cfg(not(feature = "remote"))]
pub fn open(url: &Path) -> Result<SceneFile> {
    let name = name(url);
    anyhow::bail!("{}: this brickwalk is built without the feature remote; download the scene", name.display())
}
