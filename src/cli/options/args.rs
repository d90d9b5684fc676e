//! The command line: every subcommand, every option with its unit and default. Values are validated here, so that
//! commands receive only what they can use; what is wrong ends as usage with exit status 2.

#[cfg(any(feature = "serve", feature = "viewer"))]
use super::group_args::OfView;
use super::group_args::{GroupArgs, OfTrace, OfWalk};
use super::inputs::{FromArgs, InputArgs};
use super::job_args::{JobsArgs, PartRange};
use super::query_args::QueryArgs;
use super::scene_kind::{SceneKind, scene_help};
use super::scene_name::scene_name;
use super::units::UNITS;
use crate::cli::bake_displacement::Subjects;
#[cfg(feature = "lab")]
use crate::cli::lab::bench::{BenchArgs, TestArgs};
#[cfg(feature = "lab")]
use crate::cli::lab::study::StudyCommand;
use crate::cli::output::{Usage, Verbosity};
use crate::remote::DiskCache;
use crate::session::Settings;
use crate::settings::sizes::{count, positive_count, positive_count32, size_bytes};
use crate::settings::{Adapter, CacheSize, ImageSize, SettingsError};
use brickwalk_convert::build::{LatticeStep, TextureEncoding};
use brickwalk_scenes::Stiff;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, Parser, Subcommand};
use std::path::{Path, PathBuf};

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

/// Options of `convert`.
#[derive(Clone, Debug, Args)]
#[command(after_help = UNITS)]
pub struct ConvertArgs {
    /// What to convert.
    #[command(flatten)]
    pub inputs: InputArgs,
    /// The file to write
    #[arg(short, long, value_name = "S.bricks")]
    pub output: PathBuf,
    /// How to cut and round.
    #[command(flatten)]
    pub build: BuildArgs,
    /// Texture format: bc7 (BC7 blocks, BC5 for normal maps, 1 byte per texel; loss: docs/results/textures.md) or raw
    /// (RGBA8, 4 bytes per texel)
    #[arg(long, help_heading = "Textures", value_name = "ENCODING", value_parser = textures(), default_value = "bc7")]
    pub textures: TextureEncoding,
    /// Keep the meshes of nodes called NAME, and of nodes below them, as instances that walk --motion can move; *
    /// matches any characters, ? one. May be repeated [default: none; meshes used once become part of the world
    /// object]
    #[arg(long, help_heading = "Meshes", value_name = "NAME")]
    pub movable: Vec<String>,
    /// Leave out inputs that are bad, and say which and why, instead of refusing all of them
    #[arg(long)]
    pub skip_bad: bool,
    /// What becomes of triangles and meshes.
    #[command(flatten)]
    pub mesh: MeshArgs,
}

/// Reads `finest` or a whole number.
fn lattice_step(text: &str) -> Result<LatticeStep, String> {
    let step = if text == "finest" { Some(LatticeStep::Finest) } else { text.parse().ok().map(LatticeStep::Log2) };
    step.filter(|step| !matches!(step, LatticeStep::Log2(log2) if !(-126..=96).contains(log2)))
        .ok_or_else(|| "give finest, or a whole number from -126 to 96".into())
}

/// Reads how textures are stored.
fn textures() -> impl TypedValueParser<Value = TextureEncoding> {
    let [blocks, texels] =
        [("bc7", "Blocks"), ("raw", "Texels")].map(|(name, help)| PossibleValue::new(name).help(help));
    PossibleValuesParser::new([blocks, texels]).map(|name| match &*name {
        "raw" => TextureEncoding::Raw,
        _ => TextureEncoding::Bc7,
    })
}

/// Reads on or off.
fn switch() -> impl TypedValueParser<Value = bool> {
    PossibleValuesParser::new(["on", "off"]).map(|name| name == "on")
}

