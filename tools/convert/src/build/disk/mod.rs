//! What a conversion that does not fit in memory keeps on the disk.
//!
//! `scratch` is its folder, `shard` a file of records in it, `journal` the file that says what has been done.

pub(super) mod journal;
pub(super) mod scratch;
pub(super) mod shard;
