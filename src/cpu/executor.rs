//! The CPU executor: runs the kernels that a step consists of one after the other, each over all rays or tiles in
//! parallel.

use super::cache::{BrickCache, Shared};
use crate::kernels::bound::{Bound, Counters, Demand, Scene};
use crate::kernels::dispatch::{
    COUNT_PAIRS, DVF_COSINE, DVF_KERNELS, DVF_POINTS, DVF_RAYS, DVF_SEEN, DVF_SIFT, DVF_WRITE, Dispatch, FIELD_KERNELS,
    FIELD_TRACE, INTERSECT_BINARY, ROMA_DRAW, ROMA_MEASURE, ROMA_PILOTS, ROMA_ROTATE, ROMA_TRACE, RSM_LIGHT, RSM_WRITE,
    are_pairs_culled, dispatches,
};
use crate::kernels::layout;
use crate::kernels::layout::Params;
use crate::kernels::query::query::query;
use crate::kernels::query::query_all::{count_pairs, query_all};
use crate::kernels::query::query_pairs::query_pairs;
use crate::kernels::query::tile_bounds::tile_bounds;
use crate::kernels::query::tile_lists::{TileLists, query_reduce, tile_choose, tile_scan, tile_select, tile_sort};
use crate::kernels::query::tile_walk::{tile_walk_count, tile_walk_write};
use crate::kernels::rays::{RaySet, Work};
use crate::kernels::shade::generate::{
    generate_diffuse, generate_glossy, generate_occlusion, generate_primary, generate_shadow, start_hits,
};
use crate::kernels::shade::lamps::LampTables;
use crate::kernels::shade::resolve::{AttributeView, resolve};
use crate::kernels::shade::shade::{Pixels, add_light, add_occlusion, clear_gbuffer, dvf_light, hit_demand, shade};
use crate::kernels::simd::isa::Best;
use crate::kernels::texture::sample::{Sampling, Texels, TileDemand, sample};
use crate::kernels::trace::intersect_all::intersect_all;
use crate::kernels::trace::intersect_binary::{BinaryTrees, intersect_binary};
use crate::kernels::trace::intersect_list::intersect_list;
use crate::kernels::{
    DeviceInfo, Directions, Extent, FrameExecutor, Keep, Lamps, Setup, Tuning, View, opacity, padded, report, textures,
};
use crate::schedule::{BrickStates, Executor, ExecutorError, Load, PairQuery, Pass, Report, Step};
#[cfg(test)]
use crate::secondary::df::DistanceField;
use crate::secondary::df::maps::FieldMaps;
use crate::secondary::df::twin::{FieldTables, field_trace, make_field};
use crate::secondary::dvf::maps::DvfMaps;
use crate::secondary::dvf::twin as dvf;
use crate::secondary::dvf::twin::DvfTables;
use crate::secondary::occupancy::{Cascades, clearance};
use crate::secondary::roma::cosine::roma_draw;
use crate::secondary::roma::maps::RomaMaps;
use crate::secondary::roma::twin::{RomaTables, roma_measure, roma_pilots, roma_rotate, roma_trace};
use crate::secondary::rsm::maps::RsmMaps;
use crate::secondary::rsm::twin::{RsmTables, rsm_light, rsm_write};
use crate::stream::{PayloadSource, WorkerPool, Workers};
use bricks::SceneFile;
use rayon::prelude::*;
use std::sync::Arc;
#[cfg(test)]
use std::sync::atomic::Ordering;
use std::time::Instant;

/// Bytes of a page of the cache: offsets within one are u32. Pages are numbers here, no memory.
const PAGE_BYTES: u64 = 1 << 30;

/// What kernels write.
struct Buffers {
    /// Rays by their set ([`Pass::set`]).
    sets: [RaySet; 3],
    pixels: Pixels,
    tiles: TileLists,
    roma: RomaTables,
    field: FieldTables,
    rsm: RsmTables,
    dvf: DvfTables,
}

/// Renders one scene on the processor.
pub struct CpuExecutor {
    file: Arc<SceneFile>,
    workers: Workers<Shared>,
    cache: BrickCache,
    scene: Scene,
    texels: Texels,
    /// [`crate::kernels::opacity::table`].
    opacity: Vec<[u32; 4]>,
    lamps: LampTables,
    buffers: Buffers,
    binary: Option<BinaryTrees>,
    extent: Extent,
    view: Params,
    directions: Directions,
    tuning: Tuning,
    pairs_are_culled: bool,
    count: bool,
    /// Whether textures are looked up; beside this, kernels decide as they run.
    samples: bool,
    isa: Best,
}

