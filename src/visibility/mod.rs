//! Approximate visibility: what stands for geometry that is not looked at, and how rays are answered by it.
//!
//! [`bom`] has the occupancy of space around the camera, brought together from that of bricks, which need not be resident;
//! [`roma`] answers rays by it. [`distance_field`] is the baseline: distances to occupied cells, and rays that go on by them.

pub mod bom;
pub mod distance_field;
pub mod dvf;
pub mod roma;
pub mod rsm;
