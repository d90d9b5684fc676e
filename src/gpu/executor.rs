//! The wgpu executor: turns steps into dispatches, one submission and one readback a round trip.

use super::device::Gpu;
use super::kernels::{Kernels, TEXEL_BINDING};
use super::layout::{self, Params};
use super::pages::{CachePages, MappedRange};
use super::rays::{Extent, PixelBuffers, RayBuffers, TileBuffers, storage};
use super::readback::Readback;
use super::scene::{Frame, SceneBuffers};
use super::texels::Texels;
use super::timing::Timing;
use super::wgsl::Pages;
use crate::schedule::{BrickStates, Executor, ExecutorError, Load, PairQuery, Pass, Report, Step};
use crate::stream::{Item, Workers};
use bricks::SceneFile;
use std::sync::Arc;

/// Most dispatches of one submission.
const MOST_DISPATCHES: usize = 32;
/// Entries per tile that the lists start with.
const LIST_ENTRIES_PER_TILE: u32 = 64;

/// What a frame needs to know besides the scene.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// Reference point.
    pub frame: Frame,
    /// Fields of [`Params`] that the view sets: camera, sun, sky, sample, seed, jitter.
    pub params: Params,
}

/// Renders one scene on one device.
pub struct GpuExecutor {
    gpu: Gpu,
    scene: Arc<SceneFile>,
    workers: Workers<MappedRange>,
    kernels: Kernels,
    resident: SceneBuffers,
    cache: CachePages,
    texels: Texels,
    extent: Extent,
    passes: [RayBuffers; 2],
    pixels: PixelBuffers,
    tiles: TileBuffers,
    demand: wgpu::Buffer,
    counters: wgpu::Buffer,
    params: wgpu::Buffer,
    readback: Readback,
    timing: Timing,
    groups: Groups,
    view: Params,
    threshold: u32,
    pair_count: u32,
}

/// Bind groups; made anew when a buffer is.
struct Groups {
    scene: wgpu::BindGroup,
    cache: wgpu::BindGroup,
    rays: [wgpu::BindGroup; 2],
    tiles: wgpu::BindGroup,
    shading: wgpu::BindGroup,
    empty: wgpu::BindGroup,
}

/// How an executor is set up.
#[derive(Clone, Copy, Debug)]
pub struct Setup {
    /// Picture and tiles.
    pub extent: Extent,
    /// A (tile, leaf) query with at most so many rays is not visible; 0 is exact.
    pub threshold: u32,
    /// Count nodes and triangles visited (slower).
    pub count: bool,
}

impl GpuExecutor {
    /// Sets up buffers and pipelines. `page_sizes`: bytes of the cache's pages.
    ///
    /// # Errors
    /// Textures that cannot be read; a picture or a cache beyond the device's limits, with what it allows.
    pub fn new(
        gpu: Gpu,
        scene: Arc<SceneFile>,
        workers: Workers<MappedRange>,
        page_sizes: impl Iterator<Item = u64>,
        setup: Setup,
    ) -> Result<Self, ExecutorError> {
        let most = Extent::most_rays(&gpu);
        let extent = setup.extent;
        if extent.rays() as u64 > most {
            let text = format!("{:?} holds pictures of at most {most} pixels; ask for a smaller --size", gpu.info.name);
            return Err(ExecutorError::Device(text));
        }
        let texels = Texels::new(&gpu, &scene)?;
        let cache = CachePages::new(&gpu, page_sizes);
        let most_pages = gpu.max_cache_pages(texels.pages.len());
        if cache.page_count() > most_pages {
            let text = format!(
                "{:?} holds caches of at most {} bytes ({most_pages} pages); ask for a smaller --cache",
                gpu.info.name,
                most_pages as u64 * gpu.page_bytes()
            );
            return Err(ExecutorError::Device(text));
        }
        let pages = Pages { cache: cache.page_count(), texels: texels.pages.len() };
        let kernels = Kernels::new(&gpu, pages, setup.count);
        let resident = SceneBuffers::new(&gpu, scene.resident());
        let passes = [RayBuffers::new(&gpu, extent.rays()), RayBuffers::new(&gpu, extent.rays())];
        let pixels = PixelBuffers::new(&gpu, extent.rays());
        let tiles = TileBuffers::new(&gpu, extent, extent.tiles().saturating_mul(LIST_ENTRIES_PER_TILE));
        let bricks = scene.resident().bricks.len();
        let demand = storage(&gpu, "demand", bricks, size_of::<layout::Demand>());
        let counters = storage(&gpu, "counters", layout::COUNTERS, 4);
        let params = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("params"),
            size: (MOST_DISPATCHES as u64) * params_stride(&gpu),
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let readback = Readback::new(&gpu, (bricks * size_of::<layout::Demand>() + layout::COUNTERS * 4) as u64);
        let timing = Timing::new(&gpu, MOST_DISPATCHES as u32);
        let groups = Groups::new(
            &gpu, &kernels, &resident, &cache, &texels, &passes, &pixels, &tiles, &demand, &counters, &params,
        );
        Ok(Self {
            gpu,
            scene,
            workers,
            kernels,
            resident,
            cache,
            texels,
            extent,
            passes,
            pixels,
            tiles,
            demand,
            counters,
            params,
            readback,
            timing,
            groups,
            view: Params::default(),
            threshold: setup.threshold,
            pair_count: 0,
        })
    }

