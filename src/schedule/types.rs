//! What a schedule and an executor say to each other.

use super::{BrickStates, Optimisations};
use crate::kernel::layout::HANDOVERS;
use crate::stream::{Item, Slot};
use thiserror::Error;

/// What shadow rays lead to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Lamp {
    /// A point of the sun's disc.
    Sun,
    /// A point of one of the emitters: area lights, emissive triangles, points, spots, distant lights.
    Emitter,
    /// A direction of the environment.
    Environment,
}

/// The rays that a step works on. One pass has one ray a pixel at most.
///
/// Rays lie in *sets*: set 0 are camera rays, set 1 what starts at their hits, set 2 what starts at the hits of set 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Pass {
    /// Camera rays, or rays given from outside: closest hit.
    Primary,
    /// Rays from primary hits to a lamp, or rays given from outside: any hit.
    Shadow(Lamp),
    /// Rays of limited length from primary hits, in the direction of this number around the normal: any hit.
    Occlusion(u32),
    /// Rays from primary hits in the direction of this number around the normal: closest hit.
    Diffuse(u32),
    /// Mirrored camera rays from primary hits: closest hit.
    Mirror,
    /// Rays from primary hits in a direction drawn by their gloss: closest hit.
    Glossy,
    /// Rays from the hits of set 1 to a lamp: any hit.
    BounceShadow(Lamp),
}

impl Pass {
    /// Number of the set that the rays lie in.
    pub fn set(self) -> usize {
        match self {
            Pass::Primary => 0,
            Pass::Shadow(_) | Pass::Occlusion(_) | Pass::Diffuse(_) | Pass::Mirror | Pass::Glossy => 1,
            Pass::BounceShadow(_) => 2,
        }
    }

    /// Whether any hit ends a ray.
    pub fn is_any_hit(self) -> bool {
        matches!(self, Pass::Shadow(_) | Pass::Occlusion(_) | Pass::BounceShadow(_))
    }

    /// The pass whose visibility from the frame before stands for this one's: each direction has one of its own, shadow rays
    /// share one (CHC+RT §5.4), but for those to the environment, which go everywhere.
    pub fn visibility_state(self) -> Pass {
        match self {
            Pass::Shadow(Lamp::Environment) | Pass::BounceShadow(Lamp::Environment) => self,
            Pass::Shadow(_) => Pass::Shadow(Lamp::Sun),
            Pass::BounceShadow(_) => Pass::BounceShadow(Lamp::Sun),
            own => own,
        }
    }
}

