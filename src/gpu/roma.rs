//! Occupancy maps on the device, and the kernels that make and trace them; made when a walk first asks for them.

use super::device::Gpu;
use super::groups::numbered;
use super::kernels::{self, Kernels};
use super::rays::storage;
use crate::kernel::dispatch::{ROMA_MEASURE, ROMA_NEAR, ROMA_ROTATE, ROMA_TRACE};
use crate::kernel::layout::{RomaLevel, RomaMap};
use crate::kernel::roma::RomaMaps;
use crate::schedule::ExecutorError;
use crate::visibility::bom::{Cascades, clearance};
use rayon::prelude::*;
use std::sync::Arc;

/// Pipelines and buffers.
pub struct Roma {
    layout: wgpu::BindGroupLayout,
    rotate: wgpu::ComputePipeline,
    near: wgpu::ComputePipeline,
    trace: wgpu::ComputePipeline,
    measure: wgpu::ComputePipeline,
    levels: wgpu::Buffer,
    map_records: wgpu::Buffer,
    boms: wgpu::Buffer,
    /// The words of all columns.
    pub columns: wgpu::Buffer,
    cascades: Arc<Cascades>,
    /// How the maps are placed.
    pub maps: RomaMaps,
    /// Group 2 of the kernels.
    pub group: wgpu::BindGroup,
}

impl Roma {
    /// Of nothing.
    pub fn new(gpu: &Gpu, kernels: &Kernels) -> Self {
        let layout = kernels::roma_layout(&gpu.device);
        let groups = [Some(&kernels.scene), Some(&kernels.rays), Some(&layout), Some(&kernels.shading)];
        let pipeline_layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("roma"),
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
        let [levels, map_records, boms, columns] =
            [("roma levels", size_of::<RomaLevel>()), ("roma maps", size_of::<RomaMap>()), ("boms", 4), ("columns", 4)]
                .map(|(label, stride)| storage(gpu, label, 1, stride));
        let group = group(gpu, &layout, [&levels, &map_records, &boms, &columns]);
        let [rotate, near, trace, measure] = [ROMA_ROTATE, ROMA_NEAR, ROMA_TRACE, ROMA_MEASURE].map(pipeline);
        let (cascades, maps) = (Arc::default(), RomaMaps::default());
        Self { layout, rotate, near, trace, measure, levels, map_records, boms, columns, cascades, maps, group }
    }

    /// The pipeline of a kernel, if it is one of these.
    pub fn pipeline(&self, name: &str) -> Option<&wgpu::ComputePipeline> {
        match name {
            ROMA_ROTATE => Some(&self.rotate),
            ROMA_NEAR => Some(&self.near),
            ROMA_TRACE => Some(&self.trace),
            ROMA_MEASURE => Some(&self.measure),
            _ => None,
        }
    }

    /// Takes base maps, unless they are those that it has.
    ///
    /// # Errors
    /// More than a buffer holds, with how much it does.
    pub fn set_cascades(&mut self, gpu: &Gpu, cascades: &Arc<Cascades>) -> Result<(), ExecutorError> {
        if Arc::ptr_eq(&self.cascades, cascades) {
            return Ok(());
        }
        let clearances: Vec<Vec<u8>> = cascades.levels.par_iter().map(clearance).collect();
        let bytes = cascades.levels.iter().map(|bom| size_of_val(bom.words())).sum::<usize>()
            + clearances.iter().map(Vec::len).sum::<usize>();
        let words = bytes / 4;
        check(gpu, bytes as u64)?;
        if grow(gpu, &mut self.boms, "boms", words, 4) {
            self.rebind(gpu);
        }
        let mut at = 0;
        for (bom, clearance) in cascades.levels.iter().zip(&clearances) {
            for bytes in [bytemuck::cast_slice(bom.words()), clearance] {
                gpu.queue.write_buffer(&self.boms, at, bytes);
                at += bytes.len() as u64;
            }
        }
        self.cascades = cascades.clone();
        Ok(())
    }

    /// Places the maps that are made next.
    ///
    /// # Errors
    /// More than a buffer holds, with how much it does.
    pub fn set_maps(&mut self, gpu: &Gpu, maps: &RomaMaps) -> Result<(), ExecutorError> {
        check(gpu, 4 * maps.words())?;
        let grown = [
            grow(gpu, &mut self.columns, "columns", maps.words() as usize, 4),
            grow(gpu, &mut self.map_records, "roma maps", maps.maps.len(), size_of::<RomaMap>()),
            grow(gpu, &mut self.levels, "roma levels", maps.levels.len(), size_of::<RomaLevel>()),
        ];
        if grown.contains(&true) {
            self.rebind(gpu);
        }
        gpu.queue.write_buffer(&self.levels, 0, bytemuck::cast_slice(&maps.levels));
        gpu.queue.write_buffer(&self.map_records, 0, bytemuck::cast_slice(&maps.maps));
        self.maps = maps.clone();
        Ok(())
    }

    fn rebind(&mut self, gpu: &Gpu) {
        self.group = group(gpu, &self.layout, [&self.levels, &self.map_records, &self.boms, &self.columns]);
    }
}

/// Makes room for `count` elements; whether the buffer is a new one.
pub(super) fn grow(gpu: &Gpu, buffer: &mut wgpu::Buffer, label: &str, count: usize, stride: usize) -> bool {
    let grows = buffer.size() < (count * stride) as u64;
    if grows {
        *buffer = storage(gpu, label, count, stride);
    }
    grows
}

fn group(gpu: &Gpu, layout: &wgpu::BindGroupLayout, buffers: [&wgpu::Buffer; 4]) -> wgpu::BindGroup {
    let entries = numbered(buffers, 0);
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some("roma"), layout, entries: &entries })
}

/// Refuses maps of more bytes than the device binds.
fn check(gpu: &Gpu, bytes: u64) -> Result<(), ExecutorError> {
    let most = gpu.limits.max_storage_buffer_binding_size.min(gpu.limits.max_buffer_size);
    if bytes <= most {
        return Ok(());
    }
    Err(ExecutorError::Device(format!(
        "{:?} holds occupancy maps of at most {most} bytes, these have {bytes}; give a smaller --roma-size, --roma-k or --roma-shadow-k",
        gpu.info.name
    )))
}
