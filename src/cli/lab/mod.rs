//! Commands of the laboratory.

pub mod bench;
pub mod study;
