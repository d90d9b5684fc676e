//! Pages of the brick cache on the device, and how payloads get into them.

use super::device::{Gpu, UploadPath};
use crate::schedule::{ExecutorError, Load};
use crate::stream::{Destination, Item, Workers};

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
    pub fn new(gpu: &Gpu, sizes: impl Iterator<Item = u64>) -> Self {
        let mapped = match gpu.upload {
            UploadPath::Mapped => wgpu::BufferUsages::MAP_WRITE,
            UploadPath::Staged => wgpu::BufferUsages::empty(),
        };
        let page = |bytes: u64| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("cache page"),
                size: bytes.max(256),
                usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | mapped,
                mapped_at_creation: false,
            })
        };
        let mut pages: Vec<_> = sizes.map(page).collect();
        if pages.is_empty() {
            pages.push(page(0));
        }
        Self { pages, staging: None, path: gpu.upload }
    }

    /// Number of pages.
    pub fn page_count(&self) -> usize {
        self.pages.len()
    }

    /// Bindings of group 2: each page as vectors and as words.
    pub fn bindings(&self) -> Vec<wgpu::BindGroupEntry<'_>> {
        let twice = self.pages.iter().flat_map(|page| [page, page]);
        twice
            .enumerate()
            .map(|(i, page)| wgpu::BindGroupEntry { binding: i as u32, resource: page.as_entire_binding() })
            .collect()
    }

    /// Copies payloads to their slots: workers write straight into mapped memory.
    ///
    /// # Errors
    /// The first payload that could not be read or verified; a device that does not map.
    pub fn load(
        &mut self,
        gpu: &Gpu,
        workers: &mut Workers<MappedRange>,
        loads: &[Load],
        bytes: impl Fn(Item) -> u64,
    ) -> Result<(), ExecutorError> {
        if loads.is_empty() {
            return Ok(());
        }
        match self.path {
            UploadPath::Mapped => self.load_mapped(gpu, workers, loads, bytes),
            UploadPath::Staged => self.load_staged(gpu, workers, loads, bytes),
        }
    }

    fn load_mapped(
        &mut self,
        gpu: &Gpu,
        workers: &mut Workers<MappedRange>,
        loads: &[Load],
        bytes: impl Fn(Item) -> u64,
    ) -> Result<(), ExecutorError> {
        let mut touched: Vec<u32> = loads.iter().map(|l| l.slot.page).collect();
        touched.sort_unstable();
        touched.dedup();
        for &page in &touched {
            map(gpu, &self.pages[page as usize])?;
        }
        let mut jobs = Vec::with_capacity(loads.len());
        for load in loads {
            let start = u64::from(load.slot.offset);
            let range = start..start + bytes(load.item);
            let view = self.pages[load.slot.page as usize].get_mapped_range_mut(range).map_err(device_error)?;
            jobs.push((load.item, MappedRange { view }));
        }
        let result = workers.load(jobs).map(drop);
        for &page in &touched {
            self.pages[page as usize].unmap();
        }
        Ok(result?)
    }

    fn load_staged(
        &mut self,
        gpu: &Gpu,
        workers: &mut Workers<MappedRange>,
        loads: &[Load],
        bytes: impl Fn(Item) -> u64,
    ) -> Result<(), ExecutorError> {
        let total: u64 = loads.iter().map(|l| bytes(l.item)).sum();
        let staging = match self.staging.take().filter(|s| s.size() >= total) {
            Some(staging) => staging,
            None => gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("cache staging"),
                size: total.next_power_of_two().max(1 << 20),
                usage: wgpu::BufferUsages::MAP_WRITE | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            }),
        };
        map(gpu, &staging)?;
        let mut jobs = Vec::with_capacity(loads.len());
        let mut at = 0;
        for load in loads {
            let length = bytes(load.item);
            let view = staging.get_mapped_range_mut(at..at + length).map_err(device_error)?;
            jobs.push((load.item, MappedRange { view }));
            at += length;
        }
        let result = workers.load(jobs).map(drop);
        staging.unmap();
        if result.is_ok() {
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            let mut at = 0;
            for load in loads {
                let length = bytes(load.item);
                let page = &self.pages[load.slot.page as usize];
                encoder.copy_buffer_to_buffer(&staging, at, page, u64::from(load.slot.offset), length);
                at += length;
            }
            gpu.queue.submit([encoder.finish()]);
        }
        self.staging = Some(staging);
        Ok(result?)
    }
}

/// Maps a whole buffer for writing, once the device is done with it.
fn map(gpu: &Gpu, buffer: &wgpu::Buffer) -> Result<(), ExecutorError> {
    let (send, receive) = crossbeam::channel::bounded(1);
    buffer.map_async(wgpu::MapMode::Write, .., move |result| {
        // The receiver outlives the poll below.
        let _ = send.send(result);
    });
    gpu.device.poll(wgpu::PollType::wait_indefinitely()).map_err(device_error)?;
    match receive.try_recv() {
        Ok(Ok(())) => Ok(()),
        Ok(Err(error)) => Err(device_error(error)),
        Err(error) => Err(device_error(error)),
    }
}

/// Puts the driver's words into an executor's error.
pub fn device_error(error: impl std::fmt::Display) -> ExecutorError {
    ExecutorError::Device(format!("failed: {error}"))
}
