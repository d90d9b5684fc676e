//! Which dispatches of which kernels a step consists of.

use super::layout::{self, Params};
use super::setup::Directions;
use super::table::names as kernels;
use crate::math::sampling::{cosine_hemisphere, halton};
use crate::schedule::{Lamp, Over, Own, Pass, Query, Step};

/// Direction `index` about z of passes that start at hits, before it is turned or scattered.
pub fn direction_around(index: u32) -> [f32; 3] {
    // The first point of the sequence is a corner of the square.
    cosine_hemisphere([halton(index + 1, 0), halton(index + 1, 1)])
}

impl Directions {
    /// Whether the rays of `pass` lead to an environment in directions around the normal.
    fn is_around(&self, pass: Pass) -> bool {
        self.even && pass.lamp() == Some(Lamp::Environment)
    }

    /// The parameters of `pass`.
    fn params(&self, pass: Pass, params: &Params) -> Params {
        // Every kind of pass takes random numbers of its own. Those of a sun alone depend on the sample only.
        let (stream, direction) = match pass {
            Pass::Primary | Pass::Shadow(Lamp::Sun) => (0, None),
            Pass::Shadow(Lamp::Emitter) => (1, None),
            Pass::BounceShadow(Lamp::Sun) | Pass::PathShadow(Lamp::Sun) => (2, None),
            Pass::BounceShadow(Lamp::Emitter) | Pass::PathShadow(Lamp::Emitter) => (3, None),
            Pass::Shadow(Lamp::Environment) => (6, None),
            Pass::BounceShadow(Lamp::Environment) | Pass::PathShadow(Lamp::Environment) => (7, None),
            Pass::Occlusion(index) => (4, Some((index, self.occlusion))),
            Pass::Diffuse(index) => (5, Some((index, self.diffuse))),
            Pass::Glossy | Pass::Path(_) => (8, None),
        };
        let (lamp, is_around) = (pass.lamp(), self.is_around(pass));
        // One direction, which every sample moves.
        let direction = if is_around { Some((0, 1)) } else { direction };
        let scatter = self.scatter || is_around;
        let flag = |set: bool, flag: u32| if set { flag } else { 0 };
        let mut params = Params {
            flags: params.flags
                | flag(pass.is_any_hit(), layout::PARAM_ANY_HIT)
                | flag(lamp == Some(Lamp::Emitter), layout::PARAM_EMITTER)
                | flag(lamp == Some(Lamp::Environment), layout::PARAM_ENVIRONMENT)
                | flag(pass.set() == 2, layout::PARAM_BOUNCE)
                | flag(matches!(pass, Pass::PathShadow(_)), layout::PARAM_PATH)
                | flag(self.glossy, layout::PARAM_GLOSSY)
                | flag(self.refracts, layout::PARAM_REFRACT),
            stream: params.sample.wrapping_add(stream << 24),
            length: if is_around { layout::T_INFINITE } else { self.occlusion_length },
            levels: self.lod.params(pass, params.sun_radius),
            ..*params
        };
        if self.shares {
            params.diffuse_count = self.diffuse as f32;
        }
        if let Some((index, count)) = direction {
            // Scattered, every sample moves the same directions: by what it moves them is spread over samples evenly.
            let index = if scatter { index % count.max(1) } else { index };
            let [x, y, z] = direction_around(index);
            params.around = [x, y, z, if scatter { std::f32::consts::TAU } else { self.turn }];
            params.flags |= flag(scatter, layout::PARAM_SCATTER);
            params.share = 1.0 / count.max(1) as f32;
            params.direction = index;
        }
        params
    }
}

/// The workgroups of a dispatch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Workgroups {
    /// So many in x and y.
    Fixed([u32; 2]),
    /// Of the tiles that have just been chosen; the device knows how many.
    Chosen,
    /// Of the tiles whose rays walk from the root; the device knows how many.
    Rooted,
}

/// One dispatch of a kernel.
pub struct Dispatch {
    /// The kernel's name, in the table of kernels or in a family's.
    pub kernel: &'static str,
    /// Its parameters.
    pub params: Params,
    /// What a method's kernel is told beside these.
    pub own: [u32; Own::WORDS],
    /// Its workgroups.
    pub groups: Workgroups,
    /// Phase of the schedule that its time counts for, from 0.
    pub phase: Option<usize>,
}

/// Leaves of the longest list that a tile's rays are intersected with; longer ones cost more than the walk of the top
/// level that they save (docs/methods/chc.md, "What a list costs"). Camera rays of a tile agree on what is near and
/// stop there, others do not.
fn list_most(pass: Pass) -> u32 {
    if pass == Pass::Primary { 128 } else { 12 }
}

/// Whether pairs are culled after `step`, given whether they were before it: from [`Step::CullPairs`] on to the end of
/// the pass. Other passes begin with one of the steps that end it.
pub fn are_pairs_culled(step: Step, before: bool, threshold: u32) -> bool {
    match step {
        Step::CullPairs { .. } => threshold > 0,
        Step::Lists | Step::ShortLists | Step::CountRays => false,
        _ => before,
    }
}

