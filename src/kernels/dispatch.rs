//! Which dispatches of which kernels a step consists of.

use super::layout;
use super::layout::Params;
use crate::math::sampling::{cosine_hemisphere, halton};
use crate::schedule::{Lamp, Pass, Query, RomaPart, Sift, Step};
use crate::secondary::df::{LEVELS, flood_steps};
use crate::secondary::dvf::maps::sweep_levels;

/// The directions of the passes that start at hits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Directions {
    /// Occlusion rays a pixel and sample.
    pub occlusion: u32,
    /// Their length, device units.
    pub occlusion_length: f32,
    /// Diffuse rays a pixel and sample.
    pub diffuse: u32,
    /// Greatest random turn about the normal, radians.
    pub turn: f32,
    /// Every pixel has directions of its own, all over the hemisphere: what filters over pixels and frames needs.
    pub scatter: bool,
    /// What surfaces reflect otherwise than diffusely comes by rays of its own, too.
    pub glossy: bool,
    /// Diffuse rays bring the environment's light as well as rays to it.
    pub shares: bool,
}

/// Direction `index` about z of passes that start at hits, before it is turned or scattered.
pub fn direction_around(index: u32) -> [f32; 3] {
    // The first point of the sequence is a corner of the square.
    cosine_hemisphere([halton(index + 1, 0), halton(index + 1, 1)])
}

