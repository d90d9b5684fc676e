//! The bind groups of an executor, over all of its buffers.

use super::device::Gpu;
use super::kernels::Kernels;
use super::lamps::LampBuffers;
use super::pages::CachePages;
use super::rays::{PixelBuffers, RayBuffers, TileBuffers};
use super::scene::SceneBuffers;
use super::texels::Texels;
use super::wgsl::TEXEL_BINDING;
use crate::kernels::layout::Params;
use crate::schedule::Own;

/// What kernels read and write.
pub struct Buffers {
    /// The resident part of the scene.
    pub scene: SceneBuffers,
    /// The brick cache.
    pub cache: CachePages,
    /// Textures and materials.
    pub texels: Texels,
    /// The environment and the emitters.
    pub lamps: LampBuffers,
    /// Rays and hits, by their set ([`crate::schedule::Pass::set`]).
    pub sets: [RayBuffers; 3],
    /// What shading keeps per pixel.
    pub pixels: PixelBuffers,
    /// Tiles and their lists.
    pub tiles: TileBuffers,
    /// [`crate::kernels::layout::Demand`] of every brick.
    pub demand: wgpu::Buffer,
    /// Counters, and the work of indirect dispatches.
    pub counters: wgpu::Buffer,
    /// What an indirect dispatch takes, copied from behind the counters.
    pub indirect: wgpu::Buffer,
    /// [`Params`] of every dispatch of a submission.
    pub params: wgpu::Buffer,
    /// What a method's kernel is told beside them, of every dispatch.
    pub blocks: wgpu::Buffer,
}

/// Bind groups; made anew when a buffer is.
pub struct Groups {
    /// 0: the scene.
    pub scene: wgpu::BindGroup,
    /// 1: parameters and rays, by their set.
    pub rays: [wgpu::BindGroup; 3],
    /// 2: the cache.
    pub cache: wgpu::BindGroup,
    /// 2 of kernels that shade and do not read the cache.
    pub lamps: wgpu::BindGroup,
    /// 2 of others that do not.
    pub empty: wgpu::BindGroup,
    /// 3 of kernels that work on tiles.
    pub tiles: wgpu::BindGroup,
    /// 3 of kernels that shade the hits of sets 0 and 1.
    pub shading: [wgpu::BindGroup; 2],
    /// 3 of texture lookups for the hits of sets 0 and 1; in scenes with textures.
    pub sampling: Option<[wgpu::BindGroup; 2]>,
}

impl Groups {
    /// Groups over `buffers` for the pages that `kernels` were compiled for.
    pub fn new(gpu: &Gpu, kernels: &Kernels, buffers: &Buffers) -> Self {
        let group = |label, layout: &wgpu::BindGroupLayout, entries: &[wgpu::BindGroupEntry]| {
            gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(label), layout, entries })
        };
        let Buffers { scene, cache, texels, lamps, sets, pixels, tiles, demand, counters, params, blocks, .. } =
            buffers;
        let of_dispatch = |binding, buffer, bytes: usize| wgpu::BindGroupEntry {
            binding,
            resource: wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                buffer,
                offset: 0,
                size: std::num::NonZeroU64::new(bytes as u64),
            }),
        };
        let rays = |set: &RayBuffers| {
            let mut entries = vec![of_dispatch(0, params, size_of::<Params>()), of_dispatch(6, blocks, 4 * Own::WORDS)];
            entries.extend(numbered([&set.rays, &set.hits, &set.surfaces, demand, counters], 1));
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
            &tiles.pair_nodes,
        ];
        let shading = |set: usize| {
            let RayBuffers { rays, hits, surfaces } = &sets[set];
            let (gbuffer, radiance) = (&pixels.gbuffers[set], &pixels.radiance);
            let of_bounces = [&pixels.throughput, &pixels.origins];
            let buffers = [&texels.materials, gbuffer, radiance, rays, hits, surfaces].into_iter().chain(of_bounces);
            group("shading", &kernels.shading, &numbered(buffers, 0))
        };
        let sampling = |set: usize| {
            let Texels { materials, textures, tile_slots, tile_demand, .. } = texels;
            let mut entries = numbered([materials, textures, tile_slots, &pixels.gbuffers[set], tile_demand], 0);
            entries.extend(numbered(filled(&texels.pages, kernels.pages.texels), TEXEL_BINDING as u32));
            group("sampling", &kernels.sampling, &entries)
        };
        let cache = filled(cache.pages(), kernels.pages.cache);
        Self {
            scene: group("scene", &kernels.scene, &by_binding(&scene.buffers(kernels.pages))),
            rays: [rays(&sets[0]), rays(&sets[1]), rays(&sets[2])],
            cache: group("cache", &kernels.cache, &numbered(cache, 0)),
            lamps: group("lamps", &kernels.lamps, &numbered(lamps.buffers(), 0)),
            empty: group("none", &kernels.none, &[]),
            tiles: group("tiles", &kernels.tiles, &numbered(tile_buffers, 0)),
            shading: [shading(0), shading(1)],
            sampling: (!texels.pages.is_empty()).then(|| [sampling(0), sampling(1)]),
        }
    }
}

/// The pages, then the first over and over: kernels for more pages than a scene has bind something that is never read.
fn filled(pages: &[wgpu::Buffer], count: usize) -> impl Iterator<Item = &wgpu::Buffer> {
    (0..count).map(|page| pages.get(page).unwrap_or(&pages[0]))
}

/// Whole buffers as entries by their bindings.
pub fn by_binding<'a>(buffers: &[(u32, &'a wgpu::Buffer)]) -> Vec<wgpu::BindGroupEntry<'a>> {
    let entry = |&(binding, buffer): &(u32, &'a wgpu::Buffer)| wgpu::BindGroupEntry {
        binding,
        resource: buffer.as_entire_binding(),
    };
    buffers.iter().map(entry).collect()
}

/// Whole buffers as entries from binding `first` on.
pub fn numbered<'a>(buffers: impl IntoIterator<Item = &'a wgpu::Buffer>, first: u32) -> Vec<wgpu::BindGroupEntry<'a>> {
    let entry = |(binding, buffer): (u32, &'a wgpu::Buffer)| wgpu::BindGroupEntry {
        binding,
        resource: buffer.as_entire_binding(),
    };
    (first..).zip(buffers).map(entry).collect()
}
