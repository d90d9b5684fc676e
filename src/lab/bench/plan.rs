//! The experiments of Mattausch et al. 2015, §7, as cases to be measured.

use super::paper;
use super::paper::PaperScene;
use crate::schedule::Optimisation;
use crate::settings::{Plain, Rule, Schedule, Value};
use std::fmt;

/// A part of the measurements that can be asked for alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Times in core, against both baselines.
    Table2,
    /// Times and traffic out of core.
    Table3,
    /// Aggressive culling.
    Table4,
    /// Random turns.
    Table5,
    /// Tile sizes.
    Figure5,
    /// Bytes moved against bytes needed.
    Targets,
    /// The large city, all of it resident.
    Scale,
}

impl Stage {
    /// All of them, in their order.
    pub const ALL: [Self; 7] =
        [Self::Table2, Self::Table3, Self::Table4, Self::Table5, Self::Figure5, Self::Targets, Self::Scale];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Table2 => "table2",
            Self::Table3 => "table3",
            Self::Table4 => "table4",
            Self::Table5 => "table5",
            Self::Figure5 => "figure5",
            Self::Targets => "targets",
            Self::Scale => "scale",
        }
    }
}

impl Value for Stage {
    fn read(text: &str, _: Rule, _: &str) -> Result<Self, String> {
        let names = Self::ALL.map(Self::name);
        let found = Self::ALL.into_iter().find(|stage| stage.name() == text);
        found.ok_or_else(|| crate::settings::removed::unknown(text, &names, &[]))
    }

    fn plain(&self) -> Plain {
        Plain::Text(self.name().into())
    }
}

/// A scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SceneId {
    /// The city that fits.
    City,
    /// The city that does not.
    CityLarge,
    /// The plant.
    Pipes,
    /// Sixteen copies of it.
    Pipes16,
    /// A converted Sponza.
    Sponza,
}

impl SceneId {
    /// Its name in results.
    pub fn name(self) -> &'static str {
        match self {
            Self::City => "city",
            Self::CityLarge => "city-large",
            Self::Pipes => "pipes",
            Self::Pipes16 => "pipes-16",
            Self::Sponza => "sponza",
        }
    }

    /// The scene of the paper that it stands for.
    pub fn paper(self) -> Option<PaperScene> {
        match self {
            Self::City => Some(PaperScene::City10),
            Self::CityLarge => Some(PaperScene::City200),
            Self::Pipes => Some(PaperScene::Powerplant),
            Self::Pipes16 => Some(PaperScene::Powerplant16),
            Self::Sponza => None,
        }
    }

    /// The paths through it.
    pub fn views(self) -> &'static [View] {
        if self == Self::Sponza { &[View::Near] } else { &[View::Near, View::Far] }
    }
}

/// A path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum View {
    /// Through the midst.
    Near,
    /// With everything in view.
    Far,
}

impl View {
    /// Its name in results and in the names of path files.
    pub fn name(self) -> &'static str {
        if self == Self::Near { "near" } else { "far" }
    }
}

/// A pass that is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// Camera rays.
    Primary,
    /// Occlusion rays.
    Ao,
    /// Diffuse rays.
    Diffuse,
}

impl Effect {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Primary, Self::Ao, Self::Diffuse];

    /// Its name in records.
    pub fn name(self) -> &'static str {
        match self {
            Self::Primary => "primary",
            Self::Ao => "ao",
            Self::Diffuse => "diffuse",
        }
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
    /// What is traced beside camera rays; every pass is measured.
    pub effects: &'static [Effect],
    /// How.
    pub variant: Variant,
}

impl Case {
    /// The passes that it measures.
    pub fn passes(&self) -> &'static [Effect] {
        self.effects
    }

    /// Their names.
    pub fn effects_option(&self) -> String {
        let names: Vec<&str> = self.effects.iter().map(|effect| effect.name()).collect();
        names.join(",")
    }
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Self { stage, scene, cache, tile, view, variant, .. } = self;
        let (stage, scene, view, effects) = (stage.name(), scene.name(), view.name(), self.effects_option());
        let Variant { threshold, rotation, .. } = variant;
        write!(
            f,
            "{stage}/{scene}/{cache}%/tile {tile}/{view}/{effects}/{variant}/threshold {threshold}/turn {rotation}"
        )
    }
}

/// Cases that are compared with each other: their walks are interleaved.
#[derive(Clone, Debug)]
pub struct Group {
    /// The cases: of one scene, cache and tile.
    pub cases: Vec<Case>,
    /// How often each is walked.
    pub repetitions: u32,
}

