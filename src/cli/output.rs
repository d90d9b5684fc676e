//! What commands say: results on standard output, wrong usage, and how much else is said.
//!
//! Results that a command exists for are always printed. Summaries and warnings are left out with `--quiet`, and events
//! of the library, which say what it decides, are printed with `--verbose` alone.

use bricks::one_line;
use brickwalk_convert::progress::Progress;
use clap::Args;
use std::fmt::{Debug, Write as _};
use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};
use tracing::field::{Field, Visit};
use tracing::span::{Attributes, Id, Record};
use tracing::{Event, Level, Metadata, Subscriber};

/// Wrong usage that only a command itself can see: exit status 2.
#[derive(Debug, thiserror::Error)]
#[error("{0}; see brickwalk --help")]
pub struct Usage(pub String);

/// The reader of standard output went away; the command ends quietly.
#[derive(Debug, thiserror::Error)]
#[error("standard output is closed")]
pub struct ClosedPipe;

/// How much is said.
#[derive(Clone, Copy, Debug, Default, Args)]
pub struct Verbosity {
    /// Print errors and requested results only
    ///
    /// There is no progress, no warning and no summary.
    #[arg(short, long, global = true, display_order = 900)]
    pub quiet: bool,
    /// Print decisions and timings on standard error
    ///
    /// The adapter and why, the cache, kernels, the schedule and time of every frame.
    #[arg(short, long, global = true, display_order = 901, conflicts_with = "quiet")]
    pub verbose: bool,
}

static QUIET: AtomicBool = AtomicBool::new(false);

impl Verbosity {
    /// Makes it that of the process.
    pub fn set(self) {
        QUIET.store(self.quiet, Ordering::Relaxed);
        if self.quiet {
            Progress::silence();
        }
        if self.verbose {
            // There is one already where commands run in one process, as in tests.
            let _ = tracing::subscriber::set_global_default(Events);
        }
    }
}

/// Whether only errors and results are said.
pub fn is_quiet() -> bool {
    QUIET.load(Ordering::Relaxed)
}

/// Writes text to standard output; unlike `print!`, without a panic when the reader went away.
///
/// # Errors
/// Standard output is closed or full.
pub fn print(text: &str) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(|error| {
        if error.kind() == std::io::ErrorKind::BrokenPipe {
            ClosedPipe.into()
        } else {
            anyhow::Error::new(error).context("cannot write to standard output")
        }
    })
}

/// [`print()`] of what a command did, unless `--quiet`.
///
/// # Errors
/// As [`print()`].
pub fn note(text: &str) -> anyhow::Result<()> {
    if is_quiet() { Ok(()) } else { print(text) }
}

/// Writes a value as indented JSON and a newline to standard output.
///
/// # Errors
/// As [`print()`].
pub fn print_json(value: &impl serde::Serialize) -> anyhow::Result<()> {
    print(&(serde_json::to_string_pretty(value)? + "\n"))
}

/// Prints warnings on standard error, a line each, unless `--quiet`.
pub fn warn(warnings: impl IntoIterator<Item = impl AsRef<str>>) {
    if is_quiet() {
        return;
    }
    for warning in warnings {
        let _ = writeln!(std::io::stderr(), "brickwalk: warning: {}", one_line(warning.as_ref()));
    }
}

/// Prints events of this program on standard error, a line each.
struct Events;

/// The line of an event.
#[derive(Default)]
struct Line(String);

impl Visit for Line {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        // Writing to a string does not fail.
        let _ = match field.name() {
            "message" => write!(self.0, "{value:?}"),
            name => write!(self.0, " {name}={value:?}"),
        };
    }
}

impl Subscriber for Events {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        *metadata.level() <= Level::INFO && metadata.target().starts_with("brickwalk")
    }

    fn new_span(&self, _: &Attributes<'_>) -> Id {
        Id::from_u64(1)
    }

    fn record(&self, _: &Id, _: &Record<'_>) {}

    fn record_follows_from(&self, _: &Id, _: &Id) {}

    fn event(&self, event: &Event<'_>) {
        let mut line = Line::default();
        event.record(&mut line);
        let _ = writeln!(std::io::stderr(), "brickwalk: {}", one_line(&line.0));
    }

    fn enter(&self, _: &Id) {}

    fn exit(&self, _: &Id) {}
}