/// A kernel, or a few that belong together, run over all rays or tiles of a pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Fill the pass's rays from the camera, or from the hits of the set before.
    Generate,
    /// Start the hits of rays given from outside.
    StartHits,
    /// Count the rays traced, where no other step does.
    CountRays,
    /// Bounds of the tiles, their walk of the top level, their lists of leaves.
    Lists,
    /// As [`Step::Lists`], without those lists that cost more than they save: the rays of their tiles walk from the root in the steps
    /// that follow.
    ShortLists,
    /// Intersect the listed leaves whose geometry is resident and not done: phase 1.
    IntersectResident,
    /// Intersect the listed leaves of the batch just loaded: phase 3.
    IntersectBatch,
    /// Select the listed leaves that [`Step::IntersectResident`] would intersect; the report says how many a tile has at most.
    SelectResident,
    /// Select the listed leaves that [`Step::IntersectBatch`] would intersect; the report says how many a tile has at most.
    SelectBatch,
    /// Intersect one of the leaves that were selected in each tile.
    IntersectOne {
        /// Its place among them, from 0.
        leaf: u32,
        /// Whether the batch was selected: phase 3, else 1.
        is_batch: bool,
    },
    /// Put the lists in the order of the leaves' numbers.
    SortByNumber,
    /// Make lists of leaf nodes of the binary top-level tree lists of their leaves, near first.
    SortNodesNear,
    /// Intersect everything, all of it resident, from the root.
    IntersectAll,
    /// The same by binary trees.
    IntersectBinary,
    /// Intersect what is resident and not done, from the root: phase 1.
    IntersectAllResident,
    /// Intersect the rays that asked for a brick with the batch just loaded, from the root: phase 3.
    IntersectAllBatch,
    /// With a threshold: count how many rays of each tile see each leaf, and leave pairs of a tile and a leaf that no more rays see than
    /// the threshold out of the queries and intersections that follow in the pass. Without one nothing is done.
    CullPairs {
        /// Of all leaves that are not done, resident or not; else of missing ones.
        undone: bool,
    },
    /// Ask ray by ray which bricks are still wanted: phase 2.
    Query(Query),
    /// Ask how many rays see each node of the queries set by [`Executor::set_pairs`]: phase 2 of the fronts.
    QueryPairs {
        /// By the boxes of the node's children instead of its own.
        tighter: bool,
    },
    /// Ask ray by ray which bricks the pass needed, from its final hits.
    QueryNeeded,
    /// Ask which bricks hold a final hit of the pass.
    QueryHits,
    /// Empty the G-buffer of the set before the pass's.
    ClearAttributes,
    /// Read the attributes of the hits of the set before, where they are resident.
    Resolve,
    /// Look up the textures of the hits of the set before whose tiles are resident; the report says which tiles the others ask for.
    /// In scenes without textures nothing is done.
    Sample,
    /// The same, and the next coarser level that is resident stands for what is missing: no hit waits, those concerned are counted.
    SampleCoarser,
    /// Add what the hits of the set before show by themselves, and the background where they missed.
    Shade(Shading),
    /// Add the light of the pass's lamp where its shadow ray went free.
    AddLight,
    /// Add the share of the sky's light that the pass's direction stands for, where its ray went free.
    AddOcclusion,
    /// Make the ray-aligned maps that the executor was given last: phase 1.
    RomaRotate,
    /// End the pass's rays, not traced yet, this many cells of the base map that holds their start from it: what they meet up to there is
    /// for bricks to tell.
    RomaNear {
        /// Cells.
        cells: u32,
    },
    /// End those of the pass's rays, not traced yet, that are no pilots.
    RomaPilots {
        /// One ray in so many is one.
        one_in: u32,
    },
    /// Answer the pass's rays by them, and count them: phase 3.
    RomaTrace {
        /// Columns that a ray passes before it is finished along the map's direction; 0: it takes that direction from the start.
        steps: u32,
        /// Which part of them.
        part: RomaPart,
    },
    /// Count what maps would have answered wrongly of the rays that were not sifted, after they have been traced: phase 3.
    RomaMeasure {
        /// As of [`Step::RomaTrace`].
        steps: u32,
        /// As of [`Sift::pilots`].
        pilots: u32,
        /// Cells of a base map in one of a map.
        cell: u32,
    },
    /// Make the distance fields of the base maps that the executor was given last: phase 1.
    FieldMake,
    /// Answer the pass's rays by them, and count them: phase 3.
    FieldTrace {
        /// Look-ups of a ray at most; one that has made them goes free.
        steps: u32,
    },
    /// Write a block of texels of a reflective shadow map from the hits of the set before, whose attributes are read.
    RsmWrite {
        /// The map.
        map: u32,
        /// The texel that ray 0 is for.
        corner: [u32; 2],
    },
    /// Sum the areas of so many triangles that the executor was given last, for a field of visibility.
    DvfAreas {
        /// How many.
        triangles: u32,
    },
    /// Say how many points lie on all triangles before each of them.
    DvfCounts {
        /// How many triangles.
        triangles: u32,
    },
    /// Make the rays of so many lanes of the points, in place of [`Step::Generate`].
    DvfRays {
        /// The first lane.
        first: u32,
        /// Which of its directions each takes.
        turn: u32,
        /// Only those that [`Step::DvfWrite`] noted from this word on to wait for bricks; else all.
        waiting: Option<u32>,
    },
    /// Enter what they met into the masks of the cells that they start in.
    DvfWrite {
        /// Rays that asked for bricks wait: they are noted from this word on, a bit each, and ended. Else all are answered.
        waiting: Option<u32>,
        /// Whether what the others met is entered.
        enters: bool,
    },
    /// Label so many cells, after masks have been widened, if they are to be.
    DvfFinish {
        /// How many.
        cells: u32,
        /// Whether masks are widened.
        dilate: bool,
    },
    /// Make rays around primary hits by the cosine, in place of [`Step::Generate`].
    DvfCosine,
    /// Add what they bring of the environment, and what needs no ray, as the paper has it.
    DvfLight,
    /// Answer the pass's rays, not traced yet, that the field tells, and count them: they are not traced.
    DvfSift,
    /// Count the primary hits in each cell of a field of visibility.
    DvfSeen,
    /// Find which of the points that the executor was given last lie in cells that are made anew, and how many of their rays are made.
    DvfPoints {
        /// The first side of a point that rays start from.
        first: u32,
        /// How many of them.
        count: u32,
    },
    /// Add what the hits of the set before that [`Step::RomaTrace`] gave reflect of the lamps, by their reflective shadow maps: phase 3.
    RsmLight,
}