impl CpuExecutor {
    /// Largest number of bytes of one page of the cache.
    pub const PAGE_BYTES: u64 = PAGE_BYTES;

    /// Sets up buffers; nothing is resident.
    ///
    /// # Errors
    /// Textures that cannot be read.
    pub fn new(file: Arc<SceneFile>, workers: Workers<Shared>, setup: Setup) -> Result<Self, ExecutorError> {
        let Setup { extent, count, keep, .. } = setup;
        let rays = extent.rays();
        let sets = [RaySet::new(rays), RaySet::new(rays), RaySet::new(0)];
        let tiles = TileLists::new(extent.tiles() as usize);
        Ok(Self {
            cache: BrickCache::new(file.sizes().rows()),
            scene: Scene::new(file.resident()),
            samples: keep.textures || !file.resident().textures.is_empty(),
            texels: Texels::new(&file)?,
            opacity: opacity::table(&file).map_err(|error| ExecutorError::Device(format!("failed: {error}")))?,
            lamps: LampTables::default(),
            buffers: Buffers {
                sets,
                pixels: Pixels::new(rays),
                tiles,
                roma: RomaTables::default(),
                field: FieldTables::default(),
                rsm: RsmTables::default(),
                dvf: DvfTables::default(),
            },
            binary: None,
            extent,
            view: Params::default(),
            directions: Directions::default(),
            tuning: Tuning::new(&setup),
            pairs_are_culled: false,
            count,
            isa: Best::detect(),
            file,
            workers,
        })
    }

    /// The parameters of all dispatches of a submission.
    fn params(&self) -> Params {
        let extent = self.extent;
        let params = self.buffers.field.maps.params(self.buffers.roma.maps.params(Params {
            zero: 0,
            width: extent.width,
            height: extent.height,
            tile: extent.tile,
            tiles_x: extent.tiles_x(),
            tiles: extent.tiles(),
            // Lists grow as they are placed.
            list_capacity: u32::MAX,
            threshold: self.tuning.threshold,
            list_most: self.tuning.list_most,
            pair_count: self.buffers.tiles.pairs.len() as u32,
            top_count: self.scene.top2.len() as u32,
            instance_pad: self.scene.instance_pad,
            ..self.view
        }));
        Params { rsm_maps: self.buffers.rsm.maps.maps.len() as u32, ..params }
    }

    /// The G-buffer of the hits of a set, for tests.
    #[cfg(test)]
    pub(crate) fn gbuffer_of(&mut self, set: usize) -> &mut Vec<layout::GBuffer> {
        &mut self.buffers.pixels.gbuffers[set]
    }

    /// The columns of the ray-aligned maps that were made last, for tests.
    #[cfg(test)]
    pub(crate) fn columns(&self) -> &[u32] {
        &self.buffers.roma.columns
    }

    /// The distance fields that were made last, for tests.
    #[cfg(test)]
    pub(crate) fn fields(&self) -> &[DistanceField] {
        &self.buffers.field.fields
    }

    /// The texels of reflective shadow maps, for tests.
    #[cfg(test)]
    pub(crate) fn rsm_texels(&mut self) -> &mut Vec<layout::RsmTexel> {
        &mut self.buffers.rsm.texels
    }

    /// The bits of rays that wait for bricks, for tests.
    #[cfg(test)]
    pub(crate) fn dvf_waiting(&self) -> Vec<u32> {
        self.buffers.dvf.waiting.iter().map(|word| word.load(Ordering::Relaxed)).collect()
    }

    /// The tiles and their lists, for tests.
    #[cfg(test)]
    pub(crate) fn tiles(&self) -> &TileLists {
        &self.buffers.tiles
    }
}

