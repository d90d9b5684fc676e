//! Textures on the device: their records, their tails, which are resident throughout, as words in pages, each a
//! binding; where their tiles lie in the cache, and what is asked of these.

use super::device::Gpu;
use super::rays::storage;
use super::readback::device_error;
use crate::kernels::{layout, textures};
use crate::schedule::ExecutorError;
use bricks::{Payload, SceneFile};

/// What texture lookups bind.
pub struct Texels {
    /// [`layout::Texture`]s.
    pub textures: wgpu::Buffer,
    /// [`layout::Material`]s.
    pub materials: wgpu::Buffer,
    /// [`layout::TileSlot`] of every tile.
    pub tile_slots: wgpu::Buffer,
    /// [`layout::TileDemand`] of every tile.
    pub tile_demand: wgpu::Buffer,
    /// Pages of tails; none in scenes without textures.
    pub pages: Vec<wgpu::Buffer>,
    /// Bytes of tails.
    pub bytes: u64,
    /// Number of tiles.
    pub tiles: usize,
}

impl Texels {
    /// Number of pages that the tails of the textures of `scene` need on `gpu`.
    pub fn page_count(gpu: &Gpu, scene: &SceneFile) -> usize {
        place(scene, gpu.page_bytes()).0.len()
    }

    /// Reads, verifies and uploads every tail; `keep`: with a page even if there is none.
    ///
    /// # Errors
    /// A texture that cannot be read or verified.
    pub fn new(gpu: &Gpu, scene: &SceneFile, keep: bool) -> Result<Self, ExecutorError> {
        let resident = scene.resident();
        let (page_sizes, places) = place(scene, gpu.page_bytes());
        let kept = keep && page_sizes.is_empty();
        let page_sizes = if kept { vec![16] } else { page_sizes };
        let pages: Vec<_> = page_sizes.iter().map(|&bytes| storage(gpu, "texels", bytes as usize / 16, 16)).collect();
        let mut records = Vec::with_capacity(places.len());
        let mut bytes = Vec::new();
        scene.announce((0..resident.textures.len() as u32).map(Payload::Texture));
        for (i, (texture, &(page, offset))) in (0u32..).zip(resident.textures.iter().zip(&places)) {
            bytes.resize(texture.tail.bytes as usize, 0);
            scene.copy(Payload::Texture(i), &mut bytes).map_err(device_error)?;
            gpu.queue.write_buffer(&pages[page], offset, &bytes);
            // Pending writes hold a copy each: flushed now and then, so that they do not pile up.
            gpu.queue.submit([]);
            records.push(textures::record(texture, page as u32, (offset / 4) as u32));
        }
        let textures = storage(gpu, "textures", records.len(), size_of::<layout::Texture>());
        gpu.queue.write_buffer(&textures, 0, bytemuck::cast_slice(&records));
        let records: &[layout::Material] = bytemuck::cast_slice(&resident.materials);
        let materials = storage(gpu, "materials", records.len(), size_of::<layout::Material>());
        gpu.queue.write_buffer(&materials, 0, bytemuck::cast_slice(records));
        let tiles = resident.tiles.len();
        Ok(Self {
            textures,
            materials,
            tile_slots: storage(gpu, "tile slots", tiles, size_of::<layout::TileSlot>()),
            tile_demand: storage(gpu, "tile demand", tiles, size_of::<layout::TileDemand>()),
            pages,
            bytes: resident.textures.iter().map(|texture| texture.tail.bytes).sum(),
            tiles,
        })
    }
}

/// Sizes of the pages, and page and offset of each texture's tail, filled in order. A tail is less than 88 KiB, a page
/// more.
fn place(scene: &SceneFile, page_bytes: u64) -> (Vec<u64>, Vec<(usize, u64)>) {
    let mut sizes: Vec<u64> = Vec::new();
    let mut places = Vec::new();
    for texture in &scene.resident().textures {
        let bytes = texture.tail.bytes;
        if sizes.last().is_none_or(|&used| used + bytes > page_bytes) {
            sizes.push(0);
        }
        let page = sizes.len() - 1;
        places.push((page, sizes[page]));
        sizes[page] += bytes;
    }
    (sizes, places)
}
