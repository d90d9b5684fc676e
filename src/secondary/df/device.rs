//! Distance fields on the device, and the kernels that make and trace them; made when a walk first asks for them. The
//! fields are [`super::DistanceField`]'s, bit for bit.

use super::maps::FieldMaps;
use crate::gpu::device::Gpu;
use crate::gpu::kernels;
use crate::gpu::kernels::Kernels;
use crate::gpu::method::{Method, check_bytes, grow};
use crate::gpu::rays::storage;
use crate::kernels::dispatch::FIELD_KERNELS;
use crate::kernels::layout::RomaLevel;
use crate::schedule::ExecutorError;
use crate::secondary::occupancy::Bom;
use std::sync::Arc;

/// Pipelines and buffers.
pub struct Field {
    method: Method,
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
        let method = Method::new(gpu, kernels, "field", kernels::field_layout(&gpu.device), &FIELD_KERNELS);
        let [levels, boms, nearest, distances] =
            [("field levels", size_of::<RomaLevel>()), ("field boms", 4), ("nearest", 4), ("distances", 4)]
                .map(|(label, stride)| storage(gpu, label, 1, stride));
        let group = method.group(gpu, [&levels, &boms, &nearest, &distances]);
        Self { method, levels, boms, nearest, distances, maps: FieldMaps::default(), group }
    }

    /// The pipeline of a kernel, if it is one of these.
    pub fn pipeline(&self, name: &str) -> Option<&wgpu::ComputePipeline> {
        self.method.pipeline(name)
    }

    /// Takes base maps, unless they are those that it has, and places the fields.
    ///
    /// # Errors
    /// More than a buffer holds, with how much it does.
    pub fn set(&mut self, gpu: &Gpu, maps: &FieldMaps) -> Result<(), ExecutorError> {
        let boms = &maps.cascades.levels;
        let bom_words: u64 = boms.iter().map(|bom| bom.words().len() as u64).sum();
        let (nearest, distances) = (maps.nearest_words(), maps.distance_words());
        let bytes = 4 * bom_words.max(nearest).max(distances);
        check_bytes(gpu, bytes, "distance fields", "give a smaller --df-size")?;
        let grown = [
            grow(gpu, &mut self.levels, "field levels", maps.levels.len(), size_of::<RomaLevel>()),
            grow(gpu, &mut self.boms, "field boms", bom_words as usize, 4),
            grow(gpu, &mut self.nearest, "nearest", nearest as usize, 4),
            grow(gpu, &mut self.distances, "distances", distances as usize, 4),
        ];
        if grown.contains(&true) {
            self.group = self.method.group(gpu, [&self.levels, &self.boms, &self.nearest, &self.distances]);
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
