//! The experiments of Mattausch et al. 2015, §7, as cases to be measured.

use super::paper::{self, EFFECTS};
use crate::lab::bench::scenes::{SceneId, View};
use crate::schedule::Optimisation;
use crate::settings::{Effect, Schedule, names};
use std::fmt;

names! {
    /// A part of the measurements that can be asked for alone.
    Stage {
        /// Times in core, against both baselines.
        Table2 = "table2",
        /// Times and traffic out of core.
        Table3 = "table3",
        /// Aggressive culling.
        Table4 = "table4",
        /// Random turns.
        Table5 = "table5",
        /// Tile sizes.
        Figure5 = "figure5",
        /// Bytes moved against bytes needed.
        Targets = "targets",
        /// The large city, all of it resident.
        Scale = "scale",
    }
}

/// How rays are traced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Variant {
    /// The schedule.
    pub schedule: Schedule,
    /// Temporal fronts: Algorithm 1 of the paper.
    pub fronts: bool,
    /// The query threshold, pixels.
    pub threshold: u32,
    /// Greatest turn of directions, degrees.
    pub rotation: u32,
    /// Optimisations that are left out.
    pub without: &'static [Optimisation],
    /// Whether needs are measured, which costs time.
    pub needed: bool,
}

impl Variant {
    const fn of(schedule: Schedule) -> Self {
        Self { schedule, fronts: false, threshold: 0, rotation: 36, without: &[], needed: false }
    }
}

/// Every ray from the root, over wide trees.
pub const PLAIN: Variant = Variant::of(Schedule::Plain);
/// Every ray from the root, over binary trees: the paper's kind of baseline.
pub const PLAIN_BVH2: Variant = Variant::of(Schedule::PlainBinary);
/// Lists and queries of every frame anew.
pub const CHC: Variant = Variant::of(Schedule::Chc);
/// Algorithm 1 of the paper.
pub const FRONTS: Variant = Variant { fronts: true, ..CHC };
/// Ray by ray over what is resident.
pub const DEMAND: Variant = Variant::of(Schedule::Demand);
/// The cheapest by measurement.
pub const AUTO: Variant = Variant::of(Schedule::Auto);
/// What is compared in core.
pub const IN_CORE: [Variant; 6] = [PLAIN, PLAIN_BVH2, CHC, FRONTS, DEMAND, AUTO];
/// What is compared out of core.
pub const OUT_OF_CORE: [Variant; 4] = [CHC, FRONTS, DEMAND, AUTO];
/// Optimisations of loading that are left out, each and both.
pub const WITHOUT: [&[Optimisation]; 3] =
    [&[Optimisation::Requery], &[Optimisation::NearestFirst], &[Optimisation::Requery, Optimisation::NearestFirst]];

impl fmt::Display for Variant {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(self.schedule.name())?;
        if self.fronts {
            f.write_str("+fronts")?;
        }
        if !self.without.is_empty() {
            let names: Vec<&str> = self.without.iter().map(|which| which.name()).collect();
            write!(f, " without {}", names.join(","))?;
        }
        Ok(())
    }
}

/// What a walk is of, but for its repetition.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Case {
    /// The stage.
    pub stage: Stage,
    /// The scene.
    pub scene: SceneId,
    /// Cache in percent of the scene's bricks.
    pub cache: u32,
    /// Edge of a tile in pixels.
    pub tile: u32,
    /// The path.
    pub view: View,
    /// What is traced beside camera rays; these passes are measured.
    pub effects: &'static [Effect],
    /// How.
    pub variant: Variant,
}

/// What one renderer serves: a scene, a cache and a size of tiles.
pub type Session = (SceneId, u32, u32);

impl Case {
    /// The session that it belongs to.
    pub fn session(&self) -> Session {
        (self.scene, self.cache, self.tile)
    }
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Self { stage, scene, cache, tile, view, effects, variant } = self;
        let effects: Vec<&str> = effects.iter().map(|effect| effect.name()).collect();
        let Variant { threshold, rotation, .. } = variant;
        write!(f, "{stage}/{scene}/{cache}%/tile {tile}/{view}/{}/{variant}", effects.join(","))?;
        write!(f, "/threshold {threshold}/turn {rotation}")
    }
}

/// A walk: what it is of, and which of the case, from 0.
pub type Walk = (Case, u32);

/// What a walk is told from others by.
pub fn key(case: &str, repetition: u32) -> String {
    format!("{case}/{repetition}")
}

/// The share of bricks that the paper's cache holds of a scene, percent (table 1).
pub fn paper_cache(scene: SceneId) -> u32 {
    match scene {
        SceneId::CityLarge => 47,
        SceneId::Pipes16 => 32,
        SceneId::City | SceneId::Pipes | SceneId::Sponza => 100,
    }
}

