//! Room for walks: what is left to be visited.

use super::walk::Open;

/// What is left to be visited by rays that go together, and to whom of them it may matter, a bit each.
pub(super) type Joint = (Open, u32);

/// Room for walks.
#[derive(Default)]
pub(super) struct Room {
    /// Of the top level.
    pub(super) top: Vec<Open>,
    /// Of the top level, of rays together.
    pub(super) joint: Vec<Joint>,
    /// What walks through bricks take.
    pub(super) inner: Inner,
}

/// Room for walks through bricks.
#[derive(Default)]
pub(super) struct Inner {
    /// In the frame of a brick.
    pub(super) open: Vec<Open>,
    /// Of rays together.
    pub(super) joint: Vec<Joint>,
    /// In f64, by squared distances.
    pub(super) near: Vec<(f64, Child)>,
    /// In f64, numbers of nodes.
    pub(super) nodes: Vec<u32>,
}

/// What a child of a node is: a node, or the first and the number of its triangles.
#[derive(Clone, Copy)]
pub(super) enum Child {
    Node(u32),
    Triangles(u32, u32),
}