/// Runs one kernel by its name.
fn run_kernel(
    dispatch: &Dispatch,
    pass: Pass,
    bound: &Bound,
    buffers: &mut Buffers,
    attributes: &[AttributeView],
    (sampling, tile_demand): (Sampling, &[TileDemand]),
    binary: Option<&BinaryTrees>,
) -> Result<(), ExecutorError> {
    let Buffers { sets, pixels, tiles, roma, field, rsm, dvf: visibility } = buffers;
    // The set of the pass, and the one before it, whose hits are shaded.
    let shaded = pass.set().saturating_sub(1);
    let (before, from) = sets.split_at_mut(pass.set());
    let own = &mut from[0];
    let none = RaySet::default();
    let seen = before.last().unwrap_or(&none);
    let materials = &sampling.texels.materials;
    match dispatch.kernel {
        "generate_primary" => generate_primary(bound, own),
        "generate_shadow" => generate_shadow(bound, own, seen, &pixels.throughput),
        "generate_occlusion" => generate_occlusion(bound, own, seen, &pixels.gbuffers[shaded]),
        "generate_diffuse" => generate_diffuse(bound, own, seen, pixels, materials),
        "generate_glossy" => generate_glossy(bound, own, seen, pixels, materials),
        "start_hits" => start_hits(own),
        "clear_gbuffer" => clear_gbuffer(bound, pixels, shaded),
        "hit_demand" => hit_demand(bound, own),
        "resolve" => {
            resolve(bound, seen, &mut pixels.gbuffers[shaded], materials, attributes);
        }
        "sample" => sample(bound, &mut pixels.gbuffers[shaded], sampling, tile_demand),
        "shade" => shade(bound, pixels, shaded, seen, materials),
        "add_light" => add_light(bound, pixels, shaded, (seen, own), materials),
        "add_occlusion" => add_occlusion(bound, pixels, shaded, (seen, own), materials),
        "tile_bounds" => tile_bounds(bound, own, &mut tiles.bounds),
        "tile_walk_count" => tile_walk_count(bound, tiles),
        "tile_scan" => tile_scan(bound, tiles)?,
        "tile_walk_write" => tile_walk_write(bound, tiles),
        "tile_select" => tile_select::<false>(bound, tiles),
        "tile_select_intersect" => tile_select::<true>(bound, tiles),
        "tile_choose" => tile_choose(tiles),
        "tile_sort_number" => tile_sort::<false>(bound, tiles),
        "tile_sort_near" => tile_sort::<true>(bound, tiles),
        "query" => query(bound, own, tiles),
        "query_reduce" => query_reduce(bound, tiles),
        "query_from_root" => query_all(bound, own, Work::Rooted(tiles), &tiles.pair_counts),
        "query_all" => query_all(bound, own, Work::All, &tiles.pair_counts),
        COUNT_PAIRS => {
            tiles.pair_counts.start(bound.params.tiles, bound.scene.leaves.len())?;
            count_pairs(bound, own, &tiles.pair_counts);
        }
        "query_pairs" => query_pairs(bound, own, tiles),
        "intersect_list" => intersect_list(bound, own, tiles),
        "intersect_from_root" => intersect_all::<true>(bound, own, Work::Rooted(tiles), &tiles.pair_counts),
        "intersect_from_root_all" => intersect_all::<false>(bound, own, Work::Rooted(tiles), &tiles.pair_counts),
        "intersect_selected" => intersect_all::<true>(bound, own, Work::All, &tiles.pair_counts),
        "intersect_all" => intersect_all::<false>(bound, own, Work::All, &tiles.pair_counts),
        ROMA_ROTATE => roma_rotate(bound, roma),
        ROMA_PILOTS => roma_pilots(bound, roma, own),
        ROMA_TRACE => roma_trace(bound, roma, own, seen),
        ROMA_DRAW => roma_draw(bound, roma, own, seen, (pixels, shaded)),
        ROMA_MEASURE => roma_measure(bound, roma, own, seen),
        FIELD_TRACE => field_trace(bound, field, own, seen),
        making if FIELD_KERNELS.contains(&making) => make_field(making, bound, field),
        RSM_WRITE => rsm_write(bound, rsm, pixels, seen, materials),
        RSM_LIGHT => rsm_light(bound, rsm, pixels, seen),
        DVF_COSINE => dvf::cosine(bound, visibility, own, seen, &pixels.gbuffers[shaded]),
        DVF_SEEN => dvf::seen(bound, visibility, seen),
        DVF_POINTS => dvf::points(bound, visibility),
        DVF_RAYS => dvf::rays(bound, visibility, own),
        DVF_WRITE => dvf::write(bound, visibility, own),
        DVF_SIFT => dvf::sift(bound, visibility, own, &mut pixels.gbuffers[shaded]),
        "dvf_light" => dvf_light(bound, pixels, shaded, (seen, own), materials),
        making if DVF_KERNELS.contains(&making) => dvf::make(making, bound, visibility),
        INTERSECT_BINARY => match binary {
            Some(trees) => intersect_binary(bound, own, trees),
            None => return Err(ExecutorError::Device("has no binary trees; this is a defect".into())),
        },
        other => return Err(ExecutorError::Device(format!("has no kernel {other}; this is a defect"))),
    }
    Ok(())
}

