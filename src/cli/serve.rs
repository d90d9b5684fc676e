//! `brickwalk serve`: the window in a browser, for machines without a screen.

use super::cached;
use super::options::render_args::ServeArgs;
use crate::cli::output::{is_quiet, print};
use crate::view::serve::{self, Options};
use crate::view::studio::Pace;
use anyhow::Result;
use std::io::Write;
use std::sync::Arc;

/// Runs the command.
///
/// # Errors
/// Settings that do not go together; a scene that is not there; an address that cannot be listened on.
pub fn run(args: &ServeArgs) -> Result<()> {
    let settings = args.given.settings()?;
    // What is missing is told now rather than to whoever opens the page; a model is converted once for all.
    let scene = cached::scene(&args.scene)?;
    crate::session::open_scene(&scene)?;
    let options = Options {
        scene,
        settings,
        pace: Pace::default(),
        address: args.bind,
        port: args.port,
        most: args.viewers as usize,
    };
    serve::run(options, Arc::new(|path, _| Ok(path.into())), |link| {
        print(&format!("{link}\n"))?;
        // Whoever takes the first line need not stay for more.
        if !is_quiet() {
            let _ = writeln!(std::io::stderr(), "brickwalk: open this link in a browser; Ctrl-C ends");
        }
        Ok(())
    })
}
