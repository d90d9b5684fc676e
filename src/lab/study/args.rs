//! Options of `study`.

use crate::lab::bench::args::{MINUTES, REPETITIONS};
use crate::settings::{Adapter, ImageSize, Rule, names, settings};
use std::path::PathBuf;

names! {
    /// An effect whose rays are studied alone.
    Effect {
        /// Ambient occlusion under an even sky.
        Ao = "ao",
        /// The sun, or the lamps of the scene.
        Shadow = "shadow",
        /// One bounce of diffuse light.
        Diffuse = "diffuse",
        /// The light of the sky.
        Environment = "environment",
    }
}

settings! {
    /// Options of `study`.
    pub struct StudyArgs {
        /// Folder for the results: rows.jsonl, which grows with every measurement, study.json, study.csv, report.html.
        /// Started again with the same folder and settings, a study goes on where it stopped.
        output: PathBuf = PathBuf::new(), "--output DIR", Rule::Any, "", Output, Common;
        /// The scene.
        scene: PathBuf = PathBuf::new(), "--scene S.bricks", Rule::Any, "", Output, Common;
        /// Measure for so many minutes at most, what says most first. [default: no limit]
        budget: Option<f64> = None, "--budget MINUTES", MINUTES, "", Measurement, Common;
        /// Few settings, small pictures, two sizes of the cache.
        quick: bool = false, "--quick", Rule::Any, "", Quality, Common;
        /// Switch one source of error at a time, with the same rays, and say which counts most, in place of the study.
        attribute: bool = false, "--attribute", Rule::Any, "", Measurement, Common;
        /// What is studied, with commas between them: ao, shadow, diffuse, environment. [default: all]
        effects: Vec<Effect> = Vec::new(), "--effects LIST", Rule::Any, "", Effects, Common;
        /// Sizes of the cache, percent of all bricks, with commas between them. [default: 100,47,32,20,5; with --quick
        /// 100,20; with --attribute 100]
        caches: Vec<u32> = Vec::new(), "--caches LIST", Rule::Whole(1, 100), "", Cache, Common;
        /// The camera path. [default: one made from the scene's bounds]
        path: Option<PathBuf> = None, "--path FILE.json", Rule::Any, "", Camera, Common;
        /// Views along the path. [default: 2; with --quick 1]
        views: Option<u32> = None, "--views N", Rule::Whole(1, 100), "", Camera, Common;
        /// Width and height of the pictures. [default: 640x360; with --quick 160x90]
        size: Option<ImageSize> = None, "--size WxH", Rule::Any, "pixels", Camera, Common;
        /// Samples of the pictures that others are compared with. [default: 64; with --quick 16]
        samples: Option<u32> = None, "--samples N", Rule::Whole(1, 65_536), "", Quality, Common;
        /// Turns in which every setting makes a picture; times are medians. [default: 3; with --quick 2]
        repeat: Option<u32> = None, "--repeat N", REPETITIONS, "", Measurement, Common;
        /// What renders, as `walk --adapter` has it.
        adapter: Adapter = Adapter::Auto, "--adapter NAME", Rule::Any, "", Device, Common;
    }
}

/// What the options come to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Scale {
    /// What is studied.
    pub effects: Vec<Effect>,
    /// Percent of all bricks.
    pub caches: Vec<u32>,
    /// Views along the path.
    pub views: u32,
    /// Width and height in pixels.
    pub size: ImageSize,
    /// Samples of converged pictures.
    pub samples: u32,
    /// Turns.
    pub repeat: u32,
}

impl StudyArgs {
    /// Options with their defaults.
    pub fn scale(&self) -> Scale {
        let or = |full, small| if self.quick { small } else { full };
        let (width, height) = if self.quick { (160, 90) } else { (640, 360) };
        let caches = match (self.attribute, self.quick) {
            (true, _) => vec![100],
            (false, true) => vec![100, 20],
            (false, false) => vec![100, 47, 32, 20, 5],
        };
        Scale {
            effects: if self.effects.is_empty() { Effect::ALL.to_vec() } else { self.effects.clone() },
            caches: if self.caches.is_empty() { caches } else { self.caches.clone() },
            views: self.views.unwrap_or(or(2, 1)),
            size: self.size.unwrap_or(ImageSize { width, height }),
            samples: self.samples.unwrap_or(or(64, 16)),
            repeat: self.repeat.unwrap_or(or(3, 2)),
        }
    }
}
