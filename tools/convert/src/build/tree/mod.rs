//! The trees in bricks and above them.
//!
//! `binary` builds a tree over boxes, `wide` collapses it to eight children a node, `node` quantises the boxes of such
//! a node. `top_level` makes the trees above the bricks in the same way.

pub(super) mod binary;
pub(super) mod node;
pub(super) mod top_level;
pub(super) mod wide;
