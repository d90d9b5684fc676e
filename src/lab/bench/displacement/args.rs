//! Options of `bench displacement`.

use super::plan::Stage;
use crate::lab::bench::args as bench;
use crate::secondary::displacement::shape::{MOST_DIRECTIONS, MOST_RINGS};
use crate::settings::{Adapter, Rule, settings};
use std::path::PathBuf;

settings! {
    /// Options of `bench displacement`.
    pub struct DisplacementBenchArgs {
        /// Folder for the results: displacement.json, displacement.md, report.html, a CSV a table, and rows.jsonl,
        /// which grows with every job; models are made there. Started again with the same folder and settings, the
        /// bench goes on where it stopped.
        output: PathBuf = PathBuf::new(), "--output DIR", Rule::Any, "", Output, Common;
        /// Fewer samples of fields, smaller objects. It takes about 20 seconds on two cores without a GPU; without it
        /// the bench takes about 3 minutes, 1 GiB of memory and 300 MB of disk.
        quick: bool = false, "--quick", Rule::Any, "", Quality, Common;
        /// The model over the corner: a file that `convert` reads, or a converted scene. [default: a bumpy sphere]
        model: Option<PathBuf> = None, "--model FILE", Rule::Any, "", Output, Common;
        /// Triangles of the bumpy sphere.
        triangles: u64 = 69_000, "--triangles N", Rule::Whole(8, 10_000_000), "", Quality, Common;
        /// Triangles of the largest object of figure8; the others have a tenth each, down to 1000. [default: 10M; with
        /// --quick 100K]
        most_triangles: Option<u64> = None, "--most-triangles N", Rule::Whole(1000, 100_000_000), "", Quality, Common;
        /// What to measure in this run, with commas between them. figure4 (bits of a sample, with figure 7), figure5
        /// (how directions are mapped to a square), figure6 (errors by positions and directions), figure8 (time of a
        /// ray by the triangles of the object, beside tracing it). [default: all]
        stages: Vec<Stage> = Vec::new(), "--stages LIST", Rule::Any, "", Measurement, Common;
        /// Measure for so many minutes at most. What is under way then is left for the next start; the results hold the
        /// rest. [default: no limit]
        minutes: Option<f64> = None, "--minutes N", bench::MINUTES, "", Measurement, Common;
        /// Rings of positions of a hemisphere, with commas between them, ascending: 8, 16 and 32 are 290, 1090 and 4226
        /// positions in all. figure4 has all but the first, figure5 the second, figure8 the last. [default: 8,16,32;
        /// with --quick 8,16]
        rings: Vec<u32> = Vec::new(), "--rings LIST", Rule::Whole(1, MOST_RINGS as u64), "", Methods, Common;
        /// Directions of a position on each axis of their square, with commas between them, ascending. figure4 has
        /// the second, figure5 the first two, figure8 the first. [default: 32,64,128,256; with --quick 32,64]
        directions: Vec<u32> = Vec::new(), "--directions LIST", Rule::Whole(2, MOST_DIRECTIONS as u64), "", Methods,
            Common;
        /// Rays of a vertex of the corner, of which there are 3267.
        rays: u32 = 256, "--rays N", Rule::Whole(1, 4096), "", Methods, Common;
        /// Turns in which ways are timed; times are medians.
        repeat: u32 = 5, "--repeat N", bench::REPETITIONS, "", Measurement, Common;
        /// What traces, as `walk --adapter` has it. Fields are asked on the processor.
        adapter: Adapter = Adapter::Auto, "--adapter NAME", Rule::Any, "", Device, Common;
    }
}

/// What the options come to.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Rings of a hemisphere, ascending.
    pub rings: Vec<u32>,
    /// Directions on each axis, ascending.
    pub directions: Vec<u32>,
    /// Triangles of the objects of figure 8, ascending.
    pub objects: Vec<u64>,
}

impl DisplacementBenchArgs {
    /// Options with their defaults.
    pub fn settings(&self) -> Settings {
        let or = |given: &[u32], full: &[u32]| {
            let full = if self.quick { &full[..2] } else { full };
            let mut all = if given.is_empty() { full } else { given }.to_vec();
            all.sort_unstable();
            all.dedup();
            all
        };
        let most = self.most_triangles.unwrap_or(if self.quick { 100_000 } else { 10_000_000 });
        let mut objects: Vec<u64> =
            std::iter::successors(Some(most), |n| Some(n / 10)).take_while(|&n| n >= 1000).collect();
        objects.reverse();
        Settings {
            rings: or(&self.rings, &[8, 16, 32]),
            directions: or(&self.directions, &[32, 64, 128, 256]),
            objects,
        }
    }
}
