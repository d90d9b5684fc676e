//! Distance fields on the device, and the kernels that make and trace them; made when a walk first asks for them. The fields are
//! [`crate::visibility::distance_field::DistanceField`]'s, bit for bit.

use super::device::Gpu;
use super::groups::numbered;
use super::kernels::{self, Kernels};
use super::rays::storage;
use super::roma::grow;
use crate::kernel::dispatch::FIELD_KERNELS;
use crate::kernel::field::FieldMaps;
use crate::kernel::layout::RomaLevel;
use crate::schedule::ExecutorError;
use crate::visibility::bom::Bom;
use std::sync::Arc;

/// Pipelines and buffers.
pub struct Field {
    layout: wgpu::BindGroupLayout,
    pipelines: Vec<(&'static str, wgpu::ComputePipeline)>,
    levels: wgpu::Buffer,
    boms: wgpu::Buffer,
    nearest: wgpu::Buffer,
    /// Of all fields, level by level: two f16 a word.
    pub distances: wgpu::Buffer,
    /// How they are placed.
    pub maps: FieldMaps,
    /// Group 2 of all kernels.
    pub group: wgpu::BindGroup,
}

impl Field {
    /// Of nothing.
    pub fn new(gpu: &Gpu, kernels: &Kernels) -> Self {
        let layout = kernels::field_layout(&gpu.device);
        let groups = [Some(&kernels.scene), Some(&kernels.rays), Some(&layout), Some(&kernels.shading)];
        let pipeline_layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("field"),
            bind_group_layouts: &groups,
            immediate_size: 0,
        });
        let pipeline = |name: &str| {
            let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(name),
                source: wgpu::ShaderSource::Wgsl(kernels::source(name, kernels.pages).into()),
            });
            gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(name),
                layout: Some(&pipeline_layout),
                module: &module,
                entry_point: Some("main"),
                compilation_options: Default::default(),
                cache: None,
            })
        };
        let pipelines = FIELD_KERNELS.map(|name| (name, pipeline(name))).into();
        let [levels, boms, nearest, distances] =
            [("field levels", size_of::<RomaLevel>()), ("field boms", 4), ("nearest", 4), ("distances", 4)]
                .map(|(label, stride)| storage(gpu, label, 1, stride));
        let group = group(gpu, &layout, [&levels, &boms, &nearest, &distances]);
        Self { layout, pipelines, levels, boms, nearest, distances, maps: FieldMaps::default(), group }
    }

    /// The pipeline of a kernel, if it is one of these.
    pub fn pipeline(&self, name: &str) -> Option<&wgpu::ComputePipeline> {
        self.pipelines.iter().find(|(own, _)| *own == name).map(|(_, pipeline)| pipeline)
    }

    /// Takes base maps, unless they are those that it has, and places the fields.
    ///
    /// # Errors
    /// More than a buffer holds, with how much it does.
    pub fn set(&mut self, gpu: &Gpu, maps: &FieldMaps) -> Result<(), ExecutorError> {
        let boms = &maps.cascades.levels;
        let bom_words: u64 = boms.iter().map(|bom| bom.words().len() as u64).sum();
        let (nearest, distances) = (maps.nearest_words(), maps.distance_words());
        check(gpu, 4 * bom_words.max(nearest).max(distances))?;
        let grown = [
            grow(gpu, &mut self.levels, "field levels", maps.levels.len(), size_of::<RomaLevel>()),
            grow(gpu, &mut self.boms, "field boms", bom_words as usize, 4),
            grow(gpu, &mut self.nearest, "nearest", nearest as usize, 4),
            grow(gpu, &mut self.distances, "distances", distances as usize, 4),
        ];
        if grown.contains(&true) {
            self.group = group(gpu, &self.layout, [&self.levels, &self.boms, &self.nearest, &self.distances]);
        }
        gpu.queue.write_buffer(&self.levels, 0, bytemuck::cast_slice(&maps.levels));
        if grown[1] || !Arc::ptr_eq(&self.maps.cascades, &maps.cascades) {
            let mut at = 0;
            for words in boms.iter().map(Bom::words) {
                gpu.queue.write_buffer(&self.boms, at, bytemuck::cast_slice(words));
                at += size_of_val(words) as u64;
            }
        }
        self.maps = maps.clone();
        Ok(())
    }
}

fn group(gpu: &Gpu, layout: &wgpu::BindGroupLayout, buffers: [&wgpu::Buffer; 4]) -> wgpu::BindGroup {
    let entries = numbered(buffers, 0);
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some("field"), layout, entries: &entries })
}

/// Refuses fields of more bytes than the device binds.
fn check(gpu: &Gpu, bytes: u64) -> Result<(), ExecutorError> {
    let most = gpu.limits.max_storage_buffer_binding_size.min(gpu.limits.max_buffer_size);
    if bytes <= most {
        return Ok(());
    }
    Err(ExecutorError::Device(format!(
        "{:?} holds distance fields of at most {most} bytes, these have {bytes}; give a smaller --df-size",
        gpu.info.name
    )))
}
