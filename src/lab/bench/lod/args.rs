//! Options of `bench lod`.

use super::plan::Stage;
use super::scale::Settings;
use crate::lab::bench::args as bench;
use crate::settings::{Adapter, ImageSize, Lines, Rule, Schedule, settings};
use std::path::PathBuf;

settings! {
    /// Options of `bench lod`.
    pub struct LodBenchArgs {
        /// Folder for the results: lod.json, lod.md, report.html, a CSV a table, and rows.jsonl, which grows with every
        /// job. Started again with the same folder and settings, the bench goes on where it stopped.
        output: PathBuf = PathBuf::new(), "--output DIR", Rule::Any, "", Output, Common;
        /// Small scenes, small pictures, few samples. It takes some minutes on two cores without a GPU.
        quick: bool = false, "--quick", Rule::Any, "", Quality, Common;
        /// Triangles of the city, the plant and the terrain; behind a comma those of the large city, which is measured
        /// as well if they are given. Scenes that cannot have so few have the least that they can. [default: 12M; with
        /// --quick 300K]
        triangles: Vec<u64> = Vec::new(), "--triangles N,LARGE", bench::TRIANGLES, "", Quality, Common;
        /// Measure a city of 139M triangles as well; with --quick one of four times the other's.
        large: bool = false, "--large", Rule::Any, "", Quality, Common;
        /// Folder of the converted scenes; what is missing is generated or converted there. [default: DIR/scenes]
        scenes: Option<PathBuf> = None, "--scenes DIR", Rule::Any, "", Output, Common;
        /// Folder of models that are measured beside the generated scenes: `sponza`, `scans` and `teapots_instanced`
        /// below it; what is missing is left out. [default: that of the variable BRICKWALK_SCENES]
        inputs: Option<PathBuf> = None, "--inputs DIR", Rule::Any, "", Output, Common;
        /// What to measure in this run, with commas between them. quality (errors of pictures by the sun against exact
        /// ones), walks (times and bytes with caches of 100 %, 32 % and 15 %), diffuse (both with one bounce of diffuse
        /// light), popping (what levels change from frame to frame), working-set (bytes resident by the size of
        /// scenes). [default: all]
        stages: Vec<Stage> = Vec::new(), "--stages LIST", Rule::Any, "", Measurement, Common;
        /// Measure only jobs whose names contain every word of TEXT. Given again: those of any TEXT. Names are such as
        /// "quality/city/100%"; rows.jsonl holds them, followed by what was measured. [default: all]
        only: Lines<String> = Lines::default(), "--only TEXT", Rule::Any, "", Measurement, Common;
        /// Measure for so many minutes at most. What is under way then is left for the next start; the results hold the
        /// rest. [default: no limit]
        minutes: Option<f64> = None, "--minutes N", bench::MINUTES, "", Measurement, Common;
        /// Width and height of the pictures. [default: 640x360; with --quick 96x54]
        size: Option<ImageSize> = None, "--size WxH", Rule::Any, "pixels", Camera, Common;
        /// Frames of a walk. [default: 8; with --quick 3]
        frames: Option<u32> = None, "--frames N", Rule::Whole(2, 300), "", Camera, Common;
        /// Walks of each way that are timed. [default: 3; with --quick 1]
        repeat: Option<u32> = None, "--repeat N", bench::REPETITIONS, "", Measurement, Common;
        /// Samples per pixel of the pictures that others are compared with, which have up to 16. [default: 256; with
        /// --quick 64]
        samples: Option<u32> = None, "--samples N", Rule::Whole(17, 65_536), "", Quality, Common;
        /// The schedule, as `walk --schedule` has it. `chc` loads what rays need and no more.
        schedule: Schedule = Schedule::Chc, "--schedule NAME", Rule::Any, "", Schedule, Common;
        /// What renders, as `walk --adapter` has it.
        adapter: Adapter = Adapter::Auto, "--adapter NAME", Rule::Any, "", Device, Common;
    }
}

impl LodBenchArgs {
    /// Options with their defaults.
    pub fn settings(&self) -> Settings {
        let or = |full, small| if self.quick { small } else { full };
        let (width, height) = if self.quick { (96, 54) } else { (640, 360) };
        let triangles = self.triangles.first().copied().unwrap_or(if self.quick { 300_000 } else { 12_000_000 });
        let usual = if self.quick { 4 * triangles } else { 139_000_000 };
        Settings {
            triangles,
            large: self.triangles.get(1).copied().or(self.large.then_some(usual)),
            copies: if self.quick { [1, 4, 16] } else { [1, 16, 256] },
            size: self.size.unwrap_or(ImageSize { width, height }),
            frames: self.frames.unwrap_or(or(8, 3)),
            repeat: self.repeat.unwrap_or(or(3, 1)),
            samples: self.samples.unwrap_or(or(256, 64)),
            popping_samples: or(16, 4),
            tile: or(64, 16),
            schedule: self.schedule,
        }
    }

    /// Whether a job of this name is wanted.
    pub fn wants(&self, name: &str) -> bool {
        self.only.0.is_empty() || self.only.0.iter().any(|text| text.split_whitespace().all(|word| name.contains(word)))
    }
}
