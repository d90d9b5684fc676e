//! Generated scenes: their size, their determinism, their camera paths, and glTF written from them.

mod city;
mod common;
mod gltf;
mod kinds;
mod ply;
mod soup;
mod stiff;
