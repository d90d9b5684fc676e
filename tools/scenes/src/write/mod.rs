//! Files: scenes as glTF (`gltf`), their camera paths and motion (`beside`), each complete or not there (`output`).

mod beside;
mod gltf;
mod output;

pub use beside::{write_far_path, write_motion, write_paths};
pub use gltf::{GltfForm, write_gltf};
