//! Options of what makes, checks and mends scene files.

use super::inputs::{FromArgs, InputArgs};
use super::scene_kind::{SceneKind, scene_help};
use super::scene_name::scene_name;
use super::units::UNITS;
use crate::cli::bake_displacement::Subjects;
use crate::settings::Adapter;
use crate::settings::sizes::{positive_count, positive_count32, ranged, size_bytes};
use brickwalk_convert::build::{LatticeStep, TextureEncoding};
use brickwalk_scenes::Stiff;
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use std::path::PathBuf;

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
    /// The file to write: S.bricks, or S.glb, S.gltf (with S.bin) or S.ply (triangles alone) for other programs;
    /// S.near.json and S.far.json, camera paths, are written beside it, for stiff scenes the latter alone
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
