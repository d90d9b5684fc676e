//! The command line: every subcommand, every option with its unit and default. Values are validated here, so that
//! commands receive only what they can use; what is wrong ends as usage with exit status 2.

use super::dvf_args::DvfArgs;
use super::field_args::FieldArgs;
use super::inputs::{FromArgs, InputArgs};
use super::light_args::{EffectArgs, LightArgs};
use super::named::{named_values, unknown};
use super::optimisation_args::OptimisationArgs;
use super::picture_args::PictureArgs;
use super::roma_args::RomaArgs;
use super::scene_kind::{SceneKind, scene_help};
use super::sizes::{CacheSize, ImageSize, positive_count, positive_count32, size_bytes};
use crate::lab::bench::args::BenchArgs;
use crate::lab::selftest::args::SelftestArgs;
use crate::scene::camera::check_fov_y_degrees;
use crate::session::device::Adapter;
use crate::stream::Policy;
use brickwalk_convert::build::TextureEncoding;
use brickwalk_scenes::Stiff;
use clap::{Args, Parser, Subcommand};
use std::path::PathBuf;

/// Said at the end of every help text.
pub(crate) const UNITS: &str = "Sizes are bytes and take K, M, G (powers of 1024); counts take K, M (powers of 1000).\n\
     Exit status: 0 done, 1 the input is bad (one line says what and what to do), 2 wrong usage.";

/// Walks by ray tracing through scenes that do not fit in GPU memory.
///
/// A scene is converted once into bricks, in one file; rendering streams the bricks that rays need through a small
/// cache.
#[derive(Debug, Parser)]
#[command(name = "brickwalk", bin_name = "brickwalk", version, after_help = UNITS, max_term_width = 110)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The subcommands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Generate a city larger than the demo's cache, convert it, walk through it, write a report
    Demo(DemoArgs),
    /// Convert scenes (.gltf, .glb, .obj, .ply, .stl) into one .bricks file
    Convert(ConvertArgs),
    /// Generate a scene and camera paths through it
    Scene(SceneArgs),
    /// Show what a .bricks file holds, or where a triangle comes from
    Info(InfoArgs),
    /// Check every checksum and reference of a .bricks file
    Verify(VerifyArgs),
    /// Rebuild the damaged bricks and textures of a .bricks file from what it was converted from
    Repair(RepairArgs),
    /// Render a camera path to images, records and a report, without a window
    Walk(Box<WalkArgs>),
    /// Find the closest hits of given rays
    Trace(TraceArgs),
    /// Replay a trace of brick requests against other cache sizes and policies
    Replay(ReplayArgs),
    /// Measure how far an image is from a reference: RMSE, relMSE, bias, FLIP
    Compare(CompareArgs),
    /// Measure: the experiments of the CHC+RT paper, repeated
    Bench(BenchArgs),
    /// List what can render, and what is chosen
    Adapters(AdaptersArgs),
    /// Check the numerical stability of this machine's device, case by case
    Selftest(SelftestArgs),
}

/// Options of `adapters`.
#[derive(Clone, Debug, Args)]
#[command(after_help = UNITS)]
pub struct AdaptersArgs {
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// Options of `demo`.
#[derive(Clone, Debug, Args)]
#[command(after_help = UNITS)]
pub struct DemoArgs {
    /// Folder for the scene, the frames and the report; created when missing
    #[arg(short, long, value_name = "DIR", default_value = "demo-out")]
    pub output: PathBuf,
    /// Triangles of the city, about
    #[arg(long, value_name = "COUNT", default_value = "2M", value_parser = positive_count)]
    pub triangles: u64,
    /// Frames of the walk
    #[arg(long, value_name = "N", default_value = "12", value_parser = frames)]
    pub frames: u32,
    /// Width and height of the frames in pixels, each 1 to 16384
    #[arg(long, value_name = "WxH", default_value = "640x360")]
    pub size: ImageSize,
    /// Device memory for bricks: a size, or a share P% of all bricks
    #[arg(long, value_name = "SIZE|P%", default_value = "25%")]
    pub cache: CacheSize,
    /// Seed of the city and of random sampling
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
    /// How textures are stored: bc7 (blocks, a byte a texel, of BC5 for normals, the loss measured in
    /// docs/results/textures.md) or raw (RGBA8, four bytes)
    #[arg(long, value_name = "ENCODING", value_enum, default_value = "bc7")]
    pub textures: Textures,
    /// Keep the meshes of the nodes called NAME, and of those below them, as instances of their own, so that walk
    /// --motion can move them; * stands for any characters, ? for one. Give it once for each name [default: none;
    /// meshes that are used once are baked into the world]
    #[arg(long, value_name = "NAME")]
    pub movable: Vec<String>,
    /// What becomes of triangles and meshes.
    #[command(flatten)]
    pub mesh: MeshArgs,
}

/// How textures are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Textures {
    /// Blocks.
    Bc7,
    /// Texels.
    Raw,
}

