//! Buffers of a frame: rays and hits of all sets, tiles and their lists, what shading keeps.

use super::device::Gpu;
use crate::kernels::{Extent, layout};
use wgpu::BufferUsages;

/// Most rays that buffers on this device hold.
pub fn most_rays(gpu: &Gpu) -> u64 {
    let bytes = gpu.limits.max_storage_buffer_binding_size.min(gpu.limits.max_buffer_size);
    bytes / size_of::<layout::GBuffer>().max(size_of::<layout::Surface>()) as u64
}

/// Rays, hits and surfaces of one set.
pub struct RayBuffers {
    /// [`layout::Ray`]s.
    pub rays: wgpu::Buffer,
    /// [`layout::Hit`]s.
    pub hits: wgpu::Buffer,
    /// [`layout::Surface`]s.
    pub surfaces: wgpu::Buffer,
}

/// Lists of leaves of all tiles; grown when a walk finds more.
pub struct TileBuffers {
    /// [`layout::TileBounds`].
    pub bounds: wgpu::Buffer,
    /// [`layout::TileList`]s.
    pub lists: wgpu::Buffer,
    /// [`layout::Entry`]s.
    pub list: wgpu::Buffer,
    /// Positions in the list.
    pub selection: wgpu::Buffer,
    /// Queries per position.
    pub pair_demand: wgpu::Buffer,
    /// [`layout::Pair`]s to be queried.
    pub pairs: wgpu::Buffer,
    /// Rays that see each node of the pairs.
    pub pair_rays: wgpu::Buffer,
    /// Nodes of the pairs.
    pub pair_nodes: wgpu::Buffer,
    /// Entries the lists hold.
    pub capacity: u32,
}

/// What shading keeps per pixel.
pub struct PixelBuffers {
    /// [`layout::GBuffer`] of the hits of sets 0 and 1. In scenes with further textures a second half keeps those.
    pub gbuffers: [wgpu::Buffer; 2],
    /// Radiance summed over the samples of a batch.
    pub radiance: wgpu::Buffer,
    /// Share of the light that the rays of set 1 bring, and by which density their directions were drawn.
    pub throughput: wgpu::Buffer,
    /// [`layout::Origin`]s of the rays of set 1, and behind them the counts of blocks (`shaders/paths/alive.wgsl`).
    pub origins: wgpu::Buffer,
}

/// A storage buffer of `count` elements that can be written from and copied to the host.
pub fn storage(gpu: &Gpu, label: &str, count: usize, stride: usize) -> wgpu::Buffer {
    gpu.buffer(
        label,
        (count.max(1) * stride) as u64,
        BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST,
    )
}

impl RayBuffers {
    /// For `rays` rays.
    pub fn new(gpu: &Gpu, rays: usize) -> Self {
        Self {
            rays: storage(gpu, "rays", rays, size_of::<layout::Ray>()),
            hits: storage(gpu, "hits", rays, size_of::<layout::Hit>()),
            surfaces: storage(gpu, "surfaces", rays, size_of::<layout::Surface>()),
        }
    }
}

impl TileBuffers {
    /// For the tiles of `extent` and lists of `capacity` entries in all.
    pub fn new(gpu: &Gpu, extent: Extent, capacity: u32) -> Self {
        let tiles = extent.tiles() as usize;
        let [list, selection, pair_demand] = Self::entries(gpu, capacity);
        Self {
            bounds: storage(gpu, "tile bounds", tiles, size_of::<layout::TileBounds>()),
            lists: storage(gpu, "tile lists", tiles, size_of::<layout::TileList>()),
            list,
            selection,
            pair_demand,
            pairs: storage(gpu, "pairs", 1, size_of::<layout::Pair>()),
            pair_rays: storage(gpu, "pair rays", 1, 4),
            pair_nodes: storage(gpu, "pair nodes", 1, 4),
            capacity: capacity.max(1),
        }
    }

    /// Makes room for `capacity` entries. What the lists hold is lost, what is known of the tiles is not.
    pub fn make_room(&mut self, gpu: &Gpu, capacity: u32) {
        [self.list, self.selection, self.pair_demand] = Self::entries(gpu, capacity);
        self.capacity = capacity.max(1);
    }

    /// List, selection and demand of `capacity` entries.
    fn entries(gpu: &Gpu, capacity: u32) -> [wgpu::Buffer; 3] {
        let of = |label, stride| storage(gpu, label, capacity as usize, stride);
        [of("list", size_of::<layout::Entry>()), of("selection", 4), of("pair demand", size_of::<layout::PairDemand>())]
    }
}

impl PixelBuffers {
    /// For the pixels of `extent`; `has_bounces`: they have rays in set 1 whose hits are shaded; `has_more`: of a scene
    /// with further textures.
    pub fn new(gpu: &Gpu, extent: Extent, has_bounces: bool, has_more: bool) -> Self {
        let rays = extent.rays();
        let bounces = if has_bounces { rays } else { 0 };
        // One a block of 8 x 8, and their sum.
        let counts = extent.tiles() as usize * (extent.tile as usize / 8).pow(2) + 1;
        let halves = if has_more { 2 } else { 1 };
        let gbuffer = |count| storage(gpu, "gbuffer", halves * count, size_of::<layout::GBuffer>());
        Self {
            gbuffers: [gbuffer(rays), gbuffer(bounces)],
            radiance: storage(gpu, "radiance", rays, 16),
            throughput: storage(gpu, "throughput", bounces, 16),
            origins: storage(gpu, "origins", bounces + counts, size_of::<layout::Origin>()),
        }
    }
}
