//! Options of `bench dvf`.

use crate::cli::options::args::{UNITS, ranged};
use crate::cli::options::named::named_values;
use crate::cli::options::sizes::{CacheSize, ImageSize};
use crate::lab::bench::args as bench;
use crate::session::device::Adapter;
use clap::Args;
use std::path::PathBuf;

/// What begins the options of a field that is made anew in every frame, as in the paper.
pub const ANEW: &str = "anew ";

/// What begins the options of a field whose cells are made anew for what moves, within a budget of rays a frame.
pub const RENEWED: &str = "renewed ";

/// Options of `bench dvf`.
#[derive(Clone, Debug, Args)]
#[command(after_help = UNITS)]
pub struct DvfBenchArgs {
    /// Converted scenes; a Cornell box in which a box orbits (`scene cornell`) is measured beside them. Where
    /// S.motion.json lies beside a scene its flicker is measured
    #[arg(value_name = "S.bricks")]
    pub scenes: Vec<PathBuf>,
    /// Folder for the results: dvf.json, dvf.md, report.html, a CSV a table, and rows.jsonl, which grows with every
    /// measurement. Started again with the same folder and settings, the bench goes on where it stopped
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Camera paths (JSON) of the scenes, in their order; of scenes without, S.near.json beside it, or one made from
    /// its bounds
    #[arg(long, value_name = "P.json", value_delimiter = ',')]
    pub paths: Vec<PathBuf>,
    /// The environment [default: the sky over the ground]
    #[arg(long, value_name = "FILE")]
    pub environment: Option<PathBuf>,
    /// What to measure in this run, separated by commas: points (figure 13 and table 2: points, rounding, hash and
    /// Hammersley), grid (figure 14), rays (figure 15), lanes (figure 16), masks (their resolution, dilation, which
    /// answers count), modes (same-sample and the paper's), flicker (of scenes in which something moves: what pictures
    /// change from frame to frame that exact rays do not), memory (a cache of --cache, the field of what is seen)
    /// [default: all]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub stages: Vec<Stage>,
    /// Begin no measurement after so many minutes; the results hold what is measured until then [default: no limit]
    #[arg(long, value_name = "N", value_parser = bench::minutes)]
    pub minutes: Option<f64>,
    /// Width and height of the pictures
    #[arg(long, value_name = "WxH", default_value = "320x180")]
    pub size: ImageSize,
    /// Rays to the environment a pixel, 1 to 65536
    #[arg(long, value_name = "N", default_value = "128", value_parser = |s: &str| ranged(s, 1, 65_536))]
    pub samples: u32,
    /// The most points that are strewn, 1000 to 16M: a fifth and a 25th of it beside it
    #[arg(long, value_name = "N", default_value = "400K", value_parser = |s: &str| ranged(s, 1000, 16_000_000))]
    pub points: u32,
    /// Rays of a point
    #[arg(long, value_name = "N", default_value = "128", value_parser = |s: &str| ranged(s, 1, 1024))]
    pub rays: u32,
    /// Turns of a measurement in which a picture without a field and one with it are timed, one after the other, 1 to
    /// 100: times are medians
    #[arg(long, value_name = "N", default_value = "3", value_parser = |s: &str| ranged(s, 1, 100))]
    pub repeat: u32,
    /// The cache of memory, as --cache of walk
    #[arg(long, value_name = "SIZE|P%", default_value = "15%")]
    pub cache: CacheSize,
    /// What renders: auto (a hardware GPU if there is one, else the processor), cpu (the processor), or the graphics
    /// adapter whose name contains NAME, upper and lower case alike; `brickwalk adapters` lists them
    #[arg(long, value_name = "NAME", env = "BRICKWALK_ADAPTER", default_value = "auto")]
    pub adapter: Adapter,
}

named_values! {
    /// What is measured.
    Stage {
        /// Points.
        Points = "points",
        /// Cells.
        Grid = "grid",
        /// Rays of a point.
        Rays = "rays",
        /// Lanes.
        Lanes = "lanes",
        /// Masks.
        Masks = "masks",
        /// Modes.
        Modes = "modes",
        /// Flicker.
        Flicker = "flicker",
        /// Out of core.
        Memory = "memory",
    } later &[]
}

impl Stage {
    /// All of them, in the order of the paper.
    pub const ALL: [Self; 8] =
        [Self::Points, Self::Grid, Self::Rays, Self::Lanes, Self::Masks, Self::Modes, Self::Flicker, Self::Memory];

    /// Its heading.
    pub fn title(self) -> &'static str {
        match self {
            Self::Points => "Points, figure 13 and table 2",
            Self::Grid => "Cells, figure 14",
            Self::Rays => "Rays of a point, figure 15",
            Self::Lanes => "Lanes, figure 16",
            Self::Masks => "Masks, and which answers count",
            Self::Modes => "Modes",
            Self::Flicker => "Flicker, section 4.4",
            Self::Memory => "What is seen, out of core",
        }
    }
}

impl DvfBenchArgs {
    /// The options of each measurement of a stage, beside those of all: as they would be given to `walk`.
    pub fn measurements(&self, stage: Stage) -> Vec<String> {
        let (points, rays) = (self.points, self.rays);
        let of = |options: &str| format!("--dvf-points {points} --dvf-rays {rays} {options}");
        match stage {
            Stage::Points => [25, 5, 1]
                .into_iter()
                .flat_map(|part| {
                    [("rounding", "hash"), ("ceiling", "hash"), ("ceiling", "hammersley")].map(|(count, sequence)| {
                        let points = (points / part).max(100);
                        format!("--dvf-points {points} --dvf-rays {rays} --dvf-cells 40 --dvf-count {count} --dvf-sequence {sequence}")
                    })
                })
                .collect(),
            Stage::Grid => [155, 77, 40, 21, 12].map(|cells| of(&format!("--dvf-cells {cells}"))).into_iter().chain([of("--dvf-cells auto")]).collect(),
            Stage::Rays => [8, 32, 64, 128, 256]
                .map(|rays| format!("--dvf-points {points} --dvf-rays {rays} --dvf-cells 40"))
                .to_vec(),
            Stage::Lanes => [1, 8, 32, 128].map(|lanes| of(&format!("--dvf-cells 40 --dvf-lanes {lanes}"))).to_vec(),
            Stage::Masks => [
                "--dvf-octahedral 8",
                "--dvf-octahedral 16",
                "--dvf-octahedral 32",
                "--dvf-octahedral 8 --dvf-dilate off",
                "--dvf-octahedral 16 --dvf-dilate off",
                "--dvf-octahedral 32 --dvf-dilate off",
                "--dvf-trust masks",
                "--dvf-sides both",
            ]
            .map(|options| of(&format!("--dvf-cells 40 {options}")))
            .to_vec(),
            Stage::Modes => ["same-sample", "paper"].map(|mode| of(&format!("--dvf-cells 40 --dvf-mode {mode}"))).to_vec(),
            // The paper's cells of the Cornell box, and masks so coarse that what labels do is to be seen.
            Stage::Flicker => ["", RENEWED, ANEW]
                .into_iter()
                .flat_map(|way| ["same-sample", "paper"].map(|mode| (way, mode)))
                .map(|(way, mode)| {
                    let points = (points / 25).max(100);
                    format!("{way}--dvf-points {points} --dvf-rays {rays} --dvf-cells 16 --dvf-octahedral 16 --dvf-mode {mode}")
                })
                .collect(),
            Stage::Memory => vec![of("--dvf-region view --dvf-cells 40")],
        }
    }
}