/// Options of what becomes of the triangles and meshes of inputs.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Meshes")]
pub struct MeshArgs {
    /// Skip triangles with non-finite vertices instead of refusing the input
    #[arg(long)]
    pub drop_non_finite: bool,
    /// Store a mesh that is used twice or more once, if it has at least this many triangles; copies of smaller ones
    /// are baked into the world object
    #[arg(long, value_name = "COUNT", default_value = "1K", value_parser = positive_count32)]
    pub instance_min_triangles: u32,
    /// Most triangles of smaller meshes, all copies counted, to bake into the world object; beyond this they are
    /// stored once
    #[arg(long, value_name = "COUNT", default_value = "4M", value_parser = positive_count)]
    pub bake_budget: u64,
}

/// Options of everything that writes a `.bricks` file.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Bricks")]
pub struct BuildArgs {
    /// Most triangles per brick, 1 to 1048576; large bricks are faster in core, small ones load less out of core
    /// [default: 16384]
    #[arg(long, value_name = "COUNT", value_parser = ranged::<1, { 1 << 20 }>)]
    pub brick_triangles: Option<u32>,
    /// Write no occupancy maps; --secondary roma, auto and df need them
    #[arg(long)]
    pub no_proxies: bool,
    /// Whether to store levels of detail, which stand for bricks far away: on or off
    #[arg(long, value_name = "WHETHER", default_value = "off", action = clap::ArgAction::Set, value_parser = switch())]
    pub lod: bool,
    /// Make displacement fields as well, as bake-displacement does without options
    #[arg(long)]
    pub displacement: bool,
    /// Continue an interrupted conversion with the same inputs and options
    #[arg(long, help_heading = "Conversion")]
    pub resume: bool,
    /// How to work and to round.
    #[command(flatten)]
    pub work: WorkArgs,
}

/// Options of everything that converts.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Conversion")]
pub struct WorkArgs {
    /// Threads [default: one per core]
    #[arg(long, value_name = "N", value_parser = ranged::<1, 1024>)]
    pub threads: Option<u32>,
    /// log2 of the lattice step that positions are rounded to, in world units, -126 to 96; or finest: the finest at
    /// which vertices take no more room, up to 16 times finer than the default [default: from brick sizes]
    #[arg(
        long,
        help_heading = "Bricks",
        value_name = "LOG2",
        allow_hyphen_values = true,
        value_parser = lattice_step
    )]
    pub lattice: Option<LatticeStep>,
    /// Memory limit; what does not fit goes to scratch files, about 250 bytes per triangle. The result is the same
    /// [default: a quarter of the machine's memory]
    #[arg(long, value_name = "SIZE", value_parser = size_bytes)]
    pub memory: Option<u64>,
    /// Folder for scratch files [default: the output's folder]
    #[arg(long, value_name = "DIR")]
    pub scratch: Option<PathBuf>,
    /// Build BVHs faster: about 25 % less work in all, for trees that cost about 6 % more per ray
    #[arg(long)]
    pub fast: bool,
}

/// Options of `scene`.
#[derive(Clone, Debug, Args)]
#[command(after_help = scene_help())]
pub struct SceneArgs {
    /// What to generate: city (blocks of houses along streets), pipes (a plant in an open frame of steel), terrain
    /// (mountains, woods and meadows around a pond), stadium (an ornate teapot in a stadium), cornell (a Cornell box,
    /// open in front, in which a box orbits: S.motion.json, for walk --motion, is written as well), stiff (a small
    /// scene that is hard for arithmetic or for builders, see --case)
    #[arg(value_name = "KIND")]
    pub kind: SceneKind,
    /// Which stiff scene: one of the cases below [default: none, stiff needs one]
    #[arg(long, value_name = "NAME")]
    pub case: Option<Stiff>,
    /// The file to write: S.bricks, or S.glb or S.gltf (with S.bin) for other programs; S.near.json and S.far.json,
    /// camera paths, are written beside it, for stiff scenes the latter alone
    #[arg(short, long, value_name = "S.bricks")]
    pub output: PathBuf,
    /// Triangles of the scene with its instances, about; up to 150M, of cornell and stiff scenes up to 10M [default:
    /// 1M; of stiff scenes as listed below]
    #[arg(long, value_name = "COUNT", value_parser = positive_count)]
    pub triangles: Option<u64>,
    /// Random seed; equal seeds and counts make equal scenes
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Store the city's trees and vehicles once and place them as instances; the triangles are the same. Terrain
    /// always uses instances for plants
    #[arg(long)]
    pub instanced: bool,
    /// Place N copies of the whole scene in a square; meshes of 1000 triangles and more are stored once
    #[arg(long, value_name = "N", default_value = "1", value_parser = ranged::<1, 1024>, conflicts_with = "instanced")]
    pub copies: u32,
    /// How to cut and round.
    #[command(flatten)]
    pub build: BuildArgs,
}

