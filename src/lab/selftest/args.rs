//! Options of `selftest`.

use super::defects::Defect;
use crate::settings::{Adapter, Rule, settings};
use std::path::PathBuf;

settings! {
    /// Options of `selftest`.
    pub struct SelftestArgs {
        /// Only the cases of these numbers, 1 to 60. [default: all]
        case: Vec<u32> = Vec::new(), "--case N...", Rule::Whole(1, 60), "", Measurement, Common;
        /// Seed of the generated scenes and rays; the same seed makes the same ones.
        seed: u64 = 1, "--seed N", Rule::Any, "", Measurement, Common;
        /// Rays aimed at edges and vertices of closed meshes (case 20). Other cases take a share of them, at most 1/50.
        rays: u32 = 10_000_000, "--rays COUNT", Rule::Whole(1000, 1_000_000_000), "", Measurement, Common;
        /// Instead of the cases: measure the error against scale and against the distance from the origin. It measures
        /// this program's arithmetic, plain f32 in world space and Möller-Trumbore, and writes tables and plots into
        /// this folder, which is made if missing. [default: none]
        errors: Option<PathBuf> = None, "--errors DIR", Rule::Any, "", Measurement, Common;
        /// Print JSON.
        json: bool = false, "--json", Rule::Any, "", Output, Common;
        /// What is tested, as `walk --adapter` has it.
        adapter: Adapter = Adapter::Auto, "--adapter NAME", Rule::Any, "", Device, Common;
        /// A defect planted on purpose, which the cases must notice. [default: none]
        plant: Option<Defect> = None, "--plant NAME", Rule::Any, "", Measurement, Expert;
    }
}
