//! Pages of the brick cache on the device, and how payloads get into them.

use super::device::{Gpu, UploadPath};
use super::readback::{device_error, map};
use crate::schedule::{ExecutorError, Load};
use crate::stream::{Destination, Item, Workers};
use std::collections::BTreeSet;
use wgpu::BufferUsages;

/// A mapped range that a worker fills.
pub struct MappedRange {
    view: wgpu::BufferViewMut,
}

impl Destination for MappedRange {
    fn fill(&mut self, bytes: &[u8]) {
        self.view.copy_from_slice(bytes);
    }
}

/// The device side of the cache.
pub struct CachePages {
    pages: Vec<wgpu::Buffer>,
    staging: Option<wgpu::Buffer>,
    path: UploadPath,
}

impl CachePages {
    /// Allocates pages of the given sizes; a cache of nothing still has one page, so that there is something to bind.
    pub fn new(gpu: &Gpu, sizes: &[u64]) -> Self {
        let mapped = match gpu.upload {
            UploadPath::Mapped => BufferUsages::MAP_WRITE,
            UploadPath::Staged => BufferUsages::empty(),
        };
        let page = |bytes: u64| {
            gpu.buffer("cache page", bytes.max(256), BufferUsages::STORAGE | BufferUsages::COPY_DST | mapped)
        };
        let mut pages: Vec<_> = sizes.iter().map(|&bytes| page(bytes)).collect();
        if pages.is_empty() {
            pages.push(page(0));
        }
        Self { pages, staging: None, path: gpu.upload }
    }

    /// The pages, at least one.
    pub fn pages(&self) -> &[wgpu::Buffer] {
        &self.pages
    }

    /// Copies payloads to their slots: workers write straight into mapped memory, of the pages or of the staging
    /// buffer.
    ///
    /// # Errors
    /// The first payload that could not be read or verified; a device that does not map.
    pub fn load(
        &mut self,
        gpu: &Gpu,
        workers: &Workers,
        loads: &[Load],
        bytes: impl Fn(Item) -> u64,
    ) -> Result<(), ExecutorError> {
        if loads.is_empty() {
            return Ok(());
        }
        let in_place = loads.iter().map(|load| Target {
            item: load.item,
            buffer: load.slot.page as usize,
            offset: load.slot.offset.into(),
            bytes: bytes(load.item),
        });
        let in_place: Vec<Target> = in_place.collect();
        match self.path {
            UploadPath::Mapped => fill(gpu, workers, &self.pages, &in_place),
            UploadPath::Staged => self.load_staged(gpu, workers, &in_place),
        }
    }

    /// Fills the staging buffer from its start, then copies to the places in the pages.
    fn load_staged(&mut self, gpu: &Gpu, workers: &Workers, in_place: &[Target]) -> Result<(), ExecutorError> {
        let mut total = 0;
        let staged = in_place.iter().map(|target| {
            let offset = total;
            total += target.bytes;
            Target { buffer: 0, offset, ..*target }
        });
        let staged: Vec<Target> = staged.collect();
        let staging = match self.staging.take().filter(|s| s.size() >= total) {
            Some(staging) => staging,
            None => gpu.buffer(
                "cache staging",
                total.next_power_of_two().max(1 << 20),
                BufferUsages::MAP_WRITE | BufferUsages::COPY_SRC,
            ),
        };
        let staging = self.staging.insert(staging);
        fill(gpu, workers, std::slice::from_ref(staging), &staged)?;
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        for (from, to) in staged.iter().zip(in_place) {
            encoder.copy_buffer_to_buffer(staging, from.offset, &self.pages[to.buffer], to.offset, to.bytes);
        }
        gpu.queue.submit([encoder.finish()]);
        Ok(())
    }
}

/// Where a payload goes.
#[derive(Clone, Copy)]
struct Target {
    item: Item,
    /// Index of the buffer.
    buffer: usize,
    offset: u64,
    bytes: u64,
}

/// Maps the buffers that `targets` lie in, has the workers fill them, and unmaps.
fn fill(gpu: &Gpu, workers: &Workers, buffers: &[wgpu::Buffer], targets: &[Target]) -> Result<(), ExecutorError> {
    let touched: BTreeSet<usize> = targets.iter().map(|target| target.buffer).collect();
    for &buffer in &touched {
        map(gpu, &buffers[buffer], wgpu::MapMode::Write)?;
    }
    let mut jobs = Vec::with_capacity(targets.len());
    for &Target { item, buffer, offset, bytes } in targets {
        let view = buffers[buffer].get_mapped_range_mut(offset..offset + bytes).map_err(device_error)?;
        jobs.push((item, MappedRange { view }));
    }
    let result = workers.load(jobs).map(drop);
    for &buffer in &touched {
        buffers[buffer].unmap();
    }
    Ok(result?)
}