/// Sizes of tiles of figure 5, pixels.
const TILES: [u32; 5] = [16, 32, 64, 128, 256];

/// Share of the bricks that the cache holds where bytes moved are measured against bytes needed, percent.
pub fn target_cache(scene: SceneId) -> u32 {
    if scene == SceneId::CityLarge { 25 } else { 20 }
}

const PRIMARY: &[Effect] = &[Effect::Primary];
const DIFFUSE: &[Effect] = &[Effect::Diffuse];
/// What is traced of random turns.
pub const SECONDARY: &[Effect] = &[Effect::Ao, Effect::Diffuse];

/// `EFFECTS`, each in a walk of its own: rays of one would load, or evict, what those of another need.
pub fn apart() -> impl Iterator<Item = &'static [Effect]> {
    EFFECTS.chunks(1)
}

/// All walks of these stages with tiles of so many pixels, `repeat` of what is timed, those of one session after each
/// other.
pub fn walks(stages: &[Stage], tile: u32, repeat: u32, has_sponza: bool) -> Vec<Walk> {
    let mut all = Vec::new();
    for &stage in stages {
        for group in groups(stage, tile, has_sponza) {
            // Counts are the same in every walk; of the large city times are looked at, too.
            let counts = stage == Stage::Targets && group[0].scene != SceneId::CityLarge;
            let repetitions = if counts { 1 } else { repeat };
            let turn = |repetition| group.iter().map(move |&case| (case, repetition));
            all.extend((0..repetitions).flat_map(turn));
        }
    }
    let mut order: Vec<Session> = Vec::new();
    for (case, _) in &all {
        if !order.contains(&case.session()) {
            order.push(case.session());
        }
    }
    all.sort_by_key(|(case, _): &Walk| order.iter().position(|session| *session == case.session()));
    all
}

/// Cases of one session that are compared with each other: their walks are interleaved.
type Group = Vec<Case>;

fn groups(stage: Stage, tile: u32, has_sponza: bool) -> Vec<Group> {
    let group = |scene, cache, view, effects, variants: &[Variant]| -> Group {
        let case = |&variant: &Variant| Case { stage, scene, cache, tile, view, effects, variant };
        variants.iter().map(case).collect()
    };
    let (city, plant, large) = (SceneId::City, SceneId::Pipes, SceneId::CityLarge);
    let needed = Variant { needed: true, ..CHC };
    let mut all = Vec::new();
    match stage {
        Stage::Table2 => {
            for scene in [city, plant] {
                all.extend(View::ALL.iter().map(|&view| group(scene, 100, view, EFFECTS, &IN_CORE)));
            }
            all.extend(has_sponza.then(|| group(SceneId::Sponza, 100, View::Near, EFFECTS, &IN_CORE)));
        }
        Stage::Table3 | Stage::Table4 => {
            let variants = paper::THRESHOLDS.map(|threshold| Variant { threshold, ..CHC });
            for scene in [large, SceneId::Pipes16] {
                let cache = paper_cache(scene);
                for &view in View::ALL {
                    if stage == Stage::Table3 {
                        all.extend(apart().map(|effects| group(scene, cache, view, effects, &OUT_OF_CORE)));
                    } else {
                        all.push(group(scene, cache, view, DIFFUSE, &variants));
                    }
                }
            }
        }
        Stage::Table5 => {
            let variants = paper::ROTATIONS.map(|rotation| Variant { rotation, ..CHC });
            let variants = [variants, variants.map(|variant| Variant { fronts: true, ..variant })].concat();
            all.extend([city, plant].map(|scene| group(scene, 100, View::Near, SECONDARY, &variants)));
        }
        Stage::Figure5 => {
            for tile in TILES {
                let case = |&view| Case { tile, ..group(city, 100, view, PRIMARY, &[CHC])[0] };
                all.extend(View::ALL.iter().map(|view| vec![case(view)]));
            }
        }
        Stage::Targets => {
            let variants = [&[needed][..], &WITHOUT.map(|without| Variant { without, ..needed })].concat();
            for scene in [city, plant] {
                let of = |effects| if effects == PRIMARY { &variants[..] } else { &variants[..1] };
                all.extend(apart().map(|own| group(scene, target_cache(scene), View::Near, own, of(own))));
            }
            all.push(group(large, target_cache(large), View::Near, PRIMARY, &[needed]));
        }
        Stage::Scale => all.push(group(large, 100, View::Near, EFFECTS, &[PLAIN, CHC, FRONTS])),
    }
    all
}
