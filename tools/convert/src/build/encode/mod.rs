//! Bytes of bricks.
//!
//! `brick` encodes one: its triangles, its tree, its attributes, and by `voxelise` its occupancy. `jobs` does so for
//! many in parallel and writes them in order.

pub(super) mod brick;
pub(super) mod jobs;
pub(super) mod voxelise;
#[cfg(test)]
mod voxelise_tests;
