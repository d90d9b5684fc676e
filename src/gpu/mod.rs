//! The wgpu executor: device, kernels, cache pages, timing.

pub mod binary;
pub mod device;
pub mod executor;
pub mod family;
pub mod groups;
pub mod kernels;
pub mod lamps;
pub mod pages;
pub mod probe;
pub mod rays;
pub mod readback;
pub mod scene;
pub mod texels;
pub mod timing;
pub mod wgsl;
