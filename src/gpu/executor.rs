//! The wgpu executor: turns steps into dispatches, one submission and one readback a round trip.

#[cfg(test)]
mod peek;

use super::binary::BinaryTrees;
use super::device::Gpu;
use super::groups::{Buffers, Groups};
use super::kernels::Kernels;
use super::lamps::LampBuffers;
use super::pages::{CachePages, MappedRange};
use super::rays::{PixelBuffers, RayBuffers, TileBuffers, most_rays, storage};
use super::readback::Readback;
use super::scene::SceneBuffers;
use super::texels::Texels;
use super::timing::Timing;
use super::wgsl::Pages;
use crate::kernels::dispatch::{
    COUNT_PAIRS, Dispatch, INTERSECT_BINARY, Third, Workgroups, are_pairs_culled, dispatches,
};
use crate::kernels::layout;
use crate::kernels::layout::Params;
use crate::kernels::{
    DeviceInfo, Directions, Extent, FrameExecutor, Keep, Lamps, Setup, Tuning, View, opacity, padded, reflectance,
    report, textures,
};
use crate::schedule::{BrickStates, Executor, ExecutorError, Load, PairQuery, Pass, Report, Step};
use crate::secondary::df::device::Field;
use crate::secondary::df::maps::FieldMaps;
use crate::secondary::dvf::device::Dvf;
use crate::secondary::dvf::maps::DvfMaps;
use crate::secondary::occupancy::Cascades;
use crate::secondary::roma::device::Roma;
use crate::secondary::roma::maps::RomaMaps;
use crate::secondary::rsm::device::Rsm;
use crate::secondary::rsm::maps::RsmMaps;
use crate::stream::{Item, WorkerPool, Workers};
use bricks::SceneFile;
use std::sync::Arc;

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
    workers: Workers<MappedRange>,
    kernels: Arc<Kernels>,
    buffers: Buffers,
    groups: Groups,
    binary: Option<BinaryTrees>,
    roma: Option<Roma>,
    field: Option<Field>,
    rsm: Option<Rsm>,
    dvf: Option<Dvf>,
    extent: Extent,
    readback: Readback,
    timing: Timing,
    view: Params,
    directions: Directions,
    tuning: Tuning,
    pairs_are_culled: bool,
    pair_count: u32,
    pair_nodes: u32,
}

