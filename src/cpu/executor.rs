//! The CPU executor: runs the kernels that a step consists of one after the other, each over all rays or tiles in
//! parallel.

use super::cache::BrickCache;
use crate::kernels::bound::{Bound, Counters, Demand, Scene};
use crate::kernels::dispatch::{Dispatch, are_pairs_culled, dispatches};
use crate::kernels::lamps::LampTables;
use crate::kernels::layout::{self, Params};
use crate::kernels::payloads::AttributeView;
use crate::kernels::query::stand_ins;
use crate::kernels::query::wanted::intersect_and_query;
use crate::kernels::rays::RaySet;
use crate::kernels::shade::more;
use crate::kernels::shade::shade::Pixels;
use crate::kernels::simd::isa::Best;
use crate::kernels::table::{self, Family, Target, names};
use crate::kernels::texture::texels::{Sampling, Texels, TileDemand};
use crate::kernels::tiles::TileLists;
use crate::kernels::trace::intersect_binary::BinaryTrees;
use crate::kernels::{
    DeviceInfo, Directions, Extent, FrameExecutor, Keep, Lamps, Setup, Tuning, View, opacity, padded, report, textures,
};
use crate::schedule::{BrickStates, Executor, ExecutorError, Load, Own, PairQuery, Pass, Report, Step};
use crate::stream::{PayloadSource, Workers};
use bricks::SceneFile;
use std::any::Any;
use std::sync::Arc;
use std::time::Instant;

/// Bytes of a page of the cache: offsets within one are u32. Pages are numbers here, no memory.
const PAGE_BYTES: u64 = 1 << 30;

/// What kernels write.
struct Buffers {
    /// Rays by their set ([`Pass::set`]).
    sets: [RaySet; 3],
    pixels: Pixels,
    tiles: TileLists,
    families: Vec<FamilyBuffers>,
}

/// The buffers of a secondary method's kernels.
struct FamilyBuffers {
    family: &'static Family,
    words: Vec<Vec<u32>>,
    /// What its method has noted.
    held: Option<Box<dyn Any>>,
}

impl Buffers {
    fn family(&mut self, family: &'static Family) -> &mut FamilyBuffers {
        let index = self.families.iter().position(|own| std::ptr::eq(own.family, family));
        let index = index.unwrap_or_else(|| {
            let words = vec![Vec::new(); family.buffers.len()];
            self.families.push(FamilyBuffers { family, words, held: None });
            self.families.len() - 1
        });
        &mut self.families[index]
    }
}

/// Renders one scene on the processor.
pub struct CpuExecutor {
    file: Arc<SceneFile>,
    workers: Workers,
    cache: BrickCache,
    scene: Scene,
    texels: Texels,
    /// [`crate::kernels::opacity::table`]; empty where every triangle is opaque.
    opacity: Vec<[u32; 4]>,
    lamps: LampTables,
    buffers: Buffers,
    binary: Option<BinaryTrees>,
    extent: Extent,
    /// What of it this frame takes.
    rows: Extent,
    /// The first rows of sets 1 and 2, in which the rays of paths that go on lie; until a pass begins others: all.
    path_rows: Option<Extent>,
    view: Params,
    directions: Directions,
    tuning: Tuning,
    pairs_are_culled: bool,
    count: bool,
    /// [`Setup::flat_bytes`].
    flat_bytes: u64,
    /// Rays that gain from bricks that are flat, but for those that some have been made for.
    rays: u64,
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
    pub fn new(file: Arc<SceneFile>, workers: Workers, setup: Setup) -> Result<Self, ExecutorError> {
        let Setup { extent, count, opaque, keep, flat_bytes, .. } = setup;
        let rays = extent.rays();
        let sets = [RaySet::new(rays), RaySet::new(rays), RaySet::new(0)];
        let tiles = TileLists::new(extent.tiles() as usize);
        let opacity = opacity::table(&file).map_err(|error| ExecutorError::Device(format!("failed: {error}")))?;
        Ok(Self {
            cache: BrickCache::new(file.sizes().rows()),
            scene: Scene::new(file.resident()),
            samples: keep.textures || !file.resident().textures.is_empty(),
            texels: Texels::new(&file)?,
            opacity: if opaque { Vec::new() } else { opacity },
            lamps: LampTables::default(),
            buffers: Buffers {
                sets,
                pixels: Pixels::new(rays, more::is_needed(file.resident())),
                tiles,
                families: Vec::new(),
            },
            binary: None,
            extent,
            rows: extent,
            path_rows: None,
            view: Params::default(),
            directions: Directions::default(),
            tuning: Tuning::new(&setup),
            pairs_are_culled: false,
            count,
            flat_bytes,
            rays: 0,
            isa: Best::detect(),
            file,
            workers,
        })
    }