/// The random numbers of the first ray of paths; those of passes lie below.
const FIRST_STREAM_OF_PATHS: u32 = 16;

/// Most workgroups of a dispatch in one dimension.
const MOST_GROUPS: u32 = 65_535;

/// At least `count` workgroups, as few more as two dimensions allow.
fn across(count: u32) -> [u32; 2] {
    let x = count.clamp(1, MOST_GROUPS);
    [x, count.div_ceil(x)]
}

/// The dispatches of `step` over the rays of `pass`. `params` has everything but what tells passes and their dispatches
/// apart; with `everything` resident no kernel looks for what is.
pub fn dispatches(pass: Pass, step: Step, params: &Params, directions: &Directions, everything: bool) -> Vec<Dispatch> {
    let params = Params { run_count: u32::MAX >> 1, ..directions.params(pass, params) };
    let per_ray = [params.width.div_ceil(8), params.height.div_ceil(8)];
    let per_tile = [params.tiles.div_ceil(64), 1];
    let by_tile = across(params.tiles * (params.tile / 8) * (params.tile / 8));
    let dispatch = |kernel, params, groups, phase| Dispatch { kernel, params, own: [0; Own::WORDS], groups, phase };
    let kernel = |kernel, params, groups, phase| dispatch(kernel, params, Workgroups::Fixed(groups), phase);
    let shading = |name, params| kernel(name, params, per_ray, None);
    let list = |params, phase| dispatch(kernels::intersect_list, params, Workgroups::Chosen, Some(phase));
    let choose = |params, phase| kernel(kernels::tile_choose, params, [1, 1], phase);
    let intersect = |mask, want, from_root, phase| {
        let params = Params { select_mask: mask, select_want: want, ..params };
        vec![
            kernel(kernels::tile_select_intersect, params, per_tile, Some(phase)),
            choose(params, Some(phase)),
            list(params, phase),
            dispatch(from_root, params, Workgroups::Rooted, Some(phase)),
        ]
    };
    let select_single = |mask, want, phase| {
        let params = Params { select_mask: mask, select_want: want, run_count: 1, ..params };
        vec![kernel(kernels::tile_select_intersect, params, per_tile, Some(phase)), choose(params, Some(phase))]
    };
    let query = |params: Params, phase| {
        vec![
            kernel(kernels::tile_select, params, per_tile, phase),
            choose(params, phase),
            dispatch(kernels::query, params, Workgroups::Chosen, phase),
            dispatch(kernels::query_from_root, params, Workgroups::Rooted, phase),
            kernel(kernels::query_reduce, params, per_tile, phase),
        ]
    };
    let bounds = |phase| kernel(kernels::tile_bounds, params, across(params.tiles), phase);
    let resident = layout::STATE_GEOMETRY;
    let ready = layout::STATE_GEOMETRY | layout::STATE_ATTRIBUTES;
    let not_done = layout::STATE_GEOMETRY | layout::STATE_DONE;
    let unprocessed = |undone: bool| if undone { layout::STATE_DONE } else { not_done };
    match step {
        Step::Generate if pass == Pass::Primary => vec![kernel(kernels::generate_primary, params, per_ray, None)],
        Step::Generate => {
            let kernel = match pass {
                Pass::Occlusion(_) => kernels::generate_occlusion,
                Pass::Diffuse(_) => kernels::generate_diffuse,
                Pass::Glossy => kernels::generate_glossy,
                _ if directions.is_around(pass) => kernels::generate_occlusion,
                // Paths go on by a step of their own.
                _ => kernels::generate_shadow,
            };
            vec![shading(kernel, params)]
        }
        Step::Continue(number) => {
            let stream = params.sample.wrapping_add(FIRST_STREAM_OF_PATHS.wrapping_add(number) << 24);
            vec![shading(kernels::generate_path, Params { stream, direction: number, ..params })]
        }
        Step::MovePaths { compact: false } => vec![kernel(kernels::keep_paths, params, by_tile, None)],
        Step::MovePaths { compact: true } => vec![
            kernel(kernels::count_paths, params, by_tile, None),
            kernel(kernels::scan_paths, params, [1, 1], None),
            kernel(kernels::compact_paths, params, by_tile, None),
        ],
        Step::StartHits => vec![kernel(kernels::start_hits, params, per_ray, None)],
        Step::ClipRays => vec![kernel(kernels::clip_rays, params, per_ray, None)],
        Step::HalveRays => vec![kernel(kernels::halve_rays, params, per_ray, None)],
        Step::CountRays => vec![bounds(None)],
        Step::Lists | Step::ShortLists => {
            let is_short = step == Step::ShortLists;
            let most = if is_short { params.list_most.min(list_most(pass)) } else { u32::MAX };
            let params = Params { list_most: most, ..params };
            vec![
                bounds(Some(1)),
                kernel(kernels::tile_walk_count, params, per_tile, Some(1)),
                kernel(kernels::tile_scan, params, [1, 1], Some(1)),
                kernel(kernels::tile_walk_write, params, per_tile, Some(1)),
            ]
        }
        Step::IntersectResident => {
            let from_root = if everything { kernels::intersect_from_root_all } else { kernels::intersect_from_root };
            intersect(not_done, resident, from_root, 0)
        }
        Step::IntersectBatch => intersect(layout::STATE_BATCH, layout::STATE_BATCH, kernels::intersect_from_root, 2),
        Step::SelectResident => select_single(not_done, resident, 0),
        Step::SelectBatch => select_single(layout::STATE_BATCH, layout::STATE_BATCH, 2),
        Step::IntersectOne { leaf, is_batch } => {
            vec![list(Params { run_first: leaf, run_count: 1, ..params }, if is_batch { 2 } else { 0 })]
        }
        Step::SortByNumber => vec![kernel(kernels::tile_sort_number, params, per_tile, Some(1))],
        Step::SortNodesNear => vec![kernel(kernels::tile_sort_near, params, per_tile, Some(1))],
        Step::IntersectAll => vec![kernel(kernels::intersect_all, params, by_tile, Some(0))],
        Step::IntersectBinary => vec![kernel(kernels::intersect_binary, params, by_tile, Some(0))],
        Step::IntersectAllResident => {
            let params = Params { select_mask: not_done, select_want: resident, ..params };
            vec![kernel(
                if everything { kernels::intersect_all } else { kernels::intersect_selected },
                params,
                by_tile,
                Some(0),
            )]
        }
        Step::IntersectReady => {
            let params = Params { select_mask: ready, select_want: ready, ..params };
            vec![kernel(kernels::intersect_selected, params, by_tile, Some(0))]
        }
        Step::IntersectAllBatch => {
            let params = Params { select_mask: layout::STATE_BATCH, select_want: layout::STATE_BATCH, ..params };
            vec![kernel(kernels::intersect_selected, params, by_tile, Some(2))]
        }
        Step::CullPairs { .. } if params.threshold == 0 => Vec::new(),
        Step::CullPairs { undone } => {
            let params = Params { select_mask: unprocessed(undone), select_want: 0, ..params };
            vec![kernel(kernels::count_pairs, params, by_tile, Some(1))]
        }
        Step::Query(Query { from_root, undone, up_to_next }) => {
            let flags = params.flags | if up_to_next { layout::PARAM_NEXT } else { 0 };
            let params = Params { select_mask: unprocessed(undone), select_want: 0, flags, ..params };
            if from_root { vec![kernel(kernels::query_all, params, by_tile, Some(1))] } else { query(params, Some(1)) }
        }
        Step::QueryStandIns => {
            let params = Params { select_mask: ready, select_want: ready, ..params };
            vec![kernel(kernels::query_stand_ins, params, by_tile, Some(1))]
        }
        Step::QueryPairs { tighter } => {
            let flags = params.flags | if tighter { layout::PARAM_TIGHTER } else { 0 };
            vec![kernel(kernels::query_pairs, Params { flags, ..params }, across(params.pair_count), Some(1))]
        }
        Step::QueryNeeded => {
            let flags = params.flags | layout::PARAM_NEEDED;
            query(Params { select_mask: 0, select_want: 0, flags, ..params }, None)
        }
        Step::ClearAttributes => vec![shading(kernels::clear_gbuffer, params)],
        Step::QueryHits => vec![kernel(kernels::hit_demand, params, per_ray, None)],
        Step::Resolve => vec![shading(kernels::resolve, params)],
        Step::Sample | Step::SampleCoarser => {
            let coarser = if step == Step::SampleCoarser { layout::PARAM_COARSER } else { 0 };
            let params = Params { flags: params.flags | coarser, ..params };
            vec![shading(kernels::sample, params)]
        }
        Step::Shade(light) => {
            let sun = if light.sun { layout::PARAM_SUN } else { 0 };
            let sky = if light.sky { layout::PARAM_SKY } else { 0 };
            let emission = if light.emission { layout::PARAM_EMISSION } else { 0 };
            let miss = if light.miss { layout::PARAM_MISS } else { 0 };
            let environment = if light.environment { layout::PARAM_ENVIRONMENT } else { 0 };
            let gloss = if light.gloss { layout::PARAM_EMITTER } else { 0 };
            let flags = params.flags | sun | sky | emission | miss | environment | gloss;
            vec![shading(kernels::shade, Params { flags, ..params })]
        }
        Step::AddLight => vec![shading(kernels::add_light, params)],
        Step::AddOcclusion => vec![shading(kernels::add_occlusion, params)],
        Step::Own(Own { kernel, over, block, phase, stream }) => {
            let groups = match over {
                Over::Rays => per_ray,
                Over::Elements(count) => across(count.div_ceil(64)),
                Over::Groups(count) => across(count),
            };
            let stream = stream.map_or(params.stream, |stream| params.sample.wrapping_add(stream));
            let (params, groups) = (Params { stream, ..params }, Workgroups::Fixed(groups));
            vec![Dispatch { kernel, params, own: block, groups, phase }]
        }
    }
}
