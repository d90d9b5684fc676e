//! The bind groups of an executor, over all of its buffers.

use super::device::Gpu;
use super::kernels::{Kernels, TEXEL_BINDING};
use super::layout::Params;
use super::pages::CachePages;
use super::rays::{PixelBuffers, RayBuffers, TileBuffers};
use super::scene::SceneBuffers;
use super::texels::Texels;
use crate::schedule::Pass;

/// What kernels read and write.
pub struct Buffers {
    /// The resident part of the scene.
    pub scene: SceneBuffers,
    /// The brick cache.
    pub cache: CachePages,
    /// Textures and materials.
    pub texels: Texels,
    /// Rays and hits, by [`Pass`].
    pub passes: [RayBuffers; 2],
    /// What shading keeps per pixel.
    pub pixels: PixelBuffers,
    /// Tiles and their lists.
    pub tiles: TileBuffers,
    /// [`super::layout::Demand`] of every brick.
    pub demand: wgpu::Buffer,
    /// Counters.
    pub counters: wgpu::Buffer,
    /// [`Params`] of every dispatch of a submission.
    pub params: wgpu::Buffer,
}

/// Bind groups; made anew when a buffer is.
pub struct Groups {
    /// 0: the scene.
    pub scene: wgpu::BindGroup,
    /// 1: parameters and rays, by [`Pass`].
    pub rays: [wgpu::BindGroup; 2],
    /// 2: the cache.
    pub cache: wgpu::BindGroup,
    /// 2 of kernels that do not read the cache.
    pub empty: wgpu::BindGroup,
    /// 3 of kernels that work on tiles.
    pub tiles: wgpu::BindGroup,
    /// 3 of kernels that shade.
    pub shading: wgpu::BindGroup,
}

impl Groups {
    /// Groups over `buffers` for the pages that `kernels` were compiled for.
    pub fn new(gpu: &Gpu, kernels: &Kernels, buffers: &Buffers) -> Self {
        let group = |label, layout: &wgpu::BindGroupLayout, entries: &[wgpu::BindGroupEntry]| {
            gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(label), layout, entries })
        };
        let Buffers { scene, cache, texels, passes, pixels, tiles, demand, counters, params } = buffers;
        let params = wgpu::BindGroupEntry {
            binding: 0,
            resource: wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                buffer: params,
                offset: 0,
                size: std::num::NonZeroU64::new(size_of::<Params>() as u64),
            }),
        };
        let rays = |pass: &RayBuffers| {
            let mut entries = vec![params.clone()];
            entries.extend(numbered([&pass.rays, &pass.hits, &pass.surfaces, demand, counters], 1));
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
        let mut shading = numbered(fixed, 0);
        shading.extend(numbered(filled(&texels.pages, kernels.pages.texels), TEXEL_BINDING));
        // Each page of the cache as vectors and as words.
        let cache = filled(cache.pages(), kernels.pages.cache).flat_map(|page| [page, page]);
        Self {
            scene: group("scene", &kernels.scene, &numbered(scene.buffers(), 0)),
            rays: [rays(&passes[0]), rays(&passes[1])],
            cache: group("cache", &kernels.cache, &numbered(cache, 0)),
            empty: group("none", &kernels.none, &[]),
            tiles: group("tiles", &kernels.tiles, &numbered(tile_buffers, 0)),
            shading: group("shading", &kernels.shading, &shading),
        }
    }
}

/// The pages, then the first over and over: kernels for more pages than a scene has bind something that is never read.
fn filled(pages: &[wgpu::Buffer], count: usize) -> impl Iterator<Item = &wgpu::Buffer> {
    (0..count).map(|page| pages.get(page).unwrap_or(&pages[0]))
}

/// Whole buffers as entries from binding `first` on.
fn numbered<'a>(buffers: impl IntoIterator<Item = &'a wgpu::Buffer>, first: u32) -> Vec<wgpu::BindGroupEntry<'a>> {
    let entry = |(binding, buffer): (u32, &'a wgpu::Buffer)| wgpu::BindGroupEntry {
        binding,
        resource: buffer.as_entire_binding(),
    };
    (first..).zip(buffers).map(entry).collect()
}
