//! Steps: what an executor is asked to run.

use super::Pass;

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
    /// As [`Step::Lists`], without those lists that cost more than they save: the rays of their tiles walk from the
    /// root in the steps that follow.
    ShortLists,
    /// Intersect the listed leaves whose geometry is resident and not done: phase 1.
    IntersectResident,
    /// Intersect the listed leaves of the batch just loaded: phase 3.
    IntersectBatch,
    /// Select the listed leaves that [`Step::IntersectResident`] would intersect; the report says how many a tile has
    /// at most.
    SelectResident,
    /// Select the listed leaves that [`Step::IntersectBatch`] would intersect; the report says how many a tile has at
    /// most.
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
    /// With a threshold: count how many rays of each tile see each leaf, and leave pairs of a tile and a leaf that no
    /// more rays see than the threshold out of the queries and intersections that follow in the pass. Without one
    /// nothing is done.
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
    /// Look up the textures of the hits of the set before whose tiles are resident; the report says which tiles the
    /// others ask for. In scenes without textures nothing is done.
    Sample,
    /// The same, and the next coarser level that is resident stands for what is missing: no hit waits, those concerned
    /// are counted.
    SampleCoarser,
    /// Add what the hits of the set before show by themselves, and the background where they missed.
    Shade(Shading),
    /// Add the light of the pass's lamp where its shadow ray went free.
    AddLight,
    /// Add the share of the sky's light that the pass's direction stands for, where its ray went free.
    AddOcclusion,
    /// Make the ray-aligned maps that the executor was given last: phase 1.
    RomaRotate,
    /// End those of the pass's rays, not traced yet, that are no pilots.
    RomaPilots {
        /// One ray in so many is one.
        one_in: u32,
    },
    /// Answer the pass's rays by them, and count them: phase 3.
    RomaTrace {
        /// Columns that a ray passes before it is finished along the map's direction; 0: it takes that direction from
        /// the start.
        steps: u32,
        /// Which part of them.
        part: RomaPart,
    },
    /// Count what maps would have answered wrongly of the rays that were not sifted, after they have been traced: phase
    /// 3.
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
        /// Rays that asked for bricks wait: they are noted from this word on, a bit each, and ended. Else all are
        /// answered.
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
    /// Find which of the points that the executor was given last lie in cells that are made anew, and how many of their
    /// rays are made.
    DvfPoints {
        /// The first side of a point that rays start from.
        first: u32,
        /// How many of them.
        count: u32,
    },
    /// Add what the hits of the set before that [`Step::RomaTrace`] gave reflect of the lamps, by their reflective
    /// shadow maps: phase 3.
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

/// Which part of rays occupancy maps answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RomaPart {
    /// All of them, by the map of the stratum that they lie in.
    Whole,
    /// All of them, which are snapped, by the maps that are drawn in proportion to the cosines between their directions
    /// and the normals of the set before; they go on in these directions.
    Cosine,
    /// Of those that have met nothing up to where [`Sift::near`] ended them, what lies beyond: they have been traced.
    Far,
    /// Whether they meet anything. Those that do not are answered; the others are still to be traced.
    Sift(Sift),
    /// All of them, after the pilots of [`Step::RomaPilots`] were traced; each of these counts for what maps get wrong
    /// of so many.
    Correct {
        /// One ray in so many is a pilot.
        one_in: u32,
    },
}

impl RomaPart {
    /// The one that answers all rays of a pass; with no `steps` they are snapped. `is_long`: so far do they go that
    /// what the cosine is within a stratum counts.
    pub fn answering(pass: Pass, steps: u32, is_long: bool) -> Self {
        let is_around_normal = matches!(pass, Pass::Occlusion(_) | Pass::Diffuse(_));
        if is_around_normal && steps == 0 && is_long { Self::Cosine } else { Self::Whole }
    }
}

/// How rays are sifted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sift {
    /// Those in doubt are traced up to so many cells of the base map that holds their start from it; `None`: to their
    /// ends.
    pub near: Option<u32>,
    /// One ray in so many is a pilot: it is not sifted; 0: none.
    pub pilots: u32,
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
    /// The rays were drawn by gloss: they meet the sun's disc, and what they meet of it and of surfaces that shine is
    /// weighted against rays to these.
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
