//! What is measured.

use super::args::Settings as Scale;
use crate::lab::bench::scenes::SceneId;
use crate::secondary::roma::{self, Unsnapped};
use crate::secondary::{EffectMethods, Method};
use crate::session::Settings;
use crate::settings::{Effect, EffectList, Length, Turn, names};
use std::fmt;

names! {
    /// A part of the measurements that can be asked for alone.
    Stage {
        /// Times over resolutions and numbers of directions (the paper's table 2).
        Speed = "speed",
        /// Errors by scenes (its figure 5).
        Ao = "ao",
        /// Errors by resolutions and numbers of directions (its figure 9).
        Resolution = "resolution",
        /// Errors by the length of rays: where the method fails.
        Radius = "radius",
        /// Snapped and unsnapped shadow rays (its figures 7 and 8).
        Shadows = "shadows",
        /// One-bounce diffuse light of the sun by reflective shadow maps (its figure 6).
        Diffuse = "diffuse",
        /// A cache that holds 15 % of the scene.
        OutOfCore = "out-of-core",
        /// Rays that maps and bricks answer together, out of core.
        Handover = "handover",
        /// Errors by the distance from where maps with larger cells take over.
        Seams = "seams",
        /// How often columns pass through single sheets, by how base maps are made and looked up (spec §2).
        Leaks = "leaks",
    }
}

/// How rays are answered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Way {
    /// By tracing them.
    Exact,
    /// By ray-aligned occupancy maps.
    Roma {
        /// Square root of the number of directions.
        k: u32,
        /// Cells of a map on each axis.
        size: u32,
        /// Whether rays keep their direction.
        is_unsnapped: bool,
    },
    /// By tracing those that maps do not find free.
    Sifted,
    /// By maps, and one of so many is traced to correct them by.
    Corrected {
        /// How many.
        one_in: u32,
    },
    /// By tracing them as far as it takes for so many of a hundred to be answered otherwise.
    Bounded {
        /// How many.
        percent: u32,
    },
    /// By a distance field, the paper's baseline.
    Field {
        /// Cells on each axis.
        size: u32,
    },
}

impl fmt::Display for Way {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Exact => f.write_str("exact"),
            Self::Roma { k, size, is_unsnapped } => {
                write!(f, "roma {size} K={k}{}", if *is_unsnapped { " unsnapped" } else { "" })
            }
            Self::Sifted => f.write_str("sift, in doubt traced"),
            Self::Corrected { one_in } => write!(f, "sift, one in {one_in}"),
            Self::Bounded { percent } => write!(f, "sift, {percent} % wrong"),
            Self::Field { size } => write!(f, "df {size}"),
        }
    }
}

impl Way {
    /// `settings` for it.
    pub fn over(&self, settings: &Settings) -> Settings {
        let (roma, mut settings) = (&settings.roma, settings.clone());
        settings.secondary = EffectMethods::every(match self {
            Self::Exact => Method::Exact,
            Self::Roma { .. } => Method::Roma,
            Self::Sifted | Self::Corrected { .. } | Self::Bounded { .. } => Method::Sift,
            Self::Field { .. } => Method::Df,
        });
        match *self {
            Self::Exact => {}
            Self::Roma { k, size, is_unsnapped } => {
                let unsnapped = vec![if is_unsnapped { Unsnapped::All } else { Unsnapped::None }];
                settings.roma = roma::Options { k, shadow_k: k, diffuse_k: k, size, unsnapped, ..roma.clone() };
            }
            Self::Sifted => settings.roma.error = None,
            Self::Corrected { one_in } => settings.roma.one_in = Some(one_in),
            Self::Bounded { percent } => settings.roma.error = Some(percent.into()),
            Self::Field { size } => settings.df.size = size,
        }
        settings
    }

    /// Whether bricks are asked.
    pub fn is_traced(&self) -> bool {
        !matches!(self, Self::Roma { .. } | Self::Field { .. })
    }

    /// MiB of a level: a bit a cell of every map; of a distance field 16 bits a cell, and two mips. `None` where there
    /// are neither.
    pub fn mib(&self) -> Option<f64> {
        let cubed = |size: u32| f64::from(size).powi(3) / f64::from(1 << 20);
        match self {
            Self::Roma { k, size, .. } => Some(f64::from(k * k) * cubed(*size) / 8.0),
            Self::Field { size } => Some(2.0 * cubed(*size) * (1.0 + 1.0 / 8.0 + 1.0 / 64.0)),
            _ => None,
        }
    }

