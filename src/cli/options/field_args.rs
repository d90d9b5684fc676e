//! Options of `--secondary df`.

use super::args::ranged;
use super::roma_args::of;
use crate::secondary::df::{DfSettings, Tracing};
use clap::Args;

/// Look-ups of shadow rays (Zeng et al., §7).
const SHADOW_STEPS: u32 = 16;

/// Options of distance fields.
#[derive(Clone, Debug, Args)]
pub struct FieldArgs {
    /// With --secondary df: cells of a distance field on each axis: 32, 64, 128 or 256; one of 128 takes 4 MiB, as
    /// --roma-size 128
    /// --roma-k 4 does, and 4.6 MiB with its coarser levels, for each of up to six sizes of cells
    #[arg(long, value_name = "CELLS", default_value = "128", value_parser = |s: &str| of(s, &[32, 64, 128, 256]))]
    pub df_size: u32,
    /// With --secondary df: look-ups, 1 to 1024, that a ray makes at most; one that has made them goes free, and
    /// rays_capped counts it [default: 64 for ao, 16 for shadow]
    #[arg(long, value_name = "N", value_parser = |s: &str| ranged(s, 1, 1024))]
    pub df_steps: Option<u32>,
    /// With --secondary df: cells, 0 to 8, by which rays start off their surface; less than 0.87 more than --df-hit,
    /// and some surfaces shade themselves
    #[arg(long, value_name = "CELLS", default_value = "1.5", value_parser = |s: &str| cells(s, 0.0))]
    pub df_lift: f64,
    /// With --secondary df: cells, 0.01 to 8, between a ray and the middle of an occupied cell within which it hits;
    /// 0.5 is the face of a cell in a layer of them, more is darker
    #[arg(long, value_name = "CELLS", default_value = "0.5", value_parser = |s: &str| cells(s, 0.01))]
    pub df_hit: f64,
}

impl FieldArgs {
    /// How rays are answered.
    pub fn settings(&self) -> DfSettings {
        DfSettings {
            size: self.df_size,
            occlusion_steps: self.df_steps.unwrap_or(Tracing::default().iterations),
            shadow_steps: self.df_steps.unwrap_or(SHADOW_STEPS),
            lift: self.df_lift,
            hit: self.df_hit as f32,
        }
    }
}

/// Parses a length from `least` to 8 cells.
fn cells(text: &str, least: f64) -> Result<f64, String> {
    let found = text.parse().ok().filter(|cells| (least..=8.0).contains(cells));
    found.ok_or_else(|| format!("it must be a number of cells from {least} to 8"))
}