impl From<Textures> for TextureEncoding {
    fn from(textures: Textures) -> Self {
        match textures {
            Textures::Bc7 => Self::Bc7,
            Textures::Raw => Self::Raw,
        }
    }
}

/// Options of what becomes of the triangles and meshes of inputs.
#[derive(Clone, Debug, Args)]
pub struct MeshArgs {
    /// Drop triangles with a vertex that is not a finite number instead of refusing the input
    #[arg(long)]
    pub drop_non_finite: bool,
    /// Instances of a mesh that is used twice or more are stored once if it has at least this many triangles; smaller
    /// ones are copied into the world
    #[arg(long, value_name = "COUNT", default_value = "1K", value_parser = positive_count32)]
    pub instance_min_triangles: u32,
    /// Most triangles of smaller meshes, all copies counted, that are copied into the world; beyond it they are stored
    /// once
    #[arg(long, value_name = "COUNT", default_value = "4M", value_parser = positive_count)]
    pub bake_budget: u64,
}

/// Options of everything that writes a `.bricks` file.
#[derive(Clone, Debug, Args)]
pub struct BuildArgs {
    /// Most triangles of a brick, 1 to 1048576; larger is faster in core, smaller reads less out of core [default:
    /// 16384]
    #[arg(long, value_name = "COUNT", value_parser = brick_triangles)]
    pub brick_triangles: Option<u32>,
    /// Leave out the occupancy maps of bricks, which approximate secondary rays where no brick is loaded
    #[arg(long)]
    pub no_proxies: bool,
    /// Continue a conversion with the same inputs and options that was interrupted; without this it starts anew
    #[arg(long)]
    pub resume: bool,
    /// How to work and to round.
    #[command(flatten)]
    pub work: WorkArgs,
}

/// Options of everything that converts.
#[derive(Clone, Debug, Args)]
pub struct WorkArgs {
    /// Threads that convert [default: one per core]
    #[arg(long, value_name = "N", value_parser = threads)]
    pub threads: Option<u32>,
    /// log2 of the step that positions are rounded to, in world units [default: from the sizes of the bricks]
    #[arg(long, value_name = "LOG2", allow_hyphen_values = true, value_parser = clap::value_parser!(i32).range(-126..=96))]
    pub lattice: Option<i32>,
    /// Memory to get by with; what does not fit goes to the disk, about 250 bytes a triangle beside the output. The
    /// file is the same [default: a quarter of the machine's]
    #[arg(long, value_name = "SIZE", value_parser = size_bytes)]
    pub memory: Option<u64>,
    /// Folder for scratch files [default: that of the output]
    #[arg(long, value_name = "DIR")]
    pub scratch: Option<PathBuf>,
    /// Build the trees in bricks faster: about a quarter less work in all (city, 12M triangles), for trees that cost a
    /// ray about 6 % more (city, 1M triangles)
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
    /// Seed; the same seed and count make the same scene
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Store the city's trees and vehicles once and place them as instances; the triangles are the same. Terrain always
    /// does so with what grows on it
    #[arg(long)]
    pub instanced: bool,
    /// Place the whole scene so many times, in a square; meshes of 1000 triangles and more are stored once
    #[arg(long, value_name = "N", default_value = "1", value_parser = copies, conflicts_with = "instanced")]
    pub copies: u32,
    /// How to cut and round.
    #[command(flatten)]
    pub build: BuildArgs,
}