/// Whom rays ask, and for what.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Query {
    /// Every ray from the root; else by the lists, where the ray's tile has one.
    pub from_root: bool,
    /// Of all bricks that are not done, resident or not; else of missing ones.
    pub undone: bool,
    /// Each ray up to the first that it enters of those it asks for; else for all that it enters before its hit.
    pub up_to_next: bool,
}

impl Pilots {
    /// Adds others.
    pub fn add(&mut self, other: Self) {
        self.rays += other.rays;
        self.missed += other.missed;
        for (total, doubted) in self.doubted.iter_mut().zip(other.doubted) {
            *total += doubted;
        }
    }
}

/// Which part of rays occupancy maps answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RomaPart {
    /// All of them, by the map of the stratum that they lie in.
    Whole,
    /// All of them, which are snapped, by the maps that are drawn in proportion to the cosines between their directions and the normals of the set before;
    /// they go on in these directions.
    Cosine,
    /// Of those that have met nothing where [`Step::RomaNear`] ended them, what lies beyond: they have been traced.
    Far,
    /// Whether they meet anything. Those that do not are answered; the others are still to be traced.
    Sift(Sift),
    /// All of them, after the pilots of [`Step::RomaPilots`] were traced; each of these counts for what maps get wrong of so many.
    Correct {
        /// One ray in so many is a pilot.
        one_in: u32,
    },
}

impl RomaPart {
    /// The one that answers all rays of a pass; with no `steps` they are snapped. `is_long`: so far do they go that what the cosine is within a stratum
    /// counts.
    pub fn answering(pass: Pass, steps: u32, is_long: bool) -> Self {
        let is_around_normal = matches!(pass, Pass::Occlusion(_) | Pass::Diffuse(_));
        if is_around_normal && steps == 0 && is_long { Self::Cosine } else { Self::Whole }
    }
}

/// How rays are sifted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sift {
    /// Those in doubt are traced up to so many cells of the base map that holds their start from it; `None`: to their ends.
    pub near: Option<u32>,
    /// One ray in so many is a pilot: it is not sifted; 0: none.
    pub pilots: u32,
}

/// Rays that are traced to their ends though they could be sifted, and what maps would have answered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pilots {
    /// How many there are.
    pub rays: u64,
    /// That meet something and would have been found free.
    pub missed: u64,
    /// That are free and would have met something in the maps, had they been traced up to each of [`HANDOVERS`] distances.
    pub doubted: [u64; HANDOVERS as usize],
}

