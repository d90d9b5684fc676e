//! The environment and the emitters on the device: group 2 of kernels that light.

use super::device::Gpu;
use super::rays::storage;
use super::wgsl::Pages;
use crate::kernels::frame::Frame;
use crate::kernels::layer_tables::LAYER_TABLES;
use crate::kernels::reflectance::REFLECTANCES;
use crate::kernels::{Lamps, layout};
use crate::schedule::ExecutorError;
use std::sync::Arc;

/// The buffers.
pub struct LampBuffers {
    texels: wgpu::Buffer,
    table: wgpu::Buffer,
    emitters: wgpu::Buffer,
    reflectances: wgpu::Buffer,
    lamps: Arc<Lamps>,
    frame: Option<Frame>,
}

impl LampBuffers {
    /// Of nothing, with the tables that kernels for `pages` look up.
    pub fn new(gpu: &Gpu, pages: Pages) -> Self {
        let [texels, table, emitters] = allocate(gpu, 0, 0);
        let entries: &[[f32; 2]] = match pages {
            Pages { gloss: false, .. } => &[],
            Pages { layers: false, .. } => &REFLECTANCES,
            _ => &LAYER_TABLES,
        };
        let reflectances = storage(gpu, "reflectances", entries.len(), 8);
        gpu.queue.write_buffer(&reflectances, 0, bytemuck::cast_slice(entries));
        Self { texels, table, emitters, reflectances, lamps: Arc::default(), frame: None }
    }

    /// All of them, in the order of their bindings.
    pub fn buffers(&self) -> [&wgpu::Buffer; 4] {
        [&self.texels, &self.table, &self.emitters, &self.reflectances]
    }

    /// Takes `lamps`, unless they are those that it has; whether the buffers are new ones.
    ///
    /// # Errors
    /// More than a buffer holds, with how much it does.
    pub fn set(&mut self, gpu: &Gpu, lamps: &Arc<Lamps>) -> Result<bool, ExecutorError> {
        if Arc::ptr_eq(&self.lamps, lamps) {
            return Ok(false);
        }
        let (texels, emitters) = (lamps.texels(), lamps.entries());
        let most = gpu.limits.max_storage_buffer_binding_size.min(gpu.limits.max_buffer_size);
        let bytes = (emitters * size_of::<layout::Emitter>()).max(size_of_val(texels)) as u64;
        if bytes > most {
            let text = format!(
                "{:?} holds at most {} lights and an environment of {} texels; leave emission out, or choose another \
                 --adapter",
                gpu.info.name,
                most / (2 * size_of::<layout::Emitter>()) as u64,
                most / 16
            );
            return Err(ExecutorError::Device(text));
        }
        [self.texels, self.table, self.emitters] = allocate(gpu, texels.len(), emitters);
        gpu.queue.write_buffer(&self.texels, 0, bytemuck::cast_slice(texels));
        gpu.queue.write_buffer(&self.table, 0, bytemuck::cast_slice(lamps.texel_table()));
        (self.lamps, self.frame) = (lamps.clone(), None);
        Ok(true)
    }

    /// Moves the emitters to `frame`, if they are not there yet.
    pub fn rebase(&mut self, gpu: &Gpu, frame: Frame) {
        if self.frame != Some(frame) {
            self.frame = Some(frame);
            gpu.queue.write_buffer(&self.emitters, 0, bytemuck::cast_slice(&self.lamps.placed(&frame)));
        }
    }
}

fn allocate(gpu: &Gpu, texels: usize, emitters: usize) -> [wgpu::Buffer; 3] {
    [
        storage(gpu, "environment", texels, 16),
        storage(gpu, "environment table", texels, 8),
        storage(gpu, "emitters", emitters, size_of::<layout::Emitter>()),
    ]
}