/// Options of `info`.
#[derive(Clone, Debug, Args)]
#[command(after_help = UNITS)]
pub struct InfoArgs {
    /// The scene
    #[arg(value_name = "S.bricks")]
    pub scene: PathBuf,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// Read all bricks too: the surface-area cost of the whole tree
    #[arg(long, conflicts_with = "id")]
    pub deep: bool,
    /// Say which file, node, mesh, primitive and triangle the triangle with this id comes from
    #[arg(long, value_name = "N")]
    pub id: Option<u32>,
    /// List the instances, which walk --motion can move: number, node, nodes above it that convert --movable named,
    /// mesh, triangles, bounds in world units
    #[arg(long, conflicts_with_all = ["id", "deep"])]
    pub instances: bool,
}

/// Options of `verify`.
#[derive(Clone, Debug, Args)]
#[command(after_help = UNITS)]
pub struct VerifyArgs {
    /// The scene
    #[arg(value_name = "S.bricks")]
    pub scene: PathBuf,
}

/// Options of `repair`.
#[derive(Clone, Debug, Args)]
#[command(after_help = UNITS)]
pub struct RepairArgs {
    /// The scene; damaged bricks and textures are written in place, everything else stays as it is
    #[arg(value_name = "S.bricks")]
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

/// Options of what streams bricks to a device.
#[derive(Clone, Debug, Args)]
pub struct StreamArgs {
    /// Device memory for bricks and tiles of textures: a size, or a share P% of all of them; it must hold the two
    /// largest bricks
    #[arg(long, value_name = "SIZE|P%", default_value = "25%")]
    pub cache: CacheSize,
    /// Host memory for verified bricks; 0 keeps none
    #[arg(long, value_name = "SIZE", default_value = "1G",
        value_parser = |s: &str| if s == "0" { Ok(0) } else { size_bytes(s) })]
    pub host_cache: u64,
    /// How bricks to intersect are found: chc (tiles against the top level, loading what rays need), demand (one
    /// traversal per ray over what is resident, loading what rays ask for), plain (everything resident, one traversal
    /// per ray; the cache must hold the scene), auto (the cheapest of these by measurement, for each effect; chc with
    /// --fronts on or a
    /// --query-threshold). For measurements: plain-bvh2 (as plain, over binary trees made at the start, which take
    /// memory beside the cache: the kind of baseline of the CHC+RT paper). Pictures are the same
    #[arg(long, value_name = "NAME", default_value = "auto")]
    pub schedule: Schedule,
    /// Width and height of a screen tile in pixels, a power of two from 8 to 512
    #[arg(long, value_name = "PIXELS", default_value = "64", value_parser = tile)]
    pub tile: u32,
    /// Threads that read bricks and check them [default: one per core, at most 4]
    #[arg(long, value_name = "N", alias = "hash-threads", value_parser = threads)]
    pub workers: Option<u32>,
    /// Which brick makes room for another: round-robin (the next one in the cache), second-chance (the next one that
    /// was not used since its turn came last), lru (the one not used for longest)
    #[arg(long, value_name = "NAME", default_value = "round-robin",
        value_parser = |s: &str| one_of(s, &Policy::ALL.map(Policy::name)))]
    pub evict: String,
    /// Keep query pairs of tiles and nodes from frame to frame (walk, with schedule chc): on, off
    #[arg(long, value_name = "on|off", default_value = "off", value_parser = |s: &str| one_of(s, &["on", "off"]))]
    pub fronts: String,
    /// Leave a brick out of a tile where at most this many of its rays could see it, scaled to a tile of 200x200
    /// pixels; 0 is exact, more loads less and misses hits
    #[arg(long, value_name = "PIXELS", default_value = "0", value_parser = query_threshold)]
    pub query_threshold: u32,
    /// Write the trace of brick requests to this file, for replay against other caches [default: none]
    #[arg(long, value_name = "F")]
    pub requests_out: Option<PathBuf>,
    /// Count the nodes that rays visit and the triangles that they test (nodes_visited, triangles_tested), which takes
    /// time
    #[arg(long)]
    pub count: bool,
    /// What renders: auto (a hardware GPU if there is one, else the processor), cpu (the processor), or the graphics
    /// adapter whose name contains NAME, upper and lower case alike; `brickwalk adapters` lists them
    #[arg(long, value_name = "NAME", env = "BRICKWALK_ADAPTER", default_value = "auto")]
    pub adapter: Adapter,
}

