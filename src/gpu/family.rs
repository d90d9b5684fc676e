//! The kernels of secondary methods on the device: pipelines, and group 2, buffers of their own. Made when a walk first
//! asks for the method.

use super::device::Gpu;
use super::groups::numbered;
use super::kernels::{FamilyPipelines, Kernels};
use super::lamps::LampBuffers;
use super::rays::storage;
use crate::kernels::table::Family;
use crate::schedule::ExecutorError;
use std::any::Any;
use std::sync::Arc;

/// Storage buffers of kernels of a family beside their own: 7 of the scene, 5 of the rays, 8 of shading.
const OTHER_BUFFERS: usize = 7 + 5 + 8;
/// Those of the lamps.
const LAMP_BUFFERS: usize = 4;

/// Pipelines and buffers of a family.
pub struct FamilyBuffers {
    /// Which.
    pub family: &'static Family,
    /// Group 2 of its kernels.
    pub group: wgpu::BindGroup,
    /// What its method has noted.
    pub held: Option<Box<dyn Any>>,
    pipelines: Arc<FamilyPipelines>,
    buffers: Vec<wgpu::Buffer>,
}

impl FamilyBuffers {
    /// Of nothing.
    ///
    /// # Errors
    /// The device binds too few buffers.
    pub fn new(
        gpu: &Gpu,
        kernels: &Kernels,
        lamps: &LampBuffers,
        family: &'static Family,
    ) -> Result<Self, ExecutorError> {
        let lamp_buffers = if family.has_lamps { LAMP_BUFFERS } else { 0 };
        let needed = OTHER_BUFFERS + lamp_buffers + family.buffers.len() + kernels.pages.of_scene();
        let most = gpu.limits.max_storage_buffers_per_shader_stage as usize;
        if most < needed {
            return Err(ExecutorError::Device(format!(
                "{:?} binds {most} buffers a kernel, those of {} need {needed}; use --secondary exact, or another \
                 --adapter",
                gpu.info.name, family.what
            )));
        }
        let pipelines = kernels.family(gpu, family);
        let buffers: Vec<_> = family.buffers.iter().map(|buffer| storage(gpu, buffer.name, 1, buffer.stride)).collect();
        let group = group(gpu, family, &pipelines.layout, lamps, &buffers);
        Ok(Self { family, group, held: None, pipelines, buffers })
    }

    /// The pipeline of a kernel, if it is one of these.
    pub fn pipeline(&self, name: &str) -> Option<&wgpu::ComputePipeline> {
        self.pipelines.pipeline(name)
    }

    /// A buffer.
    pub fn buffer(&self, buffer: usize) -> &wgpu::Buffer {
        &self.buffers[buffer]
    }

    /// Makes room for so many elements in each buffer.
    ///
    /// # Errors
    /// More than a buffer holds, with how much it does.
    pub fn reserve(&mut self, gpu: &Gpu, lamps: &LampBuffers, elements: &[usize]) -> Result<(), ExecutorError> {
        let most = gpu.limits.max_storage_buffer_binding_size.min(gpu.limits.max_buffer_size);
        let Family { what, remedy, .. } = self.family;
        let mut is_new = false;
        for ((own, buffer), &count) in self.family.buffers.iter().zip(&mut self.buffers).zip(elements) {
            let bytes = count as u64 * own.stride as u64;
            if bytes > most {
                let name = &gpu.info.name;
                return Err(ExecutorError::Device(format!(
                    "{name:?} holds {what} of at most {most} bytes, this takes {bytes}; {remedy}"
                )));
            }
            if buffer.size() < bytes {
                *buffer = storage(gpu, own.name, count, own.stride);
                is_new = true;
            }
        }
        if is_new {
            self.rebind(gpu, lamps);
        }
        Ok(())
    }

    /// Binds the lamps and the buffers, some of which are new ones.
    pub fn rebind(&mut self, gpu: &Gpu, lamps: &LampBuffers) {
        self.group = group(gpu, self.family, &self.pipelines.layout, lamps, &self.buffers);
    }
}

fn group(
    gpu: &Gpu,
    family: &Family,
    layout: &wgpu::BindGroupLayout,
    lamps: &LampBuffers,
    buffers: &[wgpu::Buffer],
) -> wgpu::BindGroup {
    let lamps = lamps.buffers().into_iter().filter(|_| family.has_lamps);
    let entries = numbered(lamps.chain(buffers), 0);
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(family.name), layout, entries: &entries })
}
