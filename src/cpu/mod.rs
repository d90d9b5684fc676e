//! The executor that needs no graphics device: a twin of every kernel, run by rayon over bands of rays and over tiles.
//!
//! A twin has the name of its kernel in `shaders/` and the same operations in the same order, in f32; what the WGSL guards with
//! `barrier` rounds as it stands here, because Rust neither contracts nor reassociates. So both executors find the same hits, bit
//! for bit, where rays are the same. Rays differ where they depend on functions that WGSL leaves some ulps (sine, cosine,
//! inverse square root): those of soft shadows, occlusion, diffuse and mirrored light.
//!
//! Intersection kernels take rays of one octant together (`packet.rs`): they meet children in the same order, so that each has the
//! hits, uses and counts that it has alone.
//!
//! Geometry and attributes of resident bricks are the verified bytes that a worker read, shared with the host cache: a brick
//! is traversed where it lies. Slots only say what the budget holds.

mod bc5;
mod bc7;
pub mod brick;
pub mod cache;
mod dvf;
pub mod executor;
mod field;
mod generate;
mod gloss;
mod indices;
mod intersect_all;
mod intersect_binary;
mod intersect_list;
mod interval;
pub mod isa;
mod lamps;
pub mod leaf;
mod light;
pub mod node;
mod opacity;
mod packet;
mod packet_node;
mod packet_surface;
mod packet_triangle;
mod packet_walk;
mod pair_counts;
mod query;
mod query_all;
mod query_pairs;
mod random;
mod rays;
mod resolve;
mod roma;
mod roma_cosine;
mod rsm;
mod sample;
mod scene;
mod shade;
mod texture;
mod tile_bounds;
mod tile_lists;
mod tile_walk;
mod vector;
mod walk_brick;
mod wide;

#[cfg(test)]
mod lockstep;
#[cfg(test)]
mod lockstep_tests;
#[cfg(test)]
mod packet_tests;
#[cfg(test)]
mod texture_tests;

pub use executor::CpuExecutor;
pub use gloss::Gloss;

use crate::kernel::DeviceInfo;

/// Rays that are tested together at most.
pub fn lanes() -> u32 {
    isa::Best::detect().lanes()
}

/// What summaries say of the processor.
pub fn device_info() -> DeviceInfo {
    DeviceInfo {
        name: "cpu".into(),
        driver: "brickwalk".into(),
        driver_info: format!("{} threads, {}", rayon::current_num_threads(), isa::Best::detect().name()),
        backend: "cpu".into(),
        upload: "in place",
        timestamps: true,
    }
}
