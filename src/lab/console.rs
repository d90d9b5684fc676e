//! Whom the laboratory talks to. It prints nothing by itself, and catches no Ctrl-C.

use anyhow::Result;
use brickwalk_convert::progress::Progress;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// What a caller lends to a run.
#[derive(Clone, Copy)]
pub struct Console<'a> {
    /// Shows lines of text.
    pub show: &'a dyn Fn(&str) -> Result<()>,
    /// Set when the run should come to a good end.
    pub stop: &'a AtomicBool,
    /// Progress of a new job, which ends early when `stop` is set.
    pub job: &'a dyn Fn() -> Progress,
    /// When the run should come to a good end, too.
    pub until: Option<Instant>,
}

/// The run was to come to an end: what was being measured is left.
#[derive(Clone, Copy, Debug, thiserror::Error)]
#[error("the run was to come to an end")]
pub struct Stopped;

impl Console<'_> {
    /// Shows lines of text.
    ///
    /// # Errors
    /// The caller's.
    pub fn show(&self, text: &str) -> Result<()> {
        (self.show)(text)
    }

    /// For a run of so many minutes from now on.
    pub fn within(self, minutes: Option<f64>) -> Self {
        Self { until: minutes.map(|minutes| Instant::now() + Duration::from_secs_f64(60.0 * minutes)), ..self }
    }

    /// Whether somebody wants the run to come to an end.
    pub fn is_interrupted(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Whether the run should come to an end.
    pub fn is_stopped(&self) -> bool {
        self.is_interrupted() || self.until.is_some_and(|until| Instant::now() >= until)
    }

    /// Goes on, unless the run should come to an end.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn go_on(&self) -> Result<()> {
        if self.is_stopped() { Err(Stopped.into()) } else { Ok(()) }
    }
}
