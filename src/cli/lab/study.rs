//! `study`: error against run time over methods, parameters and sizes of the cache.

use super::bench::console;
use crate::cli::options::group_args::{GroupArgs, View};
use crate::cli::options::scene_name::scene_name;
use crate::cli::options::units::UNITS;
use crate::lab::study;
use crate::lab::study::args::StudyArgs;
use crate::settings::Entry;
use anyhow::Result;
use clap::Args;
use std::path::PathBuf;

/// The settings of a study that are options.
#[derive(Clone, Copy, Debug)]
pub struct OfStudy;

impl View for OfStudy {
    type Group = StudyArgs;

    fn has(entry: &Entry) -> bool {
        !["output", "scene"].contains(&entry.field.key)
    }
}

/// Options of `study`.
#[derive(Clone, Debug, Args)]
#[command(after_help = UNITS)]
pub struct StudyCommand {
    /// The scene, or the URL of one
    #[arg(value_name = "S.bricks", value_parser = scene_name())]
    scene: PathBuf,
    /// Folder for the results. Started again with the same folder and settings, a study goes on where it stopped
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Everything else.
    #[command(flatten)]
    options: GroupArgs<OfStudy>,
}

/// Runs `study`.
///
/// # Errors
/// The scene's; the device's; the folder cannot be written.
pub fn run(args: &StudyCommand) -> Result<()> {
    let (scene, output) = (args.scene.clone(), args.output.clone());
    study::run(&StudyArgs { scene, output, ..args.options.over(None)? }, console())
}
