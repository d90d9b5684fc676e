//! `brickwalk bench executors` (`executors.rs`), `brickwalk bench roma` (`roma/`), `brickwalk bench dvf` (`dvf/`), and
//! `brickwalk bench chc`: the experiments of Mattausch et al. 2015 on the generated scenes, each ratio beside the
//! paper's.
//!
//! Everything runs in this process: a renderer a scene, cache and size of tiles, in which the cases of a group take
//! turns. Each finished walk is a line of `cells.jsonl`; tables, plots and pages are made from these lines alone.

pub mod args;
mod cells;
pub mod dvf;
mod executors;
mod measure;
mod output;
mod paper;
pub mod plan;
mod plots;
mod results;
pub mod roma;
mod rows;
mod scenes;
mod tables;

use crate::kernels::DeviceInfo;
use crate::lab::console::Console;
use crate::output::atomic;
use crate::session::device::Device;
use crate::settings::SettingsError;
use crate::settings::sizes::human_count;
use anyhow::{Result, bail};
use args::{ChcArgs, ExecutorsArgs, Settings};
use brickwalk_convert::progress::Progress;
use cells::{Cells, Header};
use dvf::args::DvfBenchArgs;
use measure::{Bench, DoesNotFit};
use plan::{Case, Group, PLAIN_BVH2, Scope};
use roma::args::RomaBenchArgs;
use serde_json::json;
use std::time::{Duration, Instant};

/// What can be measured.
#[derive(Clone, Debug)]
pub enum Experiment {
    /// The experiments of the CHC+RT paper.
    Chc(ChcArgs),
    /// The same frames on every device.
    Executors(ExecutorsArgs),
    /// The experiments of the ROMA paper.
    Roma(RomaBenchArgs),
    /// The experiments of the paper of discrete visibility fields.
    Dvf(DvfBenchArgs),
}

/// Runs an experiment.
///
/// # Errors
/// The folder holds other measurements or cannot be written; a scene cannot be generated or read; the device's.
pub fn run(experiment: &Experiment, console: Console) -> Result<()> {
    let args = match experiment {
        Experiment::Chc(args) => args,
        Experiment::Executors(args) => return executors::run(args, console),
        Experiment::Roma(args) => return roma::run(args, console),
        Experiment::Dvf(args) => return dvf::run(args, console),
    };
    let settings = args.settings();
    if settings.frames <= settings.skip {
        let text = format!("--frames {}: it must be above {}", settings.frames, settings.skip);
        return Err(SettingsError::Conflict(text).into());
    }
    chc(args, &settings, console)
}

fn chc(args: &ChcArgs, settings: &Settings, console: Console) -> Result<()> {
    let start = Instant::now();
    let scope = |stages| Scope { stages, sponza: args.sponza.is_some(), tile: settings.tile, repeat: settings.repeat };
    let mut wanted = plan::groups(&scope(args.stages()));
    for group in &mut wanted {
        group.cases.retain(|case| args.wants(&case.to_string()));
    }
    wanted.retain(|group| !group.cases.is_empty());
    if wanted.is_empty() {
        let text = format!("--only {}: no case of these stages has such a name", args.only.0.join(", "));
        return Err(SettingsError::Conflict(text).into());
    }
    atomic::create_folder(&args.output)?;
    let header = header(args, settings)?;
    let mut cells = Cells::open(&args.output, header, args.resume)?;
    let deadline = args.minutes.map(|minutes| start + Duration::from_secs_f64(60.0 * minutes));
    let mut run = Run { args, settings, console, cells: &mut cells, notes: Vec::new(), deadline };
    let ended = run.measure(&wanted)?;
    let notes = std::mem::take(&mut run.notes);
    // What earlier runs measured of other stages is shown, too.
    let all = plan::groups(&scope(plan::Stage::ALL.to_vec()));
    let text = output::write(&args.output, settings, &cells, &all, &notes)?;
    console.show(&text)?;
    match ended {
        Ended::Finished => Ok(()),
        Ended::OutOfTime => console.show("Out of time: the same command goes on where this one stopped.\n"),
        Ended::Interrupted => {
            bail!("interrupted; {} holds what is measured, and the same command goes on", args.output.display())
        }
    }
}