impl SceneArgs {
    /// Those of a city of so many triangles, else the defaults.
    pub fn city(output: PathBuf, triangles: u64, seed: u64) -> Self {
        let work = WorkArgs { threads: None, lattice: None, memory: None, scratch: None, fast: false };
        let build = BuildArgs {
            brick_triangles: None,
            no_proxies: false,
            lod: false,
            displacement: false,
            resume: false,
            work,
        };
        let (kind, triangles) = (SceneKind::Generated(brickwalk_scenes::Kind::City), Some(triangles));
        Self { kind, case: None, output, triangles, seed, instanced: false, copies: 1, build }
    }
}

/// Options of `info`.
#[derive(Clone, Debug, Args)]
#[command(after_help = UNITS)]
pub struct InfoArgs {
    /// The scene: a .bricks file, the URL of one, or a model
    ///
    /// A model (.gltf, .glb, .obj, .ply, .stl, tileset.json) is converted once into a folder and taken from there the
    /// next time, as long as its files are the same; a line says where it is. The folder is BRICKWALK_CACHE_DIR, else
    /// brickwalk in the user's cache. `convert` has options for how a model is converted
    #[arg(value_name = "S.bricks|MODEL", value_parser = scene_name())]
    pub scene: PathBuf,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// Read all bricks, too, and show the SAH cost of the whole tree
    #[arg(long, conflicts_with = "id")]
    pub deep: bool,
    /// Show which file, node, mesh, primitive and triangle the triangle with id N comes from
    #[arg(long, value_name = "N")]
    pub id: Option<u32>,
    /// List the instances that walk --motion can move: number, node, parents named by convert --movable, mesh,
    /// triangles, bounds in world units
    #[arg(long, conflicts_with_all = ["id", "deep"])]
    pub instances: bool,
}

/// Options of `verify`.
#[derive(Clone, Debug, Args)]
#[command(after_help = UNITS)]
pub struct VerifyArgs {
    /// The scene, or the URL of one
    #[arg(value_name = "S.bricks", value_parser = scene_name())]
    pub scene: PathBuf,
}

/// Options of `repair`.
#[derive(Clone, Debug, Args)]
#[command(after_help = UNITS)]
pub struct RepairArgs {
    /// The scene; damaged bricks and textures are rewritten in place
    #[arg(value_name = "S.bricks", value_parser = scene_name())]
    pub scene: PathBuf,
    /// What the scene was converted from.
    #[command(flatten)]
    pub inputs: FromArgs,
    /// How to work and to round.
    #[command(flatten)]
    pub work: WorkArgs,
    /// What becomes of triangles and meshes.
    #[command(flatten)]
    pub mesh: MeshArgs,
}

