//! Twins of the kernels by which paths go on from hit to hit.

// A twin's file has the name of its kernel.
pub mod generate_path;
pub mod move_paths;
