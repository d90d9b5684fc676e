//! The wgpu executor: turns steps into dispatches, one submission and one readback a round trip.

#[cfg(test)]
mod peek;

use super::binary::BinaryTrees;
use super::device::Gpu;
use super::family::FamilyBuffers;
use super::groups::{Buffers, Groups};
use super::kernels::Kernels;
use super::lamps::LampBuffers;
use super::pages::CachePages;
use super::rays::{PixelBuffers, RayBuffers, TileBuffers, most_rays, storage};
use super::readback::{Readback, check};
use super::scene::SceneBuffers;
use super::texels::Texels;
use super::timing::Timing;
use super::wgsl::Pages;
use crate::kernels::dispatch::{Dispatch, Workgroups, are_pairs_culled, dispatches};
use crate::kernels::layout::Params;
use crate::kernels::shade::more;
use crate::kernels::table::{self, Bindings, Family, names};
use crate::kernels::{
    DeviceInfo, Directions, Extent, FrameExecutor, Keep, Lamps, Setup, Tuning, View, layer_tables, layout, opacity,
    padded, reflectance, report, textures,
};
use crate::schedule::{BrickStates, Executor, ExecutorError, Load, Own, PairQuery, Pass, Report, Step};
use crate::stream::{Item, Workers};
use bricks::SceneFile;
use std::any::Any;
use std::sync::Arc;
use wgpu::BufferUsages;

/// Most dispatches of one submission.
const MOST_DISPATCHES: usize = 96;
/// Bytes of the numbers of workgroups in x, y and z.
const INDIRECT_BYTES: u64 = 12;
/// Entries per tile that the lists start with.
const LIST_ENTRIES_PER_TILE: u32 = 64;

/// Renders one scene on one device.
pub struct GpuExecutor {
    gpu: Gpu,
    scene: Arc<SceneFile>,
    workers: Workers,
    kernels: Arc<Kernels>,
    buffers: Buffers,
    groups: Groups,
    binary: Option<BinaryTrees>,
    families: Vec<FamilyBuffers>,
    /// Of families that nothing is made of: nothing.
    unheld: Option<Box<dyn Any>>,
    extent: Extent,
    /// What of it this frame takes.
    rows: Extent,
    /// The first rows of sets 1 and 2, in which the rays of paths that go on lie; until a pass begins others: all.
    path_rows: Option<Extent>,
    /// Of every submission.
    readback: Readback,
    /// Of whole buffers.
    whole: Readback,
    timing: Timing,
    view: Params,
    directions: Directions,
    tuning: Tuning,
    pairs_are_culled: bool,
    pair_count: u32,
    pair_nodes: u32,
    has_bounces: bool,
}

impl GpuExecutor {
    /// Sets up buffers, and pipelines for them. `page_sizes`: bytes of the cache's pages.
    ///
    /// # Errors
    /// Textures that cannot be read; a picture or a cache beyond the device's limits, with what it allows.
    pub fn new(
        gpu: Gpu,
        scene: Arc<SceneFile>,
        workers: Workers,
        page_sizes: &[u64],
        setup: Setup,
    ) -> Result<Self, ExecutorError> {
        // A cache of nothing has a page, too.
        let texels = Texels::page_count(&gpu, &scene);
        let resident = scene.resident();
        let keep = setup.keep;
        let pages = Pages {
            cache: page_sizes.len().max(1),
            texels: texels.max(usize::from(keep.textures)),
            opacity: keep.opacity || (opacity::is_needed(resident) && !setup.opaque),
            gloss: keep.gloss || reflectance::is_needed(resident),
            layers: layer_tables::is_needed(resident),
            levels: resident.has_levels_in_use(),
            hides: setup.hides,
        };
        check_pages(&gpu, pages)?;
        let kernels = Arc::new(Kernels::new(&gpu, pages, setup.count));
        Self::with_kernels(gpu, kernels, scene, workers, page_sizes, setup)
    }

