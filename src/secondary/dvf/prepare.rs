//! The field of visibility of a walk: read from its file, or made and kept there.

use super::file::{FileError, decode, encode};
use super::{Cells, Dvf, DvfKept, DvfMade, DvfSettings, DvfTracing, EFFECT, Options, Region, RegionKind, Renewal};
use crate::counters::Record;
use crate::frame::{RenderError, Renderer};
use crate::output::atomic;
use crate::scene::path::CameraPath;
use anyhow::{Context, Result, bail};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::sync::Arc;
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

/// Who watches rays being traced: how many have been, about how many there are; says whether to go on.
pub type Watch<'a> = dyn FnMut(u64, u64) -> bool + 'a;

/// What a field is made for.
pub struct Walk<'a> {
    /// Where the camera goes.
    pub path: &'a CameraPath,
    /// In how many frames.
    pub frames: u32,
    /// Instances move meanwhile.
    pub is_moving: bool,
}

/// Gives `renderer`, of the scene in `file`, the field that `options` ask for, for a walk. Nothing is done where no
/// rays lead to an environment.
///
/// # Errors
/// A brick that cannot be read; the device's; `watch` stopped it.
pub fn prepare(
    renderer: &mut Renderer,
    file: &Path,
    options: &Options,
    walk: &Walk,
    warnings: &mut Vec<String>,
    watch: &mut Watch,
) -> Result<Option<Note>> {
    if !renderer.draws_environment() {
        warnings.push(
            "--secondary dvf answers rays to an environment alone, and there are none; give --environment and \
             --effects environment"
                .into(),
        );
        return Ok(None);
    }
    if options.how().paper && renderer.settings.effects.diffuse.is_some() {
        bail!(
            "--dvf-mode paper goes without diffuse in --effects, which would bring the environment's light again; use \
             --dvf-mode same-sample"
        );
    }
    let making = options.settings();
    let name = file.display().to_string();
    let region = match options.region {
        RegionKind::Scene => Region::scene(renderer.scene.resident()),
        RegionKind::View => {
            let views = walk.frames.min(MOST_VIEWS);
            let cameras: Vec<_> = (0..views).map(|view| walk.path.frame(view, views)).collect();
            renderer.visible_region(&cameras).with_context(|| name.clone())?
        }
    };
    let extension = if options.region == RegionKind::View { "view.dvf" } else { "dvf" };
    let file = options.file.clone().unwrap_or_else(|| file.with_extension(extension));
    let key = key(renderer.scene.checksum(), &making, &region);
    let (kept, made) = match read(&file, key, warnings) {
        Some(kept) => (kept, None),
        None => {
            let (made, seconds) = make(renderer, &making, &region, options.tracing(), watch).with_context(|| name)?;
            if let Err(error) = atomic::write(&file, &encode(&made.kept, key)) {
                warnings.push(format!("the field of visibility is not kept: {error:#}"));
            }
            (made.kept.clone(), Some((made, seconds)))
        }
    };
    let mut dvf = Dvf::new(Arc::new(kept.finished(making.dilate)), options.how());
    if walk.is_moving && options.renew > 0 {
        dvf = dvf.renewed_by(renewal(options, Arc::new(kept), region));
    }
    renderer.methods.set(dvf);
    Ok(Some(Note { file, made }))
}

/// How options have cells of a field made anew.
pub fn renewal(options: &Options, kept: Arc<DvfKept>, region: Region) -> Renewal {
    let (settings, tracing) = (options.settings(), options.tracing());
    Renewal { kept, settings, region, tracing, rays: options.renew.into(), frames: 1 }
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
fn read(file: &Path, key: u64, warnings: &mut Vec<String>) -> Option<DvfKept> {
    let found = std::fs::read(file).map_err(FileError::from).and_then(|bytes| decode(&bytes, key, MOST_BYTES));
    match found {
        Ok(kept) => Some(kept),
        Err(FileError::Io(error)) if error.kind() == std::io::ErrorKind::NotFound => None,
        Err(error) => {
            warnings.push(format!("{}: the field of visibility {error}; it is made anew", file.display()));
            None
        }
    }
}

/// Makes a field; how many seconds it took.
///
/// # Errors
/// As of [`crate::frame::Engine::make_dvf`].
pub fn make(
    renderer: &mut Renderer,
    settings: &DvfSettings,
    region: &Region,
    tracing: DvfTracing,
    mut watch: &mut Watch,
) -> Result<(DvfMade, f64)> {
    let start = Instant::now();
    match renderer.make_dvf(settings, region, tracing, &mut watch) {
        Err(RenderError::Interrupted) => {
            bail!("interrupted while the field of visibility was made; nothing of it is kept")
        }
        made => Ok((made?, start.elapsed().as_secs_f64())),
    }
}

impl Note {
    /// As summaries have it; `is_moving`: instances move, so that cells are made anew.
    pub fn report(&self, renderer: &Renderer, options: &Options, is_moving: bool, records: &[Record]) -> Value {
        let Some(field) = renderer.methods.get::<Dvf>().and_then(Dvf::field) else { return Value::Null };
        let own = || records.iter().filter(|record| record.pass == EFFECT);
        let sum = |of: &dyn Fn(&Record) -> u64| own().map(of).sum::<u64>();
        json!({
            "file": self.file.file_name().map(|name| name.to_string_lossy()),
            "points_asked": options.points,
            "rays": options.rays,
            "cells": field.shape.size,
            "side": field.shape.side,
            "octahedral": field.shape.octahedral,
            "known_cells": field.known_cells(),
            "bytes": field.shape.bytes(),
            "dilate": options.dilate,
            "sequence": options.sequence.name(),
            "count": options.count.name(),
            "sides": options.sides.name(),
            "region": options.region.name(),
            "mode": options.mode.name(),
            "trust": options.trust.name(),
            "renew": is_moving.then(|| json!({
                "rays_a_frame": options.renew,
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
