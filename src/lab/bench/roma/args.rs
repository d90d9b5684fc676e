//! Options of `bench roma`.

use super::plan::Stage;
use crate::lab::bench::args as bench;
use crate::settings::{Adapter, ImageSize, Rule, settings};
use std::path::PathBuf;

settings! {
    /// Options of `bench roma`.
    pub struct RomaBenchArgs {
        /// Folder for the results: roma.json, roma.md, report.html, a CSV a table, and rows.jsonl, which grows with
        /// every job. Started again with the same folder and settings, the bench goes on where it stopped.
        output: PathBuf = PathBuf::new(), "--output DIR", Rule::Any, "", Output, Common;
        /// Small scenes, small pictures, few samples. It takes about 5 minutes on two cores without a GPU.
        quick: bool = false, "--quick", Rule::Any, "", Quality, Common;
        /// Triangles of the city, and of the plant of pipes. [default: 12M; with --quick 100K]
        triangles: Option<u64> = None, "--triangles N", bench::TRIANGLES, "", Quality, Common;
        /// Folder of the generated scenes; what is missing is generated there. [default: DIR/scenes]
        scenes: Option<PathBuf> = None, "--scenes DIR", Rule::Any, "", Output, Common;
        /// A converted Sponza, measured beside the generated scenes. [default: none]
        sponza: Option<PathBuf> = None, "--sponza S.bricks", Rule::Any, "", Output, Common;
        /// What to measure in this run, with commas between them. speed (times over resolutions and numbers of
        /// directions), ao (errors by scenes), resolution (errors by resolutions and numbers of directions), radius
        /// (errors by the length of rays), shadows (snapped and unsnapped rays to an area light), diffuse (light of the
        /// sun by one bounce, its errors without the sun's own), out-of-core (a cache of 15 %), handover (maps and
        /// bricks together, out of core), seams (errors by the distance from where larger cells take over), leaks
        /// (columns that pass through single sheets). [default: all]
        stages: Vec<Stage> = Vec::new(), "--stages LIST", Rule::Any, "", Measurement, Common;
        /// Measure for so many minutes at most. What is under way then is left for the next start; the results hold the
        /// rest. [default: no limit]
        minutes: Option<f64> = None, "--minutes N", bench::MINUTES, "", Measurement, Common;
        /// Width and height of the pictures. [default: 1920x1080; with --quick 160x90]
        size: Option<ImageSize> = None, "--size WxH", Rule::Any, "pixels", Camera, Common;
        /// Turns of every way, beside one that brings in what frames need. [default: 5; with --quick 2]
        repeat: Option<u32> = None, "--repeat N", bench::REPETITIONS, "", Measurement, Common;
        /// Samples per pixel of pictures that are converged, 2 to 65536. [default: 1024; with --quick 8]
        samples: Option<u32> = None, "--samples N", Rule::Whole(2, 65_536), "", Quality, Common;
        /// Length of ambient-occlusion rays, in world units.
        ao_length: f64 = 16.0, "--ao-length LENGTH", Rule::Real(1e-6, 1e9), "", Effects, Common;
        /// What renders, as `walk --adapter` has it.
        adapter: Adapter = Adapter::Auto, "--adapter NAME", Rule::Any, "", Device, Common;
    }
}

/// What the options come to.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Triangles of each generated scene.
    pub triangles: u64,
    /// Width and height in pixels.
    pub size: ImageSize,
    /// Turns.
    pub repeat: u32,
    /// Samples of converged pictures.
    pub samples: u32,
    /// Length of occlusion rays, world units.
    pub ao_length: f64,
    /// Edge of a tile, pixels.
    pub tile: u32,
}

impl RomaBenchArgs {
    /// Options with their defaults.
    pub fn settings(&self) -> Settings {
        let or = |full, small| if self.quick { small } else { full };
        let (width, height) = if self.quick { (160, 90) } else { (1920, 1080) };
        Settings {
            triangles: self.triangles.unwrap_or(if self.quick { 100_000 } else { 12_000_000 }),
            size: self.size.unwrap_or(ImageSize { width, height }),
            repeat: self.repeat.unwrap_or(or(5, 2)),
            samples: self.samples.unwrap_or(or(1024, 8)),
            ao_length: self.ao_length,
            tile: or(64, 16),
        }
    }
}