impl Directions {
    /// The parameters of `pass`.
    fn params(&self, pass: Pass, params: &Params) -> Params {
        // Every kind of pass takes random numbers of its own. Those of a sun alone depend on the sample only.
        let (stream, direction) = match pass {
            Pass::Primary | Pass::Shadow(Lamp::Sun) => (0, None),
            Pass::Shadow(Lamp::Emitter) => (1, None),
            Pass::BounceShadow(Lamp::Sun) => (2, None),
            Pass::BounceShadow(Lamp::Emitter) => (3, None),
            Pass::Shadow(Lamp::Environment) => (6, None),
            Pass::BounceShadow(Lamp::Environment) => (7, None),
            Pass::Occlusion(index) => (4, Some((index, self.occlusion))),
            Pass::Diffuse(index) => (5, Some((index, self.diffuse))),
            Pass::Glossy => (8, None),
        };
        let lamp = match pass {
            Pass::Shadow(lamp) | Pass::BounceShadow(lamp) => Some(lamp),
            _ => None,
        };
        let flag = |set: bool, flag: u32| if set { flag } else { 0 };
        let mut params = Params {
            flags: params.flags
                | flag(pass.is_any_hit(), layout::PARAM_ANY_HIT)
                | flag(lamp == Some(Lamp::Emitter), layout::PARAM_EMITTER)
                | flag(lamp == Some(Lamp::Environment), layout::PARAM_ENVIRONMENT)
                | flag(pass.set() == 2, layout::PARAM_BOUNCE)
                | flag(self.glossy, layout::PARAM_GLOSSY),
            stream: params.sample.wrapping_add(stream << 24),
            length: self.occlusion_length,
            ..*params
        };
        if self.shares {
            params.diffuse_count = self.diffuse as f32;
        }
        if let Some((index, count)) = direction {
            let [x, y, z] = direction_around(index);
            params.around = [x, y, z, if self.scatter { std::f32::consts::TAU } else { self.turn }];
            params.flags |= flag(self.scatter, layout::PARAM_SCATTER);
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

/// What group 3 of a dispatch is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Third {
    /// Tiles of rays and their lists.
    Tiles,
    /// What shading the set before the pass's needs.
    Shading,
    /// What texture lookups for the set before the pass's need.
    Sampling,
    /// What shading the set before the pass's needs, with group 2 the occupancy maps.
    Roma,
    /// The same with group 2 the distance fields.
    Field,
    /// The same with group 2 a field of visibility.
    Dvf,
    /// What shading the set before the pass's needs, with group 2 the lamps and the reflective shadow maps.
    Rsm,
}

/// One dispatch of a kernel.
pub struct Dispatch {
    /// The kernel's pipeline.
    pub kernel: &'static str,
    /// Its parameters.
    pub params: Params,
    /// Its workgroups.
    pub groups: Workgroups,
    /// Whether group 2 is the cache; else it is the lamps of kernels that shade, the maps or fields of those over such,
    /// and nothing of others.
    pub cache: bool,
    /// What group 3 is.
    pub third: Third,
    /// Phase of the schedule that its time counts for, from 0.
    pub phase: Option<usize>,
}

/// Leaves of the longest list that a tile's rays are intersected with; longer ones cost more than the walk of the top
/// level that they save (ARCHITECTURE.md, "What a list costs"). Camera rays of a tile agree on what is near and stop
/// there, others do not.
fn list_most(pass: Pass) -> u32 {
    if pass == Pass::Primary { 128 } else { 12 }
}

/// The kernel that counts, from zero, how many rays of each tile see each leaf.
pub const COUNT_PAIRS: &str = "count_pairs";

/// Whether pairs are culled after `step`, given whether they were before it: from [`Step::CullPairs`] on to the end of
/// the pass. Other passes begin with one of the steps that end it.
pub fn are_pairs_culled(step: Step, before: bool, threshold: u32) -> bool {
    match step {
        Step::CullPairs { .. } => threshold > 0,
        Step::Lists | Step::ShortLists | Step::CountRays => false,
        _ => before,
    }
}

/// The kernel that traverses binary trees.
pub const INTERSECT_BINARY: &str = "intersect_binary";

/// The kernel that makes ray-aligned occupancy maps.
pub const ROMA_ROTATE: &str = "roma_rotate";
/// The kernel that ends rays before they are traced exactly.
pub const ROMA_PILOTS: &str = "roma_pilots";
/// The kernel that traces them.
pub const ROMA_TRACE: &str = "roma_trace";
/// The kernel that draws and traces them.
pub const ROMA_DRAW: &str = "roma_draw";
/// The kernel that counts what they get wrong.
pub const ROMA_MEASURE: &str = "roma_measure";
/// The kernel that writes reflective shadow maps.
pub const RSM_WRITE: &str = "rsm_write";
/// The kernel that lights what ROMA met by them.
pub const RSM_LIGHT: &str = "rsm_light";

/// Which random numbers the look-ups of reflective shadow maps take.
const RSM_STREAM: u32 = 10 << 24;

/// The kernel that finds the occupied cells of a distance field.
pub const FLOOD_SEEDS: &str = "flood_seeds";
/// The kernel that finds the nearest of them.
pub const JUMP_FLOOD: &str = "jump_flood";
/// The kernel that makes distances of these.
pub const FLOOD_DISTANCES: &str = "flood_distances";
/// The kernel that makes a level of half as many cells.
pub const HALVE_DISTANCES: &str = "halve_distances";
/// The kernel that traces distance fields.
pub const FIELD_TRACE: &str = "field_trace";
/// All kernels over distance fields.
pub const FIELD_KERNELS: [&str; 5] = [FLOOD_SEEDS, JUMP_FLOOD, FLOOD_DISTANCES, HALVE_DISTANCES, FIELD_TRACE];

/// The kernel of areas of triangles.
pub const DVF_AREAS: &str = "dvf_areas";
/// The kernel of numbers of points on triangles.
pub const DVF_COUNTS: &str = "dvf_counts";
/// The kernel that sums blocks.
pub const DVF_UP: &str = "dvf_up";
/// The kernel that hands sums down.
pub const DVF_DOWN: &str = "dvf_down";
/// The kernel that makes rays of points.
pub const DVF_RAYS: &str = "dvf_rays";
/// The kernel that enters what they met.
pub const DVF_WRITE: &str = "dvf_write";
/// The kernel that widens masks.
pub const DVF_DILATE: &str = "dvf_dilate";
/// The kernel that labels cells.
pub const DVF_LABELS: &str = "dvf_labels";
/// The kernel that makes rays as the paper has them.
pub const DVF_COSINE: &str = "dvf_cosine";
/// The kernel that answers rays by a field.
pub const DVF_SIFT: &str = "dvf_sift";
/// The kernel that counts primary hits in cells.
pub const DVF_SEEN: &str = "dvf_seen";
/// The kernel that finds points in cells that are made anew.
pub const DVF_POINTS: &str = "dvf_points";
/// All kernels over fields of visibility.
pub const DVF_KERNELS: [&str; 12] = [
    DVF_AREAS, DVF_COUNTS, DVF_UP, DVF_DOWN, DVF_RAYS, DVF_WRITE, DVF_DILATE, DVF_LABELS, DVF_COSINE, DVF_SIFT,
    DVF_SEEN, DVF_POINTS,
];

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
    let dispatch = |kernel: &'static str, params, groups, phase| {
        let cache = kernel.starts_with("intersect");
        Dispatch { kernel, params, groups, cache, third: Third::Tiles, phase }
    };
    let kernel = |kernel, params, groups, phase| dispatch(kernel, params, Workgroups::Fixed(groups), phase);
    let shading = |kernel, params, cache| {
        let groups = Workgroups::Fixed(per_ray);
        Dispatch { kernel, params, groups, cache, third: Third::Shading, phase: None }
    };
    let roma = |kernel, params, groups, phase| {
        let groups = Workgroups::Fixed(groups);
        Dispatch { kernel, params, groups, cache: false, third: Third::Roma, phase: Some(phase) }
    };
    let list = |params, phase| dispatch("intersect_list", params, Workgroups::Chosen, Some(phase));
    let choose = |params, phase| kernel("tile_choose", params, [1, 1], phase);
    let intersect = |mask, want, from_root, phase| {
        let params = Params { select_mask: mask, select_want: want, ..params };
        vec![
            kernel("tile_select_intersect", params, per_tile, Some(phase)),
            choose(params, Some(phase)),
            list(params, phase),
            dispatch(from_root, params, Workgroups::Rooted, Some(phase)),
        ]
    };
    let select_single = |mask, want, phase| {
        let params = Params { select_mask: mask, select_want: want, run_count: 1, ..params };
        vec![kernel("tile_select_intersect", params, per_tile, Some(phase)), choose(params, Some(phase))]
    };
    let query = |params: Params, phase| {
        vec![
            kernel("tile_select", params, per_tile, phase),
            choose(params, phase),
            dispatch("query", params, Workgroups::Chosen, phase),
            dispatch("query_from_root", params, Workgroups::Rooted, phase),
            kernel("query_reduce", params, per_tile, phase),
        ]
    };
    let bounds = |phase| kernel("tile_bounds", params, across(params.tiles), phase);
    let resident = layout::STATE_GEOMETRY;
    let not_done = layout::STATE_GEOMETRY | layout::STATE_DONE;
    let unprocessed = |undone: bool| if undone { layout::STATE_DONE } else { not_done };
    match step {
        Step::Generate if pass == Pass::Primary => vec![kernel("generate_primary", params, per_ray, None)],
        Step::Generate => {
            let kernel = match pass {
                Pass::Occlusion(_) => "generate_occlusion",
                Pass::Diffuse(_) => "generate_diffuse",
                Pass::Glossy => "generate_glossy",
                Pass::Primary | Pass::Shadow(_) | Pass::BounceShadow(_) => "generate_shadow",
            };
            vec![shading(kernel, params, false)]
        }
        Step::StartHits => vec![kernel("start_hits", params, per_ray, None)],
        Step::CountRays => vec![bounds(None)],
        Step::Lists | Step::ShortLists => {
            let is_short = step == Step::ShortLists;
            let most = if is_short { params.list_most.min(list_most(pass)) } else { u32::MAX };
            let params = Params { list_most: most, ..params };
            vec![
                bounds(Some(1)),
                kernel("tile_walk_count", params, per_tile, Some(1)),
                kernel("tile_scan", params, [1, 1], Some(1)),
                kernel("tile_walk_write", params, per_tile, Some(1)),
            ]
        }
        Step::IntersectResident => {
            let from_root = if everything { "intersect_from_root_all" } else { "intersect_from_root" };
            intersect(not_done, resident, from_root, 0)
        }
        Step::IntersectBatch => intersect(layout::STATE_BATCH, layout::STATE_BATCH, "intersect_from_root", 2),
        Step::SelectResident => select_single(not_done, resident, 0),
        Step::SelectBatch => select_single(layout::STATE_BATCH, layout::STATE_BATCH, 2),
        Step::IntersectOne { leaf, is_batch } => {
            vec![list(Params { run_first: leaf, run_count: 1, ..params }, if is_batch { 2 } else { 0 })]
        }
        Step::SortByNumber => vec![kernel("tile_sort_number", params, per_tile, Some(1))],
        Step::SortNodesNear => vec![kernel("tile_sort_near", params, per_tile, Some(1))],
        Step::IntersectAll => vec![kernel("intersect_all", params, by_tile, Some(0))],
        Step::IntersectBinary => vec![kernel(INTERSECT_BINARY, params, by_tile, Some(0))],
        Step::IntersectAllResident => {
            let params = Params { select_mask: not_done, select_want: resident, ..params };
            vec![kernel(if everything { "intersect_all" } else { "intersect_selected" }, params, by_tile, Some(0))]
        }
        Step::IntersectAllBatch => {
            let params = Params { select_mask: layout::STATE_BATCH, select_want: layout::STATE_BATCH, ..params };
            vec![kernel("intersect_selected", params, by_tile, Some(2))]
        }
        Step::CullPairs { .. } if params.threshold == 0 => Vec::new(),
        Step::CullPairs { undone } => {
            let params = Params { select_mask: unprocessed(undone), select_want: 0, ..params };
            vec![kernel(COUNT_PAIRS, params, by_tile, Some(1))]
        }
        Step::Query(Query { from_root, undone, up_to_next }) => {
            let flags = params.flags | if up_to_next { layout::PARAM_NEXT } else { 0 };
            let params = Params { select_mask: unprocessed(undone), select_want: 0, flags, ..params };
            if from_root { vec![kernel("query_all", params, by_tile, Some(1))] } else { query(params, Some(1)) }
        }
        Step::QueryPairs { tighter } => {
            let flags = params.flags | if tighter { layout::PARAM_TIGHTER } else { 0 };
            vec![kernel("query_pairs", Params { flags, ..params }, across(params.pair_count), Some(1))]
        }
        Step::QueryNeeded => {
            let flags = params.flags | layout::PARAM_NEEDED;
            query(Params { select_mask: 0, select_want: 0, flags, ..params }, None)
        }
        Step::ClearAttributes => vec![shading("clear_gbuffer", params, false)],
        Step::QueryHits => vec![kernel("hit_demand", params, per_ray, None)],
        Step::Resolve => vec![shading("resolve", params, true)],
        Step::Sample | Step::SampleCoarser => {
            let coarser = if step == Step::SampleCoarser { layout::PARAM_COARSER } else { 0 };
            let params = Params { flags: params.flags | coarser, ..params };
            vec![Dispatch { third: Third::Sampling, ..shading("sample", params, true) }]
        }
        Step::Shade(light) => {
            let sun = if light.sun { layout::PARAM_SUN } else { 0 };
            let sky = if light.sky { layout::PARAM_SKY } else { 0 };
            let emission = if light.emission { layout::PARAM_EMISSION } else { 0 };
            let miss = if light.miss { layout::PARAM_MISS } else { 0 };
            let environment = if light.environment { layout::PARAM_ENVIRONMENT } else { 0 };
            let gloss = if light.gloss { layout::PARAM_EMITTER } else { 0 };
            let flags = params.flags | sun | sky | emission | miss | environment | gloss;
            vec![shading("shade", Params { flags, ..params }, false)]
        }
        Step::AddLight => vec![shading("add_light", params, false)],
        Step::AddOcclusion => vec![shading("add_occlusion", params, false)],
        Step::RomaRotate => {
            let columns = params.roma_levels * params.roma_k * params.roma_k * params.roma_size * params.roma_size;
            vec![roma(ROMA_ROTATE, params, across(columns.div_ceil(64)), 0)]
        }
        Step::RomaPilots { one_in } => {
            let roma_part = layout::ROMA_CORRECT;
            let params = Params { roma_part, roma_pilots: one_in, ..params };
            vec![roma(ROMA_PILOTS, params, per_ray, 0)]
        }
        Step::RomaTrace { steps, part } => {
            let (roma_part, Sift { near, pilots }) = match part {
                RomaPart::Whole | RomaPart::Cosine => (layout::ROMA_WHOLE, Sift::default()),
                RomaPart::Far => (layout::ROMA_FAR, Sift::default()),
                RomaPart::Sift(sift) => (layout::ROMA_SIFT, sift),
                RomaPart::Correct { one_in } => (layout::ROMA_CORRECT, Sift { near: None, pilots: one_in }),
            };
            let roma_near = near.unwrap_or(layout::NONE);
            let params = Params { roma_steps: steps, roma_part, roma_near, roma_pilots: pilots, ..params };
            let kernel = if part == RomaPart::Cosine { ROMA_DRAW } else { ROMA_TRACE };
            vec![roma(kernel, params, per_ray, 2)]
        }
        Step::RomaMeasure { steps, pilots, cell } => {
            let params = Params { roma_steps: steps, roma_pilots: pilots, roma_near: cell, ..params };
            vec![roma(ROMA_MEASURE, params, per_ray, 2)]
        }
        Step::FieldMake => (0..params.field_levels).flat_map(|level| make_field(&params, level)).collect(),
        Step::FieldTrace { steps } => {
            vec![field(FIELD_TRACE, Params { field_steps: steps, ..params }, per_ray, 2)]
        }
        Step::DvfAreas { triangles } => {
            let mut all = vec![dvf(DVF_AREAS, params, across(triangles.div_ceil(64)))];
            all.extend(sweep(&params, triangles, false));
            all
        }
        Step::DvfCounts { triangles } => {
            let mut all = vec![dvf(DVF_COUNTS, params, across(triangles.div_ceil(64)))];
            all.extend(sweep(&params, triangles, true));
            all
        }
        Step::DvfRays { first, turn, waiting } => {
            let dvf_next = waiting.unwrap_or(layout::NONE);
            vec![dvf(DVF_RAYS, Params { dvf_first: first, dvf_turn: turn, dvf_next, ..params }, per_ray)]
        }
        Step::DvfWrite { waiting, enters } => {
            let dvf_next = waiting.unwrap_or(layout::NONE);
            vec![dvf(DVF_WRITE, Params { dvf_next, dvf_count: enters.into(), ..params }, per_ray)]
        }
        Step::DvfFinish { cells, dilate } => {
            let widened = dilate.then(|| dvf(DVF_DILATE, params, across((2 * cells).div_ceil(64))));
            widened.into_iter().chain([dvf(DVF_LABELS, params, across(cells.div_ceil(64)))]).collect()
        }
        Step::DvfCosine => {
            let [x, y, z] = direction_around(params.sample);
            vec![dvf(DVF_COSINE, Params { around: [x, y, z, 0.0], ..params }, per_ray)]
        }
        Step::DvfLight => vec![shading("dvf_light", params, false)],
        Step::DvfSift => vec![dvf(DVF_SIFT, params, per_ray)],
        Step::DvfSeen => vec![dvf(DVF_SEEN, params, per_ray)],
        Step::DvfPoints { first, count } => {
            let params = Params { dvf_first: first, dvf_count: count, ..params };
            vec![dvf(DVF_POINTS, params, across(count.div_ceil(64)))]
        }
        Step::RsmWrite { map, corner: [x, y] } => {
            let params = Params { rsm_map: map, rsm_x: x, rsm_y: y, ..params };
            vec![Dispatch { third: Third::Rsm, ..shading(RSM_WRITE, params, false) }]
        }
        Step::RsmLight => {
            let params = Params { stream: params.sample.wrapping_add(RSM_STREAM), ..params };
            vec![Dispatch { third: Third::Rsm, phase: Some(2), ..shading(RSM_LIGHT, params, false) }]
        }
    }
}

