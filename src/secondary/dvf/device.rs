//! Discrete visibility fields on the device, and the kernels that make them and answer rays by them; made when a walk
//! first asks for them.

use super::maps::{DvfMaps, sweep_elements};
use super::mask::UNKNOWN;
use crate::gpu::device::Gpu;
use crate::gpu::kernels;
use crate::gpu::kernels::Kernels;
use crate::gpu::method::{Method, check_bindings, check_bytes, grow};
use crate::gpu::rays::storage;
use crate::kernels::dispatch::DVF_KERNELS;
use crate::kernels::layout::{DvfGrid, DvfTriangle};
use crate::schedule::ExecutorError;
use std::sync::Arc;

/// Storage buffers of the kernels: 7 of the scene, 5 of the rays, 9 of their own, 8 of shading; one more with opacity.
const STORAGE_BUFFERS: u32 = 29;

const WHAT: &str = "fields of visibility";
const REMEDY: &str = "give fewer --dvf-cells or a smaller --dvf-octahedral";

/// Pipelines and buffers.
pub struct Dvf {
    method: Method,
    grid: wgpu::Buffer,
    masks: wgpu::Buffer,
    labels: wgpu::Buffer,
    triangles: wgpu::Buffer,
    sums: wgpu::Buffer,
    directions: wgpu::Buffer,
    waiting: wgpu::Buffer,
    fresh: wgpu::Buffer,
    tally: wgpu::Buffer,
    maps: DvfMaps,
    /// Group 2 of all kernels.
    pub group: wgpu::BindGroup,
}

impl Dvf {
    /// Of nothing.
    ///
    /// # Errors
    /// The device binds too few buffers.
    pub fn new(gpu: &Gpu, kernels: &Kernels) -> Result<Self, ExecutorError> {
        check_bindings(gpu, kernels, STORAGE_BUFFERS, WHAT)?;
        let method = Method::new(gpu, kernels, "dvf", kernels::dvf_layout(&gpu.device), &DVF_KERNELS);
        let [grid, masks, labels, triangles, sums, directions, waiting, fresh, tally] = [
            ("dvf grid", size_of::<DvfGrid>()),
            ("dvf masks", 4),
            ("dvf labels", 4),
            ("dvf triangles", size_of::<DvfTriangle>()),
            ("dvf sums", 8),
            ("dvf directions", 16),
            ("dvf waiting", 4),
            ("dvf fresh", 4),
            ("dvf tally", 4),
        ]
        .map(|(label, stride)| storage(gpu, label, 1, stride));
        let buffers = [&grid, &masks, &labels, &triangles, &sums, &directions, &waiting, &fresh, &tally];
        let group = method.group(gpu, buffers);
        let maps = DvfMaps::default();
        Ok(Self { method, grid, masks, labels, triangles, sums, directions, waiting, fresh, tally, maps, group })
    }

    /// The pipeline of a kernel, if it is one of these.
    pub fn pipeline(&self, name: &str) -> Option<&wgpu::ComputePipeline> {
        self.method.pipeline(name)
    }

