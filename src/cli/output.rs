//! What commands say: text on standard output, and wrong usage.

use std::io::Write;

/// Wrong usage that only a command itself can see: exit status 2.
#[derive(Debug, thiserror::Error)]
#[error("{0}; see brickwalk --help")]
pub struct Usage(pub String);

/// The reader of standard output went away; the command ends quietly.
#[derive(Debug, thiserror::Error)]
#[error("standard output is closed")]
pub struct ClosedPipe;

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

/// Writes a value as indented JSON and a newline to standard output.
///
/// # Errors
/// As [`print()`].
pub fn print_json(value: &impl serde::Serialize) -> anyhow::Result<()> {
    print(&(serde_json::to_string_pretty(value)? + "\n"))
}
