//! What stands in for `crate::stream` in the files that [`crate::threads`] compiles.

/// Locks and flags of shuttle, as `brickwalk::stream::sync` has those of the system.
pub mod sync {
    pub use shuttle::sync::atomic::AtomicBool;
    pub use shuttle::sync::{Arc, Condvar, Mutex, MutexGuard};
}
