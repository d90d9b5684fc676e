//! Options of `query`.

use super::scene_name::scene_name;
use super::units::UNITS;
use crate::settings::CacheSize;
use crate::settings::sizes::positive_count32;
use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// What is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Kind {
    /// The closest hit of each ray: t (f8), triangle (u4), u, v (f4), normal (three f4), as `trace --normals`
    Cast,
    /// Whether each ray meets anything (bool)
    Any,
    /// How many triangles each ray meets (u4)
    Count,
    /// All that rays meet, one element each, by ray and t: ray (u8), t, triangle, u, v, normal
    All,
    /// The nearest point of the scene: point (three f8), distance (f8), triangle (u4), u, v (f4), normal (three f4)
    Closest,
    /// The distance of each point from the scene (f8)
    Distance,
    /// The same, negative inside closed surfaces (f8)
    SignedDistance,
    /// Whether each point lies inside closed surfaces (bool)
    Occupancy,
    /// Whether the way between two points is free (bool)
    Visibility,
}

/// What is read.
const INPUT: &str = "The input is a NumPy array, float64 or float32, of shape (..., 6) or (..., 8) for cast, any, \
     count and all: origin xyz, direction xyz, t_min, t_max; (..., 3) for points; (..., 6) for visibility: two points. The \
     output has an element a row, in the input's shape, but that of all has one a hit. Queries are exact, of geometry \
     alone; cast and any are what rendering sees, where materials let rays pass.";

/// Options of `query`.
#[derive(Clone, Debug, Args)]
#[command(after_help = format!("{INPUT}\n\n{UNITS}"))]
pub struct QueryArgs {
    /// What is asked
    #[arg(value_name = "KIND")]
    pub kind: Kind,
    /// The scene: a .bricks file, the URL of one, or a model, which is converted first, as by `trace`
    #[arg(value_name = "S.bricks|MODEL", value_parser = scene_name())]
    pub scene: PathBuf,
    /// Rays or points: a NumPy array, world space
    #[arg(value_name = "IN.npy")]
    pub input: PathBuf,
    /// Answers: a NumPy array
    #[arg(short, long, value_name = "OUT.npy")]
    pub output: PathBuf,
    /// Memory for bricks: a size, a share P% of them, or auto: all, up to a quarter of what is free
    #[arg(long, value_name = "SIZE|P%", default_value = "auto")]
    pub cache: CacheSize,
    /// Take surfaces that are not closed for closed: occupancy and signed-distance may then be wrong near their gaps
    #[arg(long)]
    pub allow_open: bool,
    /// Threads [default: as many as the processor has]
    #[arg(long, value_name = "N", value_parser = positive_count32)]
    pub threads: Option<u32>,
    /// Print statistics as a JSON object
    #[arg(long)]
    pub json: bool,
}
