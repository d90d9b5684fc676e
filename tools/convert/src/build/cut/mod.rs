//! Which triangles make up a brick.
//!
//! `gather` collects the boxes of an object's triangles, `partition` cuts them, `cuts` does so for all objects and
//! chooses the lattices that follow.

pub(super) mod cuts;
pub(super) mod gather;
pub(super) mod partition;
