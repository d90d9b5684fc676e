//! What goes wrong while a scene is read: right answers or one line, never a hang, and right answers again when it is
//! over.

mod files;
mod frames;
mod source;

pub use files::Changed;
pub use frames::{Frames, Queried};

use crate::kind::{Fault, Outcome};

/// The name that scenes with faults have.
pub const NAME: &str = "faulty.bricks";

/// Most characters of a line that says what went wrong.
const MOST_LINE: usize = 500;

/// An error that is allowed: one line that names the scene.
///
/// # Errors
/// It is none.
pub fn told(error: &anyhow::Error) -> Result<Outcome, Fault> {
    let line = format!("{error:#}");
    if line.contains('\n') || line.chars().count() > MOST_LINE {
        return Err(Fault::new("an error is not one line", line));
    }
    if !line.contains(NAME) {
        return Err(Fault::new("an error does not name the scene", line));
    }
    Ok(Outcome::Stopped)
}
