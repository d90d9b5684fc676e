//! Small scenes of all sorts under settings of all sorts: the same bytes where they are promised, and the answers of
//! brute force.

mod builds;
mod frames;
mod queries;

pub use builds::Builds;
pub use frames::{Exact, Schedules};
pub use queries::Asked;

/// Bytes that a trial may take, those of a device on the processor among them.
const MOST_BYTES: u64 = 1 << 30;

/// A finding about something that could not be made at all.
fn refused(error: &anyhow::Error) -> crate::kind::Fault {
    crate::kind::Fault::new("a sound scene is refused", format!("{error:#}"))
}
