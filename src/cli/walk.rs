//! `brickwalk walk`: frames along a camera path, with records, a summary and a report.

use super::cached;
use super::options::render_args::WalkArgs;
use super::part::{self, Joined};
use super::watcher::{UntilStopped, Watcher};
use crate::cli::output::{Usage, is_quiet, note, print, warn};
use crate::counters::{COLUMNS, Column, Kind, Record};
use crate::output::atomic;
use crate::session::checkpoints::Checkpoint;
use crate::session::{Pictures, Session, Settings, parts, summary};
use crate::settings::sizes::{counted, human_bytes};
use anyhow::{Result, bail};
use brickwalk_convert::progress::Progress;
use brickwalk_report::Field;
use std::io::Write;
use std::path::Path;
use std::sync::atomic::Ordering;
use tracing::info;

/// Runs the command.
///
/// # Errors
/// Bad scene, path, cache or output folder; a damaged brick; the device's.
pub fn run(args: &WalkArgs) -> Result<()> {
    let settings = args.settings()?;
    if args.print_settings {
        return print(&settings.to_toml());
    }
    let (scene, output) = args.files()?;
    let scene = cached::scene(scene)?;
    match args.part {
        Some(part) => part::render(&scene, output, &settings, part),
        None => walk(&scene, output, &settings, Said { json: args.json, joins: args.join }).map(drop),
    }
}

/// What is said of a walk, and where its frames come from.
#[derive(Clone, Copy, Debug, Default)]
pub struct Said {
    /// Records are printed, too.
    pub json: bool,
    /// Frames that have been rendered as parts are taken from there.
    pub joins: bool,
}

