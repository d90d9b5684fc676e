//! The laboratory: benchmarks of the papers, the selftest, and the comparison of both executors.

pub mod bench;
pub mod console;
#[cfg(test)]
mod lockstep;
pub mod selftest;
pub mod study;
