//! Options of `bench dvf`.

use crate::cli::options::args::{UNITS, ranged};
use crate::lab::bench::args as bench;
use crate::secondary::dvf::{Cells, Count, Mode, Options, RegionKind, Sequence, Sides, Trust};
use crate::settings::Adapter;
use crate::settings::names::names;
use crate::settings::{CacheSize, Field, Group, ImageSize};
use clap::Args;
use std::path::PathBuf;

names! {
    /// What becomes of a field while something moves.
    Way {
        /// It is that of the scene as it is at first, and knows of what has moved.
        Told = "",
        /// Of it, cells are made anew, within a budget of rays a frame.
        Renewed = "renewed ",
        /// All of it is made anew in every frame, as in the paper.
        Anew = "anew ",
    }
}

/// A field that is measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Measurement {
    /// What becomes of it.
    pub way: Way,
    /// How it is made.
    pub options: Options,
    /// The settings that it is told from others by.
    keys: Vec<&'static str>,
}

/// As the options of `walk` would have it.
impl std::fmt::Display for Measurement {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let of = |key: &&str| {
            let flag = Options::FIELDS.iter().find(|field| field.key == *key).map(Field::flag)?;
            Some(format!("--{flag} {}", self.options.get(key)?))
        };
        write!(f, "{}{}", self.way, self.keys.iter().filter_map(of).collect::<Vec<_>>().join(" "))
    }
}

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

names! {
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
    }
}

impl Stage {
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
    /// The measurements of a stage.
    pub fn measurements(&self, stage: Stage) -> Vec<Measurement> {
        let base = Options { points: self.points, rays: self.rays, ..Options::default() };
        let with = |keys: &[&'static str], options: Options| Measurement {
            way: Way::Told,
            options,
            keys: [&["points", "rays"], keys].concat(),
        };
        let cells = |cells| Options { cells: Cells::Longest(cells), ..base.clone() };
        match stage {
            Stage::Points => [25, 5, 1]
                .into_iter()
                .flat_map(|part| {
                    let sets = [
                        (Count::Rounding, Sequence::Hash),
                        (Count::Ceiling, Sequence::Hash),
                        (Count::Ceiling, Sequence::Hammersley),
                    ];
                    let points = (self.points / part).max(100);
                    sets.map(|(count, sequence)| {
                        with(&["cells", "count", "sequence"], Options { points, count, sequence, ..cells(40) })
                    })
                })
                .collect(),
            Stage::Grid => [155, 77, 40, 21, 12]
                .map(cells)
                .into_iter()
                .chain([base.clone()])
                .map(|options| with(&["cells"], options))
                .collect(),
            Stage::Rays => [8, 32, 64, 128, 256].map(|rays| with(&["cells"], Options { rays, ..cells(40) })).to_vec(),
            Stage::Lanes => {
                [1, 8, 32, 128].map(|lanes| with(&["cells", "lanes"], Options { lanes, ..cells(40) })).to_vec()
            }
            Stage::Masks => {
                let sizes = [8, 16, 32];
                let of = |octahedral| Options { octahedral, ..cells(40) };
                let dilated = sizes.map(|size| with(&["cells", "octahedral"], of(size)));
                let others =
                    sizes.map(|size| with(&["cells", "octahedral", "dilate"], Options { dilate: false, ..of(size) }));
                let masks = with(&["cells", "trust"], Options { trust: Trust::Masks, ..cells(40) });
                let both = with(&["cells", "sides"], Options { sides: Sides::Both, ..cells(40) });
                dilated.into_iter().chain(others).chain([masks, both]).collect()
            }
            Stage::Modes => [Mode::SameSample, Mode::Paper]
                .map(|mode| with(&["cells", "mode"], Options { mode, ..cells(40) }))
                .to_vec(),
            // The paper's cells of the Cornell box, and masks so coarse that what labels do is to be seen.
            Stage::Flicker => Way::ALL
                .iter()
                .flat_map(|&way| [Mode::SameSample, Mode::Paper].map(|mode| (way, mode)))
                .map(|(way, mode)| {
                    let points = (self.points / 25).max(100);
                    let options = Options { points, octahedral: 16, mode, ..cells(16) };
                    Measurement { way, ..with(&["cells", "octahedral", "mode"], options) }
                })
                .collect(),
            Stage::Memory => {
                vec![with(&["region", "cells"], Options { region: RegionKind::View, ..cells(40) })]
            }
        }
    }

    /// Their names.
    pub fn names(&self, stage: Stage) -> Vec<String> {
        self.measurements(stage).iter().map(Measurement::to_string).collect()
    }
}
