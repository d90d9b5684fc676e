//! What makes bricks resident and runs steps over them.

use super::{BrickStates, Optimisations, PairQuery, Pass, Report, Step};
use crate::stream::{Item, Slot};
use std::sync::Arc;
use thiserror::Error;

/// One payload to be copied into the cache.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Load {
    /// What.
    pub item: Item,
    /// Where to.
    pub slot: Slot,
}

/// Why an executor gave up.
#[derive(Debug, Error)]
pub enum ExecutorError {
    /// A payload could not be read.
    #[error(transparent)]
    Stream(#[from] crate::stream::StreamError),
    /// The device failed.
    #[error("the device {0}")]
    Device(String),
    /// A traversal stack was too small: the scene file's heights are wrong.
    #[error("a traversal stack overflowed {0} times; the scene file's tree heights are wrong: run `brickwalk verify`")]
    StackOverflow(u32),
}

/// Makes bricks resident and runs kernels over them.
pub trait Executor {
    /// Copies payloads to their slots. Everything in `loads` is resident when this returns.
    ///
    /// # Errors
    /// A payload that cannot be read or whose checksum fails, by its brick.
    fn load(&mut self, loads: &[Load]) -> Result<(), ExecutorError>;

    /// Sets the tiles' lists, leaf nodes of the binary top level, in place of [`Step::Lists`](super::Step::Lists); one
    /// list a tile, row by row.
    ///
    /// # Errors
    /// Lists beyond what the device holds.
    fn set_lists(&mut self, lists: &[Vec<u32>]) -> Result<(), ExecutorError>;

    /// Sets the queries of the next [`Step::QueryPairs`](super::Step::QueryPairs), and the nodes of all of them, one
    /// query's after the other's. A query of several nodes asks for all at once, and where a ray sees any, for each.
    ///
    /// # Errors
    /// More than the device holds.
    fn set_pairs(&mut self, queries: &[PairQuery], nodes: &[u32]) -> Result<(), ExecutorError>;

    /// Marks leaves of the top level, where levels of detail are in use: those of levels below which something is
    /// missing, and all below these. Marked levels suffice for every ray, so that the topmost stand in. It holds until
    /// other marks are set; none are set at first.
    fn mark_leaves(&mut self, marks: &Arc<[bool]>);

    /// Runs `steps` in order over the rays of `pass` against bricks in the given states, waits, and reports.
    ///
    /// # Errors
    /// The device's, and [`ExecutorError::StackOverflow`].
    fn run(&mut self, pass: Pass, steps: &[Step], bricks: &BrickStates) -> Result<Report, ExecutorError>;
}

/// How a schedule traces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tracing {
    /// One more query asks, from the final hits, which bricks the pass needed.
    pub measure_needed: bool,
    /// The optimisations that are on.
    pub optimisations: Optimisations,
}
