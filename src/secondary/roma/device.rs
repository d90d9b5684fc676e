//! Occupancy maps on the device, and the kernels that make and trace them; made when a walk first asks for them.

use super::maps::RomaMaps;
use crate::gpu::device::Gpu;
use crate::gpu::kernels;
use crate::gpu::kernels::Kernels;
use crate::gpu::method::{Method, check_bytes, grow};
use crate::gpu::rays::storage;
use crate::kernels::dispatch::{ROMA_DRAW, ROMA_MEASURE, ROMA_PILOTS, ROMA_ROTATE, ROMA_TRACE};
use crate::kernels::layout::{RomaLevel, RomaMap};
use crate::schedule::ExecutorError;
use crate::secondary::occupancy::{Cascades, clearance};
use rayon::prelude::*;
use std::sync::Arc;

const WHAT: &str = "occupancy maps";
const REMEDY: &str = "give a smaller --roma-size, --roma-k or --roma-shadow-k";

/// Pipelines and buffers.
pub struct Roma {
    method: Method,
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
        let names = [ROMA_ROTATE, ROMA_PILOTS, ROMA_TRACE, ROMA_DRAW, ROMA_MEASURE];
        let method = Method::new(gpu, kernels, "roma", kernels::roma_layout(&gpu.device), &names);
        let [levels, map_records, boms, columns] =
            [("roma levels", size_of::<RomaLevel>()), ("roma maps", size_of::<RomaMap>()), ("boms", 4), ("columns", 4)]
                .map(|(label, stride)| storage(gpu, label, 1, stride));
        let group = method.group(gpu, [&levels, &map_records, &boms, &columns]);
        let (cascades, maps) = (Arc::default(), RomaMaps::default());
        Self { method, levels, map_records, boms, columns, cascades, maps, group }
    }

    /// The pipeline of a kernel, if it is one of these.
    pub fn pipeline(&self, name: &str) -> Option<&wgpu::ComputePipeline> {
        self.method.pipeline(name)
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
        check_bytes(gpu, bytes as u64, WHAT, REMEDY)?;
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
        check_bytes(gpu, 4 * maps.words(), WHAT, REMEDY)?;
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
        self.group = self.method.group(gpu, [&self.levels, &self.map_records, &self.boms, &self.columns]);
    }
}
