//! The steps of a conversion that does not fit in memory.
//!
//! `budget` divides the memory. `cuts` cuts objects into bricks, `external` splits those that are too large on the
//! disk. `distribute` brings the triangles of bricks together there, and `chunks` encodes them.

pub(super) mod budget;
pub(super) mod chunks;
pub(super) mod cuts;
pub(super) mod distribute;
pub(super) mod external;