/// A dispatch of a kernel over distance fields.
fn field(kernel: &'static str, params: Params, groups: [u32; 2], phase: usize) -> Dispatch {
    let groups = Workgroups::Fixed(groups);
    Dispatch { kernel, params, groups, cache: false, third: Third::Field, phase: Some(phase) }
}

/// A dispatch of a kernel over a field of visibility.
fn dvf(kernel: &'static str, params: Params, groups: [u32; 2]) -> Dispatch {
    let groups = Workgroups::Fixed(groups);
    Dispatch { kernel, params, groups, cache: false, third: Third::Dvf, phase: None }
}

/// The dispatches that sum `count` elements, and with `is_down` make each the sum of those before it; the sum of all is
/// left in the last level.
fn sweep(params: &Params, count: u32, is_down: bool) -> Vec<Dispatch> {
    let levels = sweep_levels(count);
    let of = |kernel, level: usize, next: u32| {
        let (first, count) = levels[level];
        let params = Params { dvf_first: first, dvf_count: count, dvf_next: next, ..*params };
        dvf(kernel, params, across(count.div_ceil(layout::DVF_WALK)))
    };
    let last = levels.len() - 1;
    let up = (0..last).map(|level| of(DVF_UP, level, levels[level + 1].0));
    // Of the one block below the sum of all nothing comes before.
    let next = |level: usize| if level + 1 == last { layout::NONE } else { levels[level + 1].0 };
    let down = (0..last).rev().filter(|_| is_down).map(|level| of(DVF_DOWN, level, next(level)));
    up.chain(down).collect()
}

/// The dispatches that make field `level`.
fn make_field(params: &Params, level: u32) -> Vec<Dispatch> {
    let params = Params { field_level: level, ..*params };
    let cells = |mip: u32| (params.field_cells >> mip).pow(3);
    // A thread a cell, or two cells.
    let each = |count: u32| across(count.div_ceil(64));
    let mut all = vec![field(FLOOD_SEEDS, params, each(cells(0)), 0)];
    let mut half = 0;
    for step in flood_steps(params.field_cells) {
        let params = Params { field_step: step, field_half: half, ..params };
        all.push(field(JUMP_FLOOD, params, each(cells(0)), 0));
        half = 1 - half;
    }
    all.push(field(FLOOD_DISTANCES, Params { field_half: half, ..params }, each(cells(0) / 2), 0));
    for mip in 1..LEVELS as u32 {
        all.push(field(HALVE_DISTANCES, Params { field_mip: mip, ..params }, each(cells(mip) / 2), 0));
    }
    all
}