    /// Sets up buffers for pipelines that exist, made for at least as many pages as there are. [`Setup::count`] is
    /// theirs.
    ///
    /// # Errors
    /// Textures that cannot be read; a picture beyond the device's limits, with what it allows.
    pub fn with_kernels(
        gpu: Gpu,
        kernels: Arc<Kernels>,
        scene: Arc<SceneFile>,
        workers: Workers,
        page_sizes: &[u64],
        setup: Setup,
    ) -> Result<Self, ExecutorError> {
        let extent = setup.extent;
        check_extent(&gpu, extent)?;
        let bricks = scene.resident().bricks.len();
        let buffers = Buffers {
            scene: SceneBuffers::new(&gpu, &scene, kernels.pages.levels)?,
            cache: CachePages::new(&gpu, page_sizes),
            texels: Texels::new(&gpu, &scene, setup.keep.textures)?,
            lamps: LampBuffers::new(&gpu, kernels.pages),
            sets: [extent.rays(), extent.rays(), 0].map(|rays| RayBuffers::new(&gpu, rays)),
            pixels: PixelBuffers::new(&gpu, extent, false, more::is_needed(scene.resident())),
            tiles: TileBuffers::new(&gpu, extent, extent.tiles().saturating_mul(LIST_ENTRIES_PER_TILE)),
            demand: storage(&gpu, "demand", bricks, size_of::<layout::Demand>()),
            counters: storage(&gpu, "counters", layout::COUNTERS_AND_WORK, 4),
            indirect: gpu.buffer("indirect", INDIRECT_BYTES, BufferUsages::INDIRECT | BufferUsages::COPY_DST),
            params: uniform(&gpu, "params", size_of::<Params>()),
            blocks: uniform(&gpu, "blocks", 4 * Own::WORDS),
        };
        let timing = Timing::new(&gpu, MOST_DISPATCHES as u32);
        let read = [&buffers.counters, &buffers.demand, &buffers.texels.tile_demand].into_iter().chain(timing.buffer());
        let readback = Readback::new(&gpu, read.map(|buffer| buffer.size()).sum());
        let whole = Readback::new(&gpu, 0);
        let groups = Groups::new(&gpu, &kernels, &buffers);
        let (view, directions) = (Params::default(), Directions::default());
        check(&gpu)?;
        Ok(Self {
            gpu,
            scene,
            workers,
            kernels,
            buffers,
            groups,
            binary: None,
            families: Vec::new(),
            unheld: None,
            extent,
            rows: extent,
            path_rows: None,
            readback,
            whole,
            timing,
            view,
            directions,
            tuning: Tuning::new(&setup),
            pairs_are_culled: false,
            pair_count: 0,
            pair_nodes: 0,
            has_bounces: false,
        })
    }

    /// The device.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// The pipelines.
    pub fn kernels(&self) -> &Arc<Kernels> {
        &self.kernels
    }

    /// What is made of a family.
    fn family(&self, family: &'static Family) -> Option<&FamilyBuffers> {
        self.families.iter().find(|own| std::ptr::eq(own.family, family))
    }

    fn has_more(&self) -> bool {
        more::is_needed(self.scene.resident())
    }

    /// The G-buffer of a set, without the half that keeps further textures.
    fn gbuffer_of(&mut self, set: usize) -> Result<Vec<layout::GBuffer>, ExecutorError> {
        let rays = self.rays_of(set);
        self.whole.first(&self.gpu, &self.buffers.pixels.gbuffers[set], rays)
    }

    fn rebind(&mut self) {
        self.groups = Groups::new(&self.gpu, &self.kernels, &self.buffers);
    }

    /// Rays of set 0 or 1 whose hits are shaded.
    fn rays_of(&self, set: usize) -> usize {
        let rows = if set == 0 { self.rows } else { self.path_rows.unwrap_or(self.rows) };
        rows.rays()
    }