impl Step {
    /// Whether textures are looked up in it.
    pub fn is_sampling(self) -> bool {
        matches!(self, Step::Sample | Step::SampleCoarser)
    }

    /// Whether rays meet bricks in it.
    pub fn is_intersection(self) -> bool {
        matches!(
            self,
            Step::IntersectResident
                | Step::IntersectBatch
                | Step::IntersectOne { .. }
                | Step::IntersectAll
                | Step::IntersectBinary
                | Step::IntersectAllResident
                | Step::IntersectAllBatch
        )
    }
}

/// What [`Step::Shade`] adds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Shading {
    /// The sun's light on hits, unshadowed.
    pub sun: bool,
    /// The background's, unshadowed.
    pub sky: bool,
    /// The emission of hits.
    pub emission: bool,
    /// The background itself, where rays missed.
    pub miss: bool,
    /// Rays to the environment bring light, too: what misses show is weighted against them.
    pub environment: bool,
    /// The rays were drawn by gloss: they meet the sun's disc, and what they meet of it and of surfaces that shine is weighted against rays
    /// to these.
    pub gloss: bool,
}

/// A query over pairs of one rectangle of rays: each with a node of the binary top-level tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PairQuery {
    /// First column, and the one after the last.
    pub x: [u32; 2],
    /// First row, and the one after the last.
    pub y: [u32; 2],
    /// How many nodes, 1 to [`PairQuery::MOST_NODES`].
    pub nodes: u32,
}

impl PairQuery {
    /// Most nodes of a query.
    pub const MOST_NODES: usize = 16;
}

/// One payload to be copied into the cache.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Load {
    /// What.
    pub item: Item,
    /// Where to.
    pub slot: Slot,
}

/// What rays still ask of a brick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Demand {
    /// Its number.
    pub brick: u32,
    /// Rays that enter a child box of its root at or before their hit.
    pub rays: u32,
    /// Distance at which the first of them enters, in device units.
    pub nearest: f32,
    /// Rays that enter it before any other that they ask for. Where there are some, the brick is needed: no closest hit of
    /// theirs lies before it.
    pub next: u32,
}

/// What texture lookups ask of a tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TileDemand {
    /// Its number.
    pub tile: u32,
    /// Hits that wait for some tile, and need this one, resident or not.
    pub rays: u32,
    /// The least number of a ray among them; of none `u32::MAX`.
    pub first: u32,
    /// Whether a lookup that was carried out has read it.
    pub is_used: bool,
}