    /// The distance field of as many cells on each axis, which with K = 4 takes as much memory as the maps.
    pub fn field(&self) -> Option<Self> {
        match self {
            Self::Roma { size, .. } => Some(Self::Field { size: *size }),
            _ => None,
        }
    }
}

/// Snapped rays.
const fn snapped(size: u32, k: u32) -> Way {
    Way::Roma { k, size, is_unsnapped: false }
}

/// The baseline of as much memory as [`USUAL`].
pub const FIELD: Way = Way::Field { size: 128 };

/// What the paper recommends for occlusion.
pub const USUAL: Way = snapped(128, 4);

/// The frame of the near path, of thirty, that a view shows.
const VIEW: &[u32] = &[10];

/// Frames all along it, whose errors are looked at together: a scene is more than one view.
const WALK: &[u32] = &[0, 5, 10, 15, 20, 25];

/// Ways to answer the rays of one effect in one view, or all along a path, compared with each other.
#[derive(Clone, Debug)]
pub struct Job {
    /// What it is a part of.
    pub stage: Stage,
    /// The scene.
    pub scene: SceneId,
    /// What is varied beside ways and scenes.
    pub variant: String,
    /// The pass that is measured.
    pub effect: &'static str,
    /// The settings for effect and light.
    pub settings: Settings,
    /// Those of a picture without the effect, which is taken off, where one is.
    pub without: Option<Settings>,
    /// Length of rays of occlusion, world units.
    pub length: f64,
    /// The frames of the near path, of thirty. Times are those of the first.
    pub frames: &'static [u32],
    /// Share of the scene that the cache holds, per cent.
    pub cache: u32,
    /// Whether times are measured.
    pub times: bool,
    /// Whether every picture starts with an empty cache.
    pub is_cold: bool,
    /// Whether pictures are compared.
    pub errors: bool,
    /// The ways.
    pub ways: Vec<Way>,
}

impl Job {
    /// Names a measurement.
    pub fn key(&self, way: &Way) -> String {
        [self.stage.name(), self.scene.name(), &self.variant, &way.to_string()].join("/")
    }
}

/// Occlusion alone, of a sky of one brightness.
fn occlusion(length: f64) -> Settings {
    let effects = EffectList::of(&[Effect::Ao]);
    let (sun_intensity, rotation) = (Some(0.0), Turn::FULL);
    Settings { effects, ao_rays: 1, ao_length: Length::World(length), sun_intensity, rotation, ..Settings::exact() }
}

/// The sun alone, and what is lit by what it lights, if `effects` have that.
fn bounce(effects: &[Effect]) -> Settings {
    Settings {
        effects: EffectList::of(effects),
        diffuse_rays: 1,
        sky_intensity: 0.0,
        sun_angle: 0.0,
        rotation: Turn::FULL,
        roma: roma::Options { steps: 64, ..roma::Options::default() },
        ..Settings::exact()
    }
}

