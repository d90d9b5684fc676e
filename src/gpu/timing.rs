//! Device time of every dispatch, by timestamps where the device has them.

use super::device::Gpu;
use wgpu::BufferUsages;

/// Two timestamps a dispatch.
pub struct Timing {
    set: Option<(wgpu::QuerySet, wgpu::Buffer)>,
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
            let usage = BufferUsages::QUERY_RESOLVE | BufferUsages::COPY_SRC;
            (set, gpu.buffer("timestamps", 16 * u64::from(dispatches), usage))
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

    /// What timestamps are read back of; nothing without them.
    pub fn buffer(&self) -> Option<&wgpu::Buffer> {
        self.set.as_ref().map(|(_, resolved)| resolved)
    }

    /// Puts the timestamps of `dispatches` into [`Self::buffer`].
    pub fn resolve(&self, encoder: &mut wgpu::CommandEncoder, dispatches: u32) {
        if let Some((set, resolved)) = self.set.as_ref().filter(|_| dispatches > 0) {
            encoder.resolve_query_set(set, 0..2 * dispatches, resolved, 0);
        }
    }

    /// Milliseconds of each dispatch, from the bytes of [`Self::buffer`]; none where there are no timestamps.
    pub fn ms(&self, bytes: &[u8]) -> Vec<f64> {
        let stamps: Vec<u64> = bytemuck::pod_collect_to_vec(bytes);
        stamps.chunks_exact(2).map(|p| p[1].saturating_sub(p[0]) as f64 * self.period_ns * 1e-6).collect()
    }
}