    /// The rows that the rays of a pass lie in.
    fn rows_of(&self, pass: Pass) -> Extent {
        if pass.begins() { self.rows } else { self.path_rows.unwrap_or(self.rows) }
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
            list_capacity: self.buffers.tiles.capacity,
            threshold: self.tuning.threshold,
            list_most: self.tuning.list_most,
            pair_count: self.pair_count,
            top_count: self.scene.resident().top2.len() as u32,
            instance_pad: self.buffers.scene.instance_pad,
            ..self.view
        }
    }

    /// One submission: all steps, then counters and demand read back.
    fn submit(&mut self, pass: Pass, steps: &[Step], bricks: &BrickStates) -> Result<Report, ExecutorError> {
        self.gpu.queue.write_buffer(&self.buffers.scene.slots, 0, bytemuck::cast_slice(&report::slots(bricks)));
        if pass.begins() && pass.set() == 1 {
            self.path_rows = None;
        }
        let rows = self.rows_of(pass);
        let params = self.params(rows);
        let everything = bricks.all_geometry_resident();
        let samples = steps.iter().any(|step| step.is_sampling()) && self.groups.sampling.is_some();
        if samples {
            let Texels { tile_slots, tile_demand, tiles, .. } = &self.buffers.texels;
            self.gpu.queue.write_buffer(tile_slots, 0, bytemuck::cast_slice(&textures::slots(bricks)));
            let unasked = vec![textures::UNASKED; *tiles];
            self.gpu.queue.write_buffer(tile_demand, 0, bytemuck::cast_slice(&unasked));
        }
        let mut list: Vec<Dispatch> = Vec::new();
        for &step in steps.iter().filter(|step| samples || !step.is_sampling()) {
            self.pairs_are_culled = are_pairs_culled(step, self.pairs_are_culled, self.tuning.threshold);
            let flags = if self.pairs_are_culled { layout::PARAM_CULLED } else { 0 };
            let params = Params { flags, ..params };
            list.extend(dispatches(pass, step, &params, &self.directions, everything));
        }
        let dispatches = list;
        if dispatches.iter().any(|dispatch| dispatch.kernel == names::count_pairs) {
            self.make_room_for_counts(rows)?;
        }
        let rays = rows.rays();
        let asks_for_stand_ins = dispatches.iter().any(|dispatch| dispatch.kernel == names::query_stand_ins);
        if asks_for_stand_ins {
            self.make_room_for_pair_rays(rays as u64);
        }
        let strides = [size_of::<Params>(), 4 * Own::WORDS].map(|bytes| stride(&self.gpu, bytes));
        let mut told = strides.map(|stride| vec![0u8; stride as usize * dispatches.len()]);
        for (i, dispatch) in dispatches.iter().enumerate() {
            let bytes = [bytemuck::bytes_of(&dispatch.params), bytemuck::cast_slice(&dispatch.own)];
            for ((told, stride), bytes) in told.iter_mut().zip(strides).zip(bytes) {
                told[i * stride as usize..][..bytes.len()].copy_from_slice(bytes);
            }
        }
        for (buffer, told) in [&self.buffers.params, &self.buffers.blocks].into_iter().zip(&told) {
            self.gpu.queue.write_buffer(buffer, 0, told);
        }
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        encoder.clear_buffer(&self.buffers.counters, 0, Some(layout::COUNTERS as u64 * 4));
        let unasked = vec![layout::Demand { rays: 0, nearest: u32::MAX, next: 0 }; bricks.len()];
        self.gpu.queue.write_buffer(&self.buffers.demand, 0, bytemuck::cast_slice(&unasked));
        for (i, dispatch) in dispatches.iter().enumerate() {
            if dispatch.kernel == names::count_pairs {
                encoder.clear_buffer(&self.buffers.tiles.pair_rays, 0, None);
            }
            let work = match dispatch.groups {
                Workgroups::Fixed(_) => None,
                Workgroups::Chosen => Some(layout::WORK_CHOSEN),
                Workgroups::Rooted => Some(layout::WORK_ROOTED),
            };
            if let Some(work) = work {
                let (from, to) = (&self.buffers.counters, &self.buffers.indirect);
                encoder.copy_buffer_to_buffer(from, u64::from(work) * 4, to, 0, INDIRECT_BYTES);
            }
            let mut compute = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some(dispatch.kernel),
                timestamp_writes: self.timing.writes(i as u32),
            });
            let family = self.families.iter().find_map(|own| Some((own, own.family.kernel(dispatch.kernel)?)));
            let kernel = table::kernel(dispatch.kernel).or(family.map(|(_, kernel)| kernel));
            let binary = self.binary.as_ref().filter(|_| dispatch.kernel == names::intersect_binary);
            let pipeline = match (family, binary) {
                (Some((family, _)), _) => family.pipeline(dispatch.kernel),
                (None, Some(binary)) => Some(binary.pipeline.get()),
                (None, None) => self.kernels.pipeline(dispatch.kernel),
            };
            let (Some(kernel), Some(pipeline)) = (kernel, pipeline) else {
                let text = format!("has no kernel {}; this is a bug in brickwalk", dispatch.kernel);
                return Err(ExecutorError::Device(text));
            };
            compute.set_pipeline(pipeline);
            compute.set_bind_group(0, &self.groups.scene, &[]);
            let offsets = strides.map(|stride| (i as u64 * stride) as u32);
            compute.set_bind_group(1, &self.groups.rays[pass.set()], &offsets);
            let groups = &self.groups;
            let shaded = pass.set().saturating_sub(1);
            let (second, third) = match kernel.bindings {
                Bindings::Tiles => (&groups.empty, &groups.tiles),
                Bindings::CacheTiles => (&groups.cache, &groups.tiles),
                Bindings::Shading => (&groups.lamps, &groups.shading[shaded]),
                Bindings::CacheShading => (&groups.cache, &groups.shading[shaded]),
                Bindings::Sampling => {
                    let sampling = groups.sampling.as_ref().map_or(&groups.tiles, |sampling| &sampling[shaded]);
                    (&groups.cache, sampling)
                }
                Bindings::Binary => (&groups.cache, binary.map_or(&groups.tiles, |binary| &binary.group)),
                Bindings::Own => (family.map_or(&groups.empty, |(family, _)| &family.group), &groups.shading[shaded]),
            };
            compute.set_bind_group(2, second, &[]);
            compute.set_bind_group(3, third, &[]);
            match dispatch.groups {
                Workgroups::Fixed([x, y]) => compute.dispatch_workgroups(x, y, 1),
                Workgroups::Chosen | Workgroups::Rooted => {
                    compute.dispatch_workgroups_indirect(&self.buffers.indirect, 0);
                }
            }
        }
        self.timing.resolve(&mut encoder, dispatches.len() as u32);
        let mut read = vec![&self.buffers.counters, &self.buffers.demand];
        read.extend(samples.then_some(&self.buffers.texels.tile_demand));
        read.extend(self.timing.buffer());
        self.readback.copy(&mut encoder, &read);
        self.gpu.queue.submit([encoder.finish()]);
        let bytes = self.readback.wait(&self.gpu)?;
        let (counters, rest) = bytes.split_at(layout::COUNTERS_AND_WORK * 4);
        let (demand, rest) = rest.split_at(self.buffers.demand.size() as usize);
        let (tiles, times) = rest.split_at(if samples { self.buffers.texels.tile_demand.size() as usize } else { 0 });
        let counters: Vec<u32> = bytemuck::pod_collect_to_vec(counters);
        let demand: Vec<layout::Demand> =
            bytemuck::pod_collect_to_vec(&demand[..bricks.len() * size_of::<layout::Demand>()]);
        let mut report = report::of_counters(&counters, &demand)?;
        report::take_used(&mut report, steps, bricks);
        if samples {
            let tiles = &tiles[..self.buffers.texels.tiles * size_of::<layout::TileDemand>()];
            report.tiles = textures::demand(&bytemuck::pod_collect_to_vec::<_, layout::TileDemand>(tiles));
        }
        if steps.iter().any(|step| matches!(step, Step::QueryPairs { .. })) && self.pair_count > 0 {
            let rays: Vec<u32> = self.whole.read(&self.gpu, &self.buffers.tiles.pair_rays)?;
            report.pair_rays = rays[..self.pair_nodes as usize].to_vec();
        }
        if steps.contains(&Step::MovePaths { compact: true }) {
            self.path_rows = Some(rows.first(Some(report.paths as usize)));
        }
        if asks_for_stand_ins {
            let states: Vec<u32> = self.whole.read(&self.gpu, &self.buffers.tiles.pair_rays)?;
            report.states = states[..rays].to_vec();
        }
        let mut ms_phases = [0.0; 3];
        for (dispatch, ms) in dispatches.iter().zip(self.timing.ms(times)) {
            if let Some(phase) = dispatch.phase {
                ms_phases[phase] += ms;
            }
        }
        report.counters.add_phases(ms_phases);
        Ok(report)
    }

    /// Makes room for the counts of how many rays of each tile see each leaf.
    fn make_room_for_counts(&mut self, rows: Extent) -> Result<(), ExecutorError> {
        let (tiles, leaves) = (rows.tiles(), self.scene.resident().leaves.len());
        let pairs = u64::from(tiles) * leaves as u64;
        if 4 * pairs > self.gpu.limits.max_storage_buffer_binding_size {
            return Err(report::too_many_pairs(tiles, leaves));
        }
        self.make_room_for_pair_rays(pairs);
        Ok(())
    }

    fn make_room_for_pair_rays(&mut self, count: u64) {
        if self.buffers.tiles.pair_rays.size() < 4 * count {
            self.buffers.tiles.pair_rays = storage(&self.gpu, "pair rays", count as usize, 4);
            self.rebind();
        }
    }

    /// Grows the lists to at least `entries`.
    fn grow_lists(&mut self, entries: u32) -> Result<(), ExecutorError> {
        let most = (self.gpu.limits.max_storage_buffer_binding_size / size_of::<layout::PairDemand>() as u64) as u32;
        if entries > most {
            let text = format!("cannot hold tile lists of {entries} entries; use a larger --tile");
            return Err(ExecutorError::Device(text));
        }
        let capacity = entries.saturating_add(entries / 4).min(most);
        self.buffers.tiles.make_room(&self.gpu, capacity);
        self.rebind();
        Ok(())
    }
}

