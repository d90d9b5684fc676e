//! The field of visibility of a walk: read from its file, or made and kept there.

use super::options::args::WalkArgs;
use super::options::dvf_args::RegionKind;
use crate::counters::Record;
use crate::frame::{RenderError, Renderer};
use crate::output::atomic;
use crate::scene::path::CameraPath;
use crate::secondary::dvf::answer::{Dvf, DvfMade, DvfTracing, EFFECT as DVF_EFFECT, Region};
use crate::secondary::dvf::file::{FileError, decode, encode};
use crate::secondary::dvf::renew::Renewal;
use crate::secondary::dvf::{Cells, DvfKept, DvfSettings};
use anyhow::{Context, Result, bail};
use brickwalk_convert::progress::Progress;
use serde_json::{Value, json};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;
use xxhash_rust::xxh3::xxh3_64;

/// Raised when the same settings make other bits.
const MAKING: u64 = 2;
/// Most frames whose views make a region.
const MOST_VIEWS: u32 = 5;
/// Most bytes of the masks of a field that is read.
const MOST_BYTES: u64 = 1 << 31;

/// What summaries say of a field.
pub struct Note {
    file: PathBuf,
    made: Option<(DvfMade, f64)>,
}

/// Gives `renderer` the field that the options of its walk ask for. Nothing is done where no rays lead to an
/// environment.
///
/// # Errors
/// A brick that cannot be read, the device's, Ctrl-C.
pub fn prepare(renderer: &mut Renderer, args: &WalkArgs, path: &CameraPath) -> Result<Option<Note>> {
    if !renderer.draws_environment() {
        warn(
            "--secondary dvf answers rays to an environment alone, and there are none; give --environment and --effects environment",
        );
        return Ok(None);
    }
    if args.dvf.how().paper && renderer.settings.effects.diffuse.is_some() {
        bail!(
            "--dvf-mode paper goes without diffuse in --effects, which would bring the environment's light again; use --dvf-mode same-sample"
        );
    }
    let settings = args.dvf.settings();
    let name = args.scene.display().to_string();
    let region = match args.dvf.dvf_region {
        RegionKind::Scene => Region::scene(renderer.scene.resident()),
        RegionKind::View => {
            let views = args.frames.min(MOST_VIEWS);
            let cameras: Vec<_> = (0..views).map(|view| path.frame(view, views)).collect();
            renderer.visible_region(&cameras).with_context(|| name.clone())?
        }
    };
    let extension = if args.dvf.dvf_region == RegionKind::View { "view.dvf" } else { "dvf" };
    let file = args.dvf.dvf_file.clone().unwrap_or_else(|| args.scene.with_extension(extension));
    let key = key(renderer.scene.checksum(), &settings, &region);
    let (kept, made) = match read(&file, key) {
        Some(kept) => (kept, None),
        None => {
            let (made, seconds) = make(renderer, &settings, &region, args.dvf.tracing()).with_context(|| name)?;
            if let Err(error) = atomic::write(&file, &encode(&made.kept, key)) {
                warn(&format!("the field of visibility is not kept: {error:#}"));
            }
            (made.kept.clone(), Some((made, seconds)))
        }
    };
    let mut dvf = Dvf::new(Arc::new(kept.finished(settings.dilate)), args.dvf.how());
    if args.motion.is_some() && args.dvf.dvf_renew > 0 {
        dvf = dvf.renewed_by(renewal(args, Arc::new(kept), region));
    }
    renderer.methods.set(dvf);
    Ok(Some(Note { file, made }))
}

/// How the options of a walk have cells of a field made anew.
pub fn renewal(args: &WalkArgs, kept: Arc<DvfKept>, region: Region) -> Renewal {
    let (settings, tracing) = (args.dvf.settings(), args.dvf.tracing());
    Renewal { kept, settings, region, tracing, rays: args.dvf.dvf_renew.into(), frames: 1 }
}

fn warn(text: &str) {
    let _ = writeln!(std::io::stderr(), "brickwalk: warning: {}", super::one_line(text));
}

