//! Twins of the kernels that intersect rays with bricks.

pub mod binary_tree;
pub mod brick;
pub mod flat_node;
pub mod flat_triangle;
pub mod hidden;
pub mod intersect_all;
pub mod intersect_binary;
pub mod intersect_list;
pub mod leaf;
pub mod levels;
pub mod node;
pub mod opacity;
pub mod packet;
pub mod packet_fill;
pub mod packet_flat;
pub mod packet_node;
pub mod packet_surface;
pub mod packet_triangle;
pub mod packet_walk;
pub mod run;
pub mod scratch;
pub mod walk_brick;

#[cfg(test)]
mod packet_tests;