impl FrameExecutor for GpuExecutor {
    fn device(&self) -> DeviceInfo {
        self.gpu.device_info()
    }

    fn page_bytes(&self) -> u64 {
        self.gpu.page_bytes()
    }

    fn leaves_out(&self) -> Keep {
        Keep { queries: true, textures: true, opacity: true, gloss: true }
    }

    fn set_extent(&mut self, extent: Extent) -> Result<(), ExecutorError> {
        check_extent(&self.gpu, extent)?;
        let rays = extent.rays();
        let bounces = if self.has_bounces { rays } else { 0 };
        (self.extent, self.rows, self.path_rows) = (extent, extent, None);
        self.buffers.sets = [rays, rays, bounces].map(|rays| RayBuffers::new(&self.gpu, rays));
        self.buffers.pixels = PixelBuffers::new(&self.gpu, extent, self.has_bounces, self.has_more());
        self.buffers.tiles = TileBuffers::new(&self.gpu, extent, self.buffers.tiles.capacity);
        self.rebind();
        Ok(())
    }

    fn allow_bounces(&mut self) {
        self.has_bounces = true;
        let rays = self.extent.rays();
        self.buffers.sets[2] = RayBuffers::new(&self.gpu, rays);
        self.buffers.pixels = PixelBuffers::new(&self.gpu, self.extent, true, self.has_more());
        self.rebind();
    }