    /// The device.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Bytes of textures on the device.
    pub fn texture_bytes(&self) -> u64 {
        self.texels.bytes
    }

    /// The workers that read payloads.
    pub fn workers(&mut self) -> &mut Workers<MappedRange> {
        &mut self.workers
    }

    /// Starts a frame: moves the scene to its reference point, takes its camera and lights.
    pub fn begin_frame(&mut self, view: &View) {
        self.resident.rebase(&self.gpu, self.scene.resident(), view.frame);
        self.view = view.params;
    }

    /// Writes rays from outside into `pass`; fewer than the extent holds leave the rest untraced.
    pub fn set_rays(&mut self, pass: Pass, rays: &[layout::Ray]) {
        let untraced = layout::Ray { t_min: 1.0, t_max: 0.0, direction: [1.0, 0.0, 0.0], ..Default::default() };
        let mut all = rays.to_vec();
        all.resize(self.extent.rays(), untraced);
        self.gpu.queue.write_buffer(&self.passes[pass as usize].rays, 0, bytemuck::cast_slice(&all));
    }

    /// Reads the rays of a pass back, row by row.
    ///
    /// # Errors
    /// The device's.
    pub fn read_rays(&mut self, pass: Pass) -> Result<Vec<layout::Ray>, ExecutorError> {
        self.read(|s| &s.passes[pass as usize].rays)
    }

    /// Reads the hits of a pass back.
    ///
    /// # Errors
    /// The device's.
    pub fn read_hits(&mut self, pass: Pass) -> Result<Vec<layout::Hit>, ExecutorError> {
        self.read(|s| &s.passes[pass as usize].hits)
    }

    /// Reads the surfaces of a pass back.
    ///
    /// # Errors
    /// The device's.
    pub fn read_surfaces(&mut self, pass: Pass) -> Result<Vec<layout::Surface>, ExecutorError> {
        self.read(|s| &s.passes[pass as usize].surfaces)
    }

    /// Reads the G-buffer back.
    ///
    /// # Errors
    /// The device's.
    pub fn read_gbuffer(&mut self) -> Result<Vec<layout::GBuffer>, ExecutorError> {
        self.read(|s| &s.pixels.gbuffer)
    }

    /// Reads the radiance summed over samples back; w counts them.
    ///
    /// # Errors
    /// The device's.
    pub fn read_radiance(&mut self) -> Result<Vec<[f32; 4]>, ExecutorError> {
        self.read(|s| &s.pixels.radiance)
    }

    fn read<T: bytemuck::Pod>(&mut self, buffer: impl Fn(&Self) -> &wgpu::Buffer) -> Result<Vec<T>, ExecutorError> {
        let bytes = self.readback.read(&self.gpu, buffer(self))?;
        Ok(bytemuck::pod_collect_to_vec(&bytes))
    }