/// All jobs, in their order.
pub fn jobs(settings: &Scale, has_sponza: bool) -> Vec<Job> {
    let of = |k, size, is_unsnapped| Way::Roma { k, size, is_unsnapped };
    let all = [32, 64, 128].map(|size| [snapped(size, 4), snapped(size, 8), Way::Field { size }]).concat();
    let of_length = |stage, scene, length: f64, ways: &[Way]| Job {
        stage,
        scene,
        variant: format!("rays of {length}"),
        effect: "ao",
        settings: occlusion(length),
        without: None,
        length,
        frames: VIEW,
        cache: 100,
        times: false,
        is_cold: false,
        errors: true,
        ways: [&[Way::Exact], ways].concat(),
    };
    let length = settings.ao_length;
    let job = |stage, scene, variant: &str, ways: &[Way]| Job {
        variant: variant.into(),
        times: true,
        ..of_length(stage, scene, length, ways)
    };
    let (city, pipes) = (SceneId::City, SceneId::Pipes);
    let mut scenes = vec![city, pipes];
    scenes.extend(has_sponza.then_some(SceneId::Sponza));
    let mut jobs = Vec::new();
    for &scene in &scenes {
        jobs.push(Job { errors: false, ..job(Stage::Speed, scene, "all resident", &all) });
    }
    for &scene in &scenes {
        // None takes more memory than the field.
        let ways = [USUAL, snapped(64, 8), of(4, 128, true), FIELD];
        // Rays that end in a room, too.
        jobs.extend(
            [length, length / 4.0].map(|length| Job { frames: WALK, ..of_length(Stage::Ao, scene, length, &ways) }),
        );
    }
    jobs.push(of_length(Stage::Resolution, city, length, &all));
    let halved = (0..6).map(|halvings| length / f64::from(1 << halvings));
    jobs.extend(halved.map(|length| of_length(Stage::Radius, city, length, &[USUAL, FIELD])));
    let shadows = [of(4, 128, false), of(8, 128, false), of(4, 128, true), of(8, 128, true), FIELD];
    for (light, sun_angle) in [("sun of 0.5 degrees", 0.53), ("sun of 10 degrees", 10.0)] {
        let settings = Settings { effects: EffectList::SHADOW, sky_intensity: 0.0, sun_angle, ..Settings::exact() };
        jobs.push(Job { effect: "shadow", settings, ..job(Stage::Shadows, city, light, &shadows) });
    }
    let (empty, filled) = ("cache 15 %, empty", "cache 15 %, filled");
    let cold = |stage| Job { cache: 15, is_cold: true, ..job(stage, city, empty, &[USUAL]) };
    let lit = [Effect::Shadow, Effect::Diffuse];
    let diffuse = |job| Job { effect: "diffuse", settings: bounce(&lit), ..job };
    for &scene in &scenes {
        let own = job(Stage::Diffuse, scene, "all resident", &[USUAL, snapped(128, 8), of(4, 128, true)]);
        jobs.push(Job { without: Some(bounce(&lit[..1])), ..diffuse(own) });
    }
    jobs.push(Job { errors: false, ..diffuse(cold(Stage::Diffuse)) });
    jobs.push(cold(Stage::OutOfCore));
    jobs.push(Job { errors: false, cache: 15, ..job(Stage::OutOfCore, city, filled, &[USUAL]) });
    let corrected = [2, 4, 6, 8].map(|one_in| Way::Corrected { one_in });
    let bounded = [2, 5, 10].map(|percent| Way::Bounded { percent });
    let ways = [&[USUAL][..], &corrected, &[Way::Sifted], &bounded].concat();
    for length in [length, 4.0 * length] {
        // As many rays a sample as make the maps a small part, and as are chosen among.
        let (settings, variant) =
            (Settings { ao_rays: 16, ..occlusion(length) }, format!("rays of {length}, cache 15 %"));
        jobs.push(Job { cache: 15, times: true, settings, variant, ..of_length(Stage::Handover, city, length, &ways) });
    }
    for scene in [city, pipes] {
        let settings = Settings { aov: true, ..occlusion(length) };
        jobs.push(Job { settings, frames: WALK, ..of_length(Stage::Seams, scene, length, &[USUAL, FIELD]) });
    }
    jobs
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::sizes::ImageSize;

    #[test]
    fn measurements_have_names_of_their_own() {
        let settings = Scale {
            triangles: 1000,
            size: ImageSize { width: 16, height: 9 },
            repeat: 1,
            samples: 2,
            ao_length: 16.0,
            tile: 16,
        };
        for has_sponza in [false, true] {
            let jobs = jobs(&settings, has_sponza);
            let mut keys: Vec<String> = jobs.iter().flat_map(|job| job.ways.iter().map(|way| job.key(way))).collect();
            let count = keys.len();
            keys.sort();
            keys.dedup();
            assert_eq!(keys.len(), count);
            let has_jobs = |stage: &Stage| jobs.iter().any(|job| job.stage == *stage);
            assert!(Stage::ALL.iter().all(|stage| has_jobs(stage) != (*stage == Stage::Leaks)), "leaks need no scene");
            assert!(jobs.iter().all(|job| job.ways.contains(&Way::Exact)), "all are compared with exact rays");
            assert!(jobs.iter().all(|job| job.frames.len() == 1 || !job.times), "times are those of one frame");
            // Scenes are compared at equal memory.
            let fits = |way: &Way| way.mib().is_none_or(|mib| mib <= FIELD.mib().expect("a field takes some"));
            let of_scenes = || jobs.iter().filter(|job| job.stage == Stage::Ao);
            assert!(of_scenes().all(|job| job.ways.contains(&FIELD) && job.ways.iter().all(fits)));
            assert!(!fits(&snapped(128, 8)));
            // Elsewhere is, beside every array of maps, the field of as many cells, where it answers such rays and
            // bricks do not matter.
            let others = [Stage::Ao, Stage::Diffuse, Stage::OutOfCore, Stage::Handover];
            let with_fields = jobs.iter().filter(|job| !others.contains(&job.stage));
            let has_field = |job: &Job| job.ways.iter().filter_map(Way::field).all(|field| job.ways.contains(&field));
            assert!(with_fields.clone().count() > 5 && with_fields.clone().all(has_field));
        }
    }
}
