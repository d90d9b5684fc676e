//! Triangles as bricks store them.
//!
//! `lattice` rounds positions, `attributes` is what shading reads, `triangle` is both together; `intern` numbers values
//! that are equal.

pub(super) mod attributes;
pub(super) mod intern;
pub(super) mod lattice;
pub(super) mod triangle;