    fn rebind(&mut self) {
        self.groups = Groups::new(
            &self.gpu,
            &self.kernels,
            &self.resident,
            &self.cache,
            &self.texels,
            &self.passes,
            &self.pixels,
            &self.tiles,
            &self.demand,
            &self.counters,
            &self.params,
        );
    }

    fn write_slots(&self, bricks: &BrickStates) {
        let slots: Vec<layout::Slot> = (0..bricks.len())
            .map(|brick| {
                let geometry = bricks.geometry(brick);
                let attributes = bricks.attributes(brick);
                let bit = |set: bool, bit: u32| if set { bit } else { 0 };
                layout::Slot {
                    geometry_page: geometry.map_or(0, |s| s.page),
                    geometry_offset: geometry.map_or(0, |s| s.offset / 16),
                    attributes_page: attributes.map_or(0, |s| s.page),
                    attributes_offset: attributes.map_or(0, |s| s.offset / 16),
                    state: bit(geometry.is_some(), layout::STATE_GEOMETRY)
                        | bit(bricks.done(brick), layout::STATE_DONE)
                        | bit(bricks.batch(brick), layout::STATE_BATCH)
                        | bit(attributes.is_some(), layout::STATE_ATTRIBUTES),
                    ..Default::default()
                }
            })
            .collect();
        self.gpu.queue.write_buffer(&self.resident.slots, 0, bytemuck::cast_slice(&slots));
    }

    /// One submission: all steps, then counters and demand read back.
    fn submit(&mut self, pass: Pass, steps: &[Step], bricks: &BrickStates) -> Result<Report, ExecutorError> {
        self.write_slots(bricks);
        let dispatches: Vec<Dispatch> = steps.iter().flat_map(|&step| self.dispatches(pass, step)).collect();
        let stride = params_stride(&self.gpu);
        let mut params = vec![0u8; stride as usize * dispatches.len()];
        for (i, dispatch) in dispatches.iter().enumerate() {
            let at = i * stride as usize;
            params[at..at + size_of::<Params>()].copy_from_slice(bytemuck::bytes_of(&dispatch.params));
        }
        self.gpu.queue.write_buffer(&self.params, 0, &params);
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        encoder.clear_buffer(&self.counters, 0, None);
        let unasked = vec![layout::Demand { rays: 0, nearest: u32::MAX }; bricks.len()];
        self.gpu.queue.write_buffer(&self.demand, 0, bytemuck::cast_slice(&unasked));
        for (i, dispatch) in dispatches.iter().enumerate() {
            let mut compute = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some(dispatch.kernel),
                timestamp_writes: self.timing.writes(i as u32),
            });
            compute.set_pipeline(self.kernels.pipeline(dispatch.kernel));
            compute.set_bind_group(0, &self.groups.scene, &[]);
            compute.set_bind_group(1, &self.groups.rays[pass as usize], &[(i as u64 * stride) as u32]);
            compute.set_bind_group(2, if dispatch.cache { &self.groups.cache } else { &self.groups.empty }, &[]);
            compute.set_bind_group(3, if dispatch.shading { &self.groups.shading } else { &self.groups.tiles }, &[]);
            let [x, y] = dispatch.groups;
            compute.dispatch_workgroups(x, y, 1);
        }
        self.timing.resolve(&mut encoder, dispatches.len() as u32);
        self.readback.copy(&mut encoder, &[&self.counters, &self.demand]);
        self.gpu.queue.submit([encoder.finish()]);
        let bytes = self.readback.wait(&self.gpu)?;
        let (counters, demand) = bytes.split_at(layout::COUNTERS * 4);
        let counters: Vec<u32> = bytemuck::pod_collect_to_vec(counters);
        let demand: Vec<layout::Demand> = bytemuck::pod_collect_to_vec(&demand[..bricks.len() * 8]);
        let mut report = read_report(&counters, &demand)?;
        if steps.contains(&Step::QueryPairs) && self.pair_count > 0 {
            let rays: Vec<u32> = self.read(|s| &s.tiles.pair_rays)?;
            report.pair_rays = rays[..self.pair_count as usize].to_vec();
        }
        let times = self.timing.read(&self.gpu, dispatches.len())?;
        for (dispatch, ms) in dispatches.iter().zip(times) {
            if let Some(phase) = dispatch.phase {
                report.ms_phases[phase] += ms;
            }
        }
        Ok(report)
    }

    /// Grows the lists to at least `entries`.
    fn grow_lists(&mut self, entries: u32) -> Result<(), ExecutorError> {
        let most = (self.gpu.limits.max_storage_buffer_binding_size / size_of::<layout::Demand>() as u64) as u32;
        if entries > most {
            let text = format!("cannot hold tile lists of {entries} entries; use a larger --tile");
            return Err(ExecutorError::Device(text));
        }
        let capacity = entries.saturating_add(entries / 4).min(most);
        self.tiles = TileBuffers::new(&self.gpu, self.extent, capacity);
        self.rebind();
        Ok(())
    }
}

