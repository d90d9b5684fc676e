//! Device time of every dispatch, by timestamps where the device has them.

use super::device::Gpu;
use super::readback::take;
use crate::schedule::ExecutorError;
use wgpu::BufferUsages;

/// Two timestamps a dispatch.
pub struct Timing {
    set: Option<(wgpu::QuerySet, wgpu::Buffer, wgpu::Buffer)>,
    period_ns: f64,
}

impl Timing {
    /// For up to `dispatches` of one submission.
    pub fn new(gpu: &Gpu, dispatches: u32) -> Self {
        let set = gpu.timestamps.then(|| {
            let set = gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("timestamps"),
                ty: wgpu::QueryType::Timestamp,
                count: 2 * dispatches,
            });
            let buffer = |usage| gpu.buffer("timestamps", 16 * u64::from(dispatches), usage);
            let resolved = buffer(BufferUsages::QUERY_RESOLVE | BufferUsages::COPY_SRC);
            (set, resolved, buffer(BufferUsages::MAP_READ | BufferUsages::COPY_DST))
        });
        Self { set, period_ns: f64::from(gpu.queue.get_timestamp_period()) }
    }

    /// What a compute pass writes as dispatch `i`.
    pub fn writes(&self, i: u32) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        self.set.as_ref().map(|(query_set, ..)| wgpu::ComputePassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: Some(2 * i),
            end_of_pass_write_index: Some(2 * i + 1),
        })
    }

    /// Encodes the way of `dispatches` timestamp pairs to the host.
    pub fn resolve(&self, encoder: &mut wgpu::CommandEncoder, dispatches: u32) {
        if let Some((set, resolved, mapped)) = self.set.as_ref().filter(|_| dispatches > 0) {
            encoder.resolve_query_set(set, 0..2 * dispatches, resolved, 0);
            encoder.copy_buffer_to_buffer(resolved, 0, mapped, 0, 16 * u64::from(dispatches));
        }
    }

    /// Milliseconds of each dispatch of the submission just waited for; zeros without timestamps.
    ///
    /// # Errors
    /// The device's.
    pub fn read(&self, gpu: &Gpu, dispatches: usize) -> Result<Vec<f64>, ExecutorError> {
        let Some((_, _, mapped)) = self.set.as_ref().filter(|_| dispatches > 0) else {
            return Ok(vec![0.0; dispatches]);
        };
        let stamps: Vec<u64> = bytemuck::pod_collect_to_vec(&take(gpu, mapped, 16 * dispatches as u64)?);
        Ok(stamps.chunks_exact(2).map(|p| p[1].saturating_sub(p[0]) as f64 * self.period_ns * 1e-6).collect())
    }
}
