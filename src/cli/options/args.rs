//! The command line: every subcommand, and the options of those that need few. Values are validated here, so that
//! commands receive only what they can use; what is wrong ends as usage with exit status 2.

use super::job_args::JobsArgs;
use super::query_args::QueryArgs;
#[cfg(feature = "serve")]
use super::render_args::ServeArgs;
#[cfg(feature = "viewer")]
use super::render_args::ViewArgs;
use super::render_args::{TraceArgs, WalkArgs};
use super::scene_args::{BakeDisplacementArgs, ConvertArgs, InfoArgs, RepairArgs, SceneArgs, VerifyArgs};
use super::scene_name::scene_name;
use super::units::UNITS;
#[cfg(feature = "lab")]
use crate::cli::lab::bench::{BenchArgs, TestArgs};
#[cfg(feature = "lab")]
use crate::cli::lab::study::StudyCommand;
use crate::cli::output::Verbosity;
use crate::remote::DiskCache;
use crate::settings::sizes::{positive_count, ranged};
use crate::settings::{Adapter, CacheSize, ImageSize};
use clap::{Args, Parser, Subcommand};
use std::path::PathBuf;

/// Ray traces scenes that do not fit in GPU memory, and walks a camera through them.
///
/// A scene is converted once into bricks, in one file; rendering streams the bricks that rays need through a small
/// cache.
#[derive(Debug, Parser)]
#[command(name = "brickwalk", bin_name = "brickwalk", version, after_help = UNITS, max_term_width = 110)]
pub struct Cli {
    /// How much is said.
    #[command(flatten)]
    pub verbosity: Verbosity,
    /// Keep parts of scenes from URLs in a folder, up to a size; processes may share it [default: none]
    ///
    /// What was not used for longest goes first. Without it, what a run fetches is gone after it.
    #[arg(long, global = true, display_order = 902, hide_short_help = true, value_name = "DIR,SIZE")]
    pub disk_cache: Option<DiskCache>,
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The subcommands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Generate a city larger than the cache, convert it, walk through it, write a report
    Demo(DemoArgs),
    /// Convert scenes (.gltf, .glb, .obj, .ply, .stl) into one .bricks file
    Convert(ConvertArgs),
    /// Generate a scene and camera paths through it
    Scene(SceneArgs),
    /// Show the contents of a .bricks file, or where a triangle comes from
    Info(InfoArgs),
    /// Check every checksum and reference of a .bricks file
    Verify(VerifyArgs),
    /// Rebuild damaged bricks and textures of a .bricks file from its inputs
    Repair(RepairArgs),
    /// Make displacement fields for --secondary displacement, into the scene file
    BakeDisplacement(BakeDisplacementArgs),
    /// Render frames along a camera path, with records and a report
    Walk(Box<WalkArgs>),
    /// Print what a farm runs to render a walk on many machines
    Jobs(JobsArgs),
    /// Open a window, and fly through a scene
    #[cfg(feature = "viewer")]
    View(Box<ViewArgs>),
    /// Serve the same in a browser, from a machine without a screen
    #[cfg(feature = "serve")]
    Serve(Box<ServeArgs>),
    /// Find the closest hits of given rays
    Trace(TraceArgs),
    /// Ask about geometry: all that rays meet, nearest points, distances, what lies inside, what is visible
    Query(QueryArgs),
    /// Replay recorded brick requests with other cache sizes and policies
    Replay(ReplayArgs),
    /// Compare an image with a reference: RMSE, relMSE, bias, FLIP
    Compare(CompareArgs),
    /// Run benchmarks: the experiments of the papers
    #[cfg(feature = "lab")]
    Bench(BenchArgs),
    /// Measure error against run time in a scene: which setting to use, and what does not pay
    #[cfg(feature = "lab")]
    Study(StudyCommand),
    /// Measure what rays take on this device, for --secondary auto
    Calibrate(CalibrateArgs),
    /// List the devices that can render
    Adapters(AdaptersArgs),
    /// Test this machine's device: exactness and numerical stability
    #[cfg(feature = "lab")]
    Selftest(TestArgs),
    /// Print a completion script for a shell
    Completions(CompletionsArgs),
    /// Write man pages, one per command
    Man(ManArgs),
}

/// Options of `completions`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Bash: brickwalk completions bash > ~/.local/share/bash-completion/completions/brickwalk")]
pub struct CompletionsArgs {
    /// The shell
    #[arg(value_name = "SHELL", value_enum)]
    pub shell: clap_complete::Shell,
}

/// Options of `man`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Read a page with man -l DIR/brickwalk-walk.1, or write them to a man1 folder of MANPATH.")]
pub struct ManArgs {
    /// Folder for the pages; created if missing
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
}