/// Options of `bake-displacement`.
#[derive(Clone, Debug, Args)]
#[command(after_help = UNITS)]
pub struct BakeDisplacementArgs {
    /// The scene; it is written anew with its fields, those that it has are replaced. An interrupted run goes on where
    /// it stopped
    #[arg(value_name = "S.bricks", value_parser = scene_name())]
    pub scene: PathBuf,
    /// The file to write [default: the scene]
    #[arg(short, long, value_name = "S.bricks")]
    pub output: Option<PathBuf>,
    /// What gets fields: objects that are placed more than once, bricks of the others, or all
    #[arg(long, value_name = "WHAT", default_value = "all")]
    pub of: Subjects,
    /// Positions on the sphere of an object: 290, 1090, 4226 or 16642; fields of bricks have as many samples as fit
    /// into an eighth of their geometry
    #[arg(long, value_name = "N", default_value_t = 4226, value_parser = one_of::<290, 1090, 4226, 16642>)]
    pub positions: u32,
    /// Directions of a position of an object, on each axis of their square: 32, 64, 128 or 256
    #[arg(long, value_name = "N", default_value_t = 32, value_parser = one_of::<32, 64, 128, 256>)]
    pub directions: u32,
    /// Bits of a sample: 8 (where a ray meets something) or 1 (whether it does)
    #[arg(long, value_name = "BITS", default_value_t = 8, value_parser = one_of::<1, 1, 8, 8>)]
    pub bits: u32,
    /// Memory limit: half of it for bricks, and never less than the two largest of them [default: 1 GiB]
    #[arg(long, value_name = "SIZE", value_parser = size_bytes)]
    pub memory: Option<u64>,
    /// What traces: auto (a hardware GPU if there is one, else the processor), cpu, or the graphics adapter whose name
    /// contains NAME
    #[arg(long, value_name = "NAME", env = "BRICKWALK_ADAPTER", default_value = "auto")]
    pub adapter: Adapter,
}

/// Reads one of four numbers.
fn one_of<const A: u32, const B: u32, const C: u32, const D: u32>(text: &str) -> Result<u32, String> {
    let mut all = vec![A, B, C, D];
    all.dedup();
    let known = all.iter().map(u32::to_string).collect::<Vec<_>>().join(", ");
    text.parse().ok().filter(|number| all.contains(number)).ok_or_else(|| format!("it must be one of {known}"))
}

/// Options of `walk`.
#[derive(Clone, Debug, Args)]
#[command(after_help = UNITS)]
pub struct WalkArgs {
    /// The scene: a .bricks file, the URL of one, or a model
    ///
    /// A model (.gltf, .glb, .obj, .ply, .stl, tileset.json) is converted once into a folder and taken from there the
    /// next time, as long as its files are the same; a line says where it is. The folder is BRICKWALK_CACHE_DIR, else
    /// brickwalk in the user's cache. `convert` has options for how a model is converted
    #[arg(value_name = "S.bricks|MODEL", value_parser = scene_name(), required_unless_present = "print_settings")]
    scene: Option<PathBuf>,
    /// Output folder for frames, records and report; created if missing
    #[arg(short, long, value_name = "DIR", required_unless_present = "print_settings")]
    output: Option<PathBuf>,
    /// Read settings from a file (TOML); options on the command line override it [default: none]
    #[arg(long = "settings", value_name = "F.toml", hide_short_help = true)]
    file: Option<PathBuf>,
    /// Print the settings as a TOML file and exit
    #[arg(long, hide_short_help = true)]
    pub print_settings: bool,
    /// Print records on standard output, too, one JSON object per line
    #[arg(long, hide_short_help = true)]
    pub json: bool,
    /// Render frame N, or FIRST to LAST, apart from the others, into DIR/parts, for --join [default: none]
    ///
    /// With --bands B a frame is B parts: N is band N mod B of frame N / B, from the top. Any machine may render any
    /// part, in any order; the commands differ in this option alone. What is there and whole is not rendered again.
    #[arg(long, value_name = "N|FIRST-LAST", conflicts_with_all = ["join", "json"], hide_short_help = true,
        hide_long_help = true)]
    pub part: Option<PartRange>,
    /// Take frames from DIR/parts, and render those that are missing there; removes the parts at the end
    ///
    /// Frames are, byte for byte, those of one walk on the machine that joins them, if the parts come from a device
    /// of the same kind.
    #[arg(long, hide_short_help = true, hide_long_help = true)]
    pub join: bool,
    /// Show all options, with those for experts
    #[arg(long, action = clap::ArgAction::HelpLong)]
    pub help_all: Option<bool>,
    /// Everything that renders.
    #[command(flatten)]
    given: GroupArgs<OfWalk>,
}

