//! The table of counters: one row each. `docs/records.md` is written from it, and the fields of `records.jsonl`.

use super::declare::counters;
use super::{Bricks, Column, Kind, Names, Source};
use serde::ser::SerializeMap;
use serde_json::{Map, Value};

counters! {
    /// Schedules that the effect's passes were traced by, with `+` between them, the first used first: `chc`, `demand`,
    /// `plain`, `plain-bvh2`, `cut` of frames with a budget. Empty where nothing was traced.
    schedule: Names ["name"] names;
    /// Methods that answered rays of the effect's passes, with `+` between them. Empty where all were traced.
    methods: Names ["name"] names, only "with `--secondary`";
    /// Rays generated: `rays_traced` + `rays_answered`. A ray with an empty interval is none.
    rays: u64 ["rays"] = |c| c.rays_traced + c.rays_answered;
    /// Rays that were traced through bricks, if only a part of their way.
    rays_traced: u64 ["rays"] sum from COUNTER_RAYS_TRACED;
    /// Rays that a method answered without tracing them: occupancy maps, distance fields, a field of visibility,
    /// displacement fields.
    rays_answered: u64 ["rays"] sum from COUNTER_RAYS_ANSWERED, only "with `--secondary`";
    /// Of the rays traced, those that displacement fields answered from some distance on.
    rays_shortened: u64 ["rays"] sum from COUNTER_RAYS_SHORTENED, only "with `--secondary displacement`";
    /// Cells of the field of visibility that were made anew for what moves.
    cells_renewed: u64 ["cells"] sum, only "in the pass `dvf`";
    /// Cells that primary hits lie in and that were not made anew although that would save rays: directions toward what
    /// moves are traced there.
    cells_left: u64 ["cells"] state, only "in the pass `dvf`";
    /// Wall time from first submission to last fence.
    ms: f64 ["ms"] sum;
    /// Device time of intersecting what was resident; with ROMA and distance fields, of making these.
    ms_phase1: f64 ["ms"] sum, only "on devices with timestamps";
    /// Device time of queries and lists.
    ms_phase2: f64 ["ms"] sum, only "on devices with timestamps";
    /// Device time of intersecting what was loaded or found visible; with ROMA and distance fields, of tracing these.
    ms_phase3: f64 ["ms"] sum, only "on devices with timestamps";
    /// Wall time of loading.
    ms_stream: f64 ["ms"] sum;
    /// Millions of rays traced per second of `ms`.
    mrays_per_s: f64 ["Mray/s"] = |c| if c.ms > 0.0 { c.rays_traced as f64 / c.ms * 1e-3 } else { 0.0 };
    /// Pairs (tile, node) queried, by interval and ray by ray.
    queries: u64 ["pairs"] = |c| c.queries_by_interval + c.queries_visible + c.queries_invisible;
    /// Pairs (tile, node) put to the interval test.
    queries_by_interval: u64 ["pairs"] sum from COUNTER_PAIRS_TESTED [unwritten];
    /// Ray-by-ray queries that found a ray.
    queries_visible: u64 ["pairs"] sum from COUNTER_PAIRS_VISIBLE;
    /// Ray-by-ray queries that found none.
    queries_invisible: u64 ["pairs"] sum from COUNTER_PAIRS_INVISIBLE [unwritten];
    /// Pairs that the interval test culled.
    queries_interval_culled: u64 ["pairs"] sum from COUNTER_PAIRS_CULLED;
    /// Queries over several pairs of a tile at once.
    multi_queries: u64 ["queries"] sum, only "with `--fronts on` and multi-queries";
    /// Of these, those that had to be repeated node by node.
    multi_queries_failed: u64 ["queries"] sum, only "with `--fronts on` and multi-queries";
    /// Nodes that a query found invisible although a ray of the tile enters their own box.
    queries_tightened: u64 ["pairs"] sum from COUNTER_TIGHTENED,
        only "with `--fronts on` and tighter-bounds";
    /// Visible pairs whose next query was left to a later frame.
    requeries_deferred: u64 ["pairs"] sum, only "with `--fronts on` and lazy-requery";
    /// Visible pairs (tile, leaf) at the end, over all directions and samples.
    pairs_visible: u64 ["pairs"] sum, only "with `--fronts on`";
    /// Invisible pairs (tile, node) at the end, over all directions and samples.
    pairs_invisible: u64 ["pairs"] sum, only "with `--fronts on`";
    /// Pairs whose invisible children were collapsed.
    pulled_up: u64 ["pairs"] sum, only "with `--fronts on` and pull-up";
    /// Pairs (tile, leaf) intersected.
    pairs_intersected: u64 ["pairs"] sum from COUNTER_PAIRS_INTERSECTED;
    /// Tiles, over all passes, whose rays walked from the root because their list was long.
    tiles_from_root: u64 ["tiles"] sum from COUNTER_TILES_FROM_ROOT, only "with root-walk";
    /// Pairs (tile, leaf) intersected after one of the tile with a greater number.
    pairs_front_to_back: u64 ["pairs"] sum from COUNTER_FRONT_TO_BACK, only "with front-to-back";
    /// Tiles, over all dispatches, of which a dispatch intersected two leaves or more.
    tile_batches: u64 ["tiles"] sum from COUNTER_TILE_BATCHES, only "with by-tile";
    /// Leaves that these intersected.
    tile_batch_leaves: u64 ["leaves"] sum from COUNTER_TILE_BATCH_LEAVES, only "with by-tile";
    /// Rays cut short: in maps, those that passed as many columns of cells as they may and went on along their map's
    /// direction; in distance fields, those that made as many look-ups as they may and went free.
    rays_capped: u64 ["rays"] sum from COUNTER_RAYS_CAPPED, only "with ROMA and distance fields";
    /// Bricks of batches that were taken before a wanted one with a lower number.
    bricks_nearest_first: u64 ["bricks"] sum, only "with nearest-first";
    /// Bricks that a query wanted, and a fresh one after a batch no longer did.
    bricks_no_longer_wanted: u64 ["bricks"] sum, only "with requery";
    /// Resident bricks intersected before missing ones were asked for, where any were missing.
    bricks_resident_first: u64 ["bricks"] sum, only "with resident-first";
    /// Submissions that the host waited for.
    round_trips: u64 ["submissions"] sum;
    /// Bricks that rays entered: a child box of their root before the hit at that time.
    bricks_entered: Bricks ["bricks"] distinct [unwritten];
    /// Distinct bricks that the pass needed; where that is not measured, that rays entered.
    bricks_needed: Bricks ["bricks"] distinct;
    /// Distinct bricks that hold a final hit.
    bricks_hit: Bricks ["bricks"] distinct;
    /// Payloads loaded.
    bricks_loaded: u64 ["payloads"] sum;
    /// Payloads loaded twice or more in one pass. What is loaded again over a whole walk `replay` tells, as
    /// `loaded_again`.
    bricks_reloaded: u64 ["payloads"] sum;
    /// Payloads loaded that had been loaded in the same frame before, by whatever pass.
    bricks_reloaded_frame: u64 ["payloads"] sum;
    /// Bytes of those.
    bytes_reloaded_frame: u64 ["bytes"] sum;
    /// Payloads evicted.
    bricks_evicted: u64 ["payloads"] sum;
    /// Fillings of the cache that a pass took, the most of those of the effect (a direction, a lamp, a sample is a pass
    /// each). A filling ends when a load evicts what the same filling loaded or used; 1: all that each pass used fitted
    /// at once.
    cache_passes: u64 ["fillings"] max;
    /// Payloads resident when the effect's first pass began.
    bricks_resident_start: u64 ["payloads"] state;
    /// Payloads resident when its last pass ended. Passes of other effects may have loaded and evicted some between its
    /// own.
    bricks_resident_end: u64 ["payloads"] state;
    /// Batches of loads.
    load_batches: u64 ["batches"] sum;
    /// Bytes of needed geometry.
    bytes_needed: u64 ["bytes"] sum, only "with `--measure-needed`";
    /// Of these, bytes that were not resident when the pass began.
    bytes_needed_missing: u64 ["bytes"] sum, only "with `--measure-needed`";
    /// Bytes of nodes loaded.
    bytes_bvh: u64 ["bytes"] sum;
    /// Bytes of triangles loaded.
    bytes_geometry: u64 ["bytes"] sum;
    /// Bytes of attributes loaded.
    bytes_attributes: u64 ["bytes"] sum;
    /// Bytes of tiles of textures loaded.
    bytes_textures: u64 ["bytes"] sum;
    /// Nodes visited.
    nodes_visited: u64 ["nodes"] sum from COUNTER_NODES, only "with `--count`";
    /// Triangles tested.
    triangles_tested: u64 ["triangles"] sum from COUNTER_TRIANGLES, only "with `--count`";
    /// The cache's budget.
    cache_bytes: u64 ["bytes"] state;
    /// Of it, bytes in use at the end.
    cache_used_bytes: u64 ["bytes"] state;
    /// Mean absolute difference of the effect's part of the picture from the exact one, over pixels and channels.
    error_mean: f64 ["linear radiance"] state, only "with `--measure-error`";
    /// The same over the tile where it is largest.
    error_worst_tile: f64 ["linear radiance"] state, only "with `--measure-error`";
    /// Pixels of which a ray of the effect hit something else than in the exact rendering: another triangle, for
    /// shadows and occlusion something rather than nothing or the other way round.
    error_pixels: u64 ["pixels"] sum, only "with `--measure-error`";
    /// Pixels of the frame that show what they show with everything resident. Of the pass `primary` alone.
    pixels_exact: u64 ["pixels"] sum, only "with `--frame-budget`";
    /// Pixels of the frame where levels of detail stand in for bricks that are missing. Of the pass `primary` alone.
    pixels_bounded: u64 ["pixels"] sum, only "with `--frame-budget`";
    /// Pixels, of every sample and direction, whose textures were looked up in coarser levels than they ask for, or
    /// where nothing stands in for a brick that is missing.
    unresolved_pixels: u64 ["pixels"] sum from COUNTER_UNRESOLVED, only "with `--frame-budget`";
    /// Pixels whose radiance was not finite.
    non_finite: u64 ["pixels"] sum from COUNTER_NON_FINITE;
}
