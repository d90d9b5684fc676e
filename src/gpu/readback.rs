//! Small buffers read back after each submission, and whole buffers at the end of a frame.

use super::device::Gpu;
use crate::schedule::ExecutorError;
use bytemuck::Pod;
use wgpu::BufferUsages;

/// Most bytes of a whole buffer that are on their way at a time.
const PIECE: u64 = 64 << 20;

/// A reused host-visible buffer.
pub struct Readback {
    buffer: wgpu::Buffer,
    used: u64,
}

fn mappable(gpu: &Gpu, bytes: u64) -> wgpu::Buffer {
    gpu.buffer("readback", bytes.max(16).next_multiple_of(8), BufferUsages::MAP_READ | BufferUsages::COPY_DST)
}

impl Readback {
    /// Room for `bytes` a submission.
    pub fn new(gpu: &Gpu, bytes: u64) -> Self {
        Self { buffer: mappable(gpu, bytes), used: 0 }
    }

    /// Appends copies of whole buffers; their sizes must add up to no more than the room.
    pub fn copy(&mut self, encoder: &mut wgpu::CommandEncoder, buffers: &[&wgpu::Buffer]) {
        self.used = 0;
        for buffer in buffers {
            let bytes = buffer.size().min(self.buffer.size() - self.used);
            encoder.copy_buffer_to_buffer(buffer, 0, &self.buffer, self.used, bytes);
            self.used += bytes;
        }
    }

    /// Waits for the submission and takes what was copied.
    ///
    /// # Errors
    /// The device's.
    pub fn wait(&self, gpu: &Gpu) -> Result<Vec<u8>, ExecutorError> {
        let mut taken = Vec::new();
        self.take(gpu, self.used, |bytes| taken.extend_from_slice(bytes))?;
        Ok(taken)
    }

    /// Reads a whole buffer, in pieces of bounded size; makes room for them. Bytes behind the last whole `T` are left
    /// out.
    ///
    /// # Errors
    /// The device's.
    pub fn read<T: Pod>(&mut self, gpu: &Gpu, source: &wgpu::Buffer) -> Result<Vec<T>, ExecutorError> {
        self.first(gpu, source, source.size() as usize / size_of::<T>())
    }

    /// Reads so many elements from the start of a buffer, or all that it has, as [`Self::read`] does.
    ///
    /// # Errors
    /// The device's.
    pub fn first<T: Pod>(&mut self, gpu: &Gpu, source: &wgpu::Buffer, count: usize) -> Result<Vec<T>, ExecutorError> {
        // Copies are made of words.
        let size = ((count * size_of::<T>()) as u64).next_multiple_of(4).min(source.size());
        // Of whole elements, and of words, which copies are made of.
        let piece = PIECE / (4 * size_of::<T>() as u64) * (4 * size_of::<T>() as u64);
        if self.buffer.size() < size.min(piece) {
            self.buffer = mappable(gpu, size.min(piece));
        }
        let mut all = Vec::with_capacity(size as usize / size_of::<T>());
        let mut at = 0;
        while at < size {
            let bytes = (size - at).min(piece);
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            encoder.copy_buffer_to_buffer(source, at, &self.buffer, 0, bytes);
            gpu.queue.submit([encoder.finish()]);
            self.take(gpu, bytes, |bytes| {
                let whole = &bytes[..bytes.len() / size_of::<T>() * size_of::<T>()];
                // Mapped memory is aligned as a rule.
                match bytemuck::try_cast_slice(whole) {
                    Ok(elements) => all.extend_from_slice(elements),
                    Err(_) => all.extend(bytemuck::pod_collect_to_vec::<u8, T>(whole)),
                }
            })?;
            at += bytes;
        }
        Ok(all)
    }

    /// Shows what the first `bytes` hold once the device is done.
    fn take(&self, gpu: &Gpu, bytes: u64, show: impl FnOnce(&[u8])) -> Result<(), ExecutorError> {
        map(gpu, &self.buffer, wgpu::MapMode::Read)?;
        show(&self.buffer.get_mapped_range(..bytes).map_err(device_error)?);
        self.buffer.unmap();
        Ok(())
    }
}

/// Maps a whole buffer, once the device is done with it.
pub fn map(gpu: &Gpu, buffer: &wgpu::Buffer, mode: wgpu::MapMode) -> Result<(), ExecutorError> {
    let (send, receive) = std::sync::mpsc::sync_channel(1);
    buffer.map_async(mode, .., move |result| {
        // The receiver outlives the poll below.
        let _ = send.send(result);
    });
    let done = gpu.device.poll(wgpu::PollType::wait_indefinitely());
    // It says more than what became of the wait.
    check(gpu)?;
    done.map_err(device_error)?;
    receive.try_recv().map_err(device_error)?.map_err(device_error)
}

/// Whether the device refused something that nobody waited for.
pub fn check(gpu: &Gpu) -> Result<(), ExecutorError> {
    gpu.complaint().map_or(Ok(()), |text| Err(device_error(text)))
}

/// Puts the driver's words into an executor's error.
pub fn device_error(error: impl std::fmt::Display) -> ExecutorError {
    ExecutorError::Device(format!("failed: {error}"))
}
