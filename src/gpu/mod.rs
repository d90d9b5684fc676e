//! The wgpu executor: device, layouts, kernels, cache pages, timing.

pub mod binary;
pub mod device;
pub mod dispatch;
pub mod executor;
pub mod groups;
pub mod kernels;
pub mod layout;
pub mod pages;
pub mod probe;
pub mod rays;
pub mod readback;
pub mod scene;
pub mod texels;
pub mod timing;
pub mod wgsl;

#[rustfmt::skip]
mod layout_checks {
    use super::layout;
    include!(concat!(env!("OUT_DIR"), "/layout_checks.rs"));
}
