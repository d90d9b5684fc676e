//! What stands in for `crate::settings` in the file that [`crate::inputs::disk_cache`] compiles.

/// Sizes as people write them.
pub mod sizes {
    pub use brickwalk::settings::sizes::human_bytes;
}
