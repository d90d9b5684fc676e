//! Options of `bench`.

use super::dvf::args::DvfBenchArgs;
use super::plan::Stage;
use super::roma::args::RomaBenchArgs;
use crate::cli::options::args::{UNITS, ranged};
use crate::settings::sizes::positive_count;
use crate::settings::{Adapter, CacheSize, EffectList, ImageSize, Rule, Schedule, Value};
use clap::{Args, Subcommand};
use std::path::PathBuf;

/// Options of `bench`.
#[derive(Clone, Debug, Args)]
pub struct BenchArgs {
    /// What to measure.
    #[command(subcommand)]
    pub experiments: Experiments,
}

/// What can be measured.
#[derive(Clone, Debug, Subcommand)]
pub enum Experiments {
    /// The experiments of the CHC+RT paper: its tables 2 to 5 and figures 5, 7 and 8, each ratio beside the paper's
    Chc(Box<ChcArgs>),
    /// The same frames on every device that is present: rates, and how far pictures differ from those of the first
    /// device
    Executors(Box<ExecutorsArgs>),
    /// The experiments of the ROMA paper: times of ray-aligned occupancy maps, and how far pictures by them are from
    /// exact ones
    Roma(Box<RomaBenchArgs>),
    /// The experiments of the paper of discrete visibility fields: rays to the environment that are left to be traced,
    /// and errors
    Dvf(Box<DvfBenchArgs>),
}

/// Options of `bench executors`.
#[derive(Clone, Debug, Args)]
#[command(after_help = UNITS)]
pub struct ExecutorsArgs {
    /// Folder for the results: executors.md, executors.json
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// A small scene, small pictures, few frames
    #[arg(long)]
    pub quick: bool,
    /// Triangles of the city [default: 1M; with --quick 50K]
    #[arg(long, value_name = "N", value_parser = positive_count)]
    pub triangles: Option<u64>,
    /// Folder of the generated scene; if it is missing it is generated there [default: DIR/scenes]
    #[arg(long, value_name = "DIR")]
    pub scenes: Option<PathBuf>,
    /// Width and height of the pictures [default: 1280x720; with --quick 96x54]
    #[arg(long, value_name = "WxH")]
    pub size: Option<ImageSize>,
    /// Frames of a walk [default: 5; with --quick 2]
    #[arg(long, value_name = "N", value_parser = frames)]
    pub frames: Option<u32>,
    /// Walks of each device, beside one that brings in what frames need [default: 5; with --quick 1]
    #[arg(long, value_name = "N", value_parser = repetitions)]
    pub repeat: Option<u32>,
    /// What is traced, as `walk --effects` has it
    #[arg(long, value_name = "LIST", default_value = "primary,ao,diffuse", value_parser = value::<EffectList>)]
    pub effects: EffectList,
    /// Occlusion and diffuse rays a pixel
    #[arg(long, value_name = "N", default_value = "1", value_parser = repetitions)]
    pub rays: u32,
    /// Device bytes for bricks, as `walk --cache` has it
    #[arg(long, value_name = "SIZE|P%", default_value = "100%")]
    pub cache: CacheSize,
    /// The schedule, as `walk --schedule` has it
    #[arg(long, value_name = "NAME", default_value = "chc")]
    pub schedule: Schedule,
    /// A device to be measured, as `walk --adapter` has it; repeated: each of them, and the pictures of the others are
    /// compared with those of the first [default: cpu, then every graphics adapter]
    #[arg(long = "adapter", value_name = "NAME")]
    pub adapters: Vec<Adapter>,
}

impl ExecutorsArgs {
    /// Options with their defaults.
    pub fn settings(&self) -> Settings {
        let or = |full, small| if self.quick { small } else { full };
        let (width, height) = if self.quick { (96, 54) } else { (1280, 720) };
        Settings {
            triangles: [self.triangles.unwrap_or(if self.quick { 50_000 } else { 1_000_000 }); 3],
            size: self.size.unwrap_or(ImageSize { width, height }),
            frames: self.frames.unwrap_or(or(5, 2)),
            tile: or(64, 16),
            skip: 0,
            repeat: self.repeat.unwrap_or(or(5, 1)),
            rays: self.rays,
        }
    }
}

