//! What is measured.

use super::places::{self, CITY, CITY_LARGE, PLANT, Subject};
use super::scale::Settings;
use crate::lab::bench::scenes::View;
use crate::session::Settings as WalkSettings;
use crate::settings::{Effect, EffectList, Turn, names};
use std::fmt;

names! {
    /// A part of the measurements that can be asked for alone.
    Stage {
        /// Errors of pictures by the sun.
        Quality = "quality",
        /// Times and bytes of walks by the sun.
        Walks = "walks",
        /// Errors, times and bytes with diffuse rays.
        Diffuse = "diffuse",
        /// What changes from frame to frame.
        Popping = "popping",
        /// Bytes resident by the size of scenes.
        WorkingSet = "working-set",
    }
}

/// How rays take levels of detail.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Way {
    /// Tolerance in pixels; 0 is exact, without levels.
    pub pixels: f64,
    /// Whether rays choose at random between two levels.
    pub blend: bool,
    /// Of so many blocks one is traced exactly as well.
    pub correct: Option<u32>,
}

impl Way {
    /// Levels within so many pixels; 0 is exact.
    pub const fn of(pixels: f64) -> Self {
        Self { pixels, blend: false, correct: None }
    }

    /// Whether levels are in use.
    pub fn is_levelled(&self) -> bool {
        self.pixels > 0.0
    }
}

impl fmt::Display for Way {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self.pixels {
            0.0 => return f.write_str("exact"),
            pixels => write!(f, "tau {pixels}")?,
        }
        if self.blend {
            f.write_str(" blended")?;
        }
        self.correct.map_or(Ok(()), |blocks| write!(f, " corrected 1/{blocks}"))
    }
}

/// Without levels.
pub const EXACT: Way = Way::of(0.0);
/// The usual tolerance.
pub const USUAL: Way = Way::of(1.0);
/// The same, blended.
pub const BLENDED: Way = Way { blend: true, ..USUAL };
/// All ways that pictures and walks are measured of.
pub const WAYS: [Way; 7] =
    [EXACT, Way::of(0.5), USUAL, Way::of(2.0), Way::of(4.0), BLENDED, Way { correct: Some(16), ..USUAL }];
/// Those whose popping is measured.
pub const POPPING: [Way; 3] = [USUAL, BLENDED, Way::of(2.0)];
/// Samples a pixel of the pictures whose errors are measured.
pub const SAMPLES: [u32; 2] = [1, 16];
/// Shares of the cache, per cent of the bricks.
pub const CACHES: [u32; 3] = [100, 32, 15];
/// Those of walks with diffuse rays.
const DIFFUSE_CACHES: [u32; 2] = [100, 15];

/// What is measured of a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Errors of pictures.
    Pictures,
    /// Times and bytes of walks.
    Walks,
    /// Popping.
    Popping,
    /// Bytes resident.
    Resident,
}

/// A walk.
#[derive(Clone, Debug, PartialEq)]
pub struct Party {
    /// Name of the scene.
    pub scene: &'static str,
    /// The path.
    pub view: View,
    /// How rays take levels.
    pub way: Way,
    /// Share of the cache, per cent.
    pub cache: u32,
}

impl fmt::Display for Party {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{} {} {}% {}", self.scene, self.view, self.cache, self.way)
    }
}

/// Measurements of a scene with a cache that are compared with each other.
#[derive(Clone, Debug)]
pub struct Job {
    /// What it is a part of.
    pub stage: Stage,
    /// What is measured.
    pub kind: Kind,
    /// Name of the scene, of working sets the kind of scenes.
    pub scene: &'static str,
    /// Share of the cache, per cent.
    pub cache: u32,
    /// What takes turns; of pictures the first is exact.
    pub parties: Vec<Party>,
}

impl Job {
    /// Its name.
    pub fn name(&self) -> String {
        let kind = match self.kind {
            Kind::Pictures => "pictures",
            Kind::Walks => "walks",
            Kind::Popping | Kind::Resident => "frames",
        };
        format!("{}/{}/{kind}/{}%", self.stage, self.scene, self.cache)
    }

    /// The name of a measurement: of pictures with so many samples a pixel.
    pub fn key(&self, party: &Party, samples: u32) -> String {
        let of = if self.kind == Kind::Pictures { format!(", {samples} samples") } else { String::new() };
        format!("{}/{party}{of}", self.name())
    }

