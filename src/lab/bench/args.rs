//! Options of `bench`.

use super::chc::plan::Stage;
use crate::settings::sizes::{human_count, positive_count};
use crate::settings::{
    Adapter, CacheSize, Effect, EffectList, ImageSize, Lines, Plain, Rule, Schedule, Value, settings,
};
use std::path::PathBuf;

/// Numbers of triangles.
pub const TRIANGLES: Rule = Rule::Whole(1, u64::MAX);
/// Numbers of frames.
const FRAMES: Rule = Rule::Whole(1, 300);
/// Numbers of repetitions.
pub const REPETITIONS: Rule = Rule::Whole(1, 1000);
/// Minutes.
pub const MINUTES: Rule = Rule::Real(0.0, 100_000.0);

/// Those of `all` stages that are `given`, else all.
pub fn wanted<T: Copy + PartialEq>(all: &[T], given: &[T]) -> Vec<T> {
    all.iter().filter(|stage| given.is_empty() || given.contains(stage)).copied().collect()
}

settings! {
    /// Options of `bench executors`.
    pub struct ExecutorsArgs {
        /// Folder for the results: executors.md, executors.json.
        output: PathBuf = PathBuf::new(), "--output DIR", Rule::Any, "", Output, Common;
        /// A small scene, small pictures, few frames.
        quick: bool = false, "--quick", Rule::Any, "", Quality, Common;
        /// Triangles of the city. [default: 1M; with --quick 50K]
        triangles: Option<u64> = None, "--triangles N", TRIANGLES, "", Quality, Common;
        /// Folder of the generated scene; if it is missing it is generated there. [default: DIR/scenes]
        scenes: Option<PathBuf> = None, "--scenes DIR", Rule::Any, "", Output, Common;
        /// Width and height of the pictures. [default: 1280x720; with --quick 96x54]
        size: Option<ImageSize> = None, "--size WxH", Rule::Any, "pixels", Camera, Common;
        /// Frames of a walk. [default: 5; with --quick 2]
        frames: Option<u32> = None, "--frames N", FRAMES, "", Camera, Common;
        /// Walks of each device, beside one that brings in what frames need. [default: 5; with --quick 1]
        repeat: Option<u32> = None, "--repeat N", REPETITIONS, "", Measurement, Common;
        /// What is traced, as `walk --effects` has it.
        effects: EffectList = EffectList::of(&[Effect::Ao, Effect::Diffuse]), "--effects LIST", Rule::Any, "",
            Effects, Common;
        /// Occlusion and diffuse rays per pixel.
        rays: u32 = 1, "--rays N", REPETITIONS, "", Effects, Common;
        /// Device bytes for bricks, as `walk --cache` has it.
        cache: CacheSize = CacheSize::Percent(100.0), "--cache SIZE|P%", Rule::Any, "", Cache, Common;
        /// The schedule, as `walk --schedule` has it.
        schedule: Schedule = Schedule::Chc, "--schedule NAME", Rule::Any, "", Schedule, Common;
        /// A device to be measured, as `walk --adapter` has it. Given again: each of them, and the pictures of the
        /// others are compared with those of the first. [default: cpu, then every graphics adapter]
        adapters: Lines<Adapter> = Lines::default(), "--adapter NAME", Rule::Any, "", Device, Common;
    }
}

impl ExecutorsArgs {
    /// Options with their defaults.
    pub fn settings(&self) -> Settings {
        let or = |full, small| if self.quick { small } else { full };
        let (width, height) = if self.quick { (96, 54) } else { (1280, 720) };
        Settings {
            triangles: [self.triangles.unwrap_or(if self.quick { 50_000 } else { 1_000_000 }); 3],
            size: self.size.unwrap_or(ImageSize { width, height }),
            frames: self.frames.unwrap_or(or(5, 2)),
            tile: or(64, 16),
            skip: 0,
            repeat: self.repeat.unwrap_or(or(5, 1)),
            rays: self.rays,
        }
    }
}