/// Options of `bench chc`.
#[derive(Clone, Debug, Args)]
#[command(after_help = UNITS)]
pub struct ChcArgs {
    /// Folder for the results: chc.json, chc.md, report.html, a CSV a table, and cells.jsonl, which grows with every
    /// walk. Started again with the same folder and settings, the bench goes on where it stopped
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Small scenes, small pictures, few frames: under 10 minutes on two cores without a GPU. The results say which
    /// rules of measuring are not met
    #[arg(long)]
    pub quick: bool,
    /// Triangles of the city, of the city out of core, and of the plant of pipes, of which 16 copies are out of core
    /// [default: 12M,139M,13M; with --quick 100K,200K,100K]
    #[arg(long, value_name = "A,B,C", value_parser = three_counts)]
    pub triangles: Option<Counts>,
    /// Folder of the generated scenes; what is missing is generated there [default: DIR/scenes]
    #[arg(long, value_name = "DIR")]
    pub scenes: Option<PathBuf>,
    /// A converted Sponza, measured beside the generated scenes [default: none]
    #[arg(long, value_name = "S.bricks")]
    pub sponza: Option<PathBuf>,
    /// What to measure in this run, separated by commas: table2 (in core against both baselines), table3 (out of core),
    /// table4 (aggressive culling), table5 (random turns), figure5 (tile sizes), targets (bytes moved against needed),
    /// scale (the large city all resident) [default: all]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub stages: Vec<Stage>,
    /// Measure only cases whose names contain every word of TEXT; repeated: those of any TEXT. Names are such as
    /// "table2/city/100%/tile 64/near/primary,ao,diffuse/chc+fronts/threshold 0/turn 36"; cells.jsonl holds them
    /// [default: all]
    #[arg(long, value_name = "TEXT")]
    pub only: Vec<String>,
    /// Begin no walk after so many minutes; the results hold what is measured until then [default: no limit]
    #[arg(long, value_name = "N", value_parser = minutes)]
    pub minutes: Option<f64>,
    /// Insist that DIR holds measurements to go on with
    #[arg(long)]
    pub resume: bool,
    /// Width and height of the pictures [default: 1920x1080; with --quick 96x54]
    #[arg(long, value_name = "WxH")]
    pub size: Option<ImageSize>,
    /// Frames of a walk [default: 30; with --quick 4]
    #[arg(long, value_name = "N", value_parser = frames)]
    pub frames: Option<u32>,
    /// Walks of each case [default: 5; with --quick 2]
    #[arg(long, value_name = "N", value_parser = repetitions)]
    pub repeat: Option<u32>,
    /// Width and height of a screen tile in pixels, a power of two from 8 to 512 [default: 64; with --quick 16]
    #[arg(long, value_name = "PIXELS", value_parser = crate::cli::options::args::tile)]
    pub tile: Option<u32>,
    /// What renders: auto (a hardware GPU if there is one, else the processor), cpu (the processor), or the graphics
    /// adapter whose name contains NAME, upper and lower case alike; `brickwalk adapters` lists them
    #[arg(long, value_name = "NAME", env = "BRICKWALK_ADAPTER", default_value = "auto")]
    pub adapter: Adapter,
    /// Occlusion and diffuse rays a pixel [default: 20; with --quick 2].
    #[arg(long, hide = true, value_parser = repetitions)]
    pub rays: Option<u32>,
    /// Frames at the start of a walk left out of times [default: 5; with --quick 1].
    #[arg(long, hide = true)]
    pub skip: Option<u32>,
}

/// Numbers of triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counts(pub [u64; 3]);