impl WalkArgs {
    /// The settings: what was given, else what the file says, else the defaults.
    ///
    /// # Errors
    /// A bad file; settings that do not go together.
    pub fn settings(&self) -> anyhow::Result<Settings> {
        let settings = self.given.over(self.file.as_deref())?.for_pictures();
        settings.check().map_err(usage)?;
        Ok(settings)
    }

    /// The scene and the folder for what is written.
    ///
    /// # Errors
    /// There are none, which the parser sees to but for `--print-settings`.
    pub fn files(&self) -> Result<(&Path, &Path), Usage> {
        let missing = || Usage("walk needs a scene and --output".into());
        self.scene.as_deref().zip(self.output.as_deref()).ok_or_else(missing)
    }
}

/// Which settings `view` and `serve` begin with.
#[cfg(any(feature = "serve", feature = "viewer"))]
#[derive(Clone, Debug, Args)]
pub struct ViewSettings {
    /// Read settings from a file (TOML); options on the command line override it [default: none]
    #[arg(long = "settings", value_name = "F.toml", hide_short_help = true)]
    file: Option<PathBuf>,
    /// Show all options, with those for experts
    #[arg(long, action = clap::ArgAction::HelpLong)]
    pub help_all: Option<bool>,
    /// What is rendered, and how.
    #[command(flatten)]
    given: GroupArgs<OfView>,
}

#[cfg(any(feature = "serve", feature = "viewer"))]
impl ViewSettings {
    /// The settings, as those of `walk`.
    ///
    /// # Errors
    /// A bad file; settings that do not go together.
    pub fn settings(&self) -> anyhow::Result<Settings> {
        let settings = self.given.over(self.file.as_deref())?.for_windows();
        settings.check().map_err(usage)?;
        Ok(settings)
    }
}

/// Options of `view`.
#[cfg(feature = "viewer")]
#[derive(Clone, Debug, Args)]
#[command(after_help = UNITS)]
pub struct ViewArgs {
    /// The scene: a .bricks file, the URL of one, or a model, which is converted first, as by `walk`. [default: none;
    /// drop one on the window]
    #[arg(value_name = "S.bricks|MODEL", value_parser = scene_name())]
    pub scene: Option<PathBuf>,
    /// Folder for screenshots and paths [default: the current one]
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// What is rendered, and how.
    #[command(flatten)]
    pub given: ViewSettings,
}

/// Options of `serve`.
#[cfg(feature = "serve")]
#[derive(Clone, Debug, Args)]
#[command(after_help = UNITS)]
pub struct ServeArgs {
    /// The scene: a .bricks file, the URL of one, or a model, which is converted first, as by `walk`
    #[arg(value_name = "S.bricks|MODEL", value_parser = scene_name())]
    pub scene: PathBuf,
    /// Port to listen on; 0: any that is free
    #[arg(long, value_name = "N", default_value_t = 7878)]
    pub port: u16,
    /// Address to listen on. All of a network can reach 0.0.0.0; the token in the link is all that keeps others out,
    /// and it is not encrypted. Better is a tunnel: ssh -L 7878:127.0.0.1:7878 HOST
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1")]
    pub bind: std::net::IpAddr,
    /// Sessions at a time, at most; each has a cache of its own
    #[arg(long, value_name = "N", default_value = "4", value_parser = ranged::<1, 64>)]
    pub viewers: u32,
    /// What is rendered, and how.
    #[command(flatten)]
    pub given: ViewSettings,
}

/// Settings that do not go together are wrong usage.
fn usage(error: SettingsError) -> anyhow::Error {
    match error {
        SettingsError::Conflict(text) => Usage(text).into(),
        error => error.into(),
    }
}

