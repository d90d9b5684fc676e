//! Benches: `brickwalk bench chc` (`chc/`), `brickwalk bench roma` (`roma/`), `brickwalk bench dvf` (`dvf/`): the
//! experiments of papers on our scenes, each number beside the paper's; and `brickwalk bench executors`
//! (`executors.rs`).
//!
//! Everything runs in this process. `runner.rs` goes through what is to be measured, each finished measurement is a
//! line of a file (`store.rs`), and tables, plots and pages are made from these lines alone (`results.rs`).

pub mod args;
mod chc;
pub mod dvf;
mod executors;
mod results;
pub mod roma;
mod runner;
mod scenes;
mod store;

use crate::lab::console::Console;
use anyhow::Result;
use args::{ChcArgs, ExecutorsArgs};
use dvf::args::DvfBenchArgs;
use roma::args::RomaBenchArgs;

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
    match experiment {
        Experiment::Chc(args) => chc::run(args, console),
        Experiment::Executors(args) => executors::run(args, console),
        Experiment::Roma(args) => roma::run(args, console),
        Experiment::Dvf(args) => dvf::run(args, console),
    }
}