    /// Places a field; see [`crate::kernels::FrameExecutor::set_dvf`].
    ///
    /// # Errors
    /// More than a buffer holds, with how much it does.
    pub fn set(&mut self, gpu: &Gpu, maps: &DvfMaps) -> Result<(), ExecutorError> {
        let (words, cells) = (maps.mask_words(), maps.cells());
        check_bytes(gpu, 4 * words as u64, WHAT, REMEDY)?;
        let is_same = match (&maps.field, &self.maps.field) {
            (Some(one), Some(other)) => Arc::ptr_eq(one, other),
            (None, _) => !maps.is_new && (self.maps.mask_words(), self.maps.cells()) == (words, cells),
            _ => false,
        };
        let grown = [
            grow(gpu, &mut self.masks, "dvf masks", words, 4),
            grow(gpu, &mut self.labels, "dvf labels", cells, 4),
            grow(gpu, &mut self.directions, "dvf directions", maps.directions.len(), 16),
            grow(gpu, &mut self.waiting, "dvf waiting", maps.waiting_words, 4),
            grow(gpu, &mut self.fresh, "dvf fresh", maps.fresh.as_ref().map_or(0, |fresh| fresh.words().len()), 4),
        ];
        if grown.contains(&true) {
            self.rebind(gpu);
        }
        match &maps.field {
            _ if is_same => {}
            Some(field) => {
                gpu.queue.write_buffer(&self.masks, 0, bytemuck::cast_slice(&field.masks));
                gpu.queue.write_buffer(&self.labels, 0, bytemuck::cast_slice(&field.labels));
            }
            None => {
                gpu.queue.write_buffer(&self.masks, 0, &vec![0; 4 * words]);
                gpu.queue.write_buffer(&self.labels, 0, bytemuck::cast_slice(&vec![UNKNOWN; cells]));
            }
        }
        if !maps.directions.is_empty() {
            gpu.queue.write_buffer(&self.directions, 0, bytemuck::cast_slice(&maps.directions));
        }
        if let Some(fresh) = &maps.fresh
            && self.maps.fresh.as_ref().is_none_or(|before| !Arc::ptr_eq(before, fresh))
        {
            gpu.queue.write_buffer(&self.fresh, 0, bytemuck::cast_slice(fresh.words()));
        }
        let triangles = self.maps.grid.triangles;
        self.maps = maps.clone();
        self.maps.grid.triangles = triangles;
        gpu.queue.write_buffer(&self.grid, 0, bytemuck::bytes_of(&self.maps.grid));
        Ok(())
    }

    /// Takes the triangles of a group, on which so many points lie.
    ///
    /// # Errors
    /// More than a buffer holds.
    pub fn set_triangles(
        &mut self,
        gpu: &Gpu,
        triangles: &[DvfTriangle],
        point_count: u32,
    ) -> Result<(), ExecutorError> {
        check_bytes(gpu, size_of_val(triangles) as u64, WHAT, REMEDY)?;
        let elements = sweep_elements(triangles.len() as u32) as usize;
        let grown = [
            grow(gpu, &mut self.triangles, "dvf triangles", triangles.len(), size_of::<DvfTriangle>()),
            grow(gpu, &mut self.sums, "dvf sums", elements, 8),
        ];
        if grown.contains(&true) {
            self.rebind(gpu);
        }
        gpu.queue.write_buffer(&self.triangles, 0, bytemuck::cast_slice(triangles));
        (self.maps.grid.triangles, self.maps.grid.point_count) = (triangles.len() as u32, point_count);
        gpu.queue.write_buffer(&self.grid, 0, bytemuck::bytes_of(&self.maps.grid));
        Ok(())
    }

    /// Takes what kernels count on, or the points that are listed.
    ///
    /// # Errors
    /// More than a buffer holds.
    pub fn set_tally(&mut self, gpu: &Gpu, words: &[u32]) -> Result<(), ExecutorError> {
        check_bytes(gpu, size_of_val(words) as u64, WHAT, REMEDY)?;
        if grow(gpu, &mut self.tally, "dvf tally", words.len(), 4) {
            self.rebind(gpu);
        }
        gpu.queue.write_buffer(&self.tally, 0, bytemuck::cast_slice(words));
        self.maps.grid.listed = words.len() as u32;
        gpu.queue.write_buffer(&self.grid, 0, bytemuck::bytes_of(&self.maps.grid));
        Ok(())
    }

    /// The buffer of these, and how many words of it are in use.
    pub fn tally(&self) -> (&wgpu::Buffer, usize) {
        (&self.tally, self.maps.grid.listed as usize)
    }

    /// The buffers of masks, labels and sums, and how many words of them are in use.
    pub fn results(&self) -> [(&wgpu::Buffer, usize); 3] {
        let elements = sweep_elements(self.maps.grid.triangles) as usize;
        [(&self.masks, self.maps.mask_words()), (&self.labels, self.maps.cells()), (&self.sums, 2 * elements)]
    }

    /// The bits of rays that wait, for tests.
    #[cfg(test)]
    pub fn waiting(&self) -> (&wgpu::Buffer, usize) {
        (&self.waiting, self.maps.waiting_words)
    }

    fn rebind(&mut self, gpu: &Gpu) {
        let Self { grid, masks, labels, triangles, sums, directions, waiting, fresh, tally, .. } = self;
        let buffers = [&*grid, masks, labels, triangles, sums, directions, waiting, fresh, tally];
        self.group = self.method.group(gpu, buffers);
    }
}
