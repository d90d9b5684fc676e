//! Levels of detail: bricks that stand for others far away (docs/methods/levels.md).
//!
//! Once all bricks are written, a tree over them says which up to four of them, and which up to four levels, a level
//! stands for (`plan`). Levels are made from the bottom up, side by side, each from the payloads of its children as
//! they lie in the file (`merge`), so that memory is bounded by threads and not by the scene (`build`).
//! Several processes make a depth after the other (`tasks`).
//! One level is made in steps (`simplify`): vertices are clustered on a grid of cells (`cluster`), colours and normals
//! averaged over what comes together (`surface`), and the distance between both surfaces bounded (`measure`,
//! `nearest`). Materials without textures are added for them (`flat`), and a top level over bricks and levels (`top`).

mod build;
mod cluster;
mod fit;
mod flat;
mod measure;
mod merge;
mod nearest;
mod plan;
mod simplify;
mod strands;
mod surface;
mod tasks;
mod top;
mod vector;

pub(super) use build::{LevelWriter, Levels, Maker};
pub(super) use flat::Flattened;
pub(super) use plan::{Plan, Scene};
pub(super) use tasks::LevelTasks;
pub(super) use top::build_top;
