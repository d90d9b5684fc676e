//! Options of what is split over many machines: ranges of parts, and `jobs`.

use super::units::UNITS;
use clap::Args;
use std::fmt;
use std::str::FromStr;

/// Parts of a walk, from 0, both ends among them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PartRange {
    /// The first.
    pub first: u32,
    /// The last.
    pub last: u32,
}

impl FromStr for PartRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |text: &str| text.trim().parse::<u32>().map_err(|_| format!("{text:?} is no number of a part"));
        let (first, last) = text.split_once('-').unwrap_or((text, text));
        let range = Self { first: number(first)?, last: number(last)? };
        if range.first <= range.last { Ok(range) } else { Err("the first comes after the last".into()) }
    }
}

impl fmt::Display for PartRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.first == self.last {
            true => write!(f, "{}", self.first),
            false => write!(f, "{}-{}", self.first, self.last),
        }
    }
}

/// Options of `jobs`.
#[derive(Clone, Debug, Args)]
#[command(after_help = UNITS)]
pub struct JobsArgs {
    /// What is printed: lines, a command each; openjd, a job template; json, what a program needs that splits the walk
    ///
    /// `lines`: the last one joins what the others render. Slurm arrays, GNU parallel, HyperQueue and OpenCue take such
    /// lines. `openjd`: JSON of the Open Job Description specification, 2023-09. `json`: the scene, which is converted
    /// if it is a model, the folder, the number of frames, and the settings as a TOML file.
    #[arg(long, value_enum)]
    pub format: JobFormat,
    /// Frames that a task renders; with --bands, bands of frames [1 to 1000000]
    ///
    /// The scene is opened anew for each. More of them open it less often; fewer lose less when a machine fails.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub chunk: u32,
    /// The command: walk with its scene, folder and options, as -- walk city.bricks -o out --frames 600
    #[arg(last = true, required = true, value_name = "walk ...", allow_hyphen_values = true)]
    pub command: Vec<String>,
}

/// What `jobs` prints.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum JobFormat {
    /// A command a line.
    Lines,
    /// An Open Job Description template.
    Openjd,
    /// What a program needs that splits the walk.
    Json,
}
