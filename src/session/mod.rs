//! The front door: opens a scene with an executor and a cache.

pub mod device;
pub mod lighting;
pub mod open;