/// Options of `adapters`.
#[derive(Clone, Debug, Args)]
#[command(after_help = UNITS)]
pub struct AdaptersArgs {
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// Options of `calibrate`.
#[derive(Clone, Debug, Args)]
#[command(after_help = UNITS)]
pub struct CalibrateArgs {
    /// Scenes that get rates of their own. Without any, rates of generated scenes are measured, for all others.
    /// [default: none]
    #[arg(value_name = "S.bricks", value_parser = scene_name())]
    pub scenes: Vec<PathBuf>,
    /// File of rates to write to. What it has of other devices and scenes stays. [default: rates.json in the user's
    /// folder for settings, or in BRICKWALK_CONFIG_DIR]
    #[arg(long, value_name = "FILE")]
    pub rates: Option<PathBuf>,
    /// Camera path to measure along; three views of it are rendered. [default: one made from the scene's bounds]
    #[arg(long, value_name = "FILE", requires = "scenes")]
    pub path: Option<PathBuf>,
    /// Width and height of the pictures in pixels, each 1 to 16384; rates are best for pictures of about this size
    #[arg(long, value_name = "WxH", default_value = "640x360")]
    pub size: ImageSize,
    /// What renders: auto (a hardware GPU if there is one, else the processor), cpu (the processor), or the graphics
    /// adapter whose name contains NAME, upper and lower case alike; `brickwalk adapters` lists them
    #[arg(long, value_name = "NAME", env = "BRICKWALK_ADAPTER", default_value = "auto")]
    pub adapter: Adapter,
}

/// Options of `demo`.
#[derive(Clone, Debug, Args)]
#[command(after_help = UNITS)]
pub struct DemoArgs {
    /// Output folder for scene, frames and report; created if missing
    #[arg(short, long, value_name = "DIR", default_value = "demo-out")]
    pub output: PathBuf,
    /// Triangles of the city, approximately
    #[arg(long, value_name = "COUNT", default_value = "2M", value_parser = positive_count)]
    pub triangles: u64,
    /// Frames of the walk
    #[arg(long, value_name = "N", default_value = "5", value_parser = ranged::<1, 1_000_000>)]
    pub frames: u32,
    /// Width and height of the frames in pixels, each 1 to 16384
    #[arg(long, value_name = "WxH", default_value = "480x270")]
    pub size: ImageSize,
    /// Device memory for bricks: a size, or a share P% of all bricks; what the path shows takes more than the default
    #[arg(long, value_name = "SIZE|P%", default_value = "20%")]
    pub cache: CacheSize,
    /// Random seed of the city and of sampling
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// What renders: auto (a hardware GPU if there is one, else the processor), cpu (the processor), or the graphics
    /// adapter whose name contains NAME, upper and lower case alike; `brickwalk adapters` lists them
    #[arg(long, value_name = "NAME", env = "BRICKWALK_ADAPTER", default_value = "auto")]
    pub adapter: Adapter,
}

/// What the columns of `replay` are.
const REPLAY: &str = "A request is one use of a payload (geometry or attributes of a brick) by a pass; a load is a \
     request that misses the cache; loaded again is what an earlier load had brought, in any pass. Every cache begins \
     empty. belady-greedy evicts what is used again last: a bound that knows the future and ignores pages. Sizes below \
     the two largest bricks are skipped.";

/// Options of `replay`.
#[derive(Clone, Debug, Args)]
#[command(after_help = format!("{REPLAY}\n\n{UNITS}"))]
pub struct ReplayArgs {
    /// The requests that walk or trace wrote with --requests-out
    #[arg(value_name = "F")]
    pub requests: PathBuf,
    /// Cache sizes to replay beside the recorded one: sizes, or shares P% of all bricks [default: 5% 10% 20% 50% 100%;
    /// with --plot 26 shares from 2% to 100%]
    #[arg(long, value_name = "SIZE|P%", num_args = 1.., value_delimiter = ',')]
    pub cache: Vec<CacheSize>,
    /// Write an HTML page with plots over the cache size and a table; one file that opens offline [default: none]
    #[arg(long, value_name = "FILE.html")]
    pub plot: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// Options of `compare`.
#[derive(Clone, Debug, Args)]
#[command(after_help = UNITS)]
pub struct CompareArgs {
    /// The image (PNG or EXR)
    #[arg(value_name = "A")]
    pub image: PathBuf,
    /// The reference, of the same size (PNG or EXR)
    #[arg(value_name = "B")]
    pub reference: PathBuf,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

#[cfg(test)]
#[path = "args_tests.rs"]
mod tests;