    /// The names of all its measurements.
    pub fn keys(&self) -> Vec<String> {
        let samples = if self.kind == Kind::Pictures { &SAMPLES[..] } else { &SAMPLES[..1] };
        let of = |party| samples.iter().map(move |&samples| self.key(party, samples));
        self.parties.iter().flat_map(of).collect()
    }

    /// What is traced, and lit by what: a sun and a sky of one brightness.
    pub fn base(&self) -> WalkSettings {
        let mut effects = vec![Effect::Primary, Effect::Shadow];
        if self.stage == Stage::Diffuse {
            effects.push(Effect::Diffuse);
        }
        let effects = EffectList::of(&effects);
        WalkSettings { effects, diffuse_rays: 1, rotation: Turn::FULL, ..WalkSettings::exact() }
    }
}

/// All jobs on `subjects`, those of a scene one after another, working sets last.
pub fn jobs(settings: &Settings, subjects: &[Subject]) -> Vec<Job> {
    let far = |scene, way, cache| Party { scene, view: View::Far, way, cache };
    let all = |scene, cache, ways: &[Way]| ways.iter().map(|&way| far(scene, way, cache)).collect::<Vec<_>>();
    let mut jobs = Vec::new();
    for scene in subjects.iter().filter(|subject| subject.is_shown).map(|subject| subject.name) {
        let job =
            |stage, kind, cache, ways: &[Way]| Job { stage, kind, scene, cache, parties: all(scene, cache, ways) };
        jobs.push(job(Stage::Quality, Kind::Pictures, 100, &WAYS));
        jobs.push(job(Stage::Popping, Kind::Popping, 100, &POPPING));
        jobs.push(job(Stage::Diffuse, Kind::Pictures, 100, &WAYS));
        for cache in CACHES {
            let mut own = job(Stage::Walks, Kind::Walks, cache, &WAYS);
            // What targets compare them with takes turns with them.
            if scene == CITY || scene == CITY_LARGE {
                own.parties.extend([EXACT, USUAL].map(|way| Party { view: View::Near, ..far(scene, way, cache) }));
            }
            if scene == places::PLANTS_16 {
                own.parties.push(far(PLANT, EXACT, 100));
            }
            jobs.push(own);
        }
        jobs.extend(DIFFUSE_CACHES.map(|cache| job(Stage::Diffuse, Kind::Walks, cache, &WAYS[..5])));
    }
    let resident =
        |scene, parties: Vec<Party>| Job { stage: Stage::WorkingSet, kind: Kind::Resident, scene, cache: 100, parties };
    let is_there = |name: &&str| subjects.iter().any(|subject| subject.name == *name);
    let chain = |names: &[&'static str]| -> Vec<Party> {
        names.iter().filter(|name| is_there(name)).map(|&name| far(name, USUAL, 100)).collect()
    };
    let cities = chain(&[CITY, CITY_LARGE]);
    if cities.len() > 1 {
        jobs.push(resident("cities", cities));
    }
    let plants = settings.copies.map(places::plants);
    jobs.push(resident("plants", chain(&plants)));
    jobs
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::bench::lod::args::LodBenchArgs;

    #[test]
    fn measurements_have_names_of_their_own() {
        for (quick, large) in [(false, false), (true, false), (true, true)] {
            let args = LodBenchArgs { quick, large, ..LodBenchArgs::default() };
            let settings = args.settings();
            let subjects = places::subjects(&settings, None).0;
            let all = jobs(&settings, &subjects);
            assert!(Stage::ALL.iter().all(|stage| all.iter().any(|job| job.stage == *stage)));
            assert_eq!(all.iter().any(|job| job.scene == CITY_LARGE), large);
            let mut keys: Vec<String> = all.iter().flat_map(Job::keys).collect();
            let count = keys.len();
            keys.sort();
            keys.dedup();
            assert_eq!(keys.len(), count);
            assert!(all.iter().filter(|job| job.kind == Kind::Pictures).all(|job| job.parties[0].way == EXACT));
            let has_place = |party: &Party| subjects.iter().any(|subject| subject.name == party.scene);
            assert!(all.iter().flat_map(|job| &job.parties).all(has_place), "every scene can be made");
        }
    }

    #[test]
    fn ways_are_named_after_their_options() {
        let names: Vec<String> = WAYS.iter().map(Way::to_string).collect();
        let expected = ["exact", "tau 0.5", "tau 1", "tau 2", "tau 4", "tau 1 blended", "tau 1 corrected 1/16"];
        assert_eq!(names, expected);
    }
}
