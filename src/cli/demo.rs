//! `brickwalk demo`: a city larger than the cache, generated, converted, walked through and reported.

use super::options::args::{DemoArgs, SceneArgs, VerifyArgs};
use super::{scene, verify, walk};
use crate::cli::output::note;
use crate::output::atomic;
use crate::session::Settings;
use crate::settings::Group;
use anyhow::Result;

/// Runs the command: what a user would type, each printed before it runs.
///
/// # Errors
/// Those of the commands.
pub fn run(args: &DemoArgs) -> Result<()> {
    atomic::create_folder(&args.output)?;
    let file = args.output.join("city.bricks");
    let (name, output) = (file.display(), args.output.display());
    let city = SceneArgs::city(file.clone(), args.triangles, args.seed);
    let generate = format!("scene city -o {name} --triangles {} --seed {}", args.triangles, args.seed);
    step("generate a city and convert it", &generate)?;
    scene::run(&city)?;
    step("verify every byte", &format!("verify {name}"))?;
    verify::run(&VerifyArgs { scene: file.clone() })?;
    let settings = Settings {
        path: Some(args.output.join("city.near.json")),
        frames: args.frames,
        size: args.size,
        cache: args.cache,
        seed: args.seed,
        adapter: args.adapter.clone(),
        ..Settings::default()
    };
    step("walk through it out of core", &format!("walk {name} -o {output} {}", settings.options()))?;
    walk::walk(&file, &args.output, &settings, false)
}

fn step(what: &str, command: &str) -> Result<()> {
    note(&format!("\n# {what}\n$ brickwalk {command}\n"))
}
