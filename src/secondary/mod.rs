//! Approximate visibility: what stands for geometry that is not looked at, and how rays are answered by it.

pub mod df;
pub mod dvf;
pub mod occupancy;
pub mod roma;
pub mod rsm;