impl Executor for CpuExecutor {
    fn load(&mut self, loads: &[Load]) -> Result<(), ExecutorError> {
        self.cache.load(&self.file, &self.workers, loads)
    }

    fn set_lists(&mut self, lists: &[Vec<u32>]) -> Result<(), ExecutorError> {
        let tiles = &mut self.buffers.tiles;
        tiles.make_room(lists.iter().map(|list| list.len() as u64).sum())?;
        tiles.set(lists);
        Ok(())
    }

    fn set_pairs(&mut self, queries: &[PairQuery], nodes: &[u32]) -> Result<(), ExecutorError> {
        let tiles = &mut self.buffers.tiles;
        let mut first = 0;
        tiles.pairs.clear();
        for PairQuery { x: [x0, x1], y: [y0, y1], nodes: count } in queries.iter().copied() {
            tiles.pairs.push(layout::Pair { x0, y0, x1, y1, first, count, ..Default::default() });
            first += count;
        }
        tiles.pair_nodes = nodes.to_vec();
        Ok(())
    }

    fn run(&mut self, pass: Pass, steps: &[Step], bricks: &BrickStates) -> Result<Report, ExecutorError> {
        let params = self.params();
        let resident = self.file.resident();
        let needs_all = steps.iter().any(|step| matches!(step, Step::IntersectAll | Step::IntersectBinary));
        let geometry = self.cache.geometry(resident, bricks, needs_all, &self.opacity)?;
        let attributes = match steps.contains(&Step::Resolve) {
            true => self.cache.attributes(resident, bricks)?,
            false => Vec::new(),
        };
        let samples = steps.iter().any(|step| step.is_sampling()) && self.samples;
        let tiles = if samples { self.cache.tiles(bricks)? } else { Vec::new() };
        let tile_demand: Vec<TileDemand> = tiles.iter().map(|_| TileDemand::default()).collect();
        let sampling = Sampling { texels: &self.texels, tiles: &tiles };
        let slots = report::slots(bricks);
        let demand: Vec<Demand> = (0..bricks.len()).map(|_| Demand::default()).collect();
        let counters = Counters::default();
        let mut ms_phases = [0.0; 3];
        let everything = bricks.all_geometry_resident();
        for &step in steps.iter().filter(|step| samples || !step.is_sampling()) {
            self.pairs_are_culled = are_pairs_culled(step, self.pairs_are_culled, self.tuning.threshold);
            let flags = if self.pairs_are_culled { layout::PARAM_CULLED } else { 0 };
            let params = Params { flags, ..params };
            for dispatch in dispatches(pass, step, &params, &self.directions, everything) {
                let start = Instant::now();
                let bound = Bound {
                    params: &dispatch.params,
                    scene: &self.scene,
                    bricks: &geometry,
                    slots: &slots,
                    demand: &demand,
                    counters: &counters,
                    lamps: &self.lamps,
                    count: self.count,
                    isa: self.isa,
                };
                let binary = self.binary.as_ref();
                run_kernel(&dispatch, pass, &bound, &mut self.buffers, &attributes, (sampling, &tile_demand), binary)?;
                if let Some(phase) = dispatch.phase {
                    ms_phases[phase] += start.elapsed().as_secs_f64() * 1e3;
                }
            }
        }
        let demand: Vec<layout::Demand> = demand.iter().map(Demand::get).collect();
        let mut report = Report { ms_phases, ..report::of_counters(&counters.get(), &demand)? };
        report::take_used(&mut report, steps, bricks);
        report.tiles = textures::demand(&tile_demand.iter().map(TileDemand::get).collect::<Vec<_>>());
        if steps.iter().any(|step| matches!(step, Step::QueryPairs { .. })) {
            report.pair_rays = std::mem::take(&mut self.buffers.tiles.pair_rays);
        }
        Ok(report)
    }
}

impl FrameExecutor for CpuExecutor {
    fn device(&self) -> DeviceInfo {
        super::device_info()
    }

    fn page_bytes(&self) -> u64 {
        PAGE_BYTES
    }