/// What came back from one round trip.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Round trips it took: 2 when the lists had to grow, else 1.
    pub round_trips: u32,
    /// Bricks still wanted, ascending.
    pub demand: Vec<Demand>,
    /// Tiles that lookups read or ask for, ascending.
    pub tiles: Vec<TileDemand>,
    /// Resident bricks that a step of intersection entered: some ray met a child box of their root before its hit at that
    /// time. Ascending.
    pub used: Vec<u32>,
    /// Entries that the tiles' lists hold, or would hold.
    pub list_entries: u32,
    /// Pairs (tile, node) put to the interval test.
    pub pairs_tested: u64,
    /// Of these, culled.
    pub pairs_culled: u64,
    /// Ray-by-ray queries with a ray that wants the leaf.
    pub pairs_visible: u64,
    /// Ray-by-ray queries without.
    pub pairs_invisible: u64,
    /// Pairs (tile, leaf) intersected.
    pub pairs_intersected: u64,
    /// Most leaves that a tile selected to be intersected.
    pub most_selected: u32,
    /// Tiles whose list was too long to be kept.
    pub tiles_from_root: u64,
    /// Pairs (tile, leaf) intersected after one of the tile with a greater number.
    pub pairs_front_to_back: u64,
    /// Tiles, summed over dispatches, of which a dispatch intersected two leaves or more.
    pub tile_batches: u64,
    /// Leaves that these intersected.
    pub tile_batch_leaves: u64,
    /// Groups of triangles that rays postponed.
    pub leaf_groups_postponed: u64,
    /// Rays that [`Step::RomaTrace`] finished along their map's direction because they had passed as many columns as they may, and those that
    /// [`Step::FieldTrace`] let go free because they had made as many look-ups as they may.
    pub rays_capped: u64,
    /// What [`Step::RomaMeasure`] counted.
    pub pilots: Pilots,
    /// Rays traced; counted by [`Step::Lists`], [`Step::ShortLists`], [`Step::CountRays`], [`Step::RomaTrace`] and
    /// [`Step::FieldTrace`].
    pub rays: u64,
    /// Rays that [`Step::DvfSift`] answered.
    pub rays_answered: u64,
    /// Nodes visited, when the executor counts.
    pub nodes: u64,
    /// Triangles tested, when the executor counts.
    pub triangles: u64,
    /// Pixels whose radiance was not finite.
    pub non_finite: u64,
    /// Hits with a texture of which [`Step::SampleCoarser`] took a coarser level than they ask for.
    pub unresolved: u64,
    /// Rays that see each node, after [`Step::QueryPairs`].
    pub pair_rays: Vec<u32>,
    /// Nodes that no ray sees although one enters the node's own box.
    pub queries_tightened: u64,
    /// Device time of phases 1, 2 and 3 in milliseconds; zero where the device has no timestamps.
    pub ms_phases: [f64; 3],
}

/// Why an executor gave up.
#[derive(Debug, Error)]
pub enum ExecutorError {
    /// A payload could not be read.
    #[error(transparent)]
    Stream(#[from] crate::stream::StreamError),
    /// The device failed.
    #[error("the device {0}")]
    Device(String),
    /// A traversal stack was too small: the scene file's heights are wrong.
    #[error("a traversal stack overflowed {0} times; the scene file's tree heights are wrong: run `brickwalk verify`")]
    StackOverflow(u32),
}

/// Makes bricks resident and runs kernels over them.
pub trait Executor {
    /// Copies payloads to their slots. Everything in `loads` is resident when this returns.
    ///
    /// # Errors
    /// A payload that cannot be read or whose checksum fails, by its brick.
    fn load(&mut self, loads: &[Load]) -> Result<(), ExecutorError>;

    /// Sets the tiles' lists of leaves, near first, in place of [`Step::Lists`]; one list a tile, row by row.
    ///
    /// # Errors
    /// Lists beyond what the device holds.
    fn set_lists(&mut self, lists: &[Vec<u32>]) -> Result<(), ExecutorError>;

    /// Sets the queries of the next [`Step::QueryPairs`], and the nodes of all of them, one query's after the other's. A query
    /// of several nodes asks for all at once, and where a ray sees any, for each.
    ///
    /// # Errors
    /// More than the device holds.
    fn set_pairs(&mut self, queries: &[PairQuery], nodes: &[u32]) -> Result<(), ExecutorError>;

    /// Runs `steps` in order over the rays of `pass` against bricks in the given states, waits, and reports.
    ///
    /// # Errors
    /// The device's, and [`ExecutorError::StackOverflow`].
    fn run(&mut self, pass: Pass, steps: &[Step], bricks: &BrickStates) -> Result<Report, ExecutorError>;
}

/// How a schedule traces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tracing {
    /// One more query asks, from the final hits, which bricks the pass needed.
    pub measure_needed: bool,
    /// The optimisations that are on.
    pub optimisations: Optimisations,
}

