//! Panics of decoders that are not our own become errors of the input.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};

thread_local! {
    static CATCHES: Cell<bool> = const { Cell::new(false) };
}

/// What `decode` returns, `None` if it panics: for decoders of others, which may not be proof against every input.
pub(super) fn quietly<T>(decode: impl FnOnce() -> T) -> Option<T> {
    let before = CATCHES.replace(true);
    // What is half done is dropped with the call.
    let result = catch_unwind(AssertUnwindSafe(decode)).ok();
    CATCHES.set(before);
    result
}

/// Whether a panic of this thread is caught by an importer, which makes it an error of the input: a panic hook need not
/// tell it.
pub fn catches_panics() -> bool {
    CATCHES.get()
}
