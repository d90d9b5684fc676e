//! What comes back from round trips, and the statistics of a pass.

/// Counters that a secondary method has for itself.
pub const OWN_COUNTERS: usize = 8;

/// What rays still ask of a brick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Demand {
    /// Its number.
    pub brick: u32,
    /// Rays that enter a child box of its root at or before their hit.
    pub rays: u32,
    /// Distance at which the first of them enters, in device units.
    pub nearest: f32,
    /// Rays that enter it before any other that they ask for. Where there are some, the brick is needed: no closest hit
    /// of theirs lies before it.
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
    /// Resident bricks that a step of intersection entered: some ray met a child box of their root before its hit at
    /// that time. Ascending.
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
    /// Rays that `roma_trace` finished along their map's direction because they had passed as many columns as
    /// they may, and those that `df_trace` let go free because they had made as many look-ups as they may.
    pub rays_capped: u64,
    /// What kernels of a method counted for it, from its first counter on.
    pub own: [u64; OWN_COUNTERS],
    /// Rays traced; counted by [`Step::Lists`](super::Step::Lists), [`Step::ShortLists`](super::Step::ShortLists), [`Step::CountRays`](super::Step::CountRays), by kernels of
    /// methods.
    pub rays: u64,
    /// Rays that a method answered.
    pub rays_answered: u64,
    /// Nodes visited, when the executor counts.
    pub nodes: u64,
    /// Triangles tested, when the executor counts.
    pub triangles: u64,
    /// Pixels whose radiance was not finite.
    pub non_finite: u64,
    /// Hits with a texture of which [`Step::SampleCoarser`](super::Step::SampleCoarser) took a coarser level than they ask for.
    pub unresolved: u64,
    /// Rays that see each node, after [`Step::QueryPairs`](super::Step::QueryPairs).
    pub pair_rays: Vec<u32>,
    /// Nodes that no ray sees although one enters the node's own box.
    pub queries_tightened: u64,
    /// Device time of phases 1, 2 and 3 in milliseconds; zero where the device has no timestamps.
    pub ms_phases: [f64; 3],
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
        sum.queries_tightened += r.queries_tightened;
        sum.rays_capped += r.rays_capped;
        for (total, count) in sum.own.iter_mut().zip(r.own) {
            *total += count;
        }
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
