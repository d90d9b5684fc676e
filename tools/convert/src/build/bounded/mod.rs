//! The steps of a conversion that does not fit in memory.
//!
//! `budget` divides the memory. `cuts` cuts objects into bricks, `split` splits those that are too large, `external`
//! goes through their items on the disk. `distribute` brings the triangles of bricks together there, and `chunks`
//! encodes them.

pub(super) mod budget;
pub(super) mod chunks;
pub(super) mod cuts;
pub(super) mod distribute;
pub(super) mod external;
mod split;