impl GpuExecutor {
    /// Sets up buffers, and pipelines for them. `page_sizes`: bytes of the cache's pages.
    ///
    /// # Errors
    /// Textures that cannot be read; a picture or a cache beyond the device's limits, with what it allows.
    pub fn new(
        gpu: Gpu,
        scene: Arc<SceneFile>,
        workers: Workers<MappedRange>,
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
            opacity: keep.opacity || opacity::is_needed(resident),
            gloss: keep.gloss || reflectance::is_needed(resident),
        };
        let most_pages = gpu.max_cache_pages(pages);
        if pages.cache > most_pages {
            let text = format!(
                "{:?} holds caches of at most {} bytes ({most_pages} pages); ask for a smaller --cache",
                gpu.info.name,
                most_pages as u64 * gpu.page_bytes()
            );
            return Err(ExecutorError::Device(text));
        }
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
        workers: Workers<MappedRange>,
        page_sizes: &[u64],
        setup: Setup,
    ) -> Result<Self, ExecutorError> {
        let most = most_rays(&gpu);
        let extent = setup.extent;
        if extent.rays() as u64 > most {
            let text = format!("{:?} holds pictures of at most {most} pixels; ask for a smaller --size", gpu.info.name);
            return Err(ExecutorError::Device(text));
        }
        let bricks = scene.resident().bricks.len();
        let buffers = Buffers {
            scene: SceneBuffers::new(&gpu, &scene)?,
            cache: CachePages::new(&gpu, page_sizes),
            texels: Texels::new(&gpu, &scene, setup.keep.textures)?,
            lamps: LampBuffers::new(&gpu, kernels.pages.gloss),
            sets: [extent.rays(), extent.rays(), 0].map(|rays| RayBuffers::new(&gpu, rays)),
            pixels: PixelBuffers::new(&gpu, extent.rays(), 0),
            tiles: TileBuffers::new(&gpu, extent, extent.tiles().saturating_mul(LIST_ENTRIES_PER_TILE)),
            demand: storage(&gpu, "demand", bricks, size_of::<layout::Demand>()),
            counters: storage(&gpu, "counters", layout::COUNTERS_AND_WORK, 4),
            indirect: gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("indirect"),
                size: INDIRECT_BYTES,
                usage: wgpu::BufferUsages::INDIRECT | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
            params: gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("params"),
                size: (MOST_DISPATCHES as u64) * params_stride(&gpu),
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
        };
        let read = [&buffers.counters, &buffers.demand, &buffers.texels.tile_demand];
        let readback = Readback::new(&gpu, read.iter().map(|buffer| buffer.size()).sum());
        let timing = Timing::new(&gpu, MOST_DISPATCHES as u32);
        let groups = Groups::new(&gpu, &kernels, &buffers);
        let (view, directions) = (Params::default(), Directions::default());
        Ok(Self {
            gpu,
            scene,
            workers,
            kernels,
            buffers,
            groups,
            binary: None,
            roma: None,
            field: None,
            rsm: None,
            dvf: None,
            extent,
            readback,
            timing,
            view,
            directions,
            tuning: Tuning::new(&setup),
            pairs_are_culled: false,
            pair_count: 0,
            pair_nodes: 0,
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

    fn read<T: bytemuck::Pod>(&mut self, buffer: impl Fn(&Self) -> &wgpu::Buffer) -> Result<Vec<T>, ExecutorError> {
        let bytes = self.readback.read(&self.gpu, buffer(self))?;
        Ok(bytemuck::pod_collect_to_vec(&bytes))
    }

    /// The first words of a buffer.
    fn read_words(&self, (buffer, count): (&wgpu::Buffer, usize)) -> Result<Vec<u32>, ExecutorError> {
        let bytes = self.readback.read(&self.gpu, buffer)?;
        Ok(bytemuck::pod_collect_to_vec(&bytes[..4 * count]))
    }

    fn rebind(&mut self) {
        self.groups = Groups::new(&self.gpu, &self.kernels, &self.buffers);
    }

    /// The parameters of all dispatches of a submission.
    fn params(&self) -> Params {
        let extent = self.extent;
        let params = Params {
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
        };
        let params = self.roma.as_ref().map_or(params, |roma| roma.maps.params(params));
        let params = self.field.as_ref().map_or(params, |field| field.maps.params(params));
        Params { rsm_maps: self.rsm.as_ref().map_or(0, |rsm| rsm.maps), ..params }
    }

    /// One submission: all steps, then counters and demand read back.
    fn submit(&mut self, pass: Pass, steps: &[Step], bricks: &BrickStates) -> Result<Report, ExecutorError> {
        self.gpu.queue.write_buffer(&self.buffers.scene.slots, 0, bytemuck::cast_slice(&report::slots(bricks)));
        let params = self.params();
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
        if dispatches.iter().any(|dispatch| dispatch.kernel == COUNT_PAIRS) {
            self.make_room_for_counts()?;
        }
        let stride = params_stride(&self.gpu);
        let mut params = vec![0u8; stride as usize * dispatches.len()];
        for (i, dispatch) in dispatches.iter().enumerate() {
            let at = i * stride as usize;
            params[at..at + size_of::<Params>()].copy_from_slice(bytemuck::bytes_of(&dispatch.params));
        }
        self.gpu.queue.write_buffer(&self.buffers.params, 0, &params);
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        encoder.clear_buffer(&self.buffers.counters, 0, Some(layout::COUNTERS as u64 * 4));
        let unasked = vec![layout::Demand { rays: 0, nearest: u32::MAX, next: 0 }; bricks.len()];
        self.gpu.queue.write_buffer(&self.buffers.demand, 0, bytemuck::cast_slice(&unasked));
        for (i, dispatch) in dispatches.iter().enumerate() {
            if dispatch.kernel == COUNT_PAIRS {
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
            let binary = self.binary.as_ref().filter(|_| dispatch.kernel == INTERSECT_BINARY);
            let roma = self.roma.as_ref().and_then(|roma| Some((roma.pipeline(dispatch.kernel)?, roma)));
            let field = self.field.as_ref().and_then(|field| Some((field.pipeline(dispatch.kernel)?, field)));
            let rsm = self.rsm.as_ref().and_then(|rsm| Some((rsm.pipeline(dispatch.kernel)?, rsm)));
            let of_maps = roma.map(|(pipeline, _)| pipeline).or(field.map(|(pipeline, _)| pipeline));
            let dvf = self.dvf.as_ref().and_then(|dvf| Some((dvf.pipeline(dispatch.kernel)?, dvf)));
            let of_maps = of_maps.or(rsm.map(|(pipeline, _)| pipeline)).or(dvf.map(|(pipeline, _)| pipeline));
            let own = binary.map(|b| &b.pipeline).or(of_maps);
            compute.set_pipeline(own.unwrap_or_else(|| self.kernels.pipeline(dispatch.kernel)));
            compute.set_bind_group(0, &self.groups.scene, &[]);
            compute.set_bind_group(1, &self.groups.rays[pass.set()], &[(i as u64 * stride) as u32]);
            let second = match (dispatch.cache, dispatch.third) {
                (true, _) => &self.groups.cache,
                (false, Third::Shading) => &self.groups.lamps,
                (false, Third::Roma) => roma.map_or(&self.groups.empty, |(_, roma)| &roma.group),
                (false, Third::Field) => field.map_or(&self.groups.empty, |(_, field)| &field.group),
                (false, Third::Rsm) => rsm.map_or(&self.groups.empty, |(_, rsm)| &rsm.group),
                (false, Third::Dvf) => dvf.map_or(&self.groups.empty, |(_, dvf)| &dvf.group),
                _ => &self.groups.empty,
            };
            compute.set_bind_group(2, second, &[]);
            let shaded = pass.set().saturating_sub(1);
            let third = match (dispatch.third, &self.groups.sampling) {
                (Third::Shading | Third::Roma | Third::Field | Third::Rsm | Third::Dvf, _) => {
                    &self.groups.shading[shaded]
                }
                (Third::Sampling, Some(sampling)) => &sampling[shaded],
                _ => &self.groups.tiles,
            };
            compute.set_bind_group(3, binary.map_or(third, |b| &b.group), &[]);
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
        self.readback.copy(&mut encoder, &read);
        self.gpu.queue.submit([encoder.finish()]);
        let bytes = self.readback.wait(&self.gpu)?;
        let (counters, rest) = bytes.split_at(layout::COUNTERS_AND_WORK * 4);
        let (demand, tiles) = rest.split_at(self.buffers.demand.size() as usize);
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
            let rays: Vec<u32> = self.read(|s| &s.buffers.tiles.pair_rays)?;
            report.pair_rays = rays[..self.pair_nodes as usize].to_vec();
        }
        let times = self.timing.read(&self.gpu, dispatches.len())?;
        for (dispatch, ms) in dispatches.iter().zip(times) {
            if let Some(phase) = dispatch.phase {
                report.ms_phases[phase] += ms;
            }
        }
        Ok(report)
    }

    /// Makes room for the counts of how many rays of each tile see each leaf.
    fn make_room_for_counts(&mut self) -> Result<(), ExecutorError> {
        let (tiles, leaves) = (self.extent.tiles(), self.scene.resident().leaves.len());
        let pairs = u64::from(tiles) * leaves as u64;
        if 4 * pairs > self.gpu.limits.max_storage_buffer_binding_size {
            return Err(report::too_many_pairs(tiles, leaves));
        }
        if self.buffers.tiles.pair_rays.size() < 4 * pairs {
            self.buffers.tiles.pair_rays = storage(&self.gpu, "pair rays", pairs as usize, 4);
            self.rebind();
        }
        Ok(())
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

    fn allow_bounces(&mut self) {
        let rays = self.extent.rays();
        self.buffers.sets[2] = RayBuffers::new(&self.gpu, rays);
        self.buffers.pixels = PixelBuffers::new(&self.gpu, rays, rays);
        self.rebind();
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

    fn workers(&self) -> &dyn WorkerPool {
        &self.workers
    }

    fn set_lamps(&mut self, lamps: &Arc<Lamps>) -> Result<(), ExecutorError> {
        if self.buffers.lamps.set(&self.gpu, lamps)? {
            self.rebind();
            if let Some(rsm) = &mut self.rsm {
                rsm.rebind(&self.gpu, &self.buffers.lamps);
            }
        }
        Ok(())
    }

    fn set_cascades(&mut self, cascades: &Arc<Cascades>) -> Result<(), ExecutorError> {
        let Self { gpu, kernels, roma, .. } = self;
        roma.get_or_insert_with(|| Roma::new(gpu, kernels)).set_cascades(gpu, cascades)
    }

    fn set_roma(&mut self, maps: &RomaMaps) -> Result<(), ExecutorError> {
        let Self { gpu, kernels, roma, .. } = self;
        roma.get_or_insert_with(|| Roma::new(gpu, kernels)).set_maps(gpu, maps)
    }

    fn set_field(&mut self, maps: &FieldMaps) -> Result<(), ExecutorError> {
        let Self { gpu, kernels, field, .. } = self;
        field.get_or_insert_with(|| Field::new(gpu, kernels)).set(gpu, maps)
    }

    fn set_rsm(&mut self, maps: &RsmMaps) -> Result<(), ExecutorError> {
        let Self { gpu, kernels, rsm, buffers, .. } = self;
        let rsm = match rsm {
            Some(rsm) => rsm,
            none => none.insert(Rsm::new(gpu, kernels, &buffers.lamps)?),
        };
        rsm.set(gpu, &buffers.lamps, maps)
    }

    fn set_scene(&mut self, scene: &Arc<SceneFile>) {
        self.scene = scene.clone();
        self.buffers.scene.forget_frame();
    }

    fn set_dvf(&mut self, maps: &DvfMaps) -> Result<(), ExecutorError> {
        let Self { gpu, kernels, dvf, .. } = self;
        let dvf = match dvf {
            Some(dvf) => dvf,
            none => none.insert(Dvf::new(gpu, kernels)?),
        };
        dvf.set(gpu, maps)
    }

    fn set_dvf_triangles(&mut self, triangles: &[layout::DvfTriangle], points: u32) -> Result<(), ExecutorError> {
        let Self { gpu, dvf, .. } = self;
        dvf.as_mut().map_or(Ok(()), |dvf| dvf.set_triangles(gpu, triangles, points))
    }

    fn set_dvf_tally(&mut self, words: &[u32]) -> Result<(), ExecutorError> {
        let Self { gpu, dvf, .. } = self;
        dvf.as_mut().map_or(Ok(()), |dvf| dvf.set_tally(gpu, words))
    }

    fn read_dvf_tally(&mut self) -> Result<Vec<u32>, ExecutorError> {
        self.dvf.as_ref().map_or(Ok(Vec::new()), |dvf| self.read_words(dvf.tally()))
    }

    fn read_dvf(&mut self) -> Result<(Vec<u32>, Vec<u32>), ExecutorError> {
        let Some(dvf) = &self.dvf else { return Ok(Default::default()) };
        let [masks, labels, _] = dvf.results();
        Ok((self.read_words(masks)?, self.read_words(labels)?))
    }

    fn read_dvf_sums(&mut self) -> Result<Vec<[u32; 2]>, ExecutorError> {
        let Some(dvf) = &self.dvf else { return Ok(Vec::new()) };
        let words = self.read_words(dvf.results()[2])?;
        Ok(words.as_chunks::<2>().0.to_vec())
    }

    fn begin_frame(&mut self, view: &View) {
        self.buffers.scene.rebase(&self.gpu, self.scene.resident(), view.frame);
        self.buffers.lamps.rebase(&self.gpu, view.frame);
        self.view = view.params;
        self.directions = view.directions;
    }

    fn set_rays(&mut self, pass: Pass, rays: &[layout::Ray]) {
        let all = padded(rays, self.extent.rays());
        self.gpu.queue.write_buffer(&self.buffers.sets[pass.set()].rays, 0, bytemuck::cast_slice(&all));
    }

    fn read_rays(&mut self, pass: Pass) -> Result<Vec<layout::Ray>, ExecutorError> {
        self.read(|s| &s.buffers.sets[pass.set()].rays)
    }

    fn read_hits(&mut self, pass: Pass) -> Result<Vec<layout::Hit>, ExecutorError> {
        self.read(|s| &s.buffers.sets[pass.set()].hits)
    }

    fn read_surfaces(&mut self, pass: Pass) -> Result<Vec<layout::Surface>, ExecutorError> {
        self.read(|s| &s.buffers.sets[pass.set()].surfaces)
    }

    fn read_gbuffer(&mut self) -> Result<Vec<layout::GBuffer>, ExecutorError> {
        self.read(|s| &s.buffers.pixels.gbuffers[0])
    }

    fn read_radiance(&mut self) -> Result<Vec<[f32; 4]>, ExecutorError> {
        self.read(|s| &s.buffers.pixels.radiance)
    }
}

impl Executor for GpuExecutor {
    fn set_lists(&mut self, lists: &[Vec<u32>]) -> Result<(), ExecutorError> {
        let entries: Vec<layout::Entry> =
            lists.iter().flatten().map(|&leaf| layout::Entry { leaf, near: 0.0 }).collect();
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
        self.buffers.cache.load(&self.gpu, &mut self.workers, loads, bytes)
    }

    fn run(&mut self, pass: Pass, steps: &[Step], bricks: &BrickStates) -> Result<Report, ExecutorError> {
        let report = self.submit(pass, steps, bricks)?;
        if report.list_entries <= self.buffers.tiles.capacity {
            return Ok(report);
        }
        // The lists did not fit and were left empty, so nothing has been intersected: once more, with room.
        self.grow_lists(report.list_entries)?;
        let round_trips = report.round_trips;
        let mut report = self.submit(pass, steps, bricks)?;
        report.round_trips += round_trips;
        Ok(report)
    }
}

/// Bytes from one set of parameters to the next: the device's alignment for dynamic offsets.
fn params_stride(gpu: &Gpu) -> u64 {
    (size_of::<Params>() as u64).next_multiple_of(u64::from(gpu.limits.min_uniform_buffer_offset_alignment.max(16)))
}