    fn texture_bytes(&self) -> u64 {
        self.texels.bytes + self.file.resident().opacity_bytes()
    }

    fn workers(&self) -> &dyn WorkerPool {
        &self.workers
    }

    fn leaves_out(&self) -> Keep {
        Keep { queries: true, textures: true, ..Keep::default() }
    }

    fn allow_bounces(&mut self) {
        self.buffers.sets[2] = RaySet::new(self.extent.rays());
        self.buffers.pixels.allow_bounces();
    }

    fn make_binary(&mut self) -> Result<(), ExecutorError> {
        self.binary = Some(BinaryTrees::new(&self.file)?);
        Ok(())
    }

    fn tuning(&mut self) -> &mut Tuning {
        &mut self.tuning
    }

    fn set_lamps(&mut self, lamps: &Arc<Lamps>) -> Result<(), ExecutorError> {
        self.lamps.set(lamps);
        Ok(())
    }

    fn set_cascades(&mut self, cascades: &Arc<Cascades>) -> Result<(), ExecutorError> {
        let roma = &mut self.buffers.roma;
        if !Arc::ptr_eq(&roma.cascades, cascades) {
            roma.cascades = cascades.clone();
            roma.clearances = cascades.levels.par_iter().map(clearance).collect();
        }
        Ok(())
    }

    fn set_roma(&mut self, maps: &RomaMaps) -> Result<(), ExecutorError> {
        self.buffers.roma.maps = maps.clone();
        Ok(())
    }

    fn set_field(&mut self, field: &FieldMaps) -> Result<(), ExecutorError> {
        self.buffers.field.maps = field.clone();
        Ok(())
    }

    fn set_rsm(&mut self, maps: &RsmMaps) -> Result<(), ExecutorError> {
        self.buffers.rsm.set(maps);
        Ok(())
    }

    fn set_scene(&mut self, scene: &Arc<SceneFile>) {
        self.file = scene.clone();
        self.scene.forget_frame();
    }

    fn set_dvf(&mut self, maps: &DvfMaps) -> Result<(), ExecutorError> {
        self.buffers.dvf.set(maps);
        Ok(())
    }

    fn set_dvf_triangles(&mut self, triangles: &[layout::DvfTriangle], points: u32) -> Result<(), ExecutorError> {
        self.buffers.dvf.set_triangles(triangles, points);
        Ok(())
    }

    fn set_dvf_tally(&mut self, words: &[u32]) -> Result<(), ExecutorError> {
        self.buffers.dvf.set_tally(words);
        Ok(())
    }

    fn read_dvf_tally(&mut self) -> Result<Vec<u32>, ExecutorError> {
        Ok(self.buffers.dvf.tally())
    }

    fn read_dvf(&mut self) -> Result<(Vec<u32>, Vec<u32>), ExecutorError> {
        Ok((self.buffers.dvf.masks(), self.buffers.dvf.labels.clone()))
    }

    fn read_dvf_sums(&mut self) -> Result<Vec<[u32; 2]>, ExecutorError> {
        Ok(self.buffers.dvf.sums.clone())
    }

    fn begin_frame(&mut self, view: &View) {
        self.scene.rebase(self.file.resident(), view.frame);
        self.lamps.rebase(view.frame);
        self.view = view.params;
        self.directions = view.directions;
    }

    fn set_rays(&mut self, pass: Pass, rays: &[layout::Ray]) {
        self.buffers.sets[pass.set()].rays = padded(rays, self.extent.rays());
    }

    fn read_rays(&mut self, pass: Pass) -> Result<Vec<layout::Ray>, ExecutorError> {
        Ok(self.buffers.sets[pass.set()].rays.clone())
    }

    fn read_hits(&mut self, pass: Pass) -> Result<Vec<layout::Hit>, ExecutorError> {
        Ok(self.buffers.sets[pass.set()].hits.clone())
    }

    fn read_surfaces(&mut self, pass: Pass) -> Result<Vec<layout::Surface>, ExecutorError> {
        Ok(self.buffers.sets[pass.set()].surfaces.clone())
    }

    fn read_gbuffer(&mut self) -> Result<Vec<layout::GBuffer>, ExecutorError> {
        Ok(self.buffers.pixels.gbuffers[0].clone())
    }

    fn read_radiance(&mut self) -> Result<Vec<[f32; 4]>, ExecutorError> {
        Ok(self.buffers.pixels.radiance.clone())
    }
}