/// What a field is made of, in a number.
fn key(scene: u64, settings: &DvfSettings, region: &Region) -> u64 {
    let longest = match settings.cells {
        Cells::Auto => 0,
        Cells::Longest(longest) => longest,
    };
    let flags = [settings.dilate, settings.hammersley, settings.round, settings.both];
    let mut numbers = vec![MAKING, scene, longest.into()];
    numbers.extend([settings.points, settings.rays, settings.octahedral, settings.seed].map(u64::from));
    numbers.extend(flags.map(u64::from));
    numbers.extend(region.min.to_array().into_iter().chain(region.max.to_array()).map(f64::to_bits));
    numbers.extend(region.bricks.iter().flatten().map(|&brick| u64::from(brick)));
    xxh3_64(bytemuck::cast_slice(&numbers))
}

/// The field in `file`, if it is what `key` says; otherwise it is said why it is made anew, unless there is none.
fn read(file: &Path, key: u64) -> Option<DvfKept> {
    let found = std::fs::read(file).map_err(FileError::from).and_then(|bytes| decode(&bytes, key, MOST_BYTES));
    match found {
        Ok(kept) => Some(kept),
        Err(FileError::Io(error)) if error.kind() == std::io::ErrorKind::NotFound => None,
        Err(error) => {
            warn(&format!("{}: the field of visibility {error}; it is made anew", file.display()));
            None
        }
    }
}

/// Makes a field, with progress on a terminal; how many seconds it took.
///
/// # Errors
/// As of [`crate::frame::Engine::make_dvf`].
pub fn make(
    renderer: &mut Renderer,
    settings: &DvfSettings,
    region: &Region,
    tracing: DvfTracing,
) -> Result<(DvfMade, f64)> {
    let stop = super::interrupt::flag();
    let progress = Progress::new();
    let mut told = None;
    let mut watch = |rays: u64, about: u64| {
        let before = *told.get_or_insert_with(|| {
            progress.phase("rays of the field", about);
            0
        });
        progress.advance(rays - before);
        told = Some(rays);
        !stop.load(Ordering::Relaxed)
    };
    let start = Instant::now();
    let made = renderer.make_dvf(settings, region, tracing, &mut watch);
    progress.finish();
    match made {
        Err(RenderError::Interrupted) => {
            bail!("interrupted while the field of visibility was made; nothing of it is kept")
        }
        made => Ok((made?, start.elapsed().as_secs_f64())),
    }
}

impl Note {
    /// As summaries have it.
    pub fn report(&self, renderer: &Renderer, args: &WalkArgs, records: &[Record]) -> Value {
        let Some(field) = renderer.methods.get::<Dvf>().and_then(Dvf::field) else { return Value::Null };
        let own = || records.iter().filter(|record| record.pass == DVF_EFFECT);
        let sum = |of: &dyn Fn(&Record) -> u64| own().map(of).sum::<u64>();
        let settings = args.dvf.settings();
        json!({
            "file": self.file.file_name().map(|name| name.to_string_lossy()),
            "points_asked": settings.points,
            "rays": settings.rays,
            "cells": field.shape.size,
            "side": field.shape.side,
            "octahedral": field.shape.octahedral,
            "known_cells": field.known_cells(),
            "bytes": field.shape.bytes(),
            "dilate": settings.dilate,
            "sequence": args.dvf.dvf_sequence.name(),
            "count": args.dvf.dvf_count.name(),
            "sides": args.dvf.dvf_sides.name(),
            "region": args.dvf.dvf_region.name(),
            "mode": args.dvf.dvf_mode.name(),
            "trust": args.dvf.dvf_trust.name(),
            "renew": args.motion.as_ref().map(|_| json!({
                "rays_a_frame": args.dvf.dvf_renew,
                "rays": sum(&|record| record.rays()),
                "cells": sum(&|record| record.cells_renewed),
                "cells_left": sum(&|record| record.cells_left),
            })),
            "made": self.made.as_ref().map(|(made, seconds)| json!({
                "seconds": seconds,
                "points": made.points,
                "triangles": made.triangles,
                "bricks_read": made.bricks_read,
                "drains": made.drains,
                "record": made.record,
                "trials": made.trials.iter().map(|trial| json!({
                    "longest": trial.longest, "traced": trial.traced, "wrong": trial.wrong,
                })).collect::<Vec<_>>(),
            })),
        })
    }
}
