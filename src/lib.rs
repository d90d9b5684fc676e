//! brickwalk walks by ray tracing through scenes that do not fit in GPU memory.
//!
//! See `ARCHITECTURE.md` for the house.

pub mod cli;
pub mod counters;
pub mod cpu;
pub mod frame;
pub mod gpu;
pub mod kernels;
pub mod lab;
pub mod math;
pub mod metrics;
pub mod output;
pub mod picture;
pub mod reference;
pub mod scene;
pub mod schedule;
pub mod secondary;
pub mod session;
pub mod stream;