impl StreamArgs {
    /// Threads that read bricks, at least 1.
    pub fn worker_count(&self) -> usize {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        self.workers.map_or(cores.min(4), |n| n as usize)
    }
}

/// Options of `walk`.
#[derive(Clone, Debug, Args)]
#[command(after_help = UNITS)]
pub struct WalkArgs {
    /// The scene
    #[arg(value_name = "S.bricks")]
    pub scene: PathBuf,
    /// Folder for frames, records and report; created when missing
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Camera path (JSON) [default: one made from the scene's bounds]
    #[arg(long, value_name = "P.json")]
    pub path: Option<PathBuf>,
    /// Motion of instances (JSON): {"instances": [{"node": NAME or "instance": N, "pivot": [x,y,z], "keyframes":
    /// [{"time": T, "translation": [x,y,z], "rotation": [x,y,z,w], "scale": S}, ...]}]}, in world units and in the time
    /// of the camera path. A motion is applied to where the scene has the instance: it turns and scales about the
    /// pivot, by default the middle of what it moves, and then goes by the translation, so that no translation,
    /// rotation 0,0,0,1 and scale 1 (1e-6 to 1e6), the defaults, leave it there. Translations lie on a Catmull-Rom
    /// spline, rotations turn the shorter way, and before the first keyframe and after the last it rests. What moves is
    /// an instance: see info --instances and convert
    /// --movable [default: nothing moves]
    #[allow(rustdoc::broken_intra_doc_links)]
    #[arg(long, value_name = "M.json")]
    pub motion: Option<PathBuf>,
    /// Frames along the path
    #[arg(long, value_name = "N", default_value = "30", value_parser = frames)]
    pub frames: u32,
    /// Width and height of the frames in pixels, each 1 to 16384
    #[arg(long, value_name = "WxH", default_value = "1280x720")]
    pub size: ImageSize,
    /// Vertical field of view in degrees, 1e-6 to 179.99 [default: the path's]
    #[arg(long, value_name = "DEG", value_parser = fov)]
    pub fov: Option<f64>,
    /// What is traced.
    #[command(flatten)]
    pub effects: EffectArgs,
    /// How secondary rays are answered: exact (all are traced), roma (those of ao, shadow and diffuse by maps of what
    /// cells are occupied, with a bias of a few cells, and without a brick loaded for them; what diffuse rays meet is
    /// lit by maps of what the sun, points and spots light, which load what these see; others are traced), auto (those
    /// of ao and shadow that these maps find free are not traced: an error of the nearest cell alone), df (those of ao
    /// and shadow by distances to occupied cells: the baseline that roma is compared with), dvf (those to the
    /// environment by what a field knows of the directions around them: most are not traced; the field is made on the
    /// first walk and kept beside the scene)
    #[arg(long, value_name = "METHOD", default_value = "exact")]
    pub secondary: Secondary,
    /// Occupancy maps.
    #[command(flatten)]
    pub roma: RomaArgs,
    /// Distance fields.
    #[command(flatten)]
    pub df: FieldArgs,
    /// Fields of visibility.
    #[command(flatten)]
    pub dvf: DvfArgs,
    /// Samples per pixel, 1 to 1M; beyond 64 they are summed in f64, so that no number of them makes the sum drift
    #[arg(long, value_name = "N", default_value = "1", value_parser = samples)]
    pub spp: u32,
    /// Seed of random sampling
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Write an EXR with radiance, depth, normal, triangle id and albedo beside each PNG
    #[arg(long)]
    pub aov: bool,
    /// Pictures.
    #[command(flatten)]
    pub pictures: PictureArgs,
    /// Interactive: a frame loads at most SIZE of texture tiles, those first that most hits ask for, and one at least;
    /// the next coarser level that is resident stands for the others. unresolved_pixels in the records counts such
    /// hits. While the camera rests, frames become the exact ones, if the cache holds what they need. Bricks are waited
    /// for [default: off, tiles are waited for as well]
    #[arg(long, value_name = "SIZE", value_parser = size_bytes)]
    pub interactive: Option<u64>,
    /// Ask after every pass which bricks it needed (bricks_needed in the records); takes a traversal more a pass
    #[arg(long)]
    pub measure_needed: bool,
    /// Render every frame exactly as well, in a second session with a cache of its own, and record how far each effect
    /// is from it (error_mean, error_worst_tile, error_pixels): what --query-threshold costs. Takes twice the time and
    /// device memory; the walk's times and counters leave it out
    #[arg(long)]
    pub measure_error: bool,
    /// Show frames of more than 64 samples a pixel while they are made: DIR/preview.png is replaced after 64, 128, 256
    /// samples and so on, and removed at the end
    #[arg(long)]
    pub progressive: bool,
    /// Render the first frame six times more as it is and with each thing that was left out because the scene does not
    /// need it, turn by turn, and state under left_out in summary.json what leaving it out saves (ms_saved, of medians
    /// of five). Takes a session and a cache for each
    #[arg(long)]
    pub measure_left_out: bool,
    /// Print the records on standard output too, one JSON object a line
    #[arg(long)]
    pub json: bool,
    /// Light.
    #[command(flatten)]
    pub light: LightArgs,
    /// Streaming.
    #[command(flatten)]
    pub stream: StreamArgs,
    /// Optimisations.
    #[command(flatten)]
    pub optimisations: OptimisationArgs,
}

impl WalkArgs {
    /// Refuses options that do not go together.
    ///
    /// # Errors
    /// Which option to leave out.
    pub fn check(&self) -> Result<(), crate::cli::Usage> {
        if self.pictures.taa && self.aov {
            let text = "--aov: depth, normals, ids and albedo are taken through the centres of pixels, which --taa moves; leave one out";
            return Err(crate::cli::Usage(text.into()));
        }
        Ok(())
    }
}

/// Options of `trace`.
#[derive(Clone, Debug, Args)]
#[command(after_help = UNITS)]
pub struct TraceArgs {
    /// The scene
    #[arg(value_name = "S.bricks")]
    pub scene: PathBuf,
    /// Rays: a NumPy array, float64, shape (N, 8): origin xyz, direction xyz, t_min, t_max; world space
    #[arg(long, value_name = "R.npy")]
    pub rays: PathBuf,
    /// Hits: a NumPy structured array, one row a ray: t (f8, +inf on a miss, in lengths of the direction), triangle
    /// (u4), u (f4), v (f4)
    #[arg(short, long, value_name = "H.npy")]
    pub output: PathBuf,
    /// Ask only whether anything is hit; the output is an array of bool
    #[arg(long)]
    pub any: bool,
    /// Print what was loaded as a JSON object on standard output
    #[arg(long)]
    pub json: bool,
    /// Streaming.
    #[command(flatten)]
    pub stream: StreamArgs,
}

impl TraceArgs {
    /// Refuses options of the streaming that mean nothing without frames.
    ///
    /// # Errors
    /// Which option to leave out.
    pub fn check(&self) -> Result<(), crate::cli::Usage> {
        let meaningless =
            [(self.stream.fronts == "on", "--fronts on"), (self.stream.query_threshold > 0, "--query-threshold")];
        match meaningless.iter().find(|(given, _)| *given) {
            Some((_, option)) => Err(crate::cli::Usage(format!("{option} is for walk; leave it out of trace"))),
            None => Ok(()),
        }
    }
}

/// What the columns of `replay` are.
const REPLAY: &str = "A request is one use of a payload (geometry or attributes of a brick) by a pass; a load is a request \
     that found it missing; a reload is a load of what had been loaded before. Every cache begins empty. belady-greedy evicts \
     what is used again last: a bound that needs to know the future and ignores pages. Sizes below the two largest bricks are \
     skipped.";

/// Options of `replay`.
#[derive(Clone, Debug, Args)]
#[command(after_help = format!("{REPLAY}\n\n{UNITS}"))]
pub struct ReplayArgs {
    /// The trace that walk or trace wrote with --requests-out
    #[arg(value_name = "F")]
    pub requests: PathBuf,
    /// Caches beside the recorded one: sizes, or shares P% of all bricks [default: 5% 10% 20% 50% 100%; with --plot 26
    /// shares from 2% to 100%]
    #[arg(long, value_name = "SIZE|P%", num_args = 1.., value_delimiter = ',')]
    pub cache: Vec<CacheSize>,
    /// Write a page with plots against the size of the cache, and a table; one file that opens offline [default: none]
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

named_values! {
    /// How the bricks to intersect are found.
    Schedule {
        /// Tiles against the top level; loads what rays need.
        Chc = "chc",
        /// One traversal per ray over what is resident; loads what rays ask for.
        Demand = "demand",
        /// Everything resident, one traversal per ray.
        Plain = "plain",
        /// The same over binary trees.
        PlainBvh2 = "plain-bvh2",
        /// The cheaper one.
        Auto = "auto",
    } later &[]
}

named_values! {
    /// How secondary rays are answered.
    Secondary {
        /// By tracing them.
        Exact = "exact",
        /// Those that occupancy maps can answer by these.
        Roma = "roma",
        /// Those that occupancy maps find free by these, others by tracing them.
        Auto = "auto",
        /// Those that occupancy maps can answer by distance fields.
        Df = "df",
        /// Those to the environment by fields of visibility.
        Dvf = "dvf",
    } later &["displacement"]
}

/// Accepts the values of a list.
fn one_of(text: &str, known: &[&str]) -> Result<String, String> {
    if known.contains(&text) { Ok(text.into()) } else { Err(unknown(text, known, &[])) }
}

/// Parses a whole number or count and checks its range.
pub(crate) fn ranged(text: &str, least: u64, most: u64) -> Result<u32, String> {
    let n = super::sizes::count(text)?;
    match u32::try_from(n) {
        Ok(n32) if (least..=most).contains(&n) => Ok(n32),
        _ => Err(format!("it must be from {least} to {most}")),
    }
}

fn frames(text: &str) -> Result<u32, String> {
    ranged(text, 1, 1_000_000)
}

fn copies(text: &str) -> Result<u32, String> {
    ranged(text, 1, 1024)
}

fn samples(text: &str) -> Result<u32, String> {
    ranged(text, 1, 1_000_000)
}

fn threads(text: &str) -> Result<u32, String> {
    ranged(text, 1, 1024)
}

fn query_threshold(text: &str) -> Result<u32, String> {
    ranged(text, 0, 40_000)
}

fn brick_triangles(text: &str) -> Result<u32, String> {
    ranged(text, 1, 1 << 20)
}

pub(crate) fn tile(text: &str) -> Result<u32, String> {
    let wrong = || "a tile is a power of two from 8 to 512 pixels".to_string();
    ranged(text, 8, 512).ok().filter(|n| n.is_power_of_two()).ok_or_else(wrong)
}

fn fov(text: &str) -> Result<f64, String> {
    let degrees: f64 = text.parse().map_err(|_| "it must be a number of degrees".to_string())?;
    check_fov_y_degrees(degrees).map(|()| degrees).map_err(|e| e.to_string())
}

#[cfg(test)]
#[path = "args_tests.rs"]
mod tests;