    /// Makes bricks flat that rays meet, once that pays. Camera rays gain little. Nodes and triangles are counted as
    /// those of packed bricks.
    fn flatten(&mut self, pass: Pass, steps: &[Step]) {
        let gains = pass != Pass::Primary && steps.iter().any(|step| step.is_intersection());
        if gains && self.flat_bytes > 0 && !self.count {
            self.rays += self.rows_of(pass).rays() as u64;
            self.rays -= self.cache.flatten(self.file.resident(), self.rays, self.flat_bytes);
        }
    }

    /// The rows that the rays of a pass lie in.
    fn rows_of(&self, pass: Pass) -> Extent {
        if pass.begins() { self.rows } else { self.path_rows.unwrap_or(self.rows) }
    }

    /// Has paths lie in so many rows.
    fn set_path_rows(&mut self, rows: Option<Extent>) {
        self.path_rows = rows;
        let rays = rows.unwrap_or(self.rows).rays();
        self.buffers.sets[1..].iter_mut().filter(|set| !set.rays.is_empty()).for_each(|set| set.resize(rays));
        self.buffers.pixels.resize_bounces(rays);
    }

    /// The parameters of all dispatches of a submission.
    fn params(&self, extent: Extent) -> Params {
        Params {
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
        }
    }

    /// The G-buffer of the hits of a set, for tests.
    #[cfg(test)]
    pub(crate) fn gbuffer_of(&mut self, set: usize) -> &mut Vec<layout::GBuffer> {
        &mut self.buffers.pixels.gbuffers[set]
    }

    /// What further textures of the hits of a set show, for tests.
    #[cfg(test)]
    pub(crate) fn more_of(&mut self, set: usize) -> &mut Vec<layout::More> {
        &mut self.buffers.pixels.mores[set]
    }

    /// Has the rays of a set such surfaces, for tests.
    #[cfg(test)]
    pub(crate) fn set_surfaces(&mut self, pass: Pass, surfaces: Vec<layout::Surface>) {
        self.buffers.sets[pass.set()].surfaces = surfaces;
    }

    /// The words of a buffer of a family, for tests.
    #[cfg(test)]
    pub(crate) fn words(&mut self, family: &'static Family, buffer: usize) -> &mut Vec<u32> {
        &mut self.buffers.family(family).words[buffer]
    }

    /// The tiles and their lists, for tests.
    #[cfg(test)]
    pub(crate) fn tiles(&self) -> &TileLists {
        &self.buffers.tiles
    }
}

