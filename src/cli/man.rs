//! `completions` and `man`: what shells and `man` know of the commands, made from their definition.

use super::options::args::{Cli, CompletionsArgs, ManArgs};
use crate::cli::output::{note, print};
use crate::output::atomic;
use crate::settings::sizes::counted;
use anyhow::{Context, Result};
use clap::{Command, CommandFactory};
use clap_mangen::Man;
use std::path::Path;

/// Prints the completions of a shell.
///
/// # Errors
/// Standard output is closed.
pub fn completions(args: &CompletionsArgs) -> Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "brickwalk", &mut script);
    print(&String::from_utf8(script).context("the completions are not UTF-8")?)
}

/// Writes a page for each command.
///
/// # Errors
/// The folder or a page cannot be written.
pub fn run(args: &ManArgs) -> Result<()> {
    atomic::create_folder(&args.folder)?;
    let mut cli = Cli::command().disable_help_subcommand(true);
    cli.build();
    let pages = write(&cli, &args.folder)?;
    note(&format!("{}: {}; read them with man -l\n", args.folder.display(), counted(pages, "man page")))
}

/// Writes the pages of a command and of those below it; how many they are.
fn write(command: &Command, folder: &Path) -> Result<u64> {
    // A page has room for what few need.
    let man = Man::new(command.clone().mut_args(|option| option.hide_long_help(false).hide_short_help(false)));
    let mut page = Vec::new();
    man.render(&mut page)?;
    atomic::write(&folder.join(man.get_filename()), &page)?;
    command.get_subcommands().try_fold(1, |pages, below| Ok(pages + write(below, folder)?))
}
