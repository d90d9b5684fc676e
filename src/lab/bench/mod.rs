//! Benches: `brickwalk bench chc` (`chc/`), `brickwalk bench roma` (`roma/`), `brickwalk bench dvf` (`dvf/`),
//! `brickwalk bench displacement` (`displacement/`): the experiments of papers on our scenes, each number beside the
//! paper's; `brickwalk bench lod` (`lod/`): levels of detail beside exact rays; and `brickwalk bench executors`
//! (`executors.rs`).
//!
//! Everything runs in this process. `runner.rs` goes through what is to be measured, each finished measurement is a
//! line of a file (`store.rs`), and tables, plots and pages are made from these lines alone (`results.rs`).

pub mod args;
pub mod chc;
pub mod displacement;
pub mod dvf;
pub mod executors;
pub mod lod;
#[cfg(test)]
mod published;
pub(super) mod results;
pub mod roma;
pub(super) mod runner;
pub(super) mod scenes;
pub mod store;
