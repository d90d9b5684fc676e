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
//! | `crew` | who does the costly steps of that: this process, or others |

mod assemble;
mod bounded;
mod conversion;
mod crew;
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

pub use crew::{Crew, CrewError, TaskStep};
pub use error::BuildError;
pub use settings::{BuildSettings, BuildSummary, LatticeStep, TextureEncoding};
pub use tree::wide::ITEM_COST as TRIANGLE_COST;

use crate::progress::Progress;
use crate::source::{InMemory, Source, SourceScene};
use bounded::budget::{self, Budget};
use conversion::Conversion;
use crew::Hands;
use input::objects;
use std::path::Path;

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
    run(source, settings, output, Hands::Own, progress, |conversion, threads, memory| {
        let budget = Budget::divide(memory, threads, source, &conversion.plan, settings)?;
        conversion::pool(budget.map_or(threads, |budget| budget.threads))?.install(|| match budget {
            None => conversion.in_memory(),
            Some(budget) => conversion.bounded(budget),
        })
    })
}

/// The same with the costly steps done by a `crew` of processes, for each of which `settings` say how much memory and
/// how many threads it has. The bytes of the file are the same. All see the inputs, the scratch folder and that of the
/// output under the same names.
///
/// After an error of the crew, or if `progress` is interrupted, what is done is left to be continued.
pub fn build_shared(
    source: &dyn Source,
    settings: &BuildSettings,
    output: &Path,
    crew: &dyn Crew,
    progress: &Progress,
) -> Result<BuildSummary, BuildError> {
    run(source, settings, output, Hands::Crew(crew), progress, |conversion, threads, memory| {
        let budget = Budget::share(memory, threads, source, &conversion.plan, settings)?;
        // The process that leads has none of the tasks that the memory was divided for.
        let threads = budget.threads.max(cores());
        conversion::pool(threads)?.install(|| conversion.bounded(budget))
    })
}

/// Does a task of the step that [`Crew::perform`] calls `name`, which has `position` steps before it, of a conversion
/// that another process leads with the same source, settings and output. Does nothing if it is done.
///
/// # Errors
/// As [`build_source`]. The conversion is another one, or not as far as that.
pub fn do_task(
    source: &dyn Source,
    settings: &BuildSettings,
    output: &Path,
    (name, position): (&str, u64),
    task: u64,
    progress: &Progress,
) -> Result<(), BuildError> {
    run(source, settings, output, Hands::Task(name, task), progress, |conversion, _, _| conversion.task(position))
}

fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

fn run<T>(
    source: &dyn Source,
    settings: &BuildSettings,
    output: &Path,
    hands: Hands,
    progress: &Progress,
    convert: impl FnOnce(Conversion, usize, u64) -> Result<T, BuildError>,
) -> Result<T, BuildError> {
    settings.check()?;
    let outline = source.outline();
    objects::check(outline)?;
    let plan = objects::plan(outline, settings)?;
    let threads = settings.threads.unwrap_or_else(cores);
    let memory = settings.memory_bytes.unwrap_or_else(budget::default_memory);
    let result = convert(Conversion { source, outline, plan, settings, output, hands, progress }, threads, memory);
    progress.finish();
    result
}