    fn set_hidden(&mut self, bounds: &[u32]) -> Result<(), ExecutorError> {
        if !self.kernels.pages.hides && !bounds.is_empty() {
            let pages = Pages { hides: true, ..self.kernels.pages };
            check_pages(&self.gpu, pages)?;
            self.kernels = Arc::new(Kernels::new(&self.gpu, pages, self.kernels.count));
            // What was made for the kernels before.
            self.families.clear();
            if self.binary.is_some() {
                self.make_binary()?;
            }
        }
        self.buffers.scene.set_hidden(&self.gpu, bounds);
        self.rebind();
        Ok(())
    }

    fn lose_device(&mut self) {
        self.gpu.device.destroy();
    }

    fn tuning(&mut self) -> &mut Tuning {
        &mut self.tuning
    }

    fn make_binary(&mut self) -> Result<(), ExecutorError> {
        self.binary = Some(BinaryTrees::new(&self.gpu, &self.scene, &self.kernels)?);
        Ok(())
    }

    fn texture_bytes(&self) -> u64 {
        self.buffers.texels.bytes + self.scene.resident().opacity_bytes()
    }

    fn workers(&self) -> &Workers {
        &self.workers
    }

    fn set_lamps(&mut self, lamps: &Arc<Lamps>) -> Result<(), ExecutorError> {
        if self.buffers.lamps.set(&self.gpu, lamps)? {
            self.rebind();
            for family in self.families.iter_mut().filter(|own| own.family.has_lamps) {
                family.rebind(&self.gpu, &self.buffers.lamps);
            }
        }
        Ok(())
    }

