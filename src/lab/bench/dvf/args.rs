//! Options of `bench dvf`.

use crate::lab::bench::args as bench;
use crate::secondary::dvf::{Cells, Count, Mode, Options, RegionKind, Sequence, Sides, Trust};
use crate::settings::{Adapter, CacheSize, Field, Group, ImageSize, Lines, Rule, names, settings};
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

settings! {
    /// Options of `bench dvf`.
    pub struct DvfBenchArgs {
        /// Converted scenes; a Cornell box in which a box orbits (`scene cornell`) is measured beside them. Where
        /// S.motion.json lies beside a scene its flicker is measured.
        scenes: Lines<PathBuf> = Lines::default(), "--scenes S.bricks", Rule::Any, "", Output, Common;
        /// Folder for the results: dvf.json, dvf.md, report.html, a CSV a table, and rows.jsonl, which grows with every
        /// measurement. Started again with the same folder and settings, the bench goes on where it stopped.
        output: PathBuf = PathBuf::new(), "--output DIR", Rule::Any, "", Output, Common;
        /// Camera paths (JSON) of the scenes, in their order, with commas between them. [default: S.near.json beside
        /// each, or one made from its bounds]
        paths: Vec<PathBuf> = Vec::new(), "--paths P.json", Rule::Any, "", Camera, Common;
        /// The environment. [default: the sky over the ground]
        environment: Option<PathBuf> = None, "--environment FILE", Rule::Any, "", Light, Common;
        /// What to measure in this run, with commas between them. points (figure 13 and table 2: points, rounding, hash
        /// and Hammersley), grid (figure 14), rays (figure 15), lanes (figure 16), masks (their resolution, dilation,
        /// which answers count), modes (same-sample and the paper's), flicker (of scenes in which something moves: what
        /// pictures change from frame to frame that exact rays do not), memory (a cache of --cache, the field of what
        /// is seen). [default: all]
        stages: Vec<Stage> = Vec::new(), "--stages LIST", Rule::Any, "", Measurement, Common;
        /// Measure for so many minutes at most. What is under way then is left for the next start; the results hold the
        /// rest. [default: no limit]
        minutes: Option<f64> = None, "--minutes N", bench::MINUTES, "", Measurement, Common;
        /// Width and height of the pictures.
        size: ImageSize = ImageSize { width: 320, height: 180 }, "--size WxH", Rule::Any, "pixels", Camera, Common;
        /// Rays to the environment per pixel.
        samples: u32 = 128, "--samples N", Rule::Whole(1, 65_536), "", Quality, Common;
        /// The most points that are strewn: a fifth and a 25th of it beside it.
        points: u32 = 400_000, "--points N", Rule::Whole(1000, 16_000_000), "", Methods, Common;
        /// Rays of a point.
        rays: u32 = 128, "--rays N", Rule::Whole(1, 1024), "", Methods, Common;
        /// Turns of a measurement in which a picture without a field and one with it are timed; times are medians.
        repeat: u32 = 3, "--repeat N", Rule::Whole(1, 100), "", Measurement, Common;
        /// The cache of memory, as `walk --cache` has it.
        cache: CacheSize = CacheSize::Percent(15.0), "--cache SIZE|P%", Rule::Any, "", Cache, Common;
        /// What renders, as `walk --adapter` has it.
        adapter: Adapter = Adapter::Auto, "--adapter NAME", Rule::Any, "", Device, Common;
    }
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
        let usual = || cells(40);
        let part = |part: u32| (self.points / part).max(100);
        let modes = [Mode::SameSample, Mode::Paper];
        match stage {
            Stage::Points => {
                let sets = [
                    (Count::Rounding, Sequence::Hash),
                    (Count::Ceiling, Sequence::Hash),
                    (Count::Ceiling, Sequence::Hammersley),
                ];
                let of = |points| sets.map(|(count, sequence)| Options { points, count, sequence, ..usual() });
                let all = [25, 5, 1].into_iter().flat_map(|n| of(part(n)));
                all.map(|options| with(&["cells", "count", "sequence"], options)).collect()
            }
            Stage::Grid => {
                let all = [155, 77, 40, 21, 12].map(cells).into_iter().chain([base.clone()]);
                all.map(|options| with(&["cells"], options)).collect()
            }
            Stage::Rays => [8, 32, 64, 128, 256].map(|rays| with(&["cells"], Options { rays, ..usual() })).to_vec(),
            Stage::Lanes => {
                [1, 8, 32, 128].map(|lanes| with(&["cells", "lanes"], Options { lanes, ..usual() })).to_vec()
            }
            Stage::Masks => {
                let of = |octahedral| Options { octahedral, ..usual() };
                let narrow = |size| with(&["cells", "octahedral", "dilate"], Options { dilate: false, ..of(size) });
                let mut all = [8, 16, 32].map(|size| with(&["cells", "octahedral"], of(size))).to_vec();
                all.extend([8, 16, 32].map(narrow));
                all.push(with(&["cells", "trust"], Options { trust: Trust::Masks, ..usual() }));
                all.push(with(&["cells", "sides"], Options { sides: Sides::Both, ..usual() }));
                all
            }
            Stage::Modes => modes.map(|mode| with(&["cells", "mode"], Options { mode, ..usual() })).to_vec(),
            // The paper's cells of the Cornell box, and masks so coarse that what labels do is to be seen.
            Stage::Flicker => {
                let options = |mode| Options { points: part(25), octahedral: 16, mode, ..cells(16) };
                let of = |way| {
                    modes.map(|mode| Measurement { way, ..with(&["cells", "octahedral", "mode"], options(mode)) })
                };
                Way::ALL.iter().flat_map(|&way| of(way)).collect()
            }
            Stage::Memory => vec![with(&["region", "cells"], Options { region: RegionKind::View, ..usual() })],
        }
    }

    /// Their names.
    pub fn names(&self, stage: Stage) -> Vec<String> {
        self.measurements(stage).iter().map(Measurement::to_string).collect()
    }
}
