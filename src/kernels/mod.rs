//! What both executors share: the structures that kernels read and write, which kernels a step consists of, the scene
//! relative to a frame's reference point, and what their counters say.
//!
//! A kernel is a WGSL file in `shaders/` and a function of the same name in a family here, its twin.
//!
//! Modules know those before them: plain structures ([`vector`], [`layout`], [`frame`], [`lamps`], [`payloads`] …);
//! what every twin is given ([`bound`], [`rays`], [`tiles`]); the families [`trace`], [`query`], [`texture`],
//! [`shade`] and [`paths`]; the [`table`], [`noise`] and [`denoise`]; [`dispatch`]. [`simd`] lies below `bound`, and
//! knows of the families the node test alone ([`trace::node`]).

pub mod bound;
pub mod denoise;
pub mod dispatch;
pub mod emitter_groups;
pub mod emitters;
pub mod flat;
pub mod frame;
mod frame_executor;
pub mod lamps;
pub mod layer_tables;
pub mod layout;
pub mod levels;
pub mod noise;
pub mod opacity;
pub mod paths;
pub mod payloads;
pub mod query;
pub mod rays;
pub mod reflectance;
pub mod report;
mod setup;
pub mod shade;
pub mod simd;
pub mod table;
pub mod texture;
pub mod textures;
pub mod tiles;
pub mod trace;
pub mod vector;

pub use frame_executor::{DeviceInfo, FrameExecutor, padded};
pub use lamps::Lamps;
pub use setup::{Directions, Extent, Keep, Lod, Setup, Tuning, View};
