//! Cuts a scene into bricks and writes the scene file.
//!
//! The order of the work is what makes images independent of how a scene is cut (docs/methods/exact.md, "Positions"):
//! triangles are numbered in the order of the source (`input`), a partition that ignores all settings gives the sizes
//! from which each object's lattice follows (`cut`), every position is rounded to it once (`triangles`), and only then
//! are bricks encoded (`encode`). Trees take their topology from floating-point builders, but their boxes are exact
//! integers (`tree`). Everything is the same for any number of threads.
//!
//! A scene that does not fit in memory goes through the same steps by way of the disk (`bounded`, `disk`): its items
//! are split there until they fit, then its triangles are brought together by bricks. What depends on sets of triangles
//! alone cannot differ, so neither does the file. Steps are recorded, so that an interrupted conversion can be
//! continued.
//!
//! | folder or file | what is in it |
//! | --- | --- |
//! | `conversion` | the steps, in memory and by way of the disk |
//! | `input` | objects, their placements, the parts of the source |
//! | `cut` | which triangles make up a brick, and the lattices that follow |
//! | `triangles` | positions on the lattice and attributes, as bricks store them |
//! | `tree` | binary and eight-wide trees, in bricks and above them |
//! | `texture` | levels, tiles and opacity maps of textures |
//! | `encode` | bytes of bricks |
//! | `levels` | levels of detail: bricks that stand for others |
//! | `assemble` | the resident part |
//! | `bounded`, `disk` | the same for scenes that do not fit in memory |

mod assemble;
mod bounded;
mod conversion;
mod cut;
mod disk;
mod encode;
mod error;
mod input;
mod levels;
mod settings;
mod texture;
mod tree;
mod triangles;

pub use error::BuildError;
pub use settings::{BuildSettings, BuildSummary, LatticeStep, TextureEncoding};
pub use tree::wide::ITEM_COST as TRIANGLE_COST;

use crate::progress::Progress;
use crate::source::{InMemory, Source, SourceScene};
use bounded::budget::{self, Budget};
use conversion::Conversion;
use input::objects;
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