/// Runs the twin of one kernel.
fn run_kernel(
    dispatch: &Dispatch,
    pass: Pass,
    bound: &Bound,
    buffers: &mut Buffers,
    attributes: &[AttributeView],
    (sampling, tile_demand): (Sampling, &[TileDemand]),
    binary: Option<&BinaryTrees>,
) -> Result<(), ExecutorError> {
    let Buffers { sets, pixels, tiles, families } = buffers;
    // The set of the pass, and the one before it, whose hits are shaded.
    let (before, from) = sets.split_at_mut(pass.set());
    let mut none = RaySet::default();
    let family = families.iter_mut().find_map(|own| Some((own.family.kernel(dispatch.kernel)?, &mut own.words[..])));
    let (kernel, buffers) = match (table::kernel(dispatch.kernel), family) {
        (Some(kernel), _) => (kernel, &mut [][..]),
        (None, Some(of_family)) => of_family,
        (None, None) => {
            return Err(ExecutorError::Device(format!(
                "has no kernel {}; this is a bug in brickwalk",
                dispatch.kernel
            )));
        }
    };
    let mut target = Target {
        own: &mut from[0],
        seen: before.last_mut().unwrap_or(&mut none),
        shaded: pass.set().saturating_sub(1),
        pixels,
        tiles,
        materials: &sampling.texels.materials,
        attributes,
        sampling,
        tile_demand,
        binary,
        buffers,
    };
    (kernel.twin)(bound, &mut target)
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

    fn mark_leaves(&mut self, marks: &Arc<[bool]>) {
        self.scene.mark_leaves(marks);
    }

    fn run(&mut self, pass: Pass, steps: &[Step], bricks: &BrickStates) -> Result<Report, ExecutorError> {
        if self.path_rows.is_some() && pass.begins() && pass.set() == 1 {
            self.set_path_rows(None);
        }
        let rows = self.rows_of(pass);
        self.buffers.tiles.resize(rows.tiles() as usize);
        let params = self.params(rows);
        self.flatten(pass, steps);
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
        // Of all steps, in order.
        let mut all = Vec::new();
        for &step in steps.iter().filter(|step| samples || !step.is_sampling()) {
            self.pairs_are_culled = are_pairs_culled(step, self.pairs_are_culled, self.tuning.threshold);
            let flags = if self.pairs_are_culled { layout::PARAM_CULLED } else { 0 };
            let params = Params { flags, ..params };
            let of_step = dispatches(pass, step, &params, &self.directions, everything);
            all.extend(of_step.into_iter().map(|dispatch| (step, dispatch)));
        }
        let all_have = Bound {
            params: &params,
            block: &[0; Own::WORDS],
            scene: &self.scene,
            bricks: &geometry,
            slots: &slots,
            demand: &demand,
            counters: &counters,
            lamps: &self.lamps,
            count: self.count,
            isa: self.isa,
        };
        let mut left = &all[..];
        while let [(step, dispatch), rest @ ..] = left {
            left = rest;
            if !step.leaves_pending() {
                self.buffers.sets.iter_mut().for_each(|set| set.waiting.clear());
            }
            let bound = Bound { params: &dispatch.params, block: &dispatch.own, ..all_have };
            let start = Instant::now();
            let mut asking = 0.0;
            if let [(_, query), rest @ ..] = rest
                && (dispatch.kernel, query.kernel) == (names::intersect_selected, names::query_all)
            {
                left = rest;
                let Buffers { sets, tiles, .. } = &mut self.buffers;
                let of_query = Bound { params: &query.params, ..bound };
                asking = intersect_and_query(&bound, &of_query, &mut sets[pass.set()], &tiles.pair_counts);
            } else {
                let sampling = (sampling, &tile_demand[..]);
                let binary = self.binary.as_ref();
                run_kernel(dispatch, pass, &bound, &mut self.buffers, &attributes, sampling, binary)?;
            }
            let ms = start.elapsed().as_secs_f64() * 1e3;
            if let Some(phase) = dispatch.phase {
                ms_phases[phase] += ms * (1.0 - asking);
                ms_phases[1] += ms * asking;
            }
        }
        let demand: Vec<layout::Demand> = demand.iter().map(Demand::get).collect();
        if self.flat_bytes > 0 {
            self.cache.note_uses(demand.iter().map(|demand| demand.rays > 0));
        }
        let mut report = report::of_counters(&counters.get(), &demand)?;
        report.counters.add_phases(ms_phases);
        report::take_used(&mut report, steps, bricks);
        report.tiles = textures::demand(&tile_demand.iter().map(TileDemand::get).collect::<Vec<_>>());
        if steps.iter().any(|step| matches!(step, Step::QueryPairs { .. })) {
            report.pair_rays = std::mem::take(&mut self.buffers.tiles.pair_rays);
        }
        if steps.contains(&Step::QueryStandIns) {
            report.states = stand_ins::states(&self.buffers.sets[pass.set()]);
        }
        if steps.contains(&Step::MovePaths { compact: true }) {
            self.set_path_rows(Some(rows.first(Some(report.paths as usize))));
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

    fn workers(&self) -> &Workers {
        &self.workers
    }

    fn leaves_out(&self) -> Keep {
        Keep { queries: true, textures: true, ..Keep::default() }
    }

    fn set_extent(&mut self, extent: Extent) -> Result<(), ExecutorError> {
        let has_bounces = !self.buffers.sets[2].rays.is_empty();
        (self.extent, self.rows, self.path_rows) = (extent, extent, None);
        self.buffers.sets = [extent.rays(), extent.rays(), 0].map(RaySet::new);
        let has_more = !self.buffers.pixels.mores[0].is_empty();
        self.buffers.pixels = Pixels::new(extent.rays(), has_more);
        self.buffers.tiles = TileLists::new(extent.tiles() as usize);
        if has_bounces {
            self.allow_bounces();
        }
        Ok(())
    }

    fn allow_bounces(&mut self) {
        self.buffers.sets[2] = RaySet::new(self.rows.rays());
        self.buffers.pixels.allow_bounces();
    }

    fn make_binary(&mut self) -> Result<(), ExecutorError> {
        self.binary = Some(BinaryTrees::new(&self.file)?);
        Ok(())
    }

    fn set_hidden(&mut self, bounds: &[u32]) -> Result<(), ExecutorError> {
        self.scene.hidden = bounds.to_vec();
        Ok(())
    }

    fn lose_device(&mut self) {}

    fn tuning(&mut self) -> &mut Tuning {
        &mut self.tuning
    }

    fn set_lamps(&mut self, lamps: &Arc<Lamps>) -> Result<(), ExecutorError> {
        self.lamps.set(lamps);
        Ok(())
    }

    fn reserve(&mut self, family: &'static Family, elements: &[usize]) -> Result<(), ExecutorError> {
        let own = self.buffers.family(family);
        for ((buffer, words), &count) in family.buffers.iter().zip(&mut own.words).zip(elements) {
            // As on a device there is an element at least.
            let needed = (count.max(1) * buffer.stride).div_ceil(4);
            if words.len() < needed {
                words.clear();
                words.resize(needed, 0);
            }
        }
        Ok(())
    }

    fn write(&mut self, family: &'static Family, buffer: usize, at: usize, bytes: &[u8]) {
        let words = &mut self.buffers.family(family).words[buffer];
        bytemuck::cast_slice_mut(words)[at..at + bytes.len()].copy_from_slice(bytes);
    }

    fn read(&mut self, family: &'static Family, buffer: usize, words: usize) -> Result<Vec<u32>, ExecutorError> {
        Ok(self.buffers.family(family).words[buffer][..words].to_vec())
    }

    fn held(&mut self, family: &'static Family) -> &mut Option<Box<dyn Any>> {
        &mut self.buffers.family(family).held
    }

    fn set_scene(&mut self, scene: &Arc<SceneFile>) {
        self.file = scene.clone();
        self.scene.forget_frame();
    }

    fn begin_frame(&mut self, view: &View) {
        self.scene.rebase(self.file.resident(), view.frame);
        self.lamps.rebase(view.frame);
        self.view = view.params;
        self.directions = view.directions;
        let rows = self.extent.first(view.rays);
        if rows != self.rows || self.path_rows.is_some() {
            (self.rows, self.path_rows) = (rows, None);
            self.buffers.sets.iter_mut().filter(|set| !set.rays.is_empty()).for_each(|set| set.resize(rows.rays()));
            self.buffers.pixels.resize(rows.rays());
        }
    }

    fn set_rays(&mut self, pass: Pass, rays: &[layout::Ray]) {
        self.buffers.sets[pass.set()].rays = padded(rays, self.rows_of(pass).rays());
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
