//! brickwalk walks by ray tracing through scenes that do not fit in GPU memory.
//!
//! See `ARCHITECTURE.md` for the house: math → scene → stream → visibility → schedule → kernel → cpu, gpu → render → app.

pub mod app;
pub mod cpu;
pub mod gpu;
pub mod kernel;
pub mod math;
pub mod metrics;
pub mod reference;
pub mod render;
pub mod scene;
pub mod schedule;
pub mod stats;
pub mod stream;
pub mod visibility;
