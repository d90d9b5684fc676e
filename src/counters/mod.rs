//! The records of a walk: one struct a row, written as JSON lines. Field names and meanings are those of the interface.

use crate::schedule::PassStats;
use serde::Serialize;

/// One frame and pass.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Record {
    /// Frame, from 0.
    pub frame: u32,
    /// The effect: `primary`, `shadow`, `environment`, `ao`, `diffuse`, `glossy`, and of the rays to lamps from the hits
    /// of bounces `diffuse-shadow`, `diffuse-environment`, `glossy-shadow`, `glossy-environment`; `dvf`, where the
    /// cells of a field of visibility are made anew for what moves.
    pub pass: &'static str,
    /// Rays traced.
    pub rays: u64,
    /// Rays besides that a field of visibility answered: they were not traced.
    pub rays_answered: u64,
    /// Of `dvf`: cells of the field of visibility that were made anew for what moves.
    pub cells_renewed: u64,
    /// Cells that primary hits lie in, and that were not although it would save rays: directions toward what moves are
    /// traced there.
    pub cells_left: u64,
    /// Wall time from first submission to last fence, ms.
    pub ms: f64,
    /// Device time of intersecting what was resident, ms; with ROMA and distance fields, of making these.
    pub ms_phase1: f64,
    /// Device time of queries and lists, ms.
    pub ms_phase2: f64,
    /// Device time of intersecting what was loaded or found visible, ms; with ROMA and distance fields, of tracing
    /// these.
    pub ms_phase3: f64,
    /// Wall time of loading, ms.
    pub ms_stream: f64,
    /// Millions of rays per second of `ms`.
    pub mrays_per_s: f64,
    /// Pairs (tile, node) queried, by interval and ray by ray.
    pub queries: u64,
    /// Ray-by-ray queries that found a ray.
    pub queries_visible: u64,
    /// Pairs that the interval test culled.
    pub queries_interval_culled: u64,
    /// With multi-queries: queries over several pairs of a tile at once.
    pub multi_queries: u64,
    /// Of these, those that had to be repeated node by node.
    pub multi_queries_failed: u64,
    /// With tighter-bounds: nodes that a query found invisible although a ray of the tile enters their own box.
    pub queries_tightened: u64,
    /// With lazy-requery: visible pairs whose next query was left to a later frame.
    pub requeries_deferred: u64,
    /// Visible pairs (tile, leaf) at the end.
    pub pairs_visible: u64,
    /// Invisible pairs at the end.
    pub pairs_invisible: u64,
    /// With pull-up: pairs whose children were collapsed.
    pub pulled_up: u64,
    /// Pairs (tile, leaf) intersected.
    pub pairs_intersected: u64,
    /// With root-walk: tiles, summed over passes, whose rays walked from the root because their list was long.
    pub tiles_from_root: u64,
    /// With front-to-back: pairs (tile, leaf) intersected after one of the tile with a greater number.
    pub pairs_front_to_back: u64,
    /// With by-tile: tiles, summed over dispatches, of which a dispatch intersected two leaves or more.
    pub tile_batches: u64,
    /// Leaves that these intersected.
    pub tile_batch_leaves: u64,
    /// With ROMA: rays that had passed as many columns of cells as they may, and went on along their map's direction;
    /// with distance fields, that had made as many look-ups as they may, and went free.
    pub rays_capped: u64,
    /// With nearest-first: bricks of batches that were taken before a wanted one with a lower number.
    pub bricks_nearest_first: u64,
    /// With requery: bricks that a query wanted, and a fresh one after a batch no longer did.
    pub bricks_no_longer_wanted: u64,
    /// With resident-first: resident bricks intersected before missing ones were asked for, where any were missing.
    pub bricks_resident_first: u64,
    /// Submissions that the host waited for.
    pub round_trips: u64,
    /// Distinct bricks that the pass needed, where that is known, else that rays entered.
    pub bricks_needed: u64,
    /// Distinct bricks that hold a final hit.
    pub bricks_hit: u64,
    /// Payloads loaded.
    pub bricks_loaded: u64,
    /// Payloads loaded twice or more in this pass.
    pub bricks_reloaded: u64,
    /// Payloads loaded that had been loaded in the same frame before, by whatever pass.
    pub bricks_reloaded_frame: u64,
    /// Bytes of those.
    pub bytes_reloaded_frame: u64,
    /// Payloads evicted.
    pub bricks_evicted: u64,
    /// Fillings of the cache that a pass took, the most of those of the effect (a direction, a lamp, a sample is a pass
    /// each): a filling ends when a load evicts what the same filling loaded or used. 1 where all that each pass used
    /// fitted at once.
    pub cache_passes: u64,
    /// Payloads resident when the effect's first pass began.
    pub bricks_resident_start: u64,
    /// Payloads resident at its end, but for what passes of other effects loaded and evicted between its own.
    pub bricks_resident_end: u64,
    /// Batches of loads.
    pub load_batches: u64,
    /// Bytes of needed geometry, where needs are measured.
    pub bytes_needed: u64,
    /// Of these, bytes that were not resident when the pass began.
    pub bytes_needed_missing: u64,
    /// Bytes of nodes moved.
    pub bytes_bvh: u64,
    /// Bytes of triangles moved.
    pub bytes_geometry: u64,
    /// Bytes of attributes moved.
    pub bytes_attributes: u64,
    /// Bytes of tiles of textures loaded.
    pub bytes_textures: u64,
    /// Nodes visited, with `--count`.
    pub nodes_visited: u64,
    /// Triangles tested, with `--count`.
    pub triangles_tested: u64,
    /// The cache's budget.
    pub cache_bytes: u64,
    /// Of it, bytes in use at the end.
    pub cache_used_bytes: u64,
    /// With `--measure-error`: mean absolute difference of the effect's part of the picture from the exact one, over
    /// pixels and channels, linear radiance.
    pub error_mean: f64,
    /// The same over the tile where it is largest.
    pub error_worst_tile: f64,
    /// Pixels of which a ray of the effect hit something else than in the exact rendering: another triangle, for
    /// shadows and occlusion something rather than nothing or the other way round.
    pub error_pixels: u64,
    /// Pixels, of every sample and direction, whose textures were looked up in coarser levels than they ask for
    /// (`--interactive`).
    pub unresolved_pixels: u64,
    /// Pixels whose radiance was not finite.
    pub non_finite: u64,
}