/// The settings that make measurements comparable.
fn header(args: &ChcArgs, settings: &Settings) -> Result<Header> {
    let DeviceInfo { name, driver, driver_info, backend, .. } = Device::open(&args.adapter)?.info();
    Ok(Header {
        format: cells::FORMAT,
        settings: json!({
            "triangles": settings.triangles,
            "size": settings.size.to_string(),
            "frames": settings.frames,
            "skipped_frames": settings.skip,
            "repetitions": settings.repeat,
            "rays": settings.rays,
            "tile": settings.tile,
            "sponza": args.sponza.as_ref().map(|file| file.file_name().map(|name| name.to_string_lossy().into_owned())),
        }),
        adapter: json!({
            "name": name,
            "driver": driver,
            "driver_info": driver_info,
            "backend": backend,
        }),
        commit: env!("BRICKWALK_COMMIT").into(),
    })
}

/// How a run of the bench ended.
enum Ended {
    Finished,
    OutOfTime,
    Interrupted,
}

struct Run<'a> {
    args: &'a ChcArgs,
    settings: &'a Settings,
    console: Console<'a>,
    cells: &'a mut Cells,
    /// What was not measured, and why.
    notes: Vec<String>,
    deadline: Option<Instant>,
}

impl Run<'_> {
    /// Measures what is missing of `groups`.
    fn measure(&mut self, groups: &[Group]) -> Result<Ended> {
        let progress = Progress::new();
        progress
            .phase("walks", groups.iter().map(|group| u64::from(group.repetitions) * group.cases.len() as u64).sum());
        let key = |group: &Group| group.cases.first().map(|case| (case.scene, case.cache, case.tile));
        for session in groups.chunk_by(|a, b| key(a) == key(b)) {
            let missing = |case: &&Case| (0..self.repetitions(session, case)).any(|k| !self.cells.has(case, k));
            let open: Vec<Case> = session.iter().flat_map(|group| &group.cases).filter(missing).copied().collect();
            let done = session.iter().map(|g| u64::from(g.repetitions) * g.cases.len() as u64).sum::<u64>();
            let Some(first) = open.first() else {
                progress.advance(done);
                continue;
            };
            if let Some(ended) = self.ended() {
                return Ok(ended);
            }
            let folder = self.args.scenes.clone().unwrap_or_else(|| self.args.output.join("scenes"));
            let place = scenes::place(first.scene, &folder, self.settings, self.args.sponza.as_deref(), self.console)?;
            let wants_binary = open.iter().any(|case| case.variant.schedule == PLAIN_BVH2.schedule);
            let mut bench = match Bench::open(first, &place, self.settings, &self.args.adapter, wants_binary) {
                Ok(bench) => bench,
                Err(error) if error.is::<DoesNotFit>() => {
                    self.notes.push(format!("{} with a cache of {} %: {error}", first.scene.name(), first.cache));
                    continue;
                }
                Err(error) => return Err(error),
            };
            if let Some(reason) = bench.refuses(&PLAIN_BVH2) {
                self.notes.push(format!("{}, plain-bvh2: {reason}", first.scene.name()));
            }
            for group in session {
                if let Some(ended) = self.group(&mut bench, group, &progress)? {
                    return Ok(ended);
                }
            }
        }
        progress.finish();
        Ok(Ended::Finished)
    }

    fn repetitions(&self, groups: &[Group], case: &Case) -> u32 {
        groups.iter().filter(|group| group.cases.contains(case)).map(|group| group.repetitions).max().unwrap_or(0)
    }

    /// Whether to begin no other walk.
    fn ended(&self) -> Option<Ended> {
        if self.console.is_stopped() {
            return Some(Ended::Interrupted);
        }
        self.deadline.is_some_and(|deadline| Instant::now() >= deadline).then_some(Ended::OutOfTime)
    }

    /// Interleaves the walks of a group.
    fn group(&mut self, bench: &mut Bench, group: &Group, progress: &Progress) -> Result<Option<Ended>> {
        for repetition in 0..group.repetitions {
            for case in &group.cases {
                progress.advance(1);
                if self.cells.has(case, repetition) || bench.refuses(&case.variant).is_some() {
                    continue;
                }
                if let Some(ended) = self.ended() {
                    return Ok(Some(ended));
                }
                let Some(passes) = bench.walk(case, self.console)? else { return Ok(Some(Ended::Interrupted)) };
                // The pictures are the same in every walk.
                let error = if repetition == 0 { bench.picture_error(case, self.console)? } else { None };
                if let Some(ended @ Ended::Interrupted) = self.ended() {
                    return Ok(Some(ended));
                }
                self.cells.push(case, repetition, passes, error)?;
            }
        }
        Ok(None)
    }
}

/// Counts of triangles as people read them.
fn counts(settings: &Settings) -> String {
    settings.triangles.map(human_count).join(", ")
}