/// Options of `trace`.
#[derive(Clone, Debug, Args)]
#[command(after_help = UNITS)]
pub struct TraceArgs {
    /// The scene: a .bricks file, the URL of one, or a model
    ///
    /// A model (.gltf, .glb, .obj, .ply, .stl, tileset.json) is converted once into a folder and taken from there the
    /// next time, as long as its files are the same; a line says where it is. The folder is BRICKWALK_CACHE_DIR, else
    /// brickwalk in the user's cache. `convert` has options for how a model is converted
    #[arg(value_name = "S.bricks|MODEL", value_parser = scene_name())]
    pub scene: PathBuf,
    /// Rays: a NumPy array, float64 or float32, shape (N, 8) or (N, 6): origin xyz, direction xyz, t_min, t_max; world
    /// space
    ///
    /// Without t_min and t_max they are 0 and infinity. N may be any number of axes.
    #[arg(long, value_name = "R.npy")]
    pub rays: PathBuf,
    /// Hits: a NumPy structured array, one element per ray, shaped as the rays: t (f8), triangle (u4), u (f4), v (f4)
    ///
    /// t counts in lengths of the direction, +inf on a miss, where triangle is 4294967295. u weights vertex 1 and v
    /// vertex 2 of the triangle in the order of the source file; 1 - u - v weights vertex 0.
    #[arg(short, long, value_name = "H.npy")]
    pub output: PathBuf,
    /// Test only whether a ray hits anything; the output is an array of bool
    #[arg(long)]
    pub any: bool,
    /// Add a field to the hits: normal (three f4), the triangle's unit normal in world space
    ///
    /// Seen from its tip, vertices 0, 1, 2 of the source file run counter-clockwise. It is zero on a miss.
    #[arg(long, conflicts_with = "any")]
    pub normals: bool,
    /// With --lod: the angle of the pixel that each ray stands for, in radians, above 0 to 1 [default: none]
    ///
    /// At a distance of D world units from a ray's origin a pixel is RADIANS * D wide. A camera of H rows with a
    /// vertical angle of view FOV has about FOV / H. A hit on a level of detail has the distance and normal of the
    /// level's triangle, u and v weight its vertices, and triangle is one of those of the source that it stands for
    #[arg(long, value_name = "RADIANS", allow_negative_numbers = true, value_parser = spread)]
    pub spread: Option<f64>,
    /// Print statistics as a JSON object
    #[arg(long)]
    pub json: bool,
    /// Read settings from a file (TOML); options on the command line override it [default: none]
    #[arg(long = "settings", value_name = "F.toml")]
    file: Option<PathBuf>,
    /// What streams bricks.
    #[command(flatten)]
    given: GroupArgs<OfTrace>,
}

impl TraceArgs {
    /// The settings: what was given, else what the file says, else the defaults.
    ///
    /// # Errors
    /// A bad file; an option that means nothing without frames.
    pub fn settings(&self) -> anyhow::Result<Settings> {
        if let Some(entry) = self.given.over(None)?.for_frames_alone() {
            let flag = entry.field.flag();
            return Err(Usage(format!("--{flag} is for walk; leave it out of trace")).into());
        }
        let settings = self.given.over(self.file.as_deref())?;
        if settings.lod > 0.0 && self.spread.is_none() {
            let text = "--lod needs --spread RADIANS: rays of a file have no pixels; give the angle that each stands \
                        for, such as --spread 0.001";
            return Err(Usage(text.into()).into());
        }
        Ok(settings)
    }
}

/// The angle of a pixel.
fn spread(text: &str) -> Result<f64, String> {
    let found = text.parse().ok().filter(|&angle: &f64| angle > 0.0 && angle <= 1.0);
    found.ok_or_else(|| "it must be an angle in radians, above 0 and at most 1, such as 0.001".into())
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

/// Parses a whole number or count from `LEAST` to `MOST`.
pub(crate) fn ranged<const LEAST: u32, const MOST: u32>(text: &str) -> Result<u32, String> {
    let found = u32::try_from(count(text)?).ok().filter(|n| (LEAST..=MOST).contains(n));
    found.ok_or_else(|| format!("it must be from {LEAST} to {MOST}"))
}

#[cfg(test)]
#[path = "args_tests.rs"]
mod tests;
