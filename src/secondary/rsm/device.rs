//! Reflective shadow maps on the device, and the kernels that write them and light by them; made when a walk first asks
//! for them.

use super::maps::RsmMaps;
use crate::gpu::device::Gpu;
use crate::gpu::kernels;
use crate::gpu::kernels::Kernels;
use crate::gpu::lamps::LampBuffers;
use crate::gpu::method::{Method, check_bindings, most_bytes};
use crate::gpu::rays::storage;
use crate::kernels::dispatch::{RSM_LIGHT, RSM_WRITE};
use crate::kernels::layout::{RsmMap, RsmTexel};
use crate::schedule::ExecutorError;

/// Storage buffers of both kernels: 7 of the scene, 5 of the rays, 6 of their own, 8 of shading; one more with opacity.
const STORAGE_BUFFERS: u32 = 26;

/// Pipelines and buffers.
pub struct Rsm {
    method: Method,
    map_records: wgpu::Buffer,
    /// Texels of all maps.
    pub texels: wgpu::Buffer,
    /// How many maps there are.
    pub maps: u32,
    /// Group 2 of both kernels.
    pub group: wgpu::BindGroup,
}

impl Rsm {
    /// Of nothing.
    ///
    /// # Errors
    /// The device binds too few buffers.
    pub fn new(gpu: &Gpu, kernels: &Kernels, lamps: &LampBuffers) -> Result<Self, ExecutorError> {
        check_bindings(gpu, kernels, STORAGE_BUFFERS, "diffuse light by occupancy maps")?;
        let method = Method::new(gpu, kernels, "rsm", kernels::rsm_layout(&gpu.device), &[RSM_WRITE, RSM_LIGHT]);
        let map_records = storage(gpu, "rsm maps", 1, size_of::<RsmMap>());
        let texels = storage(gpu, "rsm texels", 1, size_of::<RsmTexel>());
        let group = method.group(gpu, lamps.buffers().into_iter().chain([&map_records, &texels]));
        Ok(Self { method, map_records, texels, maps: 0, group })
    }

    /// The pipeline of a kernel, if it is one of these.
    pub fn pipeline(&self, name: &str) -> Option<&wgpu::ComputePipeline> {
        self.method.pipeline(name)
    }

    /// Takes maps; as many texels as before keep what they hold.
    ///
    /// # Errors
    /// More texels than a buffer holds, with how many it does.
    pub fn set(&mut self, gpu: &Gpu, lamps: &LampBuffers, maps: &RsmMaps) -> Result<(), ExecutorError> {
        let size = size_of::<RsmTexel>() as u64;
        let most = most_bytes(gpu) / size;
        let texels = u64::from(maps.texels);
        if texels > most {
            return Err(ExecutorError::Device(format!(
                "{:?} holds reflective shadow maps of at most {most} texels, these have {texels}; give a smaller --rsm-size or fewer --rsm-lamps",
                gpu.info.name
            )));
        }
        let records = size_of_val(&maps.maps[..]) as u64;
        let is_new = self.texels.size() != texels.max(1) * size || self.map_records.size() < records;
        if self.texels.size() != texels.max(1) * size {
            self.texels = storage(gpu, "rsm texels", texels as usize, size as usize);
        }
        if self.map_records.size() < records {
            self.map_records = storage(gpu, "rsm maps", maps.maps.len(), size_of::<RsmMap>());
        }
        if is_new {
            self.rebind(gpu, lamps);
        }
        gpu.queue.write_buffer(&self.map_records, 0, bytemuck::cast_slice(&maps.maps));
        self.maps = maps.maps.len() as u32;
        Ok(())
    }

    /// Binds the lamps, which are new ones.
    pub fn rebind(&mut self, gpu: &Gpu, lamps: &LampBuffers) {
        let own = [&self.map_records, &self.texels];
        self.group = self.method.group(gpu, lamps.buffers().into_iter().chain(own));
    }
}
