//! `brickwalk bench chc`: the experiments of Mattausch et al. 2015 on the generated scenes, each ratio beside the
//! paper's.
//!
//! A *session* is a scene, cache and size of tiles with one renderer, in which the cases of a group take turns. Each
//! finished walk is a line of `cells.jsonl`.

mod cells;
mod measure;
mod output;
mod paper;
pub mod plan;
mod plots;
mod tables;

use super::args::{ChcArgs, wanted};
use super::runner::Runner;
use super::scenes::Scenes;
use super::store::{Header, Store};
use crate::lab::console::Console;
use crate::output::atomic;
use crate::settings::SettingsError;
use anyhow::Result;
use cells::Cell;
use measure::{Bench, DoesNotFit};
use plan::{PLAIN_BVH2, Session, Stage, Walk, key};
use serde_json::json;

/// Raised when a field changes its meaning.
const FORMAT: u32 = 2;

/// Runs the command.
///
/// # Errors
/// The folder holds other measurements or cannot be written; a scene cannot be generated or read; the device's.
pub fn run(args: &ChcArgs, console: Console) -> Result<()> {
    let (settings, console) = (args.settings(), console.within(args.minutes));
    if settings.frames <= settings.skip {
        let text = format!("--frames {}: it must be above {}", settings.frames, settings.skip);
        return Err(SettingsError::Conflict(text).into());
    }
    let mut runner = Runner::new(console);
    let plan = |stages: &[Stage]| plan::walks(stages, settings.tile, settings.repeat, args.sponza.is_some());
    let mut walks = plan(&wanted(Stage::ALL, &args.stages));
    walks.retain(|(case, _)| args.wants(&case.to_string()));
    if walks.is_empty() {
        let text = format!("--only {}: no case of these stages has such a name", args.only.0.join(", "));
        return Err(SettingsError::Conflict(text).into());
    }
    atomic::create_folder(&args.output)?;
    let scenes = Scenes::new(args.scenes.as_deref(), &args.output, settings.triangles, args.sponza.as_deref(), console);
    let own = json!({
        "triangles": settings.triangles,
        "size": settings.size.to_string(),
        "frames": settings.frames,
        "skipped_frames": settings.skip,
        "repetitions": settings.repeat,
        "rays": settings.rays,
        "tile": settings.tile,
        "sponza": scenes.sponza_name(),
    });
    let header = Header::new(FORMAT, &args.adapter, own)?;
    let mut store = Store::<Cell>::open(args.output.join("cells.jsonl"), header, args.resume)?;
    let run = store.all().iter().map(|cell| cell.run + 1).max().unwrap_or(0);
    let key = |(case, repetition): &Walk| key(&case.to_string(), *repetition);
    let is_binary = |walk: &&Walk| walk.0.variant.schedule == PLAIN_BVH2.schedule && !store.has(&key(walk));
    let binary: Vec<Session> = walks.iter().filter(is_binary).map(|(case, _)| case.session()).collect();
    // What was not measured, and why.
    let mut notes = Vec::new();
    let (mut session, mut opened) = (None, None);
    let measure = |(case, repetition): &Walk| {
        if session.replace(case.session()) != Some(case.session()) {
            // Its memory is for the next one.
            opened = None;
            let place = scenes.place(case.scene)?;
            opened = match Bench::open(case, place, &settings, &args.adapter, binary.contains(&case.session())) {
                Err(error) if error.is::<DoesNotFit>() => {
                    notes.push(format!("{} with a cache of {} %: {error}", case.scene, case.cache));
                    None
                }
                bench => Some(bench?),
            };
            if let Some(reason) = opened.as_ref().and_then(|bench| bench.refuses(&PLAIN_BVH2)) {
                notes.push(format!("{}, plain-bvh2: {reason}", case.scene));
            }
        }
        let Some(bench) = opened.as_mut().filter(|bench| bench.refuses(&case.variant).is_none()) else {
            return Ok(Vec::new());
        };
        let passes = bench.walk(case, console)?;
        // The pictures are the same in every walk.
        let error = if *repetition == 0 { bench.picture_error(case, console)? } else { None };
        Ok(vec![Cell { case: case.to_string(), repetition: *repetition, run, passes, error }])
    };
    runner.measure(&mut store, &walks, |walk| vec![key(walk)], measure)?;
    // What earlier runs measured of other stages is shown, too.
    let text = output::write(&args.output, &settings, &store, &plan(Stage::ALL), &notes)?;
    runner.end(&args.output, &text)
}
