//! `brickwalk demo`: a city larger than the cache, generated, converted, walked through and reported.

use super::options::args::DemoArgs;
use super::options::scene_args::{SceneArgs, VerifyArgs};
use super::walk::{self, Said};
use super::{scene, verify};
use crate::cli::output::note;
use crate::counters::Record;
use crate::output::atomic;
use crate::session::Settings;
use crate::settings::Group;
use crate::settings::sizes::{counted, human_bytes, human_count};
use crate::stream::PayloadSource;
use anyhow::Result;
use bricks::SceneFile;

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
    }
    .for_pictures();
    step("walk through it out of core", &format!("walk {name} -o {output} {}", settings.options()))?;
    let records = walk::walk(&file, &args.output, &settings, Said::default())?;
    let scene = SceneFile::open(&file)?;
    note(&format!("{}\n", shown(&records, PayloadSource::sizes(&scene).sum())))
}

/// What a walk through a scene of so many bytes showed.
fn shown(records: &[Record], all_bytes: u64) -> String {
    let sum = |of: fn(&Record) -> u64| records.iter().map(of).sum::<u64>();
    let bytes = sum(Record::loaded_bytes);
    let cache = records.first().map_or(0, |record| record.cache_bytes);
    format!(
        "The scene takes {}, its cache held {}: {} were loaded ({}), {} evicted to make room, and every \
         pixel is exact.",
        human_bytes(all_bytes),
        human_bytes(cache),
        counted(sum(|r| r.bricks_loaded), "payload"),
        human_bytes(bytes),
        human_count(sum(|r| r.bricks_evicted))
    )
}

fn step(what: &str, command: &str) -> Result<()> {
    note(&format!("\n# {what}\n$ brickwalk {command}\n"))
}
