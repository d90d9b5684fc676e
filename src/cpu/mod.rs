//! The executor that needs no graphics device: a twin of every kernel, run by rayon over bands of rays and over tiles.
//!
//! A twin has the name of its kernel in `shaders/` and the same operations in the same order, in f32; what the WGSL
//! guards with `barrier` rounds as it stands here, because Rust neither contracts nor reassociates. So both executors
//! find the same hits, bit for bit, where rays are the same. Rays differ where they depend on functions that WGSL
//! leaves some ulps (sine, cosine, inverse square root): those of soft shadows, occlusion, diffuse and glossy light.
//!
//! Intersection kernels take rays of one octant together (`packet.rs`): they meet children in the same order, so that
//! each has the hits, uses and counts that it has alone.
//!
//! Geometry and attributes of resident bricks are the verified bytes that a worker read, shared with the host cache: a
//! brick is traversed where it lies. Slots only say what the budget holds.

pub mod cache;
pub mod executor;
mod memory;

pub use executor::CpuExecutor;
pub use memory::available_memory;

use crate::kernels::DeviceInfo;
use crate::kernels::simd::isa::Best;

/// Rays that are tested together at most.
pub fn lanes() -> u32 {
    Best::detect().describe().1
}

/// What summaries say of the processor.
pub fn device_info() -> DeviceInfo {
    DeviceInfo {
        name: "cpu".into(),
        driver: "brickwalk".into(),
        driver_info: format!("{} threads, {}", rayon::current_num_threads(), Best::detect().describe().0),
        backend: "cpu".into(),
        upload: "in place",
        timestamps: true,
    }
}
