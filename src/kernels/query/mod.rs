//! Twins of the kernels that decide which bricks tiles and rays need.

pub mod interval;
// A twin's file has the name of its kernel.
#[allow(clippy::module_inception)]
pub mod query;
pub mod query_all;
pub mod query_pairs;
pub mod stand_ins;
pub mod tile_bounds;
pub mod tile_lists;
pub mod tile_walk;
pub mod wanted;