    fn reserve(&mut self, family: &'static Family, elements: &[usize]) -> Result<(), ExecutorError> {
        let Self { gpu, kernels, buffers, families, .. } = self;
        let index = match families.iter().position(|own| std::ptr::eq(own.family, family)) {
            Some(index) => index,
            None => {
                families.push(FamilyBuffers::new(gpu, kernels, &buffers.lamps, family)?);
                families.len() - 1
            }
        };
        families[index].reserve(gpu, &buffers.lamps, elements)
    }

    fn write(&mut self, family: &'static Family, buffer: usize, at: usize, bytes: &[u8]) {
        if let Some(own) = self.family(family) {
            self.gpu.queue.write_buffer(own.buffer(buffer), at as u64, bytes);
        }
    }

    fn read(&mut self, family: &'static Family, buffer: usize, words: usize) -> Result<Vec<u32>, ExecutorError> {
        let Self { gpu, whole, families, .. } = self;
        let own = families.iter().find(|own| std::ptr::eq(own.family, family));
        let mut all = own.map_or(Ok(Vec::new()), |own| whole.read(gpu, own.buffer(buffer)))?;
        all.truncate(words);
        Ok(all)
    }

    fn held(&mut self, family: &'static Family) -> &mut Option<Box<dyn Any>> {
        match self.families.iter_mut().find(|own| std::ptr::eq(own.family, family)) {
            Some(own) => &mut own.held,
            None => {
                self.unheld = None;
                &mut self.unheld
            }
        }
    }

    fn set_scene(&mut self, scene: &Arc<SceneFile>) {
        self.scene = scene.clone();
        self.buffers.scene.forget_frame();
    }

    fn begin_frame(&mut self, view: &View) {
        self.buffers.scene.rebase(&self.gpu, self.scene.resident(), view.frame);
        self.buffers.lamps.rebase(&self.gpu, view.frame);
        self.view = view.params;
        self.directions = view.directions;
        (self.rows, self.path_rows) = (self.extent.first(view.rays), None);
    }

    fn set_rays(&mut self, pass: Pass, rays: &[layout::Ray]) {
        let all = padded(rays, self.rows_of(pass).rays());
        self.gpu.queue.write_buffer(&self.buffers.sets[pass.set()].rays, 0, bytemuck::cast_slice(&all));
    }

    fn read_rays(&mut self, pass: Pass) -> Result<Vec<layout::Ray>, ExecutorError> {
        self.whole.first(&self.gpu, &self.buffers.sets[pass.set()].rays, self.rows_of(pass).rays())
    }

    fn read_hits(&mut self, pass: Pass) -> Result<Vec<layout::Hit>, ExecutorError> {
        self.whole.first(&self.gpu, &self.buffers.sets[pass.set()].hits, self.rows_of(pass).rays())
    }

    fn read_surfaces(&mut self, pass: Pass) -> Result<Vec<layout::Surface>, ExecutorError> {
        self.whole.first(&self.gpu, &self.buffers.sets[pass.set()].surfaces, self.rows_of(pass).rays())
    }

    fn read_gbuffer(&mut self) -> Result<Vec<layout::GBuffer>, ExecutorError> {
        self.gbuffer_of(0)
    }

    fn read_radiance(&mut self) -> Result<Vec<[f32; 4]>, ExecutorError> {
        self.whole.first(&self.gpu, &self.buffers.pixels.radiance, self.rows.rays())
    }
}

impl Executor for GpuExecutor {
    fn set_lists(&mut self, lists: &[Vec<u32>]) -> Result<(), ExecutorError> {
        let entries: Vec<layout::Entry> =
            lists.iter().flatten().map(|&node| layout::Entry { node, near: 0.0 }).collect();
        if entries.len() > self.buffers.tiles.capacity as usize {
            self.grow_lists(u32::try_from(entries.len()).unwrap_or(u32::MAX))?;
        }
        let mut first = 0;
        let mut records = Vec::with_capacity(lists.len());
        for list in lists {
            records.push(layout::TileList { first, count: list.len() as u32, ..Default::default() });
            first += list.len() as u32;
        }
        let unasked = vec![layout::PairDemand { rays: 0, nearest: u32::MAX }; entries.len()];
        self.gpu.queue.write_buffer(&self.buffers.tiles.lists, 0, bytemuck::cast_slice(&records));
        self.gpu.queue.write_buffer(&self.buffers.tiles.list, 0, bytemuck::cast_slice(&entries));
        self.gpu.queue.write_buffer(&self.buffers.tiles.pair_demand, 0, bytemuck::cast_slice(&unasked));
        // All tiles have lists.
        self.gpu.queue.write_buffer(&self.buffers.counters, u64::from(layout::WORK_ROOTED) * 4, &[0; 16]);
        Ok(())
    }

