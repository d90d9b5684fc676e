//! `brickwalk view`: a window to fly through a scene.

use super::cached;
use super::options::render_args::ViewArgs;
use crate::view::studio::Pace;
use crate::view::window::{self, Options};
use anyhow::Result;
use std::path::PathBuf;
use std::sync::Arc;

/// Runs the command.
///
/// # Errors
/// Settings that do not go together; there is no display, or it fails.
pub fn run(args: &ViewArgs) -> Result<()> {
    let settings = args.given.settings()?;
    let options = Options {
        scene: args.scene.clone(),
        settings,
        pace: Pace::default(),
        folder: args.output.clone().unwrap_or_else(|| PathBuf::from(".")),
    };
    window::run(options, Arc::new(cached::scene_quietly))
}
