//! Builds small scenes and looks into the files: boxes, ids, positions, and that settings change nothing they must not.

mod bounded;
mod decode;
mod degenerate;
mod details;
mod errors;
mod invariance;
mod levels;
mod movable;
mod placement;
mod proxies;
mod scenes;
mod shared;
mod sizes;
mod structure;
