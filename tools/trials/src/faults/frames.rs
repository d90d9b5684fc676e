//! Frames and queries of scenes whose bytes are not always read as they are.

use super::source::Faulty;
use super::{NAME, told};
use crate::kind::{Fault, Kind, Limits, Outcome, Trial};
use crate::random::Random;
use crate::scenes;
use anyhow::Result;
use bricks::SceneFile;
use brickwalk::frame::Renderer;
use brickwalk::output::npy::{Hit, Ray};
use brickwalk::query::Queries;
use brickwalk::settings::CacheSize;
use std::borrow::Cow;
use std::path::Path;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Bytes that a trial may take, those of a device on the processor among them.
pub(super) const MOST_BYTES: u64 = 512 << 20;

/// Frames of a trial.
pub(super) const FRAMES: u32 = 2;

/// Scenes that trials share.
const SCENES: usize = 6;

/// A scene, and what is right of it.
pub(super) struct Sound {
    /// Its file.
    pub bytes: Arc<Cow<'static, [u8]>>,
    /// What its frames are rendered with, but for the schedule.
    pub view: String,
    frames: Vec<Vec<u32>>,
    rays: Vec<Ray>,
    hits: Vec<Hit>,
}

/// One of the scenes, which are made when they are first asked for.
pub(super) fn sound(random: &mut Random, folder: &Path) -> Result<Arc<Sound>, Fault> {
    let number = random.below(SCENES);
    static ALL: OnceLock<Mutex<Vec<Option<Arc<Sound>>>>> = OnceLock::new();
    let all = ALL.get_or_init(|| Mutex::new(vec![None; SCENES]));
    let mut all = all.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(sound) = &all[number] {
        return Ok(sound.clone());
    }
    let made = Arc::new(make(number, folder)?);
    all[number] = Some(made.clone());
    Ok(made)
}

fn make(number: usize, folder: &Path) -> Result<Sound, Fault> {
    let mut random = Random::new("faults", number as u64);
    let source = scenes::source(&mut random);
    let mut settings = scenes::settings(&mut random, &source);
    settings.brick_triangles = settings.brick_triangles.min(256);
    let path = folder.join(NAME);
    scenes::convert(source.scene, &settings, &path)?;
    let wrong = |error: anyhow::Error| Fault::new("a sound scene is refused", format!("{error:#}"));
    let bytes: Arc<Cow<'static, [u8]>> = Arc::new(std::fs::read(&path).map_err(|error| wrong(error.into()))?.into());
    let view = scenes::view(&mut random);
    let file = Arc::new(SceneFile::from_bytes(NAME, bytes.to_vec()).map_err(|error| wrong(error.into()))?);
    let mut renderer =
        scenes::open(file.clone(), &path, &format!("{view} --schedule plain --cache 100%")).map_err(wrong)?;
    let frames = scenes::frames(&mut renderer, FRAMES).map_err(wrong)?.iter().map(scenes::bits).collect();
    let rays = rays(&mut random, &file);
    let hits = cast(file, &rays, 100.0).map_err(wrong)?;
    Ok(Sound { bytes, view, frames, rays, hits })
}

/// Rays between points of a scene's box.
fn rays(random: &mut Random, file: &SceneFile) -> Vec<Ray> {
    let manifest = &file.resident().manifest;
    let mut point = || [0, 1, 2].map(|k| manifest.min[k] + (manifest.max[k] - manifest.min[k]) * random.share());
    let mut ray = || {
        let (origin, to) = (point(), point());
        let direction = [0, 1, 2].map(|k| to[k] - origin[k]);
        Ray { origin, direction, t_min: 0.0, t_max: f64::INFINITY }
    };
    let all = (0..200).map(|_| ray());
    all.filter(|ray| ray.direction != [0.0; 3]).collect()
}

/// The closest hits, with a cache for a share of the scene.
fn cast(file: Arc<SceneFile>, rays: &[Ray], percent: f64) -> Result<Vec<Hit>> {
    Queries::new(file, CacheSize::Percent(percent), 2)?.cast(rays, &mut |_| Ok(()))
}

/// A trial's scene with faults.
fn faulty(random: &mut Random, trial: &Trial) -> Result<(Arc<Sound>, Arc<Faulty>), Fault> {
    let sound = sound(random, trial.folder)?;
    let source = Arc::new(Faulty::new(sound.bytes.clone(), random));
    Ok((sound, source))
}