/// One dispatch of a kernel.
struct Dispatch {
    kernel: &'static str,
    params: Params,
    groups: [u32; 2],
    cache: bool,
    shading: bool,
    phase: Option<usize>,
}

impl GpuExecutor {
    /// The dispatches that a step consists of.
    fn dispatches(&self, pass: Pass, step: Step) -> Vec<Dispatch> {
        let extent = self.extent;
        let mut params = self.view;
        params.zero = 0;
        params.width = extent.width;
        params.height = extent.height;
        params.tile = extent.tile;
        params.tiles_x = extent.tiles_x();
        params.tiles = extent.tiles();
        params.list_capacity = self.tiles.capacity;
        params.threshold = self.threshold;
        params.pair_count = self.pair_count;
        params.top_count = self.scene.resident().top2.len() as u32;
        params.instance_pad = self.resident.instance_pad;
        params.flags = if pass == Pass::Shadow { layout::PARAM_ANY_HIT } else { 0 };
        let per_ray = [extent.width.div_ceil(8), extent.height.div_ceil(8)];
        let per_tile = [extent.tiles().div_ceil(64), 1];
        let kernel = |kernel, params, groups, phase| {
            let cache = kernel == "intersect_list" || kernel == "intersect_all";
            Dispatch { kernel, params, groups, cache, shading: false, phase }
        };
        let shading =
            |kernel, params, cache| Dispatch { kernel, params, groups: per_ray, cache, shading: true, phase: None };
        let selected = |mask, want, flags| Params { select_mask: mask, select_want: want, flags, ..params };
        let intersect = |mask, want, phase| {
            let p = selected(mask, want, params.flags);
            vec![
                kernel("tile_select_intersect", p, per_tile, Some(phase)),
                kernel("intersect_list", p, per_ray, Some(phase)),
            ]
        };
        let query = |mask, want, flags| {
            let p = selected(mask, want, flags);
            vec![
                kernel("tile_select", p, per_tile, Some(1)),
                kernel("query", p, per_ray, Some(1)),
                kernel("query_reduce", p, per_tile, Some(1)),
            ]
        };
        let across = extent.tiles().min(65_535);
        let bounds = kernel("tile_bounds", params, [across, extent.tiles().div_ceil(across)], Some(1));
        match step {
            Step::Generate if pass == Pass::Primary => vec![kernel("generate_primary", params, per_ray, None)],
            Step::Generate => vec![shading("generate_shadow", params, false)],
            Step::StartHits => vec![kernel("start_hits", params, per_ray, None)],
            Step::CountRays => vec![Dispatch { phase: None, ..bounds }],
            Step::Lists => {
                vec![
                    bounds,
                    kernel("tile_walk_count", params, per_tile, Some(1)),
                    kernel("tile_scan", params, [1, 1], Some(1)),
                    kernel("tile_walk_write", params, per_tile, Some(1)),
                ]
            }
            Step::IntersectResident => {
                intersect(layout::STATE_GEOMETRY | layout::STATE_DONE, layout::STATE_GEOMETRY, 0)
            }
            Step::IntersectBatch => intersect(layout::STATE_BATCH, layout::STATE_BATCH, 2),
            Step::IntersectAll => vec![kernel("intersect_all", params, per_ray, Some(0))],
            Step::QueryMissing => query(layout::STATE_GEOMETRY | layout::STATE_DONE, 0, params.flags),
            Step::QueryPairs => {
                let across = self.pair_count.clamp(1, 65_535);
                vec![kernel("query_pairs", params, [across, self.pair_count.div_ceil(across)], Some(1))]
            }
            Step::QueryNeeded => {
                let exact = Params { threshold: 0, ..params };
                let mut dispatches = query(0, 0, params.flags | layout::PARAM_NEEDED);
                for dispatch in &mut dispatches {
                    dispatch.params.threshold = exact.threshold;
                    dispatch.phase = None;
                }
                dispatches
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
}

impl Executor for GpuExecutor {
    fn set_lists(&mut self, lists: &[Vec<u32>]) -> Result<(), ExecutorError> {
        let entries: Vec<u32> = lists.iter().flatten().copied().collect();
        if entries.len() > self.tiles.capacity as usize {
            self.grow_lists(u32::try_from(entries.len()).unwrap_or(u32::MAX))?;
        }
        let mut first = 0;
        let mut records = Vec::with_capacity(lists.len());
        for list in lists {
            records.push(layout::TileList { first, count: list.len() as u32, ..Default::default() });
            first += list.len() as u32;
        }
        let unasked = vec![layout::Demand { rays: 0, nearest: u32::MAX }; entries.len()];
        self.gpu.queue.write_buffer(&self.tiles.lists, 0, bytemuck::cast_slice(&records));
        self.gpu.queue.write_buffer(&self.tiles.list, 0, bytemuck::cast_slice(&entries));
        self.gpu.queue.write_buffer(&self.tiles.pair_demand, 0, bytemuck::cast_slice(&unasked));
        Ok(())
    }

    fn set_pairs(&mut self, pairs: &[PairQuery]) -> Result<(), ExecutorError> {
        let records: Vec<layout::Pair> = pairs
            .iter()
            .map(|p| layout::Pair {
                x0: p.x[0],
                y0: p.y[0],
                x1: p.x[1],
                y1: p.y[1],
                node: p.node,
                ..Default::default()
            })
            .collect();
        if (self.tiles.pair_rays.size() / 4) < records.len() as u64 {
            let room = records.len().next_power_of_two();
            self.tiles.pairs = storage(&self.gpu, "pairs", room, size_of::<layout::Pair>());
            self.tiles.pair_rays = storage(&self.gpu, "pair rays", room, 4);
            self.rebind();
        }
        self.gpu.queue.write_buffer(&self.tiles.pairs, 0, bytemuck::cast_slice(&records));
        self.pair_count = records.len() as u32;
        Ok(())
    }

    fn load(&mut self, loads: &[Load]) -> Result<(), ExecutorError> {
        let resident = self.scene.resident();
        let bytes = |item: Item| match item.kind {
            crate::stream::Kind::Geometry => resident.bricks[item.brick as usize].geometry.bytes,
            crate::stream::Kind::Attributes => resident.bricks[item.brick as usize].attributes.bytes,
        };
        self.cache.load(&self.gpu, &mut self.workers, loads, bytes)
    }

    fn run(&mut self, pass: Pass, steps: &[Step], bricks: &BrickStates) -> Result<Report, ExecutorError> {
        let report = self.submit(pass, steps, bricks)?;
        if report.list_entries <= self.tiles.capacity {
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

fn read_report(counters: &[u32], demand: &[layout::Demand]) -> Result<Report, ExecutorError> {
    let count = |i: u32| u64::from(counters[i as usize]);
    if counters[layout::COUNTER_STACK_OVERFLOW as usize] > 0 {
        return Err(ExecutorError::StackOverflow(counters[layout::COUNTER_STACK_OVERFLOW as usize]));
    }
    let wanted = demand.iter().enumerate().filter(|(_, d)| d.rays > 0);
    Ok(Report {
        round_trips: 1,
        demand: wanted.map(|(brick, d)| (brick as u32, d.rays, f32::from_bits(d.nearest))).collect(),
        list_entries: counters[layout::COUNTER_LIST_ENTRIES as usize],
        pairs_tested: count(layout::COUNTER_PAIRS_TESTED),
        pairs_culled: count(layout::COUNTER_PAIRS_CULLED),
        pairs_visible: count(layout::COUNTER_PAIRS_VISIBLE),
        pairs_invisible: count(layout::COUNTER_PAIRS_INVISIBLE),
        pairs_intersected: count(layout::COUNTER_PAIRS_INTERSECTED),
        rays: count(layout::COUNTER_RAYS),
        nodes: count(layout::COUNTER_NODES),
        triangles: count(layout::COUNTER_TRIANGLES),
        non_finite: count(layout::COUNTER_NON_FINITE),
        ms_phases: [0.0; 3],
        pair_rays: Vec::new(),
    })
}

/// Bytes from one set of parameters to the next: the device's alignment for dynamic offsets.
fn params_stride(gpu: &Gpu) -> u64 {
    (size_of::<Params>() as u64).next_multiple_of(u64::from(gpu.limits.min_uniform_buffer_offset_alignment.max(16)))
}

impl Groups {
    #[allow(clippy::too_many_arguments)]
    fn new(
        gpu: &Gpu,
        kernels: &Kernels,
        scene: &SceneBuffers,
        cache: &CachePages,
        texels: &Texels,
        passes: &[RayBuffers; 2],
        pixels: &PixelBuffers,
        tiles: &TileBuffers,
        demand: &wgpu::Buffer,
        counters: &wgpu::Buffer,
        params: &wgpu::Buffer,
    ) -> Self {
        let group = |label, layout: &wgpu::BindGroupLayout, entries: &[wgpu::BindGroupEntry]| {
            gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(label), layout, entries })
        };
        let params_binding = wgpu::BufferBinding {
            buffer: params,
            offset: 0,
            size: std::num::NonZeroU64::new(size_of::<Params>() as u64),
        };
        let rays = |pass: &RayBuffers| {
            let mut entries = vec![wgpu::BindGroupEntry {
                binding: 0,
                resource: wgpu::BindingResource::Buffer(params_binding.clone()),
            }];
            let buffers = [&pass.rays, &pass.hits, &pass.surfaces, demand, counters];
            entries.extend(numbered(&buffers, 1));
            group("rays", &kernels.rays, &entries)
        };
        let tile_buffers = [
            &tiles.bounds,
            &tiles.lists,
            &tiles.list,
            &tiles.selection,
            &tiles.pair_demand,
            &tiles.pairs,
            &tiles.pair_rays,
        ];
        let primary = &passes[Pass::Primary as usize];
        let fixed = [
            &texels.materials,
            &texels.textures,
            &pixels.gbuffer,
            &pixels.radiance,
            &primary.rays,
            &primary.hits,
            &primary.surfaces,
        ];
        let mut shading = numbered(&fixed, 0);
        shading.extend(numbered(&texels.pages.iter().collect::<Vec<_>>(), TEXEL_BINDING));
        Self {
            scene: group("scene", &kernels.scene, &scene.bindings()),
            cache: group("cache", &kernels.cache, &cache.bindings()),
            rays: [rays(&passes[0]), rays(&passes[1])],
            tiles: group("tiles", &kernels.tiles, &numbered(&tile_buffers, 0)),
            shading: group("shading", &kernels.shading, &shading),
            empty: group("none", &kernels.none, &[]),
        }
    }
}

/// Whole buffers as entries from binding `first` on.
fn numbered<'a>(buffers: &[&'a wgpu::Buffer], first: u32) -> Vec<wgpu::BindGroupEntry<'a>> {
    let entry = |(i, b): (usize, &&'a wgpu::Buffer)| wgpu::BindGroupEntry {
        binding: first + i as u32,
        resource: b.as_entire_binding(),
    };
    buffers.iter().enumerate().map(entry).collect()
}
