//! Vectors of numbers by instruction set.

pub mod isa;
pub mod wide;
