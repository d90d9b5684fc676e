//! Options of `selftest`.

use super::defects::Defect;
use crate::cli::options::args::{UNITS, ranged};
use crate::settings::Adapter;
use clap::Args;
use std::path::PathBuf;

/// Options of `selftest`.
#[derive(Clone, Debug, Args)]
#[command(after_help = UNITS)]
pub struct SelftestArgs {
    /// Only the cases of these numbers [default: all]
    #[arg(long, value_name = "N", num_args = 1.., value_delimiter = ',', value_parser = |s: &str| ranged(s, 1, 60))]
    pub case: Vec<u32>,
    /// Seed of the generated scenes and rays; the same seed makes the same ones
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Rays aimed at edges and vertices of closed meshes (case 20); other cases take a share of them, at most 1/50
    #[arg(long, value_name = "COUNT", default_value = "10M", value_parser = |s: &str| ranged(s, 1000, 1_000_000_000))]
    pub rays: u32,
    /// Instead of the cases: measure the error against scale and against the distance from the origin, of this
    /// program's arithmetic, of plain f32 in world space and of Möller-Trumbore, and write tables and plots into this
    /// folder, which is made if missing [default: none]
    #[arg(long, value_name = "DIR")]
    pub errors: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// What is tested: auto (a hardware GPU if there is one, else the processor), cpu (the processor), or the graphics
    /// adapter whose name contains NAME, upper and lower case alike; `brickwalk adapters` lists them
    #[arg(long, value_name = "NAME", env = "BRICKWALK_ADAPTER", default_value = "auto")]
    pub adapter: Adapter,
    /// A defect planted on purpose, which the cases must notice.
    #[arg(long, hide = true)]
    pub plant: Option<Defect>,
}