settings! {
    /// Options of `bench chc`.
    pub struct ChcArgs {
        /// Folder for the results: chc.json, chc.md, report.html, a CSV a table, and cells.jsonl, which grows with
        /// every walk. Started again with the same folder and settings, the bench goes on where it stopped.
        output: PathBuf = PathBuf::new(), "--output DIR", Rule::Any, "", Output, Common;
        /// Small scenes, small pictures, few frames. It takes under 10 minutes on two cores without a GPU. The results
        /// say which rules of measuring are not met.
        quick: bool = false, "--quick", Rule::Any, "", Quality, Common;
        /// Triangles of the city, of the city out of core, and of the plant of pipes. Of the latter 16 copies are out
        /// of core. [default: 12M,139M,13M; with --quick 100K,200K,100K]
        triangles: Option<Counts> = None, "--triangles A,B,C", Rule::Any, "", Quality, Common;
        /// Folder of the generated scenes; what is missing is generated there. [default: DIR/scenes]
        scenes: Option<PathBuf> = None, "--scenes DIR", Rule::Any, "", Output, Common;
        /// A converted Sponza, measured beside the generated scenes. [default: none]
        sponza: Option<PathBuf> = None, "--sponza S.bricks", Rule::Any, "", Output, Common;
        /// What to measure in this run, with commas between them. table2 (in core against both baselines), table3 (out
        /// of core), table4 (aggressive culling), table5 (random turns), figure5 (tile sizes), targets (bytes moved
        /// against needed), scale (the large city all resident). [default: all]
        stages: Vec<Stage> = Vec::new(), "--stages LIST", Rule::Any, "", Measurement, Common;
        /// Measure only cases whose names contain every word of TEXT. Given again: those of any TEXT. Names are such as
        /// "table2/city/100%/tile 64/near/primary,ao,diffuse/chc+fronts/threshold 0/turn 36"; cells.jsonl holds them.
        /// [default: all]
        only: Lines<String> = Lines::default(), "--only TEXT", Rule::Any, "", Measurement, Common;
        /// Measure for so many minutes at most. What is under way then is left for the next start; the results hold the
        /// rest. [default: no limit]
        minutes: Option<f64> = None, "--minutes N", MINUTES, "", Measurement, Common;
        /// Insist that DIR holds measurements to go on with.
        resume: bool = false, "--resume", Rule::Any, "", Measurement, Common;
        /// Width and height of the pictures. [default: 1920x1080; with --quick 96x54]
        size: Option<ImageSize> = None, "--size WxH", Rule::Any, "pixels", Camera, Common;
        /// Frames of a walk. [default: 30; with --quick 4]
        frames: Option<u32> = None, "--frames N", FRAMES, "", Camera, Common;
        /// Walks of each case. [default: 5; with --quick 2]
        repeat: Option<u32> = None, "--repeat N", REPETITIONS, "", Measurement, Common;
        /// Width and height of a screen tile. [default: 64; with --quick 16]
        tile: Option<u32> = None, "--tile PIXELS", Rule::PowerOfTwo(8, 512), "pixels", Schedule, Common;
        /// What renders, as `walk --adapter` has it.
        adapter: Adapter = Adapter::Auto, "--adapter NAME", Rule::Any, "", Device, Common;
        /// Occlusion and diffuse rays per pixel. [default: 20; with --quick 2]
        rays: Option<u32> = None, "--rays N", REPETITIONS, "", Effects, Expert;
        /// Frames at the start of a walk left out of times. [default: 5; with --quick 1]
        skip: Option<u32> = None, "--skip N", Rule::Any, "", Measurement, Expert;
    }
}

/// Numbers of triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counts(pub [u64; 3]);

impl Value for Counts {
    fn read(text: &str, _: Rule, _: &str) -> Result<Self, String> {
        let counts: Vec<u64> = text.split(',').map(|count| positive_count(count.trim())).collect::<Result<_, _>>()?;
        let three = <[u64; 3]>::try_from(counts).map_err(|_| "it must be three counts, such as 12M,139M,13M")?;
        Ok(Self(three))
    }

    fn plain(&self) -> Plain {
        self.0.to_vec().plain()
    }
}

/// What the options come to.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Triangles.
    pub triangles: [u64; 3],
    /// Width and height in pixels.
    pub size: ImageSize,
    /// Frames of a walk.
    pub frames: u32,
    /// Edge of a tile in pixels.
    pub tile: u32,
    /// Of the frames, left out of times.
    pub skip: u32,
    /// Walks of each case.
    pub repeat: u32,
    /// Secondary rays a pixel.
    pub rays: u32,
}

impl ChcArgs {
    /// Options with their defaults.
    pub fn settings(&self) -> Settings {
        let or = |full, small| if self.quick { small } else { full };
        let (width, height) = if self.quick { (96, 54) } else { (1920, 1080) };
        let triangles = if self.quick { [100_000, 200_000, 100_000] } else { [12_000_000, 139_000_000, 13_000_000] };
        Settings {
            triangles: self.triangles.map_or(triangles, |own| own.0),
            size: self.size.unwrap_or(ImageSize { width, height }),
            frames: self.frames.unwrap_or(or(30, 4)),
            tile: self.tile.unwrap_or(or(64, 16)),
            skip: self.skip.unwrap_or(or(5, 1)),
            repeat: self.repeat.unwrap_or(or(5, 2)),
            rays: self.rays.unwrap_or(or(20, 2)),
        }
    }

    /// Whether a case of this name is wanted.
    pub fn wants(&self, name: &str) -> bool {
        self.only.0.is_empty() || self.only.0.iter().any(|text| text.split_whitespace().all(|word| name.contains(word)))
    }
}

impl Settings {
    /// Rules of measuring (and conditions of the paper) that these settings do not meet.
    pub fn unmet(&self) -> Vec<String> {
        let Self { triangles, size: ImageSize { width, height }, repeat, skip, rays, .. } = *self;
        let counts = triangles.map(human_count).join(", ");
        let is_large = [11_000_000, 130_000_000, 12_000_000].iter().zip(triangles).all(|(&least, own)| own >= least);
        let rules = [
            (repeat >= 5, format!("{repeat} walks of each case, not 5")),
            (skip >= 5, format!("the first {skip} frames left out, not 5")),
            ((width, height) == (1920, 1080), format!("{width}x{height} pixels, not the paper's 1920x1080")),
            (rays == 20, format!("{rays} secondary rays a pixel, not the paper's 20")),
            (is_large, format!("scenes of {counts} triangles, smaller than the paper's")),
        ];
        rules.into_iter().filter(|(is_met, _)| !is_met).map(|(_, text)| text).collect()
    }
}