/// A finding that says what the faults were.
fn wrong(what: &str, source: &Faulty, more: &str) -> Fault {
    Fault::new(what, format!("{} ({} struck): {more}", source.told(), source.struck()))
}

/// Frames.
pub struct Frames;

impl Kind for Frames {
    fn name(&self) -> &'static str {
        "faults/frames"
    }

    fn about(&self) -> &'static str {
        "Frames of a scene whose bytes are refused, cut, changed or late: right pixels or one line, then right pixels"
    }

    fn limits(&self) -> Limits {
        Limits { seconds: 60.0, bytes: MOST_BYTES }
    }

    fn trial(&self, trial: &Trial) -> Result<Outcome, Fault> {
        let mut random = Random::new(self.name(), trial.seed);
        let (sound, source) = faulty(&mut random, trial)?;
        let options = format!("{} {}", sound.view, scenes::schedule(&mut random));
        let file = match SceneFile::from_source(NAME, source.clone()) {
            Ok(file) => Arc::new(file),
            Err(error) => return told(&error.into()),
        };
        let mut renderer = match scenes::open(file, Path::new(NAME), &options) {
            Ok(renderer) => renderer,
            Err(error) => return told(&error),
        };
        let mut outcome = Outcome::Passed;
        let explained = |fault: Fault| wrong(&fault.what, &source, &format!("{options}: {}", fault.text));
        for number in 0..FRAMES {
            if let Err(error) = sound.frame(&mut renderer, number).map_err(explained)? {
                outcome = told(&error)?;
            }
        }
        source.end();
        sound.all(&mut renderer).map_err(explained)?;
        Ok(outcome)
    }
}

impl Sound {
    /// Renders a frame, which is right or not there.
    pub fn frame(&self, renderer: &mut Renderer, number: u32) -> Result<Result<()>, Fault> {
        match scenes::frame(renderer, number, FRAMES) {
            Err(error) => Ok(Err(error)),
            Ok(pixels) if Some(&scenes::bits(&pixels)) == self.frames.get(number as usize) => Ok(Ok(())),
            Ok(_) => Err(Fault::new("wrong pixels", format!("frame {number}"))),
        }
    }

    /// Renders all frames, which are to be right: what is held after an error is whole.
    pub fn all(&self, renderer: &mut Renderer) -> Result<(), Fault> {
        for number in 0..FRAMES {
            let frame = self.frame(renderer, number)?;
            frame.map_err(|error| Fault::new("no frame after a fault is over", format!("{error:#}")))?;
        }
        Ok(())
    }
}

/// Queries.
pub struct Queried;

impl Kind for Queried {
    fn name(&self) -> &'static str {
        "faults/queries"
    }

    fn about(&self) -> &'static str {
        "Closest hits in a scene whose bytes are refused, cut, changed or late: right hits or one line, then right hits"
    }

    fn limits(&self) -> Limits {
        Limits { seconds: 60.0, bytes: MOST_BYTES }
    }

    fn trial(&self, trial: &Trial) -> Result<Outcome, Fault> {
        let mut random = Random::new(self.name(), trial.seed);
        let (sound, source) = faulty(&mut random, trial)?;
        let made = SceneFile::from_source(NAME, source.clone()).map_err(anyhow::Error::from).and_then(|file| {
            Queries::new(Arc::new(file), CacheSize::Percent(random.pick([0.0, 20.0, 100.0])), random.within(1, 3))
        });
        let queries = match made {
            Ok(queries) => queries,
            Err(error) => return told(&error),
        };
        let mut outcome = Outcome::Passed;
        for _ in 0..3 {
            match queries.cast(&sound.rays, &mut |_| Ok(())) {
                Ok(hits) if hits != sound.hits => return Err(wrong("wrong hits", &source, "")),
                Ok(_) => {}
                Err(error) => outcome = told(&error)?,
            }
        }
        source.end();
        match queries.cast(&sound.rays, &mut |_| Ok(())) {
            Ok(hits) if hits == sound.hits => Ok(outcome),
            Ok(_) => Err(wrong("wrong hits after a fault is over", &source, "")),
            Err(error) => Err(wrong("no hits after a fault is over", &source, &format!("{error:#}"))),
        }
    }
}
