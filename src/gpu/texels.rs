//! Base colour textures on the device: all mip levels as words in pages, each a binding.

use super::device::Gpu;
use super::pages::device_error;
use super::rays::storage;
use crate::kernel::layout;
use crate::schedule::ExecutorError;
use bricks::{Payload, SceneFile};

/// Textures and materials of a scene, resident throughout.
pub struct Texels {
    /// [`layout::Texture`]s.
    pub textures: wgpu::Buffer,
    /// [`layout::Material`]s.
    pub materials: wgpu::Buffer,
    /// Pages of words, at least one.
    pub pages: Vec<wgpu::Buffer>,
    /// Bytes of texels.
    pub bytes: u64,
}

impl Texels {
    /// Number of pages that the textures of `scene` need on `gpu`.
    pub fn page_count(gpu: &Gpu, scene: &SceneFile) -> usize {
        place(scene, gpu.page_bytes()).0.len()
    }

    /// Reads, verifies and uploads every texture.
    ///
    /// # Errors
    /// A texture that cannot be read or verified, or that is larger than a page.
    pub fn new(gpu: &Gpu, scene: &SceneFile) -> Result<Self, ExecutorError> {
        let resident = scene.resident();
        let (page_sizes, places) = place(scene, gpu.page_bytes());
        let pages: Vec<_> = page_sizes.iter().map(|&bytes| storage(gpu, "texels", bytes as usize / 4, 4)).collect();
        let mut records = Vec::with_capacity(places.len());
        let mut bytes = Vec::new();
        for (i, (texture, &(page, offset))) in resident.textures.iter().zip(&places).enumerate() {
            bytes.resize(texture.texels.bytes as usize, 0);
            scene.copy(Payload::Texture(i as u32), &mut bytes).map_err(device_error)?;
            if offset + texture.texels.bytes > page_sizes[page] {
                let text = format!("cannot hold texture {i} of {} bytes in one buffer; scale it down", bytes.len());
                return Err(ExecutorError::Device(text));
            }
            gpu.queue.write_buffer(&pages[page], offset, &bytes);
            // Pending writes hold a copy each: flushed now and then, so that they do not pile up.
            gpu.queue.submit([]);
            records.push(layout::Texture {
                width: texture.width,
                height: texture.height,
                levels: texture.levels,
                wrap: texture.wrap,
                page: page as u32,
                offset: (offset / 4) as u32,
                ..Default::default()
            });
        }
        let textures = storage(gpu, "textures", records.len(), size_of::<layout::Texture>());
        gpu.queue.write_buffer(&textures, 0, bytemuck::cast_slice(&records));
        let records: Vec<layout::Material> = resident
            .materials
            .iter()
            .map(|m| layout::Material {
                base_color: m.base_color,
                emission: m.emission,
                metallic: m.metallic,
                roughness: m.roughness,
                alpha_cutoff: m.alpha_cutoff,
                flags: m.flags,
                base_color_texture: m.base_color_texture,
                padding: [0; 4],
            })
            .collect();
        let materials = storage(gpu, "materials", records.len(), size_of::<layout::Material>());
        gpu.queue.write_buffer(&materials, 0, bytemuck::cast_slice(&records));
        let bytes = resident.textures.iter().map(|t| t.texels.bytes).sum();
        Ok(Self { textures, materials, pages, bytes })
    }
}

/// Sizes of the pages, and page and offset of each texture, filled in order.
fn place(scene: &SceneFile, page_bytes: u64) -> (Vec<u64>, Vec<(usize, u64)>) {
    let mut sizes = vec![0u64];
    let mut places = Vec::new();
    for texture in &scene.resident().textures {
        let bytes = texture.texels.bytes;
        let full = sizes.last().is_some_and(|&used| used > 0 && used + bytes > page_bytes);
        if full {
            sizes.push(0);
        }
        let page = sizes.len() - 1;
        places.push((page, sizes[page]));
        sizes[page] = (sizes[page] + bytes).min(page_bytes);
    }
    (sizes, places)
}
