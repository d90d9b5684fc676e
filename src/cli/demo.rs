//! `brickwalk demo`: a city larger than the cache, generated, converted, walked through and reported.

use super::options::args::{Cli, Command, DemoArgs};
use crate::output::atomic;
use anyhow::{Context, Result};
use clap::Parser;
use std::ffi::OsString;

/// Runs the command: the same commands that a user would type, each printed before it runs.
///
/// # Errors
/// Those of the commands.
pub fn run(args: &DemoArgs) -> Result<()> {
    atomic::create_folder(&args.output)?;
    let scene = args.output.join("city.bricks");
    let path = args.output.join("city.near.json");
    let (triangles, seed) = (args.triangles.to_string(), args.seed.to_string());
    let mut generate: Vec<OsString> = ["brickwalk", "scene", "city", "-o"].map(OsString::from).to_vec();
    generate.push(scene.clone().into());
    generate.extend(["--triangles", &triangles, "--seed", &seed].map(OsString::from));
    step("generate and convert a city", &generate)?;
    step("check every byte of it", &["brickwalk".into(), "verify".into(), scene.clone().into()])?;
    let mut walk: Vec<OsString> = vec!["brickwalk".into(), "walk".into(), scene.into(), "-o".into()];
    walk.push(args.output.clone().into());
    walk.extend(["--path".into(), path.into()]);
    let (frames, size, cache) = (args.frames.to_string(), args.size.to_string(), args.cache.to_string());
    walk.extend(["--frames", &frames, "--size", &size, "--cache", &cache, "--seed", &seed].map(OsString::from));
    walk.extend(["--adapter", &args.adapter.to_string()].map(OsString::from));
    step("walk through it, out of core", &walk)?;
    let report = args.output.join("report.html");
    super::print(&format!("Done. Frames: {}\nReport: {}\n", args.output.join("frames").display(), report.display()))
}

fn step(what: &str, words: &[OsString]) -> Result<()> {
    let line: Vec<_> = words.iter().map(|w| w.to_string_lossy()).collect();
    super::print(&format!("\n# {what}\n$ {}\n", line.join(" ")))?;
    let cli = Cli::try_parse_from(words).context("the demo's own command")?;
    match &cli.command {
        Command::Demo(_) => Ok(()),
        command => super::run(command),
    }
}