/// Statistics of one pass.
#[derive(Clone, Debug, Default)]
pub struct PassStats {
    /// Sums over the pass's round trips.
    pub report: Report,
    /// Wall time in `Executor::load`, milliseconds.
    pub ms_stream: f64,
    /// Wall time of the pass, milliseconds.
    pub ms: f64,
    /// Bricks that rays entered: a child box of their root before the hit at that time.
    pub bricks_intersected: Vec<u32>,
    /// Distinct bricks that the pass needed (definitions.md), where it was asked.
    pub bricks_needed: Option<Vec<u32>>,
    /// Distinct bricks that hold a final hit, where it was asked.
    pub bricks_hit: Option<Vec<u32>>,
    /// Pairs (tile, leaf) of the visible fronts at the end, summed over directions and samples.
    pub pairs_visible: u64,
    /// Pairs (tile, node) of the invisible fronts at the end, summed likewise.
    pub pairs_invisible: u64,
    /// Queries over several pairs at once.
    pub multi_queries: u64,
    /// Of these, those that a ray saw, so that each pair was asked for by itself.
    pub multi_queries_failed: u64,
    /// Visible pairs whose next query was left to a later frame.
    pub requeries_deferred: u64,
    /// Pairs whose invisible children were collapsed.
    pub pulled_up: u64,
    /// Bricks of batches that were taken before a wanted one with a lower number.
    pub bricks_nearest_first: u64,
    /// Bricks that a query wanted, and a fresh one after a batch no longer did.
    pub bricks_no_longer_wanted: u64,
    /// Resident bricks intersected before missing ones were asked for, where any were missing.
    pub bricks_resident_first: u64,
    /// Bytes of needed geometry, where it was asked.
    pub bytes_needed: u64,
    /// Bytes of needed geometry that was not resident when the pass began, where it was asked.
    pub bytes_needed_missing: u64,
    /// Payloads loaded.
    pub loaded: u64,
    /// Payloads loaded twice or more in this pass.
    pub reloaded: u64,
    /// Payloads loaded that had been loaded in the same frame before.
    pub reloaded_frame: u64,
    /// Bytes of those.
    pub bytes_reloaded_frame: u64,
    /// Payloads evicted.
    pub evicted: u64,
    /// Most fillings of the cache that one of the passes took ([`crate::stream::Residency::fillings`]).
    pub cache_passes: u64,
    /// Bytes of nodes loaded.
    pub bytes_bvh: u64,
    /// Bytes of triangles loaded.
    pub bytes_geometry: u64,
    /// Bytes of attributes loaded.
    pub bytes_attributes: u64,
    /// Bytes of tiles of textures loaded.
    pub bytes_textures: u64,
    /// Batches of loads.
    pub batches: u64,
    /// Cells of a field of visibility that were made anew.
    pub cells_renewed: u64,
    /// Cells that are seen and were not, although that would save rays.
    pub cells_left: u64,
}

impl PassStats {
    /// Adds what one round trip reported.
    pub fn add(&mut self, r: Report) {
        let sum = &mut self.report;
        sum.round_trips += r.round_trips;
        sum.pairs_tested += r.pairs_tested;
        sum.pairs_culled += r.pairs_culled;
        sum.pairs_visible += r.pairs_visible;
        sum.pairs_invisible += r.pairs_invisible;
        sum.pairs_intersected += r.pairs_intersected;
        sum.tiles_from_root += r.tiles_from_root;
        sum.pairs_front_to_back += r.pairs_front_to_back;
        sum.tile_batches += r.tile_batches;
        sum.tile_batch_leaves += r.tile_batch_leaves;
        sum.leaf_groups_postponed += r.leaf_groups_postponed;
        sum.queries_tightened += r.queries_tightened;
        sum.rays_capped += r.rays_capped;
        sum.pilots.add(r.pilots);
        sum.rays += r.rays;
        sum.rays_answered += r.rays_answered;
        sum.nodes += r.nodes;
        sum.triangles += r.triangles;
        sum.non_finite += r.non_finite;
        sum.unresolved += r.unresolved;
        for (total, ms) in sum.ms_phases.iter_mut().zip(r.ms_phases) {
            *total += ms;
        }
    }
}
