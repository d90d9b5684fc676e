//! Whom the laboratory talks to. It prints nothing by itself, and catches no Ctrl-C.

use anyhow::Result;
use brickwalk_convert::progress::Progress;
use std::sync::atomic::{AtomicBool, Ordering};

/// What a caller lends to a run.
#[derive(Clone, Copy)]
pub struct Console<'a> {
    /// Shows lines of text.
    pub show: &'a dyn Fn(&str) -> Result<()>,
    /// Set when the run should come to a good end.
    pub stop: &'a AtomicBool,
    /// Progress of a new job, which ends early when `stop` is set.
    pub job: &'a dyn Fn() -> Progress,
}

impl Console<'_> {
    /// Shows lines of text.
    ///
    /// # Errors
    /// The caller's.
    pub fn show(&self, text: &str) -> Result<()> {
        (self.show)(text)
    }

    /// Whether the run should come to an end.
    pub fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}
