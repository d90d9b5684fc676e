//! Steps: what an executor is asked to run.

/// A kernel, or a few that belong together, run over all rays or tiles of a pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Fill the pass's rays from the camera, or from the hits of the set before.
    Generate,
    /// Make the rays by which paths go on from the hits of set 1, each path's of this number; run as a pass of set 2.
    /// As one of [`Pass::BounceShadow`](super::Pass), by facets that refract alone.
    Continue(u32),
    /// Move them to set 1, as the rays of [`Pass::Path`](super::Pass).
    MovePaths {
        /// Whether those that go on come together in the first rows; else each keeps its place.
        compact: bool,
    },
    /// Start the hits of rays given from outside.
    StartHits,
    /// Leave of the rays what lies on this side of the plane that the scene is cut at.
    ClipRays,
    /// Leave out the rays of three pixels in four: of all whose column or row is odd.
    HalveRays,
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
    /// Intersect what is resident with its attributes, from the root: phase 1.
    IntersectReady,
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
    /// Ask ray by ray, from the hits of [`Step::IntersectReady`], for what stands in for bricks that would be entered:
    /// levels of detail that are marked ([`Executor::mark_leaves`](super::Executor::mark_leaves)), and bricks that are
    /// missing. Rays that ask for nothing, and have hit nothing that stands in, have their final hits: phase 2.
    QueryStandIns,
    /// Ask how many rays see each node of the queries set by [`Executor::set_pairs`](super::Executor::set_pairs): phase
    /// 2 of the fronts.
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
    /// Run a kernel of a secondary method.
    Own(Own),
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

/// A kernel of a secondary method, and what it is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Own {
    /// The kernel's name.
    pub kernel: &'static str,
    /// Over what its threads run.
    pub over: Over,
    /// Its parameters beside those of all kernels, as its WGSL declares them; zeros behind.
    pub block: [u32; Own::WORDS],
    /// The phase that its time counts for, from 0.
    pub phase: Option<usize>,
    /// Which random numbers it takes, in place of the pass's.
    pub stream: Option<u32>,
}

/// Over what the threads of a kernel run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Over {
    /// The rays of the pass, or its pixels.
    Rays,
    /// So many elements, 64 a workgroup.
    Elements(u32),
    /// So many workgroups.
    Groups(u32),
}

impl Own {
    /// Words of [`Own::block`].
    pub const WORDS: usize = 16;

    /// A kernel over the rays of the pass, told `block`, timed by no phase.
    pub fn new<T: bytemuck::Pod>(kernel: &'static str, block: &T) -> Self {
        const { assert!(size_of::<T>() <= 4 * Self::WORDS) };
        let mut words = [0; Self::WORDS];
        bytemuck::bytes_of_mut(&mut words)[..size_of::<T>()].copy_from_slice(bytemuck::bytes_of(block));
        Self { kernel, over: Over::Rays, block: words, phase: None, stream: None }
    }

    /// The same over other threads.
    pub fn over(self, over: Over) -> Self {
        Self { over, ..self }
    }

    /// The same, its time counted for a phase.
    pub fn in_phase(self, phase: usize) -> Self {
        Self { phase: Some(phase), ..self }
    }
}

impl From<Own> for Step {
    fn from(own: Own) -> Self {
        Self::Own(own)
    }
}

impl Step {
    /// Whether textures are looked up in it.
    pub fn is_sampling(self) -> bool {
        matches!(self, Step::Sample | Step::SampleCoarser)
    }

    /// Whether after it no ray is pending that was not before.
    pub fn leaves_pending(self) -> bool {
        matches!(self, Step::IntersectBatch | Step::IntersectAllBatch | Step::Query(_))
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
                | Step::IntersectReady
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