fn three_counts(text: &str) -> Result<Counts, String> {
    let counts: Vec<u64> = text.split(',').map(|count| positive_count(count.trim())).collect::<Result<_, _>>()?;
    let three = <[u64; 3]>::try_from(counts).map_err(|_| "it must be three counts, such as 12M,139M,13M")?;
    Ok(Counts(three))
}

pub(crate) fn minutes(text: &str) -> Result<f64, String> {
    let minutes: f64 = text.parse().map_err(|_| "it must be a number of minutes")?;
    if (0.0..=100_000.0).contains(&minutes) { Ok(minutes) } else { Err("it must be from 0 to 100000".into()) }
}

/// Reads the value of a setting.
fn value<T: Value>(text: &str) -> Result<T, String> {
    T::read(text, Rule::Any, "")
}

fn frames(text: &str) -> Result<u32, String> {
    ranged(text, 1, 300)
}

pub(crate) fn repetitions(text: &str) -> Result<u32, String> {
    ranged(text, 1, 1000)
}

/// What the options come to.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Triangles.
    pub triangles: [u64; 3],
    /// Width and height in pixels.
    pub size: ImageSize,
    /// Frames of a walk.
    pub frames: u32,
    /// Edge of a tile in pixels.
    pub tile: u32,
    /// Of the frames, left out of times.
    pub skip: u32,
    /// Walks of each case.
    pub repeat: u32,
    /// Secondary rays a pixel.
    pub rays: u32,
}

impl ChcArgs {
    /// Options with their defaults.
    pub fn settings(&self) -> Settings {
        let quick = self.quick;
        let or = |full, small| if quick { small } else { full };
        let size = if quick { (96, 54) } else { (1920, 1080) };
        Settings {
            triangles: self
                .triangles
                .map_or(or([12_000_000, 139_000_000, 13_000_000], [100_000, 200_000, 100_000]), |t| t.0),
            size: self.size.unwrap_or(ImageSize { width: size.0, height: size.1 }),
            frames: self.frames.unwrap_or(if quick { 4 } else { 30 }),
            tile: self.tile.unwrap_or(if quick { 16 } else { 64 }),
            skip: self.skip.unwrap_or(if quick { 1 } else { 5 }),
            repeat: self.repeat.unwrap_or(if quick { 2 } else { 5 }),
            rays: self.rays.unwrap_or(if quick { 2 } else { 20 }),
        }
    }

    /// The stages wanted.
    pub fn stages(&self) -> Vec<Stage> {
        let wanted = |stage: &Stage| self.stages.is_empty() || self.stages.contains(stage);
        Stage::ALL.into_iter().filter(wanted).collect()
    }

    /// Whether a case of this name is wanted.
    pub fn wants(&self, name: &str) -> bool {
        self.only.is_empty() || self.only.iter().any(|text| text.split_whitespace().all(|word| name.contains(word)))
    }
}

impl Settings {
    /// Rules of measuring (and conditions of the paper) that these settings do not meet.
    pub fn unmet(&self) -> Vec<String> {
        let mut unmet = Vec::new();
        let mut unless = |met: bool, text: String| {
            if !met {
                unmet.push(text);
            }
        };
        unless(self.repeat >= 5, format!("{} walks of each case, not 5", self.repeat));
        unless(self.skip >= 5, format!("the first {} frames left out, not 5", self.skip));
        unless(self.frames > self.skip, "no frame is left to measure but the last".into());
        let ImageSize { width, height } = self.size;
        unless((width, height) == (1920, 1080), format!("{width}x{height} pixels, not the paper's 1920x1080"));
        unless(self.rays == 20, format!("{} secondary rays a pixel, not the paper's 20", self.rays));
        let counts = self.triangles.map(crate::settings::sizes::human_count).join(", ");
        let alike = [11_000_000, 130_000_000, 12_000_000].iter().zip(self.triangles).all(|(&least, own)| own >= least);
        unless(alike, format!("scenes of {counts} triangles, smaller than the paper's"));
        unmet
    }
}
