//! Locks and flags of what threads share, under one name: trials of schedules (`tools/trials/src/threads/`) put others
//! in their place, which try one order of threads after the other.

pub use std::sync::atomic::AtomicBool;
pub use std::sync::{Arc, Condvar, Mutex, MutexGuard};
