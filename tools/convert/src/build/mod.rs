//! Cuts a scene into bricks and writes the scene file.
//!
//! The order of the work is what makes images independent of how a scene is cut (numerics.md, "Positions"): triangles
//! are numbered in the order of the source (`objects`), a partition that ignores all settings gives the sizes from
//! which each object's lattice follows (`partition`, `lattice`), every position is rounded to it once (`triangle`), and
//! only then are bricks encoded (`brick`). Trees take their topology from floating-point builders (`binary`, `wide`),
//! but their boxes are exact integers (`node`). Everything is the same for any number of threads.
//!
//! A scene that does not fit in memory (`budget`) goes through the same steps by way of the disk (`scratch`, `spill`):
//! its items are split there until they fit (`external`, `bounded`), then its triangles are brought together by bricks
//! (`distribute`). What depends on sets of triangles alone cannot differ, so neither does the file. Steps are recorded
//! (`journal`), so that an interrupted conversion can be continued.

mod assemble;
mod attributes;
mod binary;
mod bounded;
mod brick;
mod budget;
mod conversion;
mod cut;
mod distribute;
mod encode;
mod error;
mod external;
mod gather;
mod intern;
mod journal;
mod lattice;
mod matrix;
mod node;
mod objects;
mod opacity;
mod partition;
mod parts;
mod scratch;
mod settings;
mod spill;
mod textures;
mod top_level;
mod triangle;
mod voxelise;
#[cfg(test)]
mod voxelise_tests;
mod wide;

pub use error::BuildError;
pub use settings::{BuildSettings, BuildSummary, TextureEncoding};
pub use wide::ITEM_COST as TRIANGLE_COST;

use crate::progress::Progress;
use crate::source::{InMemory, Source, SourceScene};
use budget::Budget;
use conversion::Conversion;
use std::path::Path;

/// Stack of a worker: the partition recurses, and a thread that waits takes up other work on the same stack.
const STACK_BYTES: usize = 16 << 20;

/// Builds a scene that lies in memory, see [`build_source`].
pub fn build(
    scene: SourceScene,
    settings: &BuildSettings,
    output: &Path,
    progress: &Progress,
) -> Result<BuildSummary, BuildError> {
    build_source(&InMemory::from(scene), settings, output, progress)
}

/// Builds `source` into the scene file `output`, which appears whole or not at all.
///
/// The bytes of the file depend on the source and on the settings but for their `threads` and `memory_bytes`. Ids and
/// positions depend on neither of these nor on `brick_triangles`.
///
/// After an error nothing is left behind. If `progress` is interrupted or the process ends, what did not fit in memory
/// leaves `.NAME.partial` beside the output and a scratch folder, to be continued with `resume` or removed by the next
/// conversion to that output.
pub fn build_source(
    source: &dyn Source,
    settings: &BuildSettings,
    output: &Path,
    progress: &Progress,
) -> Result<BuildSummary, BuildError> {
    settings.check()?;
    let outline = source.outline();
    objects::check(outline)?;
    let plan = objects::plan(outline, settings)?;
    let cores = || std::thread::available_parallelism().map_or(1, usize::from);
    let threads = settings.threads.unwrap_or_else(cores);
    let memory = settings.memory_bytes.unwrap_or_else(budget::default_memory);
    let budget = Budget::divide(memory, threads, source, &plan, settings)?;
    let threads = budget.map_or(threads, |budget| budget.threads);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).stack_size(STACK_BYTES).build()?;
    let conversion = Conversion { source, outline, plan, settings, output, progress };
    let summary = pool.install(|| match budget {
        None => conversion.in_memory(),
        Some(budget) => conversion.bounded(budget),
    });
    progress.finish();
    summary
}
