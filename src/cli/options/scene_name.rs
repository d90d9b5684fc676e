//! Reads where a scene is.

use crate::remote;
use clap::builder::{PathBufValueParser, TypedValueParser};
use std::path::PathBuf;

/// A path, or a URL: what is secret of it goes no further.
pub fn scene_name() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().map(|path| remote::name(&path))
}
