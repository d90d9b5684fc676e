//! Which dispatches of which kernels a step consists of.

use super::layout::{self, Params};
use crate::schedule::{Pass, Step};

/// One dispatch of a kernel.
pub struct Dispatch {
    /// The kernel's pipeline.
    pub kernel: &'static str,
    /// Its parameters.
    pub params: Params,
    /// Workgroups in x and y.
    pub groups: [u32; 2],
    /// Whether group 2 is the cache.
    pub cache: bool,
    /// Whether group 3 is what shading needs, not the tiles.
    pub shading: bool,
    /// Phase of the schedule that its time counts for, from 0.
    pub phase: Option<usize>,
}

/// Most workgroups of a dispatch in one dimension.
const MOST_GROUPS: u32 = 65_535;

/// At least `count` workgroups, as few more as two dimensions allow.
fn across(count: u32) -> [u32; 2] {
    let x = count.clamp(1, MOST_GROUPS);
    [x, count.div_ceil(x)]
}

/// The dispatches of `step` over the rays of `pass`. `params` has everything but what tells the dispatches of a pass apart.
pub fn dispatches(pass: Pass, step: Step, params: &Params) -> Vec<Dispatch> {
    let any_hit = if pass == Pass::Shadow { layout::PARAM_ANY_HIT } else { 0 };
    let params = Params { flags: any_hit, ..*params };
    let per_ray = [params.width.div_ceil(8), params.height.div_ceil(8)];
    let per_tile = [params.tiles.div_ceil(64), 1];
    let kernel = |kernel, params, groups, phase| {
        let cache = kernel == "intersect_list" || kernel == "intersect_all";
        Dispatch { kernel, params, groups, cache, shading: false, phase }
    };
    let shading =
        |kernel, params, cache| Dispatch { kernel, params, groups: per_ray, cache, shading: true, phase: None };
    let intersect = |mask, want, phase| {
        let params = Params { select_mask: mask, select_want: want, ..params };
        vec![
            kernel("tile_select_intersect", params, per_tile, Some(phase)),
            kernel("intersect_list", params, per_ray, Some(phase)),
        ]
    };
    let query = |params: Params, phase| {
        vec![
            kernel("tile_select", params, per_tile, phase),
            kernel("query", params, per_ray, phase),
            kernel("query_reduce", params, per_tile, phase),
        ]
    };
    let bounds = |phase| kernel("tile_bounds", params, across(params.tiles), phase);
    let resident = layout::STATE_GEOMETRY;
    let not_done = layout::STATE_GEOMETRY | layout::STATE_DONE;
    match step {
        Step::Generate if pass == Pass::Primary => vec![kernel("generate_primary", params, per_ray, None)],
        Step::Generate => vec![shading("generate_shadow", params, false)],
        Step::StartHits => vec![kernel("start_hits", params, per_ray, None)],
        Step::CountRays => vec![bounds(None)],
        Step::Lists => vec![
            bounds(Some(1)),
            kernel("tile_walk_count", params, per_tile, Some(1)),
            kernel("tile_scan", params, [1, 1], Some(1)),
            kernel("tile_walk_write", params, per_tile, Some(1)),
        ],
        Step::IntersectResident => intersect(not_done, resident, 0),
        Step::IntersectBatch => intersect(layout::STATE_BATCH, layout::STATE_BATCH, 2),
        Step::IntersectAll => vec![kernel("intersect_all", params, per_ray, Some(0))],
        Step::QueryMissing => query(Params { select_mask: not_done, select_want: 0, ..params }, Some(1)),
        Step::QueryPairs => vec![kernel("query_pairs", params, across(params.pair_count), Some(1))],
        Step::QueryNeeded => {
            // Of every leaf, exactly.
            let flags = any_hit | layout::PARAM_NEEDED;
            query(Params { select_mask: 0, select_want: 0, threshold: 0, flags, ..params }, None)
        }
        Step::ClearAttributes => vec![shading("clear_gbuffer", params, false)],
        Step::QueryHits => vec![kernel("hit_demand", params, per_ray, None)],
        Step::Resolve => vec![shading("resolve", params, true)],
        Step::Shade { shadows } => {
            let flags = if shadows { layout::SHADE_SHADOWS } else { 0 };
            vec![shading("shade", Params { flags, ..params }, false)]
        }
    }
}
