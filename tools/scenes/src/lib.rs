//! Generated scenes of any size, and camera paths through them.
//!
//! A scene depends on its settings alone: not on the number of threads, nor on the machine's clock. The detail of a
//! place is fixed; asking for more triangles adds more of it around the same centre.
//!
//! [`generate()`] chooses one of `city`, `pipes`, `terrain`, `stadium` and `cornell`, which draw with `mesh`, `solid`
//! and `material` and give a [`Scene`]; `write` makes files of it. `stiff` and `soup` are scenes for tests.

mod city;
mod copies;
mod cornell;
mod error;
mod generate;
mod material;
mod mesh;
mod motion;
mod path;
mod pieces;
mod pipes;
mod rings;
mod rng;
mod scene;
mod settings;
mod solid;
mod soup;
mod stadium;
mod stiff;
mod terrain;
mod vegetation;
mod write;

pub use error::Error;
pub use generate::generate;
pub use motion::{Mover, Pose};
pub use path::{CameraPath, Keyframe, LONG_FRAMES, NEAR_FRAMES};
pub use rng::Rng;
pub use scene::Scene;
pub use settings::{Kind, Settings};
pub use soup::{SoupKind, rotated_instances, soup};
pub use stiff::{Stiff, far_path, moved, one_mesh, stiff};
pub use write::{GltfForm, is_ply, write_far_path, write_gltf, write_motion, write_paths, write_ply};