impl Record {
    /// The record of a pass from its statistics; the caller adds what concerns the cache.
    pub fn of(frame: u32, pass: &'static str, stats: &PassStats) -> Self {
        let r = &stats.report;
        let needed = stats.bricks_needed.as_ref().unwrap_or(&stats.bricks_intersected);
        Self {
            frame,
            pass,
            rays: r.rays,
            rays_answered: r.rays_answered,
            cells_renewed: stats.cells_renewed,
            cells_left: stats.cells_left,
            ms: stats.ms,
            ms_phase1: r.ms_phases[0],
            ms_phase2: r.ms_phases[1],
            ms_phase3: r.ms_phases[2],
            ms_stream: stats.ms_stream,
            mrays_per_s: if stats.ms > 0.0 { r.rays as f64 / stats.ms * 1e-3 } else { 0.0 },
            queries: r.pairs_tested + r.pairs_visible + r.pairs_invisible,
            queries_visible: r.pairs_visible,
            queries_interval_culled: r.pairs_culled,
            pairs_visible: stats.pairs_visible,
            pairs_invisible: stats.pairs_invisible,
            pulled_up: stats.pulled_up,
            multi_queries: stats.multi_queries,
            multi_queries_failed: stats.multi_queries_failed,
            queries_tightened: r.queries_tightened,
            requeries_deferred: stats.requeries_deferred,
            pairs_intersected: r.pairs_intersected,
            tiles_from_root: r.tiles_from_root,
            pairs_front_to_back: r.pairs_front_to_back,
            tile_batches: r.tile_batches,
            tile_batch_leaves: r.tile_batch_leaves,
            rays_capped: r.rays_capped,
            bricks_nearest_first: stats.bricks_nearest_first,
            bricks_no_longer_wanted: stats.bricks_no_longer_wanted,
            bricks_resident_first: stats.bricks_resident_first,
            round_trips: r.round_trips.into(),
            bricks_needed: distinct(needed),
            bricks_hit: stats.bricks_hit.as_deref().map_or(0, distinct),
            bricks_loaded: stats.loaded,
            bricks_reloaded: stats.reloaded,
            bricks_reloaded_frame: stats.reloaded_frame,
            bytes_reloaded_frame: stats.bytes_reloaded_frame,
            bricks_evicted: stats.evicted,
            cache_passes: stats.cache_passes,
            load_batches: stats.batches,
            bytes_needed: stats.bytes_needed,
            bytes_needed_missing: stats.bytes_needed_missing,
            bytes_bvh: stats.bytes_bvh,
            bytes_geometry: stats.bytes_geometry,
            bytes_attributes: stats.bytes_attributes,
            bytes_textures: stats.bytes_textures,
            nodes_visited: r.nodes,
            triangles_tested: r.triangles,
            unresolved_pixels: r.unresolved,
            non_finite: r.non_finite,
            ..Self::default()
        }
    }
}

/// Number of distinct bricks: the samples of a frame name some several times.
fn distinct(bricks: &[u32]) -> u64 {
    let mut sorted = bricks.to_vec();
    sorted.sort_unstable();
    sorted.dedup();
    sorted.len() as u64
}
