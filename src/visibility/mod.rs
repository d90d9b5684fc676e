//! Approximate visibility: what stands for geometry that is not looked at, and how rays are answered by it.
//!
//! [`bom`] has the occupancy of space around the camera, brought together from that of bricks, which need not be resident;
//! [`roma`] answers rays by it.

pub mod bom;
pub mod bom_resident;
pub mod roma;