    fn set_pairs(&mut self, queries: &[PairQuery], nodes: &[u32]) -> Result<(), ExecutorError> {
        let mut first = 0;
        let mut records = Vec::with_capacity(queries.len());
        for PairQuery { x: [x0, x1], y: [y0, y1], nodes: count } in queries.iter().copied() {
            records.push(layout::Pair { x0, y0, x1, y1, first, count, ..Default::default() });
            first += count;
        }
        let tiles = &mut self.buffers.tiles;
        // No query is without a node.
        if (tiles.pair_nodes.size() / 4) < nodes.len() as u64 {
            let room = nodes.len().next_power_of_two();
            tiles.pairs = storage(&self.gpu, "pairs", room, size_of::<layout::Pair>());
            tiles.pair_rays = storage(&self.gpu, "pair rays", room, 4);
            tiles.pair_nodes = storage(&self.gpu, "pair nodes", room, 4);
            self.rebind();
        }
        self.gpu.queue.write_buffer(&self.buffers.tiles.pairs, 0, bytemuck::cast_slice(&records));
        self.gpu.queue.write_buffer(&self.buffers.tiles.pair_nodes, 0, bytemuck::cast_slice(nodes));
        (self.pair_count, self.pair_nodes) = (records.len() as u32, nodes.len() as u32);
        Ok(())
    }

    fn load(&mut self, loads: &[Load]) -> Result<(), ExecutorError> {
        let bytes = |item: Item| self.scene.loaded_bytes(item.into());
        self.buffers.cache.load(&self.gpu, &self.workers, loads, bytes)
    }

    fn mark_leaves(&mut self, marks: &Arc<[bool]>) {
        self.buffers.scene.mark_leaves(&self.gpu, marks);
    }

    fn run(&mut self, pass: Pass, steps: &[Step], bricks: &BrickStates) -> Result<Report, ExecutorError> {
        let report = self.submit(pass, steps, bricks)?;
        if report.list_entries <= self.buffers.tiles.capacity {
            return Ok(report);
        }
        // The lists did not fit and were left empty, so nothing has been intersected: once more, with room.
        self.grow_lists(report.list_entries)?;
        let round_trips = report.counters.round_trips;
        let mut report = self.submit(pass, steps, bricks)?;
        report.counters.round_trips += round_trips;
        Ok(report)
    }
}

/// Refuses more pages of the cache than the device binds.
fn check_pages(gpu: &Gpu, pages: Pages) -> Result<(), ExecutorError> {
    let most = gpu.max_cache_pages(pages);
    if pages.cache <= most {
        return Ok(());
    }
    let bytes = most as u64 * gpu.page_bytes();
    let name = &gpu.info.name;
    let text = format!("{name:?} holds caches of at most {bytes} bytes ({most} pages); ask for a smaller --cache");
    Err(ExecutorError::Device(text))
}

/// Refuses more rays than the device holds.
fn check_extent(gpu: &Gpu, extent: Extent) -> Result<(), ExecutorError> {
    let most = most_rays(gpu);
    if extent.rays() as u64 <= most {
        return Ok(());
    }
    let text = format!("{:?} holds {most} pixels at a time; ask for a smaller --size or --tile", gpu.info.name);
    Err(ExecutorError::Device(text))
}

/// Bytes from what one dispatch is told to the next: the device's alignment for dynamic offsets.
fn stride(gpu: &Gpu, bytes: usize) -> u64 {
    (bytes as u64).next_multiple_of(u64::from(gpu.limits.min_uniform_buffer_offset_alignment.max(16)))
}

/// A buffer of so many bytes for each dispatch of a submission.
fn uniform(gpu: &Gpu, label: &str, bytes: usize) -> wgpu::Buffer {
    gpu.buffer(label, (MOST_DISPATCHES as u64) * stride(gpu, bytes), BufferUsages::UNIFORM | BufferUsages::COPY_DST)
}