/// Walks through `scene` and writes frames, records, summary and report to `output`. Returns the records.
///
/// # Errors
/// As [`run`].
pub fn walk(scene: &Path, output: &Path, settings: &Settings, Said { json, joins }: Said) -> Result<Vec<Record>> {
    if joins {
        parts::check(settings).map_err(|error| Usage(error.to_string()))?;
    }
    let mut session = Session::open(scene, settings)?;
    warn(session.take_warnings());
    atomic::create_folder(&output.join("frames"))?;
    let _owned = atomic::Owned::take(output)?;
    for stale in ["summary.json", "report.html", "records.csv", "checkpoints.jsonl", "checkpoints.csv"] {
        // What is left of an earlier walk must not be taken for a part of this one.
        let _ = std::fs::remove_file(output.join(stale));
    }
    let (progress, stop) = (Progress::new(), super::interrupt::flag());
    let mut joined = joins.then(|| Joined::new(output, session.key())).transpose()?;
    session.prepare(&mut Watcher::new(&progress, stop, settings))?;
    progress.finish();
    warn(session.take_warnings());
    let are_joined = session.renderer().bands().len() > 1;
    let mut pictures = Pictures::create(output, settings, are_joined)?;
    let mut lines = atomic::JsonLines::create(&output.join("records.jsonl"))?;
    let measures = !settings.checkpoints.is_empty();
    let checkpoints = measures.then(|| atomic::JsonLines::create(&output.join("checkpoints.jsonl")));
    let mut checkpoints = checkpoints.transpose()?;
    let progress = Progress::new();
    // Of what is joined parts are counted.
    let counted_by =
        Settings { frames: if joins { parts::count(settings) } else { settings.frames }, ..settings.clone() };
    let mut watcher = Watcher::new(&progress, stop, &counted_by);
    let mut records: Vec<Record> = Vec::new();
    // Notes what a frame did, once its picture is written.
    let mut note_frame = |(own, measured): (Vec<Record>, Vec<Checkpoint>)| -> Result<()> {
        if let Some(checkpoints) = &mut checkpoints {
            measured.iter().try_for_each(|checkpoint| checkpoints.push(checkpoint).map(drop))?;
        }
        for record in own {
            let line = lines.push(&record)?;
            if json {
                print(&line)?;
            }
            records.push(record);
        }
        Ok(())
    };
    let (mut finished, mut in_writing, mut failed) = (0, None, None);
    while finished < settings.frames && !stop.load(Ordering::Relaxed) {
        let preview = settings.progressive.then(|| pictures.preview());
        let frame = match &mut joined {
            Some(joined) => joined.frame(&mut session, (finished, preview), &mut watcher),
            None => session.frame_watched(finished, watcher.of_frame(finished, preview)),
        };
        let mut frame = match frame {
            Ok(Some(frame)) => frame,
            Ok(None) => break,
            Err(error) => {
                failed = Some(error);
                break;
            }
        };
        warn(session.take_warnings());
        info!("{}", told(finished, &frame.records));
        let did = (std::mem::take(&mut frame.records), std::mem::take(&mut frame.checkpoints));
        pictures.frame(frame)?;
        in_writing.replace(did).map_or(Ok(()), &mut note_frame)?;
        finished += 1;
    }
    progress.finish();
    let (video, commands) = pictures.finish(failed.is_some())?;
    in_writing.map_or(Ok(()), &mut note_frame)?;
    if let Some(error) = failed {
        return Err(error);
    }
    let left_out = session.left_out(&mut UntilStopped(stop))?;
    let mut summary = summary::summary(&mut session, &records, left_out, video);
    if let (Some(joined), Some(summary)) = (&joined, summary.as_object_mut()) {
        summary.insert("parts".into(), joined.summary());
    }
    atomic::write(&output.join("summary.json"), (serde_json::to_string_pretty(&summary)? + "\n").as_bytes())?;
    session.write_requests()?;
    brickwalk_report::write(output, &fields())?;
    if let Some(joined) = joined.filter(|_| finished == settings.frames) {
        joined.remove(settings);
    }
    let frames = output.join("frames");
    let mut last = vec![format!("{}: {}", frames.display(), counted(finished.into(), "frame"))];
    last.push(format!("{}: report", output.join("report.html").display()));
    say(&[last, commands].concat(), json)?;
    if finished < settings.frames {
        bail!(
            "interrupted after {finished} of {} frames; the finished ones are in {}",
            settings.frames,
            output.display()
        );
    }
    let non_finite: u64 = records.iter().map(|r| r.non_finite).sum();
    if non_finite > 0 {
        let pixels = counted(non_finite, "non-finite pixel");
        bail!("{pixels}; this is a bug in brickwalk, records.jsonl names the frames");
    }
    Ok(records)
}

/// A frame in a line: how long it took, and of each effect the time, the schedule and what was loaded.
fn told(frame: u32, records: &[Record]) -> String {
    let effect = |r: &Record| {
        let schedule = r.schedule.to_string();
        let by = if schedule.is_empty() { String::new() } else { format!(" by {schedule}") };
        let bytes = r.loaded_bytes();
        let loaded = if bytes > 0 { format!(", {} loaded", human_bytes(bytes)) } else { String::new() };
        format!("{} {:.1} ms{by}{loaded}", r.pass, r.ms)
    };
    let ms: f64 = records.iter().map(|r| r.ms).sum();
    format!("frame {frame}: {ms:.1} ms: {}", records.iter().map(effect).collect::<Vec<_>>().join("; "))
}

/// What reports say of the fields of records.
fn fields() -> Vec<Field> {
    let written = COLUMNS.iter().filter(|column| column.is_written);
    let of = |column: &Column| Field {
        name: column.name,
        meaning: format!("{} Unit: {}.", column.description(), column.unit),
        only: column.only,
        adds_up: !matches!(column.kind, Kind::State | Kind::Max | Kind::Names),
    };
    written.map(of).collect()
}

/// Says lines on standard output, or beside it where records go there.
fn say(lines: &[String], json: bool) -> Result<()> {
    let text: String = lines.iter().map(|line| format!("{line}\n")).collect();
    if !json || is_quiet() {
        return note(&text);
    }
    // Whoever closed standard error does not want to know.
    let _ = std::io::stderr().write_all(text.as_bytes());
    Ok(())
}
