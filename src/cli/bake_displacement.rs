//! `bake-displacement`: displacement fields into a scene file.

use super::interrupt;
use super::options::scene_args::BakeDisplacementArgs;
use crate::cli::output::{note, warn};
use crate::remote;
use crate::secondary::displacement::make::{Making, Outcome, Watch, add_fields};
use crate::secondary::displacement::{Bench, Shape};
use crate::session::trace::for_rays;
use crate::session::{Opened, Settings, open_scene};
use crate::settings::sizes::{counted, human_bytes, human_count};
use crate::settings::{Adapter, CacheSize, HostCacheSize, names};
use crate::stream::PayloadSource;
use anyhow::Result;
use bricks::{DISPLACEMENT_BY_CPU, DISPLACEMENT_BY_GPU};
use brickwalk_convert::progress::Progress;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

names! {
    /// What gets fields.
    Subjects {
        /// Objects that are placed more than once, and bricks of the others.
        All = "all",
        /// Objects that are placed more than once.
        Objects = "objects",
        /// Bricks of objects that are placed once.
        Bricks = "bricks",
    }
}

/// Positions on the sphere of an object, and the rings of a hemisphere that have so many.
const POSITIONS: [(u32, u32); 4] = [(290, 8), (1090, 16), (4226, 32), (16_642, 64)];

/// Bytes that fields are made in, if nothing else is asked for.
pub const MEMORY: u64 = 1 << 30;

/// What is made where nothing else is asked for.
pub const MAKING: Making = Making { objects: Some(Shape { rings: 32, directions: 32 }), bricks: true, bits: 8 };

/// Runs `bake-displacement`.
///
/// # Errors
/// A scene or a device that cannot be opened; a file that cannot be written; it was interrupted, which keeps what is
/// finished.
pub fn run(args: &BakeDisplacementArgs) -> Result<()> {
    let rings = POSITIONS.iter().find(|(positions, _)| *positions == args.positions).map_or(32, |(_, rings)| *rings);
    let shape = Shape { rings, directions: args.directions };
    let making = Making {
        objects: (args.of != Subjects::Bricks).then_some(shape),
        bricks: args.of != Subjects::Objects,
        bits: args.bits,
    };
    let output = args.output.as_deref().unwrap_or(&args.scene);
    remote::refuse(&args.scene, "bake-displacement")?;
    add(&args.scene, output, &making, args.memory.unwrap_or(MEMORY), &args.adapter)
}

/// Writes the scene file `path` with fields to `output`, and says what it made.
///
/// # Errors
/// As of [`run`].
pub fn add(path: &Path, output: &Path, making: &Making, memory: u64, adapter: &Adapter) -> Result<()> {
    let start = Instant::now();
    let scene = open_scene(path)?;
    // Half of the memory for bricks, of the device or the processor, a quarter for what the host keeps of them.
    let share = 100.0 * (memory / 2) as f64 / scene.sizes().sum().max(1) as f64;
    let settings = for_rays(&Settings {
        adapter: adapter.clone(),
        cache: CacheSize::Percent(share.min(100.0)),
        host_cache: HostCacheSize::Bytes(memory / 4),
        ..Settings::exact()
    });
    let mut opened = Opened::open(Arc::clone(&scene), path, &settings)?;
    warn(std::mem::take(&mut opened.warnings));
    let mut bench = opened.bench();
    let mut shown = Shown(interrupt::job());
    let by = executor_of(&mut bench);
    let outcome = add_fields(&mut bench, output, making, by, memory, &mut shown)?;
    shown.0.finish();
    let Outcome { fields: [objects, bricks], kept, rays, bytes: [loaded, stored] } = outcome;
    let kept = if kept == 0 { String::new() } else { format!(", {kept} of an earlier run") };
    note(&format!(
        "{}: displacement fields of {} and {}{kept}: {}, {} in the file; {} rays, {:.1} s\n",
        output.display(),
        counted(objects as u64, "object"),
        counted(bricks as u64, "brick"),
        human_bytes(loaded),
        human_bytes(stored),
        human_count(rays),
        start.elapsed().as_secs_f64()
    ))
}

/// What a scene file says of who has traced its fields.
pub fn executor_of(bench: &mut Bench) -> u32 {
    if bench.executor.device().backend == "cpu" { DISPLACEMENT_BY_CPU } else { DISPLACEMENT_BY_GPU }
}

/// Shows progress.
struct Shown(Progress);

impl Watch for Shown {
    fn phase(&mut self, what: &'static str, units: u64) {
        self.0.phase(what, units);
    }

    fn advance(&mut self, units: u64) -> bool {
        self.0.advance(units);
        self.0.check().is_ok()
    }
}
