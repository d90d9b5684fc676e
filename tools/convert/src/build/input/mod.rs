//! What is to be built: objects, and the triangles that a source gives them.
//!
//! `objects` decides what becomes an object of its own and numbers the triangles, `parts` reads the source part by part
//! and checks it, `matrix` places what is read.

pub(super) mod matrix;
pub(super) mod objects;
pub(super) mod parts;