/// What the plan depends on.
#[derive(Clone, Debug)]
pub struct Scope {
    /// The stages wanted.
    pub stages: Vec<Stage>,
    /// Whether there is a Sponza.
    pub sponza: bool,
    /// Edge of a tile in pixels.
    pub tile: u32,
    /// Repetitions of what is timed.
    pub repeat: u32,
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
pub const TILES: [u32; 5] = [16, 32, 64, 128, 256];

/// Share of the bricks that the cache holds where bytes moved are measured against bytes needed, percent.
pub fn target_cache(scene: SceneId) -> u32 {
    if scene == SceneId::CityLarge { 25 } else { 20 }
}

const PRIMARY: &[Effect] = &[Effect::Primary];
const ALL_EFFECTS: &[Effect] = &[Effect::Primary, Effect::Ao, Effect::Diffuse];
const SECONDARY: &[Effect] = &[Effect::Ao, Effect::Diffuse];
const APART: [&[Effect]; 3] = [PRIMARY, &[Effect::Ao], &[Effect::Diffuse]];
const OUT: [SceneId; 2] = [SceneId::CityLarge, SceneId::Pipes16];

/// All groups, those of one session after each other.
pub fn groups(scope: &Scope) -> Vec<Group> {
    let mut all: Vec<Group> = scope.stages.iter().flat_map(|&stage| of_stage(stage, scope)).collect();
    let session = |group: &Group| group.cases.first().map(|case| (case.scene, case.cache, case.tile));
    let mut order = Vec::new();
    for group in &all {
        if !order.contains(&session(group)) {
            order.push(session(group));
        }
    }
    all.sort_by_key(|group| order.iter().position(|one| *one == session(group)));
    all
}

fn of_stage(stage: Stage, scope: &Scope) -> Vec<Group> {
    let tile = scope.tile;
    let group = |scene: SceneId, cache, view, effects, variants: &[Variant]| {
        let case = |&variant: &Variant| Case { stage, scene, cache, tile, view, effects, variant };
        Group { cases: variants.iter().map(case).collect(), repetitions: scope.repeat }
    };
    let mut groups = Vec::new();
    match stage {
        Stage::Table2 => {
            let sponza = scope.sponza.then_some(SceneId::Sponza);
            for scene in [SceneId::City, SceneId::Pipes].into_iter().chain(sponza) {
                groups.extend(scene.views().iter().map(|&view| group(scene, 100, view, ALL_EFFECTS, &IN_CORE)));
            }
        }
        Stage::Table3 => {
            for scene in OUT {
                for &view in scene.views() {
                    // Apart: rays of one effect would evict what those of another need.
                    groups.extend(APART.map(|effects| group(scene, paper_cache(scene), view, effects, &OUT_OF_CORE)));
                }
            }
        }
        Stage::Table4 => {
            let variants = paper::THRESHOLDS.map(|threshold| Variant { threshold, ..CHC });
            for scene in OUT {
                let views = scene.views().iter();
                groups.extend(views.map(|&view| group(scene, paper_cache(scene), view, APART[2], &variants)));
            }
        }
        Stage::Table5 => {
            let variants = paper::ROTATIONS.map(|rotation| Variant { rotation, ..CHC });
            let fronts = variants.map(|variant| Variant { fronts: true, ..variant });
            let all = [variants, fronts].concat();
            for scene in [SceneId::City, SceneId::Pipes] {
                groups.push(group(scene, 100, View::Near, SECONDARY, &all));
            }
        }
        Stage::Figure5 => {
            for tile in TILES {
                let own = Scope { tile, ..scope.clone() };
                for &view in SceneId::City.views() {
                    let case = Case {
                        stage,
                        scene: SceneId::City,
                        cache: 100,
                        tile: own.tile,
                        view,
                        effects: PRIMARY,
                        variant: CHC,
                    };
                    groups.push(Group { cases: vec![case], repetitions: scope.repeat });
                }
            }
        }
        Stage::Targets => {
            let needed = Variant { needed: true, ..CHC };
            let variants = WITHOUT.map(|without| Variant { without, ..needed });
            let variants = [&[needed][..], &variants].concat();
            for scene in [SceneId::City, SceneId::Pipes] {
                // Apart: rays of one effect would load what those of another need. Counts are the same in every walk.
                groups.extend(APART.map(|effects| {
                    let variants = if effects == PRIMARY { &variants[..] } else { &variants[..1] };
                    Group { repetitions: 1, ..group(scene, target_cache(scene), View::Near, effects, variants) }
                }));
            }
            let scene = SceneId::CityLarge;
            groups.push(group(scene, target_cache(scene), View::Near, PRIMARY, &[needed]));
        }
        Stage::Scale => groups.push(group(SceneId::CityLarge, 100, View::Near, ALL_EFFECTS, &[PLAIN, CHC, FRONTS])),
    }
    groups
}
