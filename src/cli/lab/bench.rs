//! `brickwalk bench` and `brickwalk selftest`: what the laboratory does.

use crate::cli::interrupt;
use crate::cli::options::group_args::{GroupArgs, Of, View};
use crate::cli::options::scene_name::scene_name;
use crate::cli::options::units::UNITS;
use crate::cli::output::{Usage, print};
use crate::lab::bench::args::{ChcArgs, ExecutorsArgs};
use crate::lab::bench::displacement::args::DisplacementBenchArgs;
use crate::lab::bench::dvf::args::DvfBenchArgs;
use crate::lab::bench::lod::args::LodBenchArgs;
use crate::lab::bench::roma::args::RomaBenchArgs;
use crate::lab::bench::{chc, displacement, dvf, executors, lod, roma};
use crate::lab::console::Console;
use crate::lab::selftest;
use crate::lab::selftest::args::SelftestArgs;
use crate::settings::{Entry, Group, Lines, SettingsError};
use anyhow::Result;
use clap::{Args, Subcommand};
use std::marker::PhantomData;
use std::path::PathBuf;

/// Options of `bench`.
#[derive(Clone, Debug, Args)]
pub struct BenchArgs {
    /// What to measure.
    #[command(subcommand)]
    experiments: Experiments,
}

/// What can be measured.
#[derive(Clone, Debug, Subcommand)]
enum Experiments {
    /// The experiments of the CHC+RT paper: its tables 2 to 5 and figures 5, 7 and 8, each ratio beside the paper's
    Chc(Measured<ChcArgs>),
    /// The same frames on every device that is present: rates, and how far pictures differ from those of the first
    /// device
    Executors(Measured<ExecutorsArgs>),
    /// The experiments of the ROMA paper: times of ray-aligned occupancy maps, and how far pictures by them are from
    /// exact ones
    Roma(Measured<RomaBenchArgs>),
    /// The experiments of the paper of discrete visibility fields: rays to the environment that are left to be traced,
    /// and errors
    Dvf(MeasuredScenes),
    /// The experiments of the paper of displacement fields: errors of light in a corner, and times of a ray by the
    /// triangles of the object
    Displacement(Measured<DisplacementBenchArgs>),
    /// What levels of detail save, and how they err: errors, bytes and times by the tolerance, and working sets by the
    /// size of scenes
    Lod(Measured<LodBenchArgs>),
}

/// The settings of an experiment, less those that are no options.
#[derive(Clone, Copy, Debug)]
struct OfBench<G>(PhantomData<G>);

impl<G: Group> View for OfBench<G> {
    type Group = G;

    fn has(entry: &Entry) -> bool {
        entry.field.key != "output" && entry.field.usage != "--scenes S.bricks"
    }
}

/// Options of an experiment.
#[derive(Clone, Debug, Args)]
#[command(after_help = UNITS)]
struct Measured<G: Group> {
    /// Folder for the results. Started again with the same folder and settings, a bench of hours goes on where it
    /// stopped
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Everything else.
    #[command(flatten)]
    options: GroupArgs<OfBench<G>>,
}

/// Options of an experiment on given scenes.
#[derive(Clone, Debug, Args)]
#[command(after_help = UNITS)]
struct MeasuredScenes {
    /// Converted scenes; a Cornell box in which a box orbits (`scene cornell`) is measured beside them. Where
    /// S.motion.json lies beside a scene its flicker is measured
    #[arg(value_name = "S.bricks", value_parser = scene_name())]
    scenes: Vec<PathBuf>,
    /// Everything else.
    #[command(flatten)]
    measured: Measured<DvfBenchArgs>,
}

/// Runs `bench`.
///
/// # Errors
/// Those of the experiment.
pub fn run(args: &BenchArgs) -> Result<()> {
    let console = console();
    let done = match &args.experiments {
        Experiments::Chc(Measured { output, options }) => {
            chc::run(&ChcArgs { output: output.clone(), ..options.over(None)? }, console)
        }
        Experiments::Executors(Measured { output, options }) => {
            executors::run(&ExecutorsArgs { output: output.clone(), ..options.over(None)? }, console)
        }
        Experiments::Roma(Measured { output, options }) => {
            roma::run(&RomaBenchArgs { output: output.clone(), ..options.over(None)? }, console)
        }
        Experiments::Dvf(MeasuredScenes { scenes, measured: Measured { output, options } }) => {
            let (scenes, output) = (Lines(scenes.clone()), output.clone());
            dvf::run(&DvfBenchArgs { scenes, output, ..options.over(None)? }, console)
        }
        Experiments::Displacement(Measured { output, options }) => {
            displacement::run(&DisplacementBenchArgs { output: output.clone(), ..options.over(None)? }, console)
        }
        Experiments::Lod(Measured { output, options }) => {
            lod::run(&LodBenchArgs { output: output.clone(), ..options.over(None)? }, console)
        }
    };
    done.map_err(in_words)
}

/// What the laboratory talks to: standard output, and Ctrl-C.
pub fn console() -> Console<'static> {
    Console { show: &print, stop: interrupt::flag(), job: &interrupt::job, until: None }
}

/// Options that do not go together are wrong usage.
fn in_words(error: anyhow::Error) -> anyhow::Error {
    match error.downcast::<SettingsError>() {
        Ok(error) => Usage(error.to_string()).into(),
        Err(error) => error,
    }
}

/// Options of `selftest`.
#[derive(Clone, Debug, Args)]
#[command(after_help = UNITS)]
pub struct TestArgs {
    /// All of them.
    #[command(flatten)]
    pub options: GroupArgs<Of<SelftestArgs>>,
}

/// Runs `selftest`.
///
/// # Errors
/// Those of the test.
pub fn test(args: &TestArgs) -> Result<()> {
    selftest::run(&args.options.over(None)?, console())
}
