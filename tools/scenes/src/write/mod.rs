//! Files: scenes as glTF (`gltf`) and PLY (`ply`), their camera paths and motion (`beside`), each complete or not there
//! (`output`).

mod beside;
mod gltf;
mod output;
mod ply;

pub use beside::{write_far_path, write_motion, write_paths};
pub use gltf::{GltfForm, write_gltf};
pub use ply::{is_ply, write_ply};
