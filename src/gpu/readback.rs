//! Small buffers read back after each submission, and whole buffers at the end of a frame.

use super::device::Gpu;
use crate::schedule::ExecutorError;
use wgpu::BufferUsages;

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
        take(gpu, &self.buffer, self.used)
    }
}

/// Reads a whole buffer, in pieces of bounded size.
///
/// # Errors
/// The device's.
pub fn read(gpu: &Gpu, source: &wgpu::Buffer) -> Result<Vec<u8>, ExecutorError> {
    const PIECE: u64 = 64 << 20;
    let piece = mappable(gpu, source.size().min(PIECE));
    let mut out = Vec::with_capacity(source.size() as usize);
    let mut at = 0;
    while at < source.size() {
        let bytes = (source.size() - at).min(PIECE);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(source, at, &piece, 0, bytes);
        gpu.queue.submit([encoder.finish()]);
        out.extend_from_slice(&take(gpu, &piece, bytes)?);
        at += bytes;
    }
    Ok(out)
}

/// Maps the first `bytes` of a readable buffer once the device is done, and copies them.
pub fn take(gpu: &Gpu, buffer: &wgpu::Buffer, bytes: u64) -> Result<Vec<u8>, ExecutorError> {
    map(gpu, buffer, wgpu::MapMode::Read)?;
    let copy = buffer.get_mapped_range(..bytes).map_err(device_error)?.to_vec();
    buffer.unmap();
    Ok(copy)
}

/// Maps a whole buffer, once the device is done with it.
pub fn map(gpu: &Gpu, buffer: &wgpu::Buffer, mode: wgpu::MapMode) -> Result<(), ExecutorError> {
    let (send, receive) = std::sync::mpsc::sync_channel(1);
    buffer.map_async(mode, .., move |result| {
        // The receiver outlives the poll below.
        let _ = send.send(result);
    });
    gpu.device.poll(wgpu::PollType::wait_indefinitely()).map_err(device_error)?;
    receive.try_recv().map_err(device_error)?.map_err(device_error)
}

/// Puts the driver's words into an executor's error.
pub fn device_error(error: impl std::fmt::Display) -> ExecutorError {
    ExecutorError::Device(format!("failed: {error}"))
}
